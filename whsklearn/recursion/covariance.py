"""The covariance in factorised form, P = U D U', and its rank-one measurement update.

U is unit upper triangular and D diagonal and positive, so P stays symmetric and positive
definite by construction (Bierman 1977, Factorization Methods for Discrete Sequential
Estimation, ch. V).  Both live in one square array: D on the diagonal, the columns of U as
rows below it, so that the inner loops run along memory.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from whsklearn._numba import njit
from whsklearn.recursion.steps import in_one

if TYPE_CHECKING:
    from collections.abc import Generator

WIND_UP = 1e3  # forgetting may take P to this many times P(0), and no further


@njit(cache=True, error_model="numpy")
def measurement_update(ud, phi, r, gain):
    """Update U and D by one row phi whose noise has variance r; ``gain`` receives L(t).

    Returns the innovation variance phi' P phi + r; (12) is r = 1.
    """
    n = phi.size
    alpha = r
    for j in range(n):
        f = phi[j]
        for i in range(j):
            f += ud[j, i] * phi[i]
        d = ud[j, j]
        g = d * f
        before = alpha
        alpha += f * g
        ud[j, j] = d * (before / alpha)
        gain[j] = g
        shift = -f / before
        for i in range(j):
            u = ud[j, i]
            ud[j, i] = u + shift * gain[i]
            gain[i] += g * u
    for j in range(n):
        gain[j] /= alpha
    return alpha


@njit(cache=True, error_model="numpy")
def inflate(ud, factor, ceiling):
    """P <- P * factor, by D alone, as far as ``ceiling`` allows.

    Without a ceiling forgetting winds P up where nothing is excited, until it overflows.
    """
    for j in range(ud.shape[0]):
        if ud[j, j] < ceiling:
            ud[j, j] = min(ud[j, j] * factor, ceiling)


def factorise(p: np.ndarray) -> np.ndarray:
    """U and D of a symmetric positive definite P, in one array."""
    return in_one(factorise_steps(p))


def factorise_steps(p: np.ndarray) -> Generator[None, None, np.ndarray]:
    """`factorise` in parts."""
    # P = U D U' with U upper: the Cholesky factor of P with both axes reversed, reversed back
    root = np.linalg.cholesky(p[::-1, ::-1])[::-1, ::-1]
    yield
    scale = root.diagonal()
    ud = (root / scale).T.copy()  # nothing is below the diagonal of the factor
    yield
    ud.flat[:: len(ud) + 1] = scale**2
    return ud


def covariance(ud: np.ndarray) -> np.ndarray:
    """P = U D U' of shape (n, n), exactly symmetric."""
    root = (np.tril(ud, -1).T + np.eye(ud.shape[0])) * np.sqrt(np.diag(ud))
    p = root @ root.T
    return (p + p.T) / 2.0
