"""Model files: a JSON document that other programs can also read.

.. code-block:: json

    {"format": "whsklearn-model", "version": 2, "kind": "axis", "dt": 0.001, "logged": "position",
     "units": {"time": "s", "input": "mNm", "output": "deg"},
     "structure": {"law": [{"class": "Viscous", "name": "viscous", "fields": {"coefficient": 0.12}}],
                   "effects": [], "inertia": 0.05},
     "parameters": {"inertia": 0.05, "viscous": 0.12}, "standard_errors": {"inertia": 0.0001},
     "parameter_units": {"inertia": "kg m²", "viscous": "Nm s/rad"}}

`load_model` builds the model from ``structure``.  ``parameters`` repeats its numbers by name, with their
``standard_errors``, for other readers.  ``units`` are those of the model's input and output, and of ``dt``.
``parameter_units`` are those of the numbers, in SI whatever the units of the columns.

Kinds: ``arx`` and ``output_error`` (``numerator``, ``denominator``, ``offset``, ``criterion``), ``wiener-hammerstein``
(``b1 f1 law b2 f2``), ``axis`` (``inertia law effects``), ``arm``
(``arm numbers``).
"""

from __future__ import annotations

import dataclasses
import json
import math
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from whsklearn.effects import Effect, FrictionLaw, effect_names, get_effect
from whsklearn.logs.files import atomic_write
from whsklearn.logs.units import UNKNOWN
from whsklearn.models.arm import ArmModel
from whsklearn.models.axis import AxisModel
from whsklearn.models.base import IdentifiedModel
from whsklearn.models.chain import ChainModel, LinearModel
from whsklearn.state.files import TAG, NotImported, decode
from whsklearn.systems.arm import Arm

FORMAT = "whsklearn-model"
VERSION = 2
_CLASSES: dict[str, type[IdentifiedModel]] = {
    "arx": LinearModel,
    "output_error": LinearModel,
    "wiener-hammerstein": ChainModel,
    "axis": AxisModel,
    "arm": ArmModel,
}
_SHARED = tuple(f.name for f in dataclasses.fields(IdentifiedModel))


def save_model(model: IdentifiedModel, path: str | os.PathLike[str]) -> None:
    """Write a ``model`` as JSON to a ``path``, replacing the file atomically.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> from whsklearn.effects import as_law
    >>> from whsklearn.models import AxisModel, load_model, save_model
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = pathlib.Path(folder, "model.json")
    ...     save_model(AxisModel(0.05, as_law("viscous,coulomb"), dt=0.001, logged="position"), path)
    ...     load_model(path).inertia
    0.05
    """
    text = json.dumps(model_document(model), indent=1, allow_nan=False)
    atomic_write(path, text.encode() + b"\n")


def load_model(path: str | os.PathLike[str]) -> Any:
    """Read a model file that `save_model`, ``identify`` or ``gap`` wrote.

    ``path``: of a JSON file. Returns LinearModel, ChainModel, AxisModel or ArmModel. Raises ValueError if the file is
    not a model file, is of a newer version, or holds an impossible number. Raises OSError if the file cannot be opened.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> from whsklearn.models import LinearModel, load_model, save_model
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = pathlib.Path(folder, "model.json")
    ...     save_model(LinearModel([0.0, 0.5], [1.0, -0.5]), path)
    ...     load_model(path).simulate([1.0, 1.0, 1.0]).tolist()
    [0.0, 0.5, 0.75]
    """
    try:
        return model_from(json.loads(Path(path).read_text(encoding="utf-8")))
    except (json.JSONDecodeError, UnicodeDecodeError):
        told = "it is not JSON. Give model.json of identify, or repaired.json of gap."
        raise ValueError(f"{Path(path).name} holds no model that can be read: {told}") from None
    except ValueError as error:
        raise ValueError(f"{Path(path).name} holds no model that can be read: {error}") from None
    except RecursionError:
        raise ValueError(f"{Path(path).name} holds no model that can be read: its JSON is nested too deeply.") from None


def as_arm(robot: Arm | str | os.PathLike[str], joints: Any = None) -> Arm:
    """An arm from any of the accepted inputs: an `Arm`, a model file (``.json``), a URDF or an MJCF file.

    ``robot``: any of them. ``joints``: those of a URDF or MJCF file that move; see `Arm.from_file`. Raises ValueError
    if the file holds no arm.

    Examples
    --------
    >>> from whsklearn import Arm
    >>> from whsklearn.models import as_arm
    >>> as_arm(Arm.from_dh([(0.3, 0, 0, 0)]))
    Arm(1 joints: joint1)
    """
    if isinstance(robot, Arm):
        return robot
    if not isinstance(robot, str | Path):
        raise ValueError(f"robot is a {type(robot).__name__}, expected an Arm or the path of a URDF or MJCF file.")
    if str(robot).endswith(".json"):
        model = load_model(robot)
        if not isinstance(model, ArmModel):
            raise ValueError(f"{Path(robot).name} holds a model of kind {model.kind}, expected an arm.")
        return model.arm
    if not str(robot).lstrip().startswith("<") and not Path(robot).is_file():
        raise ValueError(f"There is no robot file {str(robot)!r}; give the path of a URDF, MJCF or model file.")
    return Arm.from_file(robot, joints)


def model_document(model: IdentifiedModel) -> dict[str, Any]:
    """The model as the dict that `save_model` writes."""
    own = {f.name: getattr(model, f.name) for f in dataclasses.fields(model) if f.name not in _SHARED}
    return {
        "format": FORMAT,
        "version": VERSION,
        "kind": model.kind,
        "dt": float(model.dt),
        "logged": model.logged,
        "units": {"time": "s", "input": UNKNOWN, "output": UNKNOWN} | dict(model.units),
        "structure": {name: _coded(value) for name, value in own.items() if value is not None},
        "parameters": model.parameters,
        "standard_errors": {k: float(v) for k, v in model.standard_errors.items() if math.isfinite(v)},
        "parameter_units": model.parameter_units,
    }


def model_from(document: Any) -> Any:
    """The model from a dict that `model_document` returned; raises as `load_model` does."""
    if not isinstance(document, dict) or document.get("format") != FORMAT:
        raise ValueError(f'it does not have "format": "{FORMAT}"; give a model.json that identify or gap wrote.')
    version = document.get("version")
    if version != VERSION or type(version) is not int:
        raise ValueError(
            f"it has version {version!r}, and this whsklearn reads {VERSION}; upgrade whsklearn, or identify again."
        )
    kind = str(document.get("kind"))
    if kind not in _CLASSES:
        raise ValueError(f"its kind is {kind[:40]!r}, expected one of: {', '.join(_CLASSES)}.")
    try:
        fields = {k: _decoded(k, v) for k, v in document["structure"].items()}
        fields |= {name: document[name] for name in _SHARED}
        stated = {"time": "s", "input": UNKNOWN, "output": UNKNOWN}  # entries of a file for a model without units
        fields["units"] = {k: v for k, v in document["units"].items() if stated.get(k) != v}
        return _CLASSES[kind](**fields)
    except (KeyError, TypeError, AttributeError) as error:
        raise ValueError(f"a field is missing or of the wrong type ({error}); write it again.") from None


def _coded(value: Any) -> Any:
    """Encode numbers, tuples of numbers or effects, and laws as JSON."""
    if isinstance(value, str):
        return value
    if isinstance(value, Mapping):
        return {k: _coded(v) for k, v in value.items()}
    if isinstance(value, Arm):
        return {f.name: _coded(getattr(value, f.name)) for f in dataclasses.fields(value) if f.init}
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, FrictionLaw):
        return [_coded(t) for t in value.terms]
    if isinstance(value, Effect):
        return {"class": type(value).__name__, "name": value.name, "fields": dict(vars(value))}
    return [_coded(v) for v in value] if isinstance(value, (tuple, list)) else float(value)


def _decoded(name: str, value: Any) -> Any:
    """The inverse of `_coded`."""
    if name == "arm":
        sums = {axis: [_effect(e) for e in row] for axis, row in value.get("sums", {}).items()}
        return Arm(**{**value, "effects": [[_effect(e) for e in row] for row in value["effects"]], "sums": sums})
    if name not in ("law", "effects"):
        return value
    effects: list[Any] = [_effect(v) for v in value]
    return FrictionLaw(effects) if name == "law" else tuple(effects)


def _effect(coded: dict[str, Any]) -> Effect:
    """An effect of the library by its class, or a user's own by its name."""
    own, name = effect_names(), coded.get("name", "")
    if name in own and get_effect(name).evaluate is not None:
        return get_effect(name)(**coded["fields"])
    try:
        return decode({TAG: "effect", "class": coded["class"], "fields": coded["fields"]}, [])  # type: ignore[no-any-return]
    except NotImported:
        if not name or name in own:
            raise
        raise ValueError(
            f"its effect {str(name)[:40]!r} is not in the library; import the module that defines it, "
            "or name that file with --effects."
        ) from None
