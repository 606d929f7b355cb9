"""Linear least squares for inverse dynamics with sign constraints.

torque = J a + sum of terms is linear in the sizes, so a thousand candidates cost only a thousand small solves.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from whsklearn.gap.record import Array

RIDGE = 3e-5  # per sample, for columns of unit rms: far below the information of any column worth naming


def solve(columns: Array, target: Array, positive: NDArray[np.bool_]) -> tuple[Array, NDArray[np.bool_]]:
    """Sizes in the columns' own units, shape (p,), and a mask of the columns used; negative ones are dropped."""
    scale = np.sqrt(np.mean(columns**2, axis=0))
    scale[scale == 0.0] = 1.0
    z = np.column_stack([columns / scale, target])
    gram = z.T @ z
    free = np.ones(scale.size, dtype=bool)
    c = _ridge(gram, free, target.size)
    for _ in range(scale.size):
        bad = positive & free & (c < 0.0)
        if not bad.any():
            break
        worst = np.flatnonzero(bad)[np.argmin(c[bad])]  # one at a time, because the others may become positive again
        free[worst] = False
        c = _ridge(gram, free, target.size)
    return c / scale, free


def of_differences(columns: Array, target: Array) -> Array:
    """Sizes for which the first differences of columns and target agree best, shape (p,).

    If the error is a random walk rather than white, these are the efficient ones (Cochrane and Orcutt 1949, JASA
    44(245), 32-61, with a coefficient of one): a slow force that is missing hardly changes between two samples, while
    the acceleration does.
    """
    steps = np.diff(columns, axis=0)
    scale = np.linalg.norm(steps, axis=0) + 1e-300
    return np.linalg.lstsq(steps / scale, np.diff(target), rcond=1e-10)[0] / scale


def _ridge(gram: Array, free: NDArray[np.bool_], n: int) -> Array:
    out = np.zeros(free.size)
    at = np.flatnonzero(free)
    if at.size:
        held = gram[at[:, None], at]
        held.flat[:: at.size + 1] += RIDGE * n
        out[at] = np.linalg.solve(held, gram[at, -1])
    return out


def slope(x: Array, step: float) -> Array:
    """Five-point derivative of samples ``step`` seconds apart."""
    p = np.concatenate([x[:1], x[:1], x, x[-1:], x[-1:]])
    return (p[:-4] - 8 * p[1:-3] + 8 * p[3:-1] - p[4:]) / (12 * step)
