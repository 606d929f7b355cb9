"""What changed at the alarm of a stream: its rows before and after it as two records of one axis or arm.

The alarm and the comparison so tell one story of the same data.  An alarm says that the innovations differ; whether a
number of the axis changed or a drift went on is for the comparison to say.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from whsklearn.compare.arm import ArmLog
from whsklearn.compare.comparison import Comparison
from whsklearn.compare.records import compare_arms, compare_records
from whsklearn.compare.rows import Array
from whsklearn.gap.record import KINDS, MOTIONS, ServoRecord
from whsklearn.logs.units import UNKNOWN, factor_between, factor_of, integral_of, unit_of
from whsklearn.systems.arm import Arm

Side = tuple[Array, Array]  # numbers of the experiments (n,), rows (n, n_columns) with their time first

LABELS = ("before the alarm", "after it")
SHORTEST = 50  # samples of an experiment that is used


def at_an_alarm(columns: Sequence[str]) -> Callable[[Side, Side], dict[str, Any]] | None:
    """What compares the rows of an axis's stream; None unless they are time, a drive and a motion by their units.

    Parameters
    ----------
    columns : sequence of str
        Of the rows: time, input, output.

    Examples
    --------
    >>> at_an_alarm(["time_s", "torque_nm", "velocity_rad_s"]) is None, at_an_alarm(["t", "u", "y"]) is None
    (False, True)
    """
    if len(columns) != 3:
        return None
    clock, drive, motion = (unit_of(c) for c in columns)
    (per, position), rate = integral_of(motion), factor_of(motion)[1].endswith("/s")
    kind = factor_of(position)[1]
    if UNKNOWN in (drive, motion) or factor_of(drive)[1] not in KINDS["drive"] or kind not in MOTIONS:
        return None
    by = 1.0 if clock == UNKNOWN else factor_between(clock, "s")

    def record(side: Side) -> ServoRecord:
        parts, starts, n = [], [], 0
        for t, u, y in evenly(side, by):
            if rate:
                y = per * np.concatenate([[0.0], np.cumsum(0.5 * (y[1:] + y[:-1]) * np.diff(t))])
            parts.append((t, u, y))
            starts.append(n)
            n += t.size
        time, u, y = (np.concatenate(x) for x in zip(*parts, strict=True))
        return ServoRecord(time, u, y, units=(drive, position), starts=tuple(starts[1:]))

    return lambda before, after: told(compare_records([record(before), record(after)], LABELS))


def at_an_alarm_of(arm: Arm, dt: float, timed: bool) -> Callable[[Side, Side], dict[str, Any]]:
    """What compares the rows of an arm's stream: time, the positions of all joints, their drives.

    Parameters
    ----------
    arm : Arm
    dt : float
        Sampling time, in s, of rows without a time.
    timed : bool
        Whether a row begins with its time.

    Examples
    --------
    >>> import numpy as np
    >>> from whsklearn.datasets import default_arm, make_arm_log
    >>> arm = default_arm()
    >>> logs = (make_arm_log(arm, random_state=k, return_arrays=True) for k in range(2))
    >>> sides = [(np.zeros(len(q)), np.hstack([q, u])) for q, u in logs]
    >>> at_an_alarm_of(arm, 0.002, timed=False)(*sides)["verdict"]
    'nothing'
    """

    def record(side: Side) -> ArmLog:
        experiments, rows = side
        rows = rows if timed else np.column_stack([np.arange(len(rows)) * dt, rows])
        longest = max(evenly((experiments, rows), 1.0), key=lambda part: part[0].size)
        q_and_u = np.column_stack(longest[1:])
        n = arm.n_joints
        return ArmLog(1.0 / float(longest[0][1] - longest[0][0]), q_and_u[:, :n], q_and_u[:, n:])

    return lambda before, after: told(compare_arms([record(before), record(after)], arm, LABELS))


def evenly(side: Side, by: float) -> list[list[Array]]:
    """Time (s, ``by`` times as logged) and other columns of every experiment, each on an even grid.

    Where the clock restarted, the time goes on behind that of the experiment before.

    Raises ValueError if no experiment has enough samples.
    """
    experiments, rows = side
    step = float(np.median(np.diff(rows[:, 0])))
    out: list[list[Array]] = []
    for k in np.unique(experiments):
        part = rows[experiments == k]
        if len(part) >= SHORTEST:
            t = np.arange(part[0, 0], part[-1, 0] + 0.5 * step, step)
            signals = [np.interp(t, part[:, 0], x) for x in part.T[1:]]
            behind = out[-1][0][-1] + by * step if out else -np.inf
            out.append([by * t + max(0.0, behind - by * t[0]), *signals])
    if not out:
        raise ValueError(f"No {SHORTEST} rows without a pause were logged.")
    return out


def told(found: Comparison) -> dict[str, Any]:
    """The fields of a stream's record."""
    return {
        "verdict": found.verdict, "sentence": found.sentence, "changes": [c.as_dict() for c in found.changes],
        "notes": found.notes,
    }  # fmt: skip
