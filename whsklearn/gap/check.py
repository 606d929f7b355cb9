"""The data check: what would make any diagnosis worthless is said before one is made."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from whsklearn.gap.record import ServoRecord

SHORTEST = 6.0  # s
FEWEST = 600  # samples


@dataclass(frozen=True)
class Problem:
    """A finding on the data.

    Attributes
    ----------
    code : str
        Stable code, ``data-...``.
    title, explanation : str
        What is wrong, and what to do.
    fatal : bool
        Whether a diagnosis is out of the question.
    """

    code: str
    title: str
    explanation: str
    fatal: bool = True


def check_servo(record: ServoRecord) -> list[Problem]:
    """Problems of a servo log, the fatal ones first.

    Examples
    --------
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


def _shape_problems(r: ServoRecord) -> list[Problem]:
    n = len(r)
    bad = [name for name in ("time", "drive", "position") if not np.all(np.isfinite(getattr(r, name)))]
    if bad:
        text = f"Column for {', '.join(bad)} holds values that are missing or not finite; repair or cut them."
        return [Problem("data-not-finite", "Missing values", text)]
    if n > 1 and np.any(np.diff(r.time) <= 0):
        text = "Time does not increase; sort the log, or pass one experiment at a time."
        return [Problem("data-time-order", "Time runs backwards", text)]
    if n < FEWEST or r.time[-1] - r.time[0] < SHORTEST:
        span = r.time[-1] - r.time[0] if n else 0.0
        text = f"{n} samples over {span:.1f} s; at least {FEWEST} samples and {SHORTEST:.0f} s are needed. Log longer."
        return [Problem("data-too-short", "Record too short", text)]
    steps = np.diff(r.time)
    typical = float(np.median(steps))
    if np.mean(np.abs(steps - typical) > 0.5 * typical) > 0.01:
        text = f"More than 1 % of the steps differ by half from the typical {1e3 * typical:.3g} ms; resample evenly."
        return [Problem("data-uneven-time", "Uneven sampling", text)]
    if typical > 0.05:
        text = f"One sample every {typical:.3g} s; an axis needs at least 20 a second. Is the time column in seconds?"
        return [Problem("data-time-unit", "Sampling too slow", text)]
    return []


def _motion_problems(r: ServoRecord) -> list[Problem]:
    travel = np.ptp(r.position)
    if travel == 0 or np.mean(np.abs(np.diff(r.position)) > 0) < 0.002:
        text = "The position does not change; pick the measured position, or a record in which the axis moves."
        return [Problem("data-not-moving", "The axis does not move", text)]
    if np.ptp(r.drive) == 0:
        return [Problem("data-no-drive", "The drive is constant", "The drive column never changes; pick the drive.")]
    if np.mean(np.diff(r.drive) == 0) > 0.98:
        text = "The drive changes in fewer than 2 % of the samples; pick the drive that was applied."
        return [Problem("data-no-drive", "The drive hardly changes", text)]
    return []


def _value_problems(r: ServoRecord) -> list[Problem]:
    out = []
    for name in ("drive", "position"):
        x = getattr(r, name)
        share = flat_share(x)
        if share > 0.02:
            text = (
                f"The {name} stands at its extreme for {100 * share:.0f} % of the record: it is clipped in the log. "
                "Log with a wider range, or pass the part that is not clipped."
            )
            out.append(Problem(f"data-clipped-{name}", f"The {name} is clipped", text))
    jumps = np.abs(np.diff(r.position, 2))
    scale = np.quantile(jumps, 0.999) + 1e-300
    spikes = int(np.sum(jumps > 60 * scale))
    if spikes > 2:
        text = (
            f"{spikes} samples of the position jump far beyond the rest: outliers or a wrapped angle. Unwrap or repair."
        )
        out.append(Problem("data-spikes", "Jumps in the position", text))
    return out


def flat_share(x: np.ndarray) -> float:
    """Share of samples that stand exactly at the largest or the smallest value, in runs of three and more."""
    total = 0
    for extreme in (x.max(), x.min()):
        at = x == extreme
        runs = at[2:] & at[1:-1] & at[:-2]
        total += int(runs.sum())
    return total / x.size
