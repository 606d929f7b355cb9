"""The drive between its samples: held, as a digital controller gives it, or smooth, as a band-limited signal is."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

HOLDS = ("zero", "cubic")


def fine_drive(u: Array, steps: int, hold: str = "zero", bounds: NDArray[np.int64] | None = None) -> Array:
    """The drive in the middle of every fine step, shape (n, steps).

    ``cubic`` is the spline through the samples of each segment, which is off a sine of a ninth of the sampling rate by
    1e-4 of it; held, that sine loses 2 % and comes half a sample late.

    ``u`` (n,): the drive. ``steps``: fine steps a sample. ``hold`` {"zero", "cubic"}: what is between two samples.
    ``bounds``: first sample of every segment, and the number of samples.
    """
    if hold == "zero":
        return np.repeat(u[:, None], steps, axis=1)
    from scipy.interpolate import CubicSpline

    bounds = np.array([0, u.size]) if bounds is None else bounds
    middle = (np.arange(steps) + 0.5) / steps
    out = np.empty((u.size, steps))
    for a, b in itertools.pairwise(bounds.tolist()):
        at = np.minimum(np.arange(b - a)[:, None] + middle, b - a - 1.0)  # behind the last sample it stays
        out[a:b] = CubicSpline(np.arange(b - a), u[a:b])(at)
    return out
