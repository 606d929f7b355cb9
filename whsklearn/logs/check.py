"""Checks of a log before anything is fitted: time stamps, holes, clipping, repeated samples, quantization."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from whsklearn.logs.findings import Array, Finding, LogReport

ALLOWED_JITTER = 0.01  # as a share of the period; derivatives of the position are wrong by the same share
GAP = 1.5  # periods; a longer step has lost a sample, a shorter one is jitter
# Differences of neighbouring values up to this multiple of the smallest one are one step of the grid: a difference of
# two steps is none, and digits cut off in a file change one step a little.
ONE_STEP = 1.5
# Share of a step, times the root of their number, by which a difference may miss whole steps; and the share of all
# differences that must not miss them.
ON_GRID, MOSTLY = 0.02, 0.99
# Steps, however large the difference: half of any numbers lie that near to whole ones, so readings without a grid fail.
# Without this limit, differences of a thousand times the smallest one all lay on its grid.
NEAREST = 0.25
# Distinct values per sample: above this, nearly every value occurs once, and a grid is no coarser than the noise.
DISTINCT = 0.9
MOVING = 0.002  # share of samples at which the position of an axis that moves must change


def check_log(time: Array, signals: dict[str, Array], rows: NDArray[np.intp] | None = None) -> LogReport:
    """Check a log.

    ``time`` (n,): stamps in seconds. ``signals``: ``drive``, ``position`` and, if logged, ``reference``, (n,) each.
    ``rows`` (n,): row numbers in the file, if some were left out.

    Examples
    --------
    >>> import numpy as np
    >>> from whsklearn.logs import check_log
    >>> t = np.arange(2000) / 1000
    >>> report = check_log(t, {"drive": np.sin(4 * t), "position": np.cos(4 * t)})
    >>> report.ok, report.jitter < 1e-9
    (True, True)
    """
    found = [*_stamps(time, np.arange(len(time)) if rows is None else rows)]
    skipped: dict[str, str] = {}
    for name, x in signals.items():
        found += _clipping(name, x) if name in ("drive", "position") else []
    found += _repeats(signals)
    drive, position = signals.get("drive"), signals.get("position")
    if drive is None:
        skipped["LOG008"] = "no drive was named"
    elif not drive.any():
        found.append(Finding("LOG008", "error", "Nothing drove the axis; check the column and the enable."))
    quantum = None
    if position is None:
        skipped["LOG007"] = skipped["LOG009"] = "no position was named"
    elif np.ptp(position) == 0:
        found.append(Finding("LOG009", "error", "The axis stood still or the encoder was off; nothing can be fitted."))
    else:
        quantum = lattice(position, distinct=1.0) or None
        if quantum is not None:
            text = f"Values are multiples of {quantum:.4g}: its variance q^2/12 is the lowest noise a fit can reach."
            found.append(Finding("LOG007", "info", text, value=quantum))
    return LogReport(tuple(found), skipped, jitter(time), quantum)


def stillness(position: Array, steps: Array) -> tuple[str, str] | None:
    """Why a position shows no motion of an axis, as a title and what to do; None if it does.

    ``steps``: its differences from sample to sample, without those across holes.

    >>> import numpy as np
    >>> noise = np.random.default_rng(0).standard_normal(1000)
    >>> stillness(noise, np.diff(noise))[0], stillness(np.cumsum(noise), noise[1:])
    ('The axis hardly moves', None)
    """
    instead = "pick the measured position, or a record in which the axis moves."
    if not np.ptp(position) or np.mean(steps != 0) < MOVING:
        return "The axis does not move", f"The position does not change; {instead}"
    if np.mean(steps**2) > np.var(position):  # white noise changes by twice its variance
        text = "More than half of what the position changes by is noise from one sample to the next"
        return "The axis hardly moves", f"{text}; {instead}"
    return None


def runs(flags: NDArray[np.bool_]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """The first row of every run of flags that are set, and the row behind it.

    >>> runs(np.array([True, True, False, True]))
    (array([0, 3]), array([2, 4]))
    """
    edges = np.flatnonzero(np.diff(np.r_[0, flags.astype(np.int8), 0]))
    return edges[::2], edges[1::2]


def jitter(time: Array) -> float:
    """Largest deviation of a time step from the median step, relative to it; missing samples left out."""
    step = np.diff(time)
    period = float(np.median(step))
    near = step[(step > 0) & (step < GAP * period)]
    return float(np.abs(near / period - 1.0).max()) if near.size and period > 0 else np.inf


def _stamps(time: Array, rows: NDArray[np.intp]) -> list[Finding]:
    """Find irregular, missing, repeated and decreasing time stamps."""
    step = np.diff(time)
    period = float(np.median(step))
    out = []

    def found(code: str, steps: NDArray[np.intp], text: str, value: float | None = None) -> None:
        out.append(Finding(code, "error", text, rows[steps + 1], value))

    back = np.flatnonzero(step < 0)
    same = np.flatnonzero(step == 0)
    scale = period if period > 0 else np.inf  # most stamps do not increase, so there is no period to compare holes with
    holes = np.flatnonzero(step > GAP * scale)
    uneven = np.flatnonzero((step > 0) & (step <= GAP * scale) & (np.abs(step / scale - 1) > ALLOWED_JITTER))
    uneven = uneven if period > 0 else uneven[:0]
    if back.size:
        text = f"From row {rows[back[0]]} to row {rows[back[0] + 1]} it falls by {-step[back[0]]:.4g} s"
        found("LOG004", back, f"{text}; sort the log or split it into its runs.")
    if same.size:
        text = f"Row {rows[same[0] + 1]} has the stamp of the row before, {time[same[0]]:.6g} s"
        found("LOG003", same, f"{text}; drop the duplicates or resample.")
    if holes.size:
        lost = int(np.round(step[holes] / period - 1).sum())
        text = f"{holes.size} hole{'s' if holes.size > 1 else ''}, about {lost} samples, the first before row "
        text += f"{rows[holes[0] + 1]} ({step[holes[0]]:.4g} s for {period:.4g} s)"
        found("LOG002", holes, f"{text}; resample; long holes start a new group.", float(lost))
    if uneven.size:
        worst = uneven[np.argmax(np.abs(step[uneven] / period - 1))]
        off = abs(step[worst] / period - 1)
        text = f"Row {rows[worst + 1]} follows after {step[worst]:.4g} s where {period:.4g} s is usual"
        found("LOG001", uneven, f"{text} ({off:.1%} off, {ALLOWED_JITTER:.0%} allowed); resample.", off)
    return out


def _clipping(name: str, x: Array) -> list[Finding]:
    """Find flat tops that are entered and left at speed: a limit, not a turning point or a rest."""
    moves = np.abs(np.diff(x))
    if not moves.any():
        return []
    within = (x > x.min()) & (x < x.max())
    between = moves[within[1:] & within[:-1]]
    hold = between.size / max(np.count_nonzero(between), 1)  # samples; an input of steps is held at every level
    usual = float(np.median(moves[moves > 0]))
    flat, jumps, first = 0, [], []
    for extreme in (x.max(), x.min()):
        for start, stop in zip(*runs(x == extreme), strict=True):
            if stop - start >= 3 * max(hold, 1.0):
                flat += stop - start
                first.append(int(start))
                jumps += [abs(x[i] - extreme) for i in (start - 1, stop) if 0 <= i < x.size]
    step = lattice(x)  # in a quantized signal every turning point is flat, and is left by single steps
    if flat < 5 or flat > 0.6 * x.size or not jumps or np.median(jumps) < max(0.5 * usual, 1.5 * step):
        return []
    text = f"{name} stays at its extreme values in {flat} samples, first at row {min(first)}; "
    text += "cut those rows, or give the model a saturation."
    return [Finding("LOG005", "warning", text, sorted(first), flat / x.size)]


def _repeats(signals: dict[str, Array]) -> list[Finding]:
    """Find rows equal to the row before in every signal while the axis moves: the logger polls too fast."""
    table = np.column_stack(list(signals.values()))
    same = np.r_[False, (table[1:] == table[:-1]).all(axis=1)]
    same &= ~((table == table.max(axis=0)) | (table == table.min(axis=0))).any(axis=1)  # a limit, a turning point
    starts, ends = runs(same)
    lengths = ends - starts
    if table.shape[1] < 2 or len(table) < 4:
        return []
    # where the smoothest signal goes on by less than a step of its grid per row, rows are equal by chance
    rough = [np.sum(np.diff(x, 2) ** 2) / max(np.sum(np.diff(x) ** 2), 1e-300) for x in table[~same].T]
    path = table[:, int(np.argmin(rough))]
    across = path[np.minimum(ends, path.size - 1)] - path[np.maximum(starts - 2, 0)]
    moves = np.abs(across) > (lengths + 2) * lattice(path, distinct=1.0)
    moves &= lengths <= 20  # longer runs are an axis at rest
    count = int(lengths[moves].sum())
    if count < max(3, 1e-3 * len(table)):
        return []
    text = f"{count} rows equal the row before in every signal, the first is row {starts[moves][0]}; the logger polls "
    text += "faster than the controller writes, so log at the controller's rate."
    return [Finding("LOG006", "warning", text, starts[moves], count / len(table))]


def lattice(readings: ArrayLike, distinct: float = DISTINCT) -> float:
    """Step of the grid on which all readings lie, 0 if there is none.

    ``readings`` is (n,). ``distinct``: share of distinct values above which there is no grid worth knowing; 1 finds
    also one finer than the noise.

    >>> smooth = np.sin(np.arange(500.0))
    >>> round(lattice(np.round(smooth / 0.01) * 0.01), 9), lattice(smooth)
    (0.01, 0.0)
    """
    x = np.asarray(readings, dtype=float)
    values = np.unique(x)
    if values.size < 4 or values.size > distinct * x.size:
        return 0.0
    gaps = np.diff(values)
    gaps = gaps[gaps > 1e-12 * (values[-1] - values[0])]  # rounding errors
    step = float(np.median(gaps[gaps < ONE_STEP * gaps.min()]))
    steps = np.round(gaps / step)
    missed = np.abs(gaps / step - steps)
    if np.mean(missed < np.minimum(ON_GRID * np.sqrt(np.maximum(steps, 1.0)), NEAREST)) < MOSTLY:
        return 0.0
    return float(gaps.sum() / steps.sum())  # to all digits, even where a file rounds every step
