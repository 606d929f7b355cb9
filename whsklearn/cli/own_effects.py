"""User-defined effects from a Python file named on the command line."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

from whsklearn.effects import Effect, effect_names, get_effect


def load_effects(path: str | Path) -> tuple[type[Effect], ...]:
    """Run a Python file, check every effect that it defines against the contract, and include them in the search.

    Raises ValueError if the file cannot be run, defines no effect, uses a name of the library, or an effect breaks the
    contract.
    """
    from whsklearn.checks import check_effect

    path = Path(path)
    known = {name: get_effect(name) for name in effect_names()}
    spec = importlib.util.spec_from_file_location(path.stem, path)
    if spec is None or spec.loader is None:
        raise ValueError(f"{path.name} is not a Python file; give one that defines effects, such as my_effects.py.")
    module = importlib.util.module_from_spec(spec)
    sys.modules[path.stem] = module  # dataclasses look up their module
    try:
        spec.loader.exec_module(module)
    except Exception as error:  # any error of the user's code becomes one sentence
        raise ValueError(f"{path.name} cannot be run: {type(error).__name__}: {error}.") from error
    defined = {name: get_effect(name) for name in effect_names() if known.get(name) is not get_effect(name)}
    taken = [name for name in defined if name in known and known[name].__module__ != path.stem]
    if taken:
        raise ValueError(f"{path.name} defines {taken[0]!r}, which the library already has; give it another name.")
    if not defined:
        raise ValueError(
            f"{path.name} defines no effect; write a class derived from whsklearn.effects.Effect that has a name "
            "and a place, as docs/your_effect.md shows."
        )
    for cls in defined.values():
        check_effect(cls)
    return tuple(defined.values())
