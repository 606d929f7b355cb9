"""The covariance in factorised form, P = U D U', and its rank-one measurement update.

U is unit upper triangular and D diagonal and positive, so P stays symmetric and positive
definite by construction (Bierman 1977, Factorization Methods for Discrete Sequential
Estimation, ch. V).  Both live in one square array: D on the diagonal, the columns of U as
rows below it, so that the inner loops access memory contiguously.
"""

from __future__ import annotations

import numpy as np

from whsklearn._numba import njit, part
from whsklearn.effects.base import Array

WIND_UP = 1e3  # forgetting may raise P to at most this many times P(0)
FARTHEST = 5.0  # standard deviations: a normal number is farther off once in two million
LEAST_PIVOT = 1e-13  # of an information matrix with a diagonal of one: a few hundred rounding errors


@part
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
            u, s = ud[j, i], gain[i]
            ud[j, i] = u + shift * s
            gain[i] = s + g * u
    for j in range(n):
        gain[j] /= alpha
    return alpha


@part
def inflate(ud, factor, ceiling):
    """P <- P * factor, by scaling D only, as far as ``ceiling`` allows.

    Without a ceiling, forgetting winds P up in directions that are not excited until it overflows.
    """
    for j in range(ud.shape[0]):
        if ud[j, j] < ceiling:
            ud[j, j] = min(ud[j, j] * factor, ceiling)


def factors_of_inverse(information: Array) -> Array:
    """U and D of P = information^-1, for a symmetric positive semidefinite matrix of any scaling.

    information = L L' gives P = L^-T L^-1, whose first factor is upper triangular: it is U sqrt(D).  The pivots of the
    matrix, scaled to a diagonal of one, are at least LEAST_PIVOT.  A parameter that has no effect on the record
    is therefore uncertain, but its variance is finite.
    """
    n = len(information)
    inverse = np.zeros((n, n))
    _invert(information, inverse, np.zeros((n, n)), np.empty(n))
    return inverse


@njit(error_model="numpy", counted=False, short=True)
def _invert(information, inverse, low, scale):
    n = information.shape[0]
    for j in range(n):
        scale[j] = 1.0 / np.sqrt(max(information[j, j], 1e-200))
    for j in range(n):
        for i in range(j + 1):
            s = information[j, i] * scale[j] * scale[i]
            for k in range(i):
                s -= low[j, k] * low[i, k]
            low[j, i] = s / low[i, i] if i < j else np.sqrt(max(s, LEAST_PIVOT))
        for i in range(j + 1):
            s = 1.0 if i == j else 0.0
            for k in range(i, j):
                s -= low[j, k] * inverse[k, i]
            inverse[j, i] = s / low[j, j]
    for j in range(n):
        d = inverse[j, j] * scale[j]
        for i in range(j):
            inverse[j, i] *= scale[i] / d
        inverse[j, j] = d * d


def conditioned(theta: Array, p: Array, at: int, mean: float, deviation: float) -> tuple[Array, Array]:
    """Estimate (n,) and covariance (n, n) once entry ``at`` is also known to be mean +- deviation: (10) to (12).

    The entry does not go farther than `FARTHEST` deviations from the mean, whatever the rows say: noise in a column can
    be mistaken for another column, and standard errors do not know it. A covariance that is not known changes nothing.

    >>> conditioned(np.array([1.0, 4.0]), np.eye(2), 1, 0.0, 1.0)[0].tolist()
    [1.0, 2.0]
    """
    if not np.isfinite(p).all():
        return theta, p
    gain = p[:, at] / (p[at, at] + deviation**2)
    wanted = theta[at] + gain[at] * (mean - theta[at])
    nearest = min(max(wanted, mean - FARTHEST * deviation), mean + FARTHEST * deviation)
    return theta + p[:, at] / p[at, at] * (nearest - theta[at]), p - np.outer(gain, p[at])


def times(ud: Array, v: Array) -> Array:
    """P v."""
    out = np.zeros(v.size)
    _times(out, ud, v)
    return out


@njit(error_model="numpy", counted=False, short=True)
def _times(out, ud, v):
    for j in range(v.size):
        s = v[j]
        for i in range(j):
            s += ud[j, i] * v[i]
        s *= ud[j, j]
        out[j] += s
        for i in range(j):
            out[i] += ud[j, i] * s


def covariance(ud: Array) -> Array:
    """P = U D U' of shape (n, n), exactly symmetric."""
    root = (np.tril(ud, -1).T + np.eye(ud.shape[0])) * np.sqrt(np.diag(ud))
    p = root @ root.T
    return (p + p.T) / 2.0
