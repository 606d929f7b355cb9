"""`export_model`: one call from a model to the files of a format."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from typing import Any

from whsklearn.effects.base import ArgumentError
from whsklearn.export.arm_code import c_of_arm
from whsklearn.export.code import c_files, identifier, st_file
from whsklearn.export.fmu import write_fmu
from whsklearn.export.model import Loss, as_exported
from whsklearn.export.robots import arm_mjcf, arm_urdf, isaac, mjcf, urdf
from whsklearn.export.tables import Left, Ratings, write_tables
from whsklearn.logs.files import atomic_write
from whsklearn.models import ArmModel, load_model
from whsklearn.systems.arm import Arm

FORMATS = {
    "mjcf": "MuJoCo, model.xml",
    "urdf": "robot description with <dynamics>, model.urdf",
    "isaac": "Isaac Lab actuator configuration, actuator.py",
    "c": "C99 without heap, model.h and model.c",
    "st": "IEC 61131-3 Structured Text, model.st",
    "table": "tables for drives, cogging.csv and friction.csv",
    "fmu": "FMI 2.0 co-simulation with sources, model.fmu",
}
# In a folder that is given as the path.
_FILES = {"mjcf": "model.xml", "urdf": "model.urdf", "isaac": "actuator.py", "st": "model.st"}
_OF_AXIS: dict[str, Callable[[Any], tuple[str, list[Loss]]]] = {"mjcf": mjcf, "urdf": urdf, "isaac": isaac}
_OF_ARM: dict[str, Callable[[Any], tuple[str, list[Loss]]]] = {"mjcf": arm_mjcf, "urdf": arm_urdf}


@dataclass(frozen=True)
class Export:
    """The result of an export.

    Attributes
    ----------
    paths : list of Path
    losses : list of Loss
        Parts of the model that the format cannot represent, with their sizes.
    left : list of Left
        The torque that remains with each table, by a replay against the model; for ``table``.

    References
    ----------
    MuJoCo, URDF and FMI 2.0 specifications, as `whsklearn.export.export_model` writes them.

    Examples
    --------
    >>> from pathlib import Path
    >>> from whsklearn.export import Export, Loss
    >>> done = Export([Path("model.xml")], [Loss("torque_ripple", "amplitude 0.02", "MuJoCo has nothing like it")])
    >>> [loss.name for loss in done.losses]
    ['torque_ripple']
    """

    paths: list[Path] = field(default_factory=list)
    losses: list[Loss] = field(default_factory=list)
    left: list[Left] = field(default_factory=list)


def export_model(
    model: Any,
    *,
    to: str,
    out: str | PathLike[str],
    what: str = "model",
    real: str = "double",
    ratings: Ratings | None = None,
) -> Export:
    """Write a model in a format of another tool.

    Parameters
    ----------
    model : path, ServoAxis, Arm, WienerHammersteinSystem or identified model
        A path is a file that ``identify`` or ``gap`` wrote (``model.json``, ``repaired.json``).
    to : str
        A key of `FORMATS`.
    out : path
        A folder, or the path of the file.
    what : {"model", "compensator"}
        ``c`` and ``st`` also write a feed-forward torque from position and velocity; ``c`` of an arm is always its
        inverse dynamics.
    real : {"double", "float"}
        Number type of the C code.
    ratings : Ratings, optional
        Rated torque, torque constant and highest speed of a ``table``.

    Returns
    -------
    Export
        The paths and losses.

    Raises
    ------
    ValueError
        If the format is unknown, or cannot represent this kind of model at all.

    Examples
    --------
    >>> import tempfile
    >>> from whsklearn import ServoAxis
    >>> from whsklearn.effects import TorqueRipple
    >>> from whsklearn.export import export_model
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     done = export_model(ServoAxis(effects=[TorqueRipple(0.02, 6.0)]), to="mjcf", out=folder)
    ...     done.paths[0].name, str(done.losses[0])
    ('model.xml', 'torque_ripple (amplitude 0.02, order 6, phase 0 rad): MuJoCo has nothing like it')
    """
    if to not in FORMATS:
        raise ValueError(f"to is {to!r}, expected one of: {', '.join(FORMATS)}.")
    if what not in ("model", "compensator"):
        raise ValueError(f"what is {what!r}, expected 'model' or 'compensator'.")
    if what == "compensator" and to not in ("c", "st"):
        raise ArgumentError(f"A compensator is code: export it to c or st, not to {to}.")
    if real not in ("double", "float"):
        raise ValueError(f"real is {real!r}, expected 'double' or 'float'.")
    path = Path(out)
    if isinstance(model, str | PathLike):
        model = load_model(model)
    if isinstance(model, Arm | ArmModel):
        arm = model if isinstance(model, Arm) else model.arm
        if to not in ("mjcf", "urdf", "c"):
            raise ArgumentError(f"An arm of {arm.n_joints} joints is exported to mjcf, urdf or c, not to {to}.")
        return _texts(arm, to, path, what, real)
    exported = as_exported(model)
    if to == "table":
        return Export(*write_tables(exported, path, ratings or Ratings()))
    if to == "fmu":
        written, losses = write_fmu(exported, path)
        return Export([written], losses)
    return _texts(exported, to, path, what, real)


def _texts(model: Any, to: str, path: Path, what: str, real: str) -> Export:
    """Write an arm or an `Exported` in a format of text; ``path`` is a folder or the file, of C the source."""
    of_arm = isinstance(model, Arm)
    if to == "c":
        folder, stem = (path.parent, path.stem) if path.suffix in (".c", ".h") else (path, "model")
        name = identifier(stem)
        files, losses = c_of_arm(model, name, real) if of_arm else c_files(model, name, what, real)
    else:
        folder, file = (path.parent, path.name) if path.suffix else (path, _FILES[to])
        if to == "st":
            text, losses = st_file(model, identifier(Path(file).stem), what)
        else:
            text, losses = (_OF_ARM if of_arm else _OF_AXIS)[to](model)
        files = {file: text}
    folder.mkdir(parents=True, exist_ok=True)
    for file, text in files.items():
        atomic_write(folder / file, text.encode())
    return Export([folder / file for file in files], losses)
