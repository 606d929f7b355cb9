"""A log that `load_log` has read, in the form that each kind of model takes."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from whsklearn.filtering.records import CUTOFF_SIGMA, HIGHEST_CUTOFF, filtered, gaussian_derivatives
from whsklearn.gap import least_squares as ols
from whsklearn.gap.plants.arm_view import ArmRecord
from whsklearn.gap.record import Array, ServoRecord, noise_level
from whsklearn.identification.drive_lead import earlier
from whsklearn.logs.load import Log
from whsklearn.logs.units import UNKNOWN, assumed, factor_between, integral_of

# Share of the residual below which a delay, a derivative or an integral is accepted: a delay trades off against viscous
# friction (`benchmarks.real_axes --only so101`).
WORTH_IT = 0.9
LONGEST_DELAY = 0.4  # s between a command's stamp and its effect: a bus of hobby servos needs 0.06 to 0.2
CUTOFF = 4.0  # Hz: commands of a position servo are slow
PER_PERIOD = 16  # rows of the regression in a period of that frequency
# Inertia and friction drive no axis, and derivative and integral have the sign of the gain.  Without these signs the
# command of two chirps of SO-101 is taken 0.16 s late, beside a negative friction; with them 0.04 and 0.08 s.
POSITIVE = np.array([True, True, True, False, False, False, True, True])


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


# --- a position servo of which only command and position are logged ------------------------------------------------
class Loop(NamedTuple):
    """What is known of a position loop, beside its gain: delay of the command (s), T_D (s) and 1 / T_I (1/s).

    >>> Loop(delay=0.1, derivative=0.0, integral=0.5)
    Loop(delay=0.1, derivative=0.0, integral=0.5)
    """

    delay: float
    derivative: float
    integral: float


def following_error(record: ServoRecord) -> tuple[Array, Loop]:
    """(drive in units of the loop's gain, rad; the loop), with the first commands repeated.

    Inside the servo, torque = gain (e + T_D de/dt + 1/T_I int e dt) of the error e = command - position.  A command
    that is time-stamped when it is sent acts later.  Delay, T_D and T_I are those at which inertia, viscous and dry
    friction, a constant and gravity explain the error best; each is left out if it does not explain considerably more.
    Neither the delay nor a filter or an integral reaches across a hole.  The reference of the ``record`` is the
    command; its drive is not used.  Astrom, Hagglund 2006, Advanced PID Control, ISA, equation (3.4).

    >>> t = np.arange(3000) * 0.02
    >>> wave = lambda t: 0.4 * np.sin(1.3 * t) + 0.2 * np.sin(4.1 * t + 1.0) + 0.05 * np.sin(9.0 * t)
    >>> sags = wave(t - 0.1) - 0.02 * np.cos(wave(t - 0.1))
    >>> record = ServoRecord(t, np.zeros_like(t), sags, wave(t), units=("rad", "rad"))
    >>> round(following_error(record)[1].delay, 2)
    0.1
    """
    command, position, dt = record.reference, record.position, record.dt
    assert command is not None
    kernels = gaussian_derivatives(CUTOFF_SIGMA / (2 * np.pi * min(CUTOFF, HIGHEST_CUTOFF / dt)), dt)
    middle, longest = position.mean(), round(LONGEST_DELAY / dt)
    (c, rate), (q, v, a) = (
        [record.by_piece(partial(filtered, taps=k, every=1), x - middle) for k in taps]
        for x, taps in ((command, kernels[:2]), (position, kernels))
    )
    dry = np.tanh(v / (0.05 * float(np.std(v)) + 1e-12))
    axis = np.column_stack([a, v, dry, np.ones_like(q), np.cos(q + middle), np.sin(q + middle)])
    inside = record.by_piece(partial(_inner, edge=kernels[0].size + longest), np.ones(q.size, dtype=bool))
    rows = np.flatnonzero(inside)[:: max(1, int(1.0 / (PER_PERIOD * CUTOFF * dt)))]

    def fitted(samples: int, n: int) -> tuple[float, Array]:
        """(rms residual, the first n of T_D and 1 / T_I) at one delay."""
        error, slope = (record.by_piece(partial(earlier, samples=-samples), x) - y for x, y in ((c, q), (rate, v)))
        loop = [-slope, -record.by_piece(lambda e: np.cumsum(e) * dt, error)][:n]
        columns = np.column_stack([axis, *loop])[rows]
        sizes, _ = ols.solve(columns, error[rows], POSITIVE[: columns.shape[1]])
        return float(np.std(error[rows] - columns @ sizes)), sizes[axis.shape[1] :]

    best, least = (0, 0), fitted(0, 0)[0]
    for n in range(3):
        losses = [fitted(k, n)[0] for k in range(longest + 1)]
        if min(losses) < WORTH_IT * least:
            best, least = (int(np.argmin(losses)), n), min(losses)
    derivative, integral = np.append(fitted(*best)[1], np.zeros(2 - best[1]))
    error = record.by_piece(partial(earlier, samples=-best[0]), command) - position

    def controlled(e: Array) -> Array:
        slope = np.gradient(e, dt) if e.size > 1 else np.zeros_like(e)
        return e + derivative * slope + integral * dt * np.cumsum(e)

    drive = record.by_piece(controlled, error)
    return drive, Loop(best[0] * dt, float(derivative), float(integral))


def _inner(all_of_it: Array, edge: int) -> Array:
    """The samples of a segment that are not affected by its ends through a filter or a delay."""
    edge = min(edge, all_of_it.size // 4)
    n = np.arange(all_of_it.size)
    return (n >= edge) & (n < all_of_it.size - edge)
