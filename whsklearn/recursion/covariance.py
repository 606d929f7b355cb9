"""The covariance in factorised form, P = U D U', and its rank-one measurement update.

U is unit upper triangular and D diagonal and positive, so P stays symmetric and positive
definite by construction (Bierman 1977, Factorization Methods for Discrete Sequential
Estimation, ch. V).  Both live in one square array: D on the diagonal, U above it.
"""

from __future__ import annotations

import numpy as np
from numba import njit


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
            f += ud[i, j] * phi[i]
        d = ud[j, j]
        g = d * f
        before = alpha
        alpha += f * g
        ud[j, j] = d * (before / alpha)
        gain[j] = g
        if before > 0.0:
            lam = -f / before
            for i in range(j):
                u = ud[i, j]
                ud[i, j] = u + lam * gain[i]
                gain[i] += g * u
    for j in range(n):
        gain[j] /= alpha
    return alpha


@njit(cache=True, error_model="numpy")
def inflate(ud, factor):
    """P <- P * factor, by D alone."""
    for j in range(ud.shape[0]):
        ud[j, j] *= factor


def factorise(p: np.ndarray) -> np.ndarray:
    """U and D of a symmetric positive definite P, in one array."""
    # P = U D U' with U upper: the Cholesky factor of P with both axes reversed, reversed back
    lower = np.linalg.cholesky(p[::-1, ::-1])[::-1, ::-1]
    scale = np.diag(lower).copy()
    ud = np.triu(lower / scale, 1)
    ud[np.diag_indices_from(ud)] = scale**2
    return ud


def covariance(ud: np.ndarray) -> np.ndarray:
    """P = U D U' of shape (n, n), exactly symmetric."""
    u = np.triu(ud, 1) + np.eye(ud.shape[0])
    root = u * np.sqrt(np.diag(ud))
    return root @ root.T
