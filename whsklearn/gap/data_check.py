"""The data check: problems that would make any diagnosis worthless are reported before one is made."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from whsklearn.gap.record import ServoRecord
from whsklearn.logs.check import runs, stillness
from whsklearn.logs.timebase import LONG_GAP, SLOWEST

# s: a third of a record is lost to restarts and filters, and the rest must hold several reversals.
SHORTEST_RECORD = 3.0
FEWEST_SAMPLES = 300
# Share of steps that may differ from the typical one by more than the second share of it; the same share of a step by
# which the rates of two records may differ.
UNEVEN, UNEVEN_STEP = 0.01, 0.5
# Changes of the drive: a torque step has two.
FEWEST_CHANGES = 4
# Share of samples at an extreme that is worth mentioning; runs of at least so many samples count.
FLAT, FLAT_RUN = 0.02, 3
# s over which a halt at an extreme is compared with the rest of the path.
TURNING = 0.01
# Multiple of the usual change of path (this quantile of it): a turn stays below 0.6 on eight pendulum logs and, because
# v = a t, below 1; sines clipped at their median or at nine tenths reach 1.9 to 7.6 (blind records of
# `benchmarks.blind_logs`).
SHARPER, USUAL = 1.4, 0.99
# Multiple of the 0.999 quantile of second differences; how many of them a record may have.
SPIKE, SPIKES_BORNE = 60.0, 2


@dataclass(frozen=True)
class DataProblem:
    """A problem found in the data.

    Attributes
    ----------
    code : str
        Stable code, ``data-...``.
    title, explanation : str
        What is wrong, and what to do.
    fatal : bool
        Whether it makes a diagnosis impossible.

    References
    ----------
    Ljung 1999, System Identification, 2nd ed., ch. 14, Preprocessing data.

    Examples
    --------
    >>> from whsklearn.gap import DataProblem
    >>> DataProblem("data-limit", "The drive stands at its limit.", "Saturation is one of the effects.", False)
    DataProblem(code='data-limit', ...fatal=False)
    """

    code: str
    title: str
    explanation: str
    fatal: bool = True


def check_servo(record: ServoRecord) -> list[DataProblem]:
    """Problems of a servo log, the fatal ones first.

    >>> import numpy as np
    >>> t = np.arange(8000) / 1000
    >>> [p.code for p in check_servo(ServoRecord(t, np.zeros(8000), np.zeros(8000)))]
    ['data-not-moving']
    """
    shape = _shape_problems(record)
    if shape:
        return shape
    out = _motion_problems(record) or _value_problems(record)
    return sorted(out, key=lambda p: not p.fatal)


def _shape_problems(r: ServoRecord) -> list[DataProblem]:
    n = len(r)
    bad = [name for name in ("time", "drive", "position") if not np.all(np.isfinite(getattr(r, name)))]
    if bad:
        text = f"Column for {', '.join(bad)} holds values that are missing or not finite; repair or cut them."
        return [DataProblem("data-not-finite", "Missing values", text)]
    if n > 1 and np.any(np.diff(r.time) <= 0):
        text = "Time does not increase; sort the log, or pass one experiment at a time."
        return [DataProblem("data-time-order", "Time runs backwards", text)]
    if n < FEWEST_SAMPLES or r.time[-1] - r.time[0] < SHORTEST_RECORD:
        span = r.time[-1] - r.time[0] if n else 0.0
        text = (
            f"{n} samples over {span:.3g} s; at least {FEWEST_SAMPLES} samples and {SHORTEST_RECORD:.0f} s "
            "are needed. Log longer."
        )
        return [DataProblem("data-too-short", "Record too short", text)]
    steps = np.delete(np.diff(r.time), np.array(r.starts, dtype=int) - 1)
    typical = float(np.median(steps))
    longest = int(np.argmax(steps))
    if steps[longest] >= LONG_GAP * typical:
        text = (
            f"{1e3 * steps[longest]:.3g} ms pass after {r.time[longest]:.6g} s where {1e3 * typical:.3g} ms are usual: "
            "samples are missing. Read the file with load_log, which repairs or splits it, or pass one unbroken part."
        )
        return [DataProblem("data-uneven-time", "A hole in time", text)]
    if np.mean(np.abs(steps - typical) > UNEVEN_STEP * typical) > UNEVEN:
        text = f"More than 1 % of the steps differ by half from the typical {1e3 * typical:.3g} ms; resample evenly."
        return [DataProblem("data-uneven-time", "Uneven sampling", text)]
    if typical > SLOWEST:
        text = f"One sample every {typical:.3g} s; an axis needs at least 20 a second. Log faster."
        return [DataProblem("data-time-unit", "Sampling too slow", text)]
    return []


def _motion_problems(r: ServoRecord) -> list[DataProblem]:
    if still := stillness(r.position, r.by_piece(np.diff, r.position)):
        return [DataProblem("data-not-moving", *still)]
    if np.ptp(r.drive) == 0:
        return [
            DataProblem("data-no-drive", "The drive is constant", "The drive column never changes; pick the drive.")
        ]
    changes = np.count_nonzero(np.diff(r.drive))
    if changes < FEWEST_CHANGES:
        text = (
            f"The drive changes {changes} times in the whole record, at least {FEWEST_CHANGES} are expected. If "
            "this is a step test, log a richer motion as well: a step cannot distinguish effects. If the drive is in "
            "another column, name that one."
        )
        return [DataProblem("data-no-drive", "The drive hardly changes", text)]
    return []


def _value_problems(r: ServoRecord) -> list[DataProblem]:
    out = []
    share = flat_share(r.drive)
    if share > FLAT:
        text = (
            f"The drive is at its extreme for {100 * share:.0f} % of the record. If that is the limit of the "
            "amplifier, the log is as it should be; if the logger cut it off, log with a wider range."
        )
        out.append(DataProblem("data-drive-at-limit", "The drive reaches a limit", text, fatal=False))
    share = flat_share(r.position)
    if share > FLAT:
        cut = cut_at_speed(r.position, r.dt)
        text = f"The position is at its extreme for {100 * share:.0f} % of the record"
        text += (
            " and gets there at full speed: it is clipped in the log. Log with a wider range, or pass the part that "
            "is not clipped." if cut else ": the axis rests there or is against a stop."
        )  # fmt: skip
        title = "The position is clipped" if cut else "The position rests at its extreme"
        out.append(DataProblem("data-clipped-position" if cut else "data-rest-at-extreme", title, text, fatal=cut))
    jumps = np.abs(r.by_piece(lambda x: np.diff(x, 2), r.position))
    scale = np.quantile(jumps, 0.999) + 1e-300
    spikes = int(np.sum(jumps > SPIKE * scale))
    if spikes > SPIKES_BORNE:
        text = (
            f"{spikes} samples of the position jump far beyond the rest: outliers or a wrapped angle. Unwrap or repair."
        )
        out.append(DataProblem("data-spikes", "Jumps in the position", text))
    return out


def cut_at_speed(x: np.ndarray, dt: float) -> bool:
    """Whether most runs at an extreme begin and end at speed, as no real axis does.

    A clipped reading enters and leaves its run with the speed of the motion that was cut off.  An axis that turns
    around or comes to rest changes its speed there no faster than elsewhere, and the distance that it covers in k
    samples before or after the halt is within its usual change of path over k samples.  That is measured on the record
    itself, so a coarse grid, friction or a stiff load change the bound just as they change the path.
    """
    k = max(2, round(TURNING / dt))
    if x.size < 10 * k:
        return False
    at = (x == x.max()) | (x == x.min())
    halts = [(a, b) for a, b in zip(*runs(at), strict=True) if b - a >= FLAT_RUN and a >= k and b + k <= x.size]
    near = np.convolve(at, np.ones(2 * k + 1), mode="same")[k:-k] > 0
    bends = np.abs(x[2 * k :] - 2 * x[k:-k] + x[: -2 * k])
    if not halts or near.all():
        return False
    usual = float(np.quantile(bends[~near], USUAL))
    speeds = [min(abs(x[a] - x[a - k]), abs(x[b - 1 + k] - x[b - 1])) for a, b in halts]
    return float(np.median(speeds)) > SHARPER * usual


def flat_share(x: np.ndarray) -> float:
    """Share of samples exactly at the largest or the smallest value, in runs of at least `FLAT_RUN`."""
    total = 0
    for extreme in (x.max(), x.min()):
        at = x == extreme
        total += int(np.lib.stride_tricks.sliding_window_view(at, FLAT_RUN).all(axis=1).sum())
    return total / x.size
