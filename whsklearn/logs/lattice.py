"""The grid on which the readings of a digital sensor lie."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

# Differences of neighbouring values up to this multiple of the smallest one are one step of the grid: a difference of
# two steps is none, and digits cut off in a file change one step a little.
ONE_STEP = 1.5
# Share of a step, times the root of their number, by which a difference may miss whole steps; and the share of all
# differences that must not miss them.
ON_GRID, MOSTLY = 0.02, 0.99
# Distinct values per sample: above this, nearly every value occurs once, and a grid is no coarser than the noise.
DISTINCT = 0.9


def lattice(readings: ArrayLike, distinct: float = DISTINCT) -> float:
    """Step of the grid on which all readings lie, 0 if there is none.

    ``readings`` is (n,). ``distinct``: share of distinct values above which there is no grid worth knowing; 1 finds
    also one finer than the noise.

    >>> import numpy as np
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
    if np.mean(np.abs(gaps / step - steps) < ON_GRID * np.sqrt(np.maximum(steps, 1.0))) < MOSTLY:
        return 0.0
    return float(gaps.sum() / steps.sum())  # to all digits, even where a file rounds every step
