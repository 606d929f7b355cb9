"""Likely mistakes in a log: an inverted or unsigned drive, a velocity for a position, degrees for radians, ms for s.

Pure functions of signals, which the gap workflow and ``identify`` use when a log is read and when a result is not
physical. Each result is a sentence and the option that corrects the mistake; nothing is changed without being asked.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from whsklearn.logs.findings import Array
from whsklearn.logs.timebase import SLOWEST
from whsklearn.logs.units import factor_of, seconds_of, unit_of

MOST_ROWS = 50_000  # a mistake is in every row; more rows only take time
SLOW = 0.2  # s; no axis is logged at five times a second, but ms called s look like that
FAST = 2e-6  # s; no logger is faster, but s taken as ms look like that
SHORT = 3.0  # s; `gap` rejects a shorter log of an axis
SURE = 0.15  # correlation of drive and velocity; below minus this the axis would deliver power
EXPLAINED = 0.3  # share of the drive's residual that the sign of the column explains if it is a velocity
# Share of the residual power of a drive that never changes its sign which is left once signs are restored to it. In 60
# logs of `make_servo_log`, bare and with one of four effects, at most 0.6 of a magnitude's and at least 1 of a lift's;
# but 0.96 of a magnitude's where a pendulum turns over several turns, which stays unseen (a script that was not kept;
# `tests/logs/test_slips.py` holds both sides).
SIGNED = 0.7
# Shares of a column's variance about its mean that an axis with the other column as its position explains. Two columns
# are called exchanged if the one called the position is a torque to `TORQUE`, and the one called the drive is none to
# `NONE` (`tests/logs/test_slips.py`).
TORQUE, NONE = 0.9, 0.5
EXACT = 1e-9  # of the highest speed; smaller changes of a speed come from rounding
PASSES = 20  # of restoring the sign; it settles in about five
_VELOCITY = "--velocity COLUMN in place of --position"


class Slip(NamedTuple):
    """A likely mistake, and the option that would correct it.

    Attributes
    ----------
    sentence : str
    option : str
        Of the commands.

    Examples
    --------
    >>> from whsklearn.logs import Slip
    >>> print(Slip("The position has the unit deg/s: it is a velocity.", "--velocity COLUMN in place of --position"))
    The position has the unit deg/s: it is a velocity. If so, add --velocity COLUMN in place of --position.
    """

    sentence: str
    option: str

    def __str__(self) -> str:
        return f"{self.sentence} If so, add {self.option}."


def slips_in(log: Any) -> list[Slip]:
    """Likely slips in a log that `load_log` read: units, signs, a velocity in place of a position.

    ``log``: as `load_log` returns it, with ``position``. Returns an empty list if nothing looks wrong.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn.utils import Bunch
    >>> from whsklearn.logs import slips_in
    >>> t = np.arange(4000) / 200
    >>> q, v, a = np.sin(3 * t), 3 * np.cos(3 * t), -9 * np.sin(3 * t)
    >>> q += 0.3 * np.sin(7 * t); v += 2.1 * np.cos(7 * t); a -= 14.7 * np.sin(7 * t)
    >>> log = Bunch(time=t, X=-(0.1 * a + 0.5 * np.sign(v))[:, None], y=q, units={}, command=None)
    >>> [s.option for s in slips_in(log)]
    ['--invert-drive']
    """
    stated = unit_of(log.get("columns", {}).get("time", ""), "")  # of the column; those of the log are seconds by now
    found = time_slips(log.time, stated or log.units.get("time", "s"), SLOW if stated else SLOWEST)
    n = min(log.y.size, MOST_ROWS)
    unit = log.units.get("position", "")
    if "velocity" not in log.get("columns", ()):  # an integrated velocity grows for as long as the axis turns
        found += unit_slips(log.y[:n], unit)
    if log.get("command") is None and n > 200 and not found:
        found += drive_slips(log.X[:n, 0], log.y[:n])
    return found


def time_slips(time: Array, unit: str, slow: float = SLOW) -> list[Slip]:
    """Milliseconds taken for seconds, or vice versa; of samples at most ``slow`` (s) apart none are taken for ms."""
    period = float(np.median(np.diff(time[:MOST_ROWS])))
    if unit == "samples":
        return []
    if period > slow:
        text = f"There is one sample every {period:.4g} s: time looks like ms or a count of samples, not s."
        return [Slip(text, "--unit time=ms, or --rate HZ in place of --time")]
    scale = seconds_of(unit)  # s called ms are a thousand times as close, and the log a thousand times as short
    if scale < 1.0 and (period <= FAST or (period <= scale * SLOWEST and np.ptp(time) < SHORT)):
        return [Slip(f"There is one sample every {period:.3g} s: time looks like s, not {unit}.", "--unit time=s")]
    if period <= FAST:
        text = f"There is one sample every {period:.3g} s, faster than any logger: time looks like hours or days"
        return [Slip(f"{text}, not s.", "--rate HZ in place of --time")]
    return []


def unit_slips(position: Array, unit: str) -> list[Slip]:
    """A velocity, by its unit; degrees in a column of radians, by a range of many turns."""
    if factor_of(unit)[1].endswith("/s"):
        return [Slip(f"The position has the unit {unit}: it is a velocity.", _VELOCITY)]
    span = float(np.ptp(position)) if position.size else 0.0
    middle = position - 0.5 * (position.max() + position.min())
    swings = int(np.sum(np.diff(np.sign(middle[np.abs(middle) > 0.2 * span])) != 0))
    if unit == "rad" and 4 * math.pi < span < 720.0 and swings > 0:
        text = f"The position swings over {span:.3g} rad, {span / (2 * math.pi):.3g} turns: are those degrees?"
        return [Slip(text, "--unit position=deg")]
    return []


def drive_slips(drive: Array, position: Array) -> list[Slip]:
    """An inverted drive, by power and inertia; one without its sign; a velocity for a position, by its friction."""
    p = position - position.mean()
    v, a = _derivatives(p)
    fastest = EXACT * float(np.abs(v).max())
    if not (np.ptp(drive) > 0 and np.ptp(v) > fastest and np.ptp(a) > fastest):  # at one speed no inertia shows
        return []
    if _as_torque(drive, p, v, a)[0] < NONE:
        share, weight = _as_torque(position, drive - drive.mean(), *_derivatives(drive - drive.mean()))
        if share > TORQUE and weight > 0.0:
            text = f"As a motion, the drive's column explains {100 * share:.0f} % of the position's as its torque"
            return [Slip(f"{text}: are the two exchanged?", "--drive and --position the other way round")]
    inside = slice(20, -20)
    u, p, v, a = (x[inside] for x in (drive - drive.mean(), p, v, a))
    one = np.ones_like(p)
    rest, axis = _rest(u, [one, p, v]), [one, p, v, a, np.sign(v)]
    by_axis = 1.0 - _rest(u, axis) / rest
    by_speed = 1.0 - _rest(u, [one, p, v, np.sign(position[inside])]) / rest
    crosses = abs(position.mean()) < 0.5 * position.std()
    if crosses and by_speed > EXPLAINED and by_speed > 2.0 * by_axis:
        text = "The drive changes sign with the position column, not with its rate: is the column a velocity?"
        return [Slip(text, _VELOCITY)]
    if drive.min() >= 0.0 or drive.max() <= 0.0:
        size = np.abs(drive[inside])
        if min(_rest_of_size(size, axis, s) for s in (p, v, a)) < SIGNED * _rest(size, axis):
            text = "The drive never changes its sign, but the motion is that of one that does: is it a magnitude only?"
            return [Slip(text, "its sign to the column (of a PWM duty, from the direction pin)")]
    inertia = np.linalg.lstsq(np.column_stack([a, v, np.sign(v), p, one]), u, rcond=None)[0][0]
    power = float(np.mean(u * v) / (u.std() * v.std()))
    if inertia < 0 and power < -SURE:
        text = "The axis would deliver power and have a negative inertia: is the sign of the drive inverted?"
        return [Slip(text, "--invert-drive")]
    return []


def _as_torque(torque: Array, p: Array, v: Array, a: Array) -> tuple[float, float]:
    """Share of a torque that an axis with this motion explains, and the weight of the acceleration in it."""
    y, p, v, a = (x[20:-20] for x in (torque, p, v, a))
    columns = [a, v, np.sign(v), p, np.ones_like(p)]
    weights = np.linalg.lstsq(np.column_stack(columns), y, rcond=None)[0]
    return 1.0 - _rest(y, columns) / (float(y.var()) * y.size + 1e-300), float(weights[0])


def _rest(y: Array, columns: list[Array]) -> float:
    """Residual sum of squares of y on the columns."""
    table = np.column_stack(columns)
    return float(np.sum((y - table @ np.linalg.lstsq(table, y, rcond=None)[0]) ** 2)) + 1e-300


def _rest_of_size(size: Array, columns: list[Array], start: Array) -> float:
    """Residual of ``size`` with a sign on the columns, which gets that of the fit, first that of ``start``, in turn."""
    table, sign = np.column_stack(columns), np.sign(start)
    for _ in range(PASSES):
        fitted = table @ np.linalg.lstsq(table, sign * size, rcond=None)[0]
        sign, before = np.sign(fitted), sign
        if np.array_equal(sign, before):
            break
    return _rest(sign * size, columns)


def _derivatives(p: Array) -> tuple[Array, Array]:
    """First and second differences per sample, smoothed over a fifteenth of the usual time between zero crossings."""
    from scipy.signal import savgol_filter

    crossings = max(2, int(np.sum(np.diff(np.sign(p)) != 0)))
    width = int(np.clip(2 * p.size / crossings / 15, 7, 401)) | 1
    width = min(width, (p.size - 1) | 1)
    return savgol_filter(p, width, 3, deriv=1), savgol_filter(p, width, 3, deriv=2)
