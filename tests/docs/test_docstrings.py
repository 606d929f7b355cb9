"""Every public name has its page, and nearly every public class an executed example and a source."""

from __future__ import annotations

import inspect
import re
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "docs"))
reference = pytest.importorskip("reference")

OBJECTS = {
    f"{p}.{n}": o for p, names in reference.public().items() for n, o in names.items() if reference.is_documented(o)
}
CLASSES = {name: o for name, o in OBJECTS.items() if inspect.isclass(o)}
FUNCTIONS = {name: o for name, o in OBJECTS.items() if not inspect.isclass(o)}
SHARE = 0.95


def has_example(item) -> bool:
    return ">>>" in (item.__doc__ or "")


def has_source(item) -> bool:
    """A section of literature, or what an effect names as its source."""
    return "References\n" in (item.__doc__ or "") or bool(getattr(item, "reference", ""))


def test_every_public_name_is_in_the_index() -> None:
    page = reference.reference_page()
    missing = [name for name in OBJECTS if not re.search(rf"^   {name.rpartition('.')[2]}$", page, re.MULTILINE)]
    assert missing == []
    assert {"GapFinder", "load_log", "RMILSRegressor", "Cogging"} <= {name.rpartition(".")[2] for name in OBJECTS}


@pytest.mark.parametrize("has", [has_example, has_source])
def test_classes_with_an_example_and_a_source(has) -> None:
    lacking = [name for name, cls in CLASSES.items() if not has(cls)]
    assert len(lacking) <= (1 - SHARE) * len(CLASSES), lacking


def test_functions_with_an_example() -> None:
    lacking = [name for name, f in FUNCTIONS.items() if not has_example(f)]
    assert len(lacking) <= (1 - SHARE) * len(FUNCTIONS), lacking


def test_every_public_object_is_described() -> None:
    assert [name for name, o in OBJECTS.items() if not inspect.getdoc(o)] == []


def test_public_methods_are_described() -> None:
    lacking = [
        f"{name}.{n}"
        for name, cls in CLASSES.items()
        for n, member in vars(cls).items()
        if not n.startswith("_") and (inspect.isroutine(member) or isinstance(member, property))
        if not inspect.getdoc(member)
    ]
    assert lacking == []


def test_every_effect_says_all_that_a_reader_asks() -> None:
    """Equation, signature, what the record must hold, source, example, and the neighbours it is mistaken for."""
    catalogue = pytest.importorskip("catalogue")
    effects = [c for c in catalogue.catalogued() if c.__module__.startswith("whsklearn.")]
    assert len(effects) >= 33
    for cls in effects:
        said = {"equation", "signature", "needs", "reference"} & {n for n in dir(cls) if getattr(cls, n)}
        assert said == {"equation", "signature", "needs", "reference"}, cls.__name__
        assert has_example(cls), cls.__name__
        neighbours = re.findall(r"^    (\w+) : ", (cls.__doc__ or "").partition("See Also")[2], re.MULTILINE)
        assert neighbours, cls.__name__
        assert all(n in catalogue.whsklearn.effects.__all__ and n != cls.__name__ for n in neighbours), cls.__name__
