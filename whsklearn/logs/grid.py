"""A log on an even grid: estimators and derivatives need one sample per period, whatever the logger did."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from whsklearn.logs.check import ALLOWED_JITTER, GAP
from whsklearn.logs.findings import Array, Finding

if TYPE_CHECKING:
    from numpy.typing import NDArray


MOTIONS = ("position", "reference", "command")


class Even(NamedTuple):
    """Signals on an even grid, segment by segment."""

    time: Array
    signals: dict[str, Array]
    segment: NDArray[np.int64]
    period: float
    finding: Finding | None
    rounded: bool  # the stamps were rounded and have been replaced; the values are as logged


def even(time: Array, signals: dict[str, Array], segment: NDArray[np.int64]) -> Even:
    """Signals with one sample per period in each segment; unchanged if the stamps are even.

    Stamps within one tick of an even line were rounded by the logger while the samples were not; these stamps are
    replaced. Otherwise motions are interpolated by cubic splines and other signals linearly: linear interpolation of a
    motion is off by h^2 a / 8, at 100 Hz more than an encoder's noise, and its acceleration is a train of pulses.

    ``time`` (n,): increasing stamps in s. ``signals``: by role. ``segment`` (n,): number of the segment of each
    row.
    """
    step = np.diff(time)
    inside = np.diff(segment) == 0
    period = float(np.median(step[inside])) if inside.any() else float(np.median(step))
    if np.all(np.abs(step[inside] / period - 1.0) <= ALLOWED_JITTER):
        return Even(time, signals, segment, period, None, False)
    bounds = np.r_[0, np.flatnonzero(~inside) + 1, time.size].tolist()
    spans = [slice(a, b) for a, b in itertools.pairwise(bounds) if b - a >= 3]
    lines = [_line(time[part]) for part in spans]
    straight = [line for line in lines if line is not None]
    if len(straight) == len(spans) > 0:
        period = float(np.median([(line[-1] - line[0]) / (line.size - 1) for line in straight]))
        text = f"The time stamps are rounded; rows are taken {period:.6g} s apart in {len(spans)} segment(s)."
        parts = [(line, {k: v[part] for k, v in signals.items()}) for line, part in zip(straight, spans, strict=True)]
    else:
        near = step[inside & (step < GAP * period)]
        period = float(near.mean())  # the median of 10, 12, 10, 12 ms is neither of them
        text = f"Onto an even grid of {period:.6g} s in {len(spans)} segment(s): motions by splines, the rest linearly."
        parts = [_resampled(time[part], {k: v[part] for k, v in signals.items()}, period) for part in spans]
    return Even(
        np.concatenate([t for t, _ in parts]),
        {k: np.concatenate([v[k] for _, v in parts]) for k in signals},
        np.concatenate([np.full(t.size, i, dtype=np.int64) for i, (t, _) in enumerate(parts)]),
        period,
        Finding("LOG011", "warning", text, value=period),
        len(straight) == len(spans),
    )


def _resampled(t: Array, signals: dict[str, Array], period: float) -> tuple[Array, dict[str, Array]]:
    """Resample one segment to its grid."""
    grid = t[0] + period * np.arange(int((t[-1] - t[0]) / period * (1 + 1e-9)) + 1)
    return grid, {k: _at(grid, t, v, k in MOTIONS) for k, v in signals.items()}


def _line(t: Array) -> Array | None:
    """An even line through stamps that were rounded to a tick of at least a tenth of the period; None otherwise."""
    steps = np.round(np.diff(t), 9)
    short, long = float(steps.min()), float(steps.max())
    tick = long - short
    often = float(np.mean(steps == long))
    # Rounding gives two step lengths, both whole ticks and one tick apart, and both frequent; lost samples are rare.
    if tick < 0.1 * steps.mean() or not np.all((steps == short) | (steps == long)) or not 0.02 < often < 0.98:
        return None
    line = t[0] + (t[-1] - t[0]) / (t.size - 1) * np.arange(t.size)
    off = t - line
    if abs(short / tick - round(short / tick)) > 1e-3 or np.ptp(off) > 1.01 * tick:
        return None
    return line + 0.5 * (off.max() + off.min())


def _at(grid: Array, t: Array, values: Array, smooth: bool) -> Array:
    """Interpolate the values at new times."""
    if not smooth:
        return np.interp(grid, t, values)
    from scipy.interpolate import CubicSpline

    return np.asarray(CubicSpline(t, values)(np.minimum(grid, t[-1])))
