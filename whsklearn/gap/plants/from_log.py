"""A log that `load_log` has read, in the form that each kind of model takes."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd

from whsklearn.gap.following_error import following_error
from whsklearn.gap.plants.arm_view import ArmRecord
from whsklearn.gap.record import ServoRecord, noise_level
from whsklearn.logs.load import Log
from whsklearn.logs.units import UNKNOWN, assumed, factor_between, integral_of


def taken_from(log: Log, kind: str) -> tuple[Any, dict[str, Any]]:
    """(record, names of its columns).

    ``kind``: ``servo`` for an axis or a simulator of one, ``wiener-hammerstein``, or ``arm``, whose log is in SI.

    >>> t = np.arange(400) / 100
    >>> log = Log(time=t, X=np.cos(t)[:, None], y=np.rad2deg(np.sin(t)), reference=None, command=None)
    >>> log |= Log(groups=np.zeros(400, dtype=int), units={"drive": "mNm", "position": "deg"})
    >>> record, _ = taken_from(log, "servo")
    >>> float(record.drive[0]), record.units, record.logged
    (0.001, ('Nm', 'rad'), ('mNm', 'deg'))
    """
    starts = tuple(int(k) + 1 for k in np.flatnonzero(np.diff(log.groups)))
    if kind == "arm":
        return ArmRecord(log.time, log.y, log.X, starts), {}
    if kind != "servo":
        u, y = (f"{name} [{log.units.get(role, '')}]" for name, role in (("u", "drive"), ("y", "position")))
        frame = pd.DataFrame({"time": log.time, u: log.X[:, 0], y: log.y})
        return frame, {"input": u, "output": y, "time": "time"}
    drive_unit, unit = log.units.get("drive", UNKNOWN), log.units["position"]
    drive, reference = log.X[:, 0], log.reference
    if reference is not None:
        reference = reference * factor_between(log.units.get("reference", unit), unit)
    if log.command is not None:
        reference = log.command * factor_between(log.units.get("command", unit), unit)
        drive, drive_unit = reference - log.y, unit
    report = log.get("report")
    record = ServoRecord(
        log.time, drive, log.y, reference, assumed(drive_unit, unit),
        resolution=1.0 if unit.startswith("counts") else 0.0,
        quantum=(report.quantum or 0.0) if report is not None else 0.0,
        in_place_of_drive="" if log.command is None else "command minus position", logged=(drive_unit, unit),
        starts=starts, speed_noise=speed_noise(log),
    )  # fmt: skip
    return record if log.command is None else _with_error_for_drive(record), {}


def speed_noise(log: Log) -> float:
    """Noise of a logged velocity whose integral is the position, in the position's unit per s; 0 if none is.

    >>> t = np.arange(2000) / 100
    >>> rpm = 60 * np.sin(t) + np.random.default_rng(0).standard_normal(2000)
    >>> frame, units = pd.DataFrame({"velocity": rpm}), {"velocity": "rpm", "position": "turns"}
    >>> 0.9 < 60 * speed_noise(Log(frame=frame, units=units)) < 1.1
    True
    >>> speed_noise(Log(frame=frame.assign(position=t), units=units, columns={"position": "angle"}))
    0.0
    """
    if "velocity" not in log.get("frame", ()) or "position" in log.get("columns", ()):
        return 0.0
    return integral_of(log.units["velocity"])[0] * noise_level(log.frame["velocity"])


def servo_record(log: Any, columns: dict[str, Any]) -> ServoRecord:
    """The record of an axis in SI, from a log, a frame with these columns, or a record."""
    if isinstance(log, ServoRecord):
        return log
    if isinstance(log, Log):
        record: ServoRecord = taken_from(log, "servo")[0]
        return record
    return ServoRecord.from_frame(log, **columns)


def _with_error_for_drive(record: ServoRecord) -> ServoRecord:
    """The record with its drive, and the remark on it, for the loop that the record shows."""
    drive, loop = following_error(record)
    of_error = [
        f"{size:.3g} {unit} times its {name}"
        for name, size, unit in (("derivative", loop.derivative, "s"), ("integral", loop.integral, "1/s"))
        if size
    ]
    late = f", the command taken {loop.delay:.3g} s later," if loop.delay else ""
    text = (
        f"No drive is logged: {' plus '.join([f'command minus position{late}', *of_error])} is used instead. Sizes "
        "are per unit of the loop's gain: inertia in s2, viscous friction in s, torques in the unit of the "
        "position. The gain itself, and what the loop does besides (filters, feedforward, limits), cannot be known "
        "from this log."
    )
    return replace(record, drive=drive, in_place_of_drive=text)
