"""Recursive least squares for many axes at once, on all cores of one process."""

from __future__ import annotations

import itertools
import os
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from whsklearn._inputs import real_array
from whsklearn._numba import njit, part
from whsklearn.effects.base import Array
from whsklearn.recursion.rows.covariance import WIND_UP

ABREAST = 48  # axes processed together; their factors just fit into the fastest cache
TOGETHER = 4  # samples that are rearranged at a time


def least_squares_of_many(
    X: ArrayLike, y: ArrayLike, *, P0: float = 1e6, forgetting: float = 1.0, n_jobs: int | None = None
) -> tuple[Array, Array]:
    """Estimates and covariances of many independent recursions, (7) to (9) with p = 1.

    Parameters
    ----------
    X : array-like of shape (n_axes, n, n_params)
        Regressors of each axis.
    y : array-like of shape (n_axes, n)
        Outputs.
    P0 : float, default=1e6
        Initial covariance scale p_0.
    forgetting : float, default=1
        Forgetting factor lambda.
    n_jobs : int, optional
        Number of threads; by default one for each core.  The result does not depend on it.

    Returns
    -------
    theta : ndarray of shape (n_axes, n_params)
    P : ndarray of shape (n_axes, n_params, n_params)
        In units of the noise variance.

    Raises
    ------
    ValueError
        If the shapes do not match, a value is not finite or a setting is out of range.

    Examples
    --------
    >>> import numpy as np
    >>> from whsklearn.recursion import least_squares_of_many
    >>> X = np.random.default_rng(0).normal(size=(5, 100, 2))
    >>> theta, P = least_squares_of_many(X, X @ [1.0, -2.0])
    >>> theta.round(3)[0], P.shape
    (array([ 1., -2.]), (5, 2, 2))
    """
    X, y = np.ascontiguousarray(real_array(X, "X")), np.ascontiguousarray(real_array(y, "y"))
    if X.ndim != 3 or y.shape != X.shape[:2] or 0 in X.shape:
        raise ValueError(f"X has shape {X.shape} and y {y.shape}; expected (n_axes, n, n_params) and (n_axes, n).")
    if not 0 < P0 < np.inf or not 0 < forgetting <= 1:
        raise ValueError(f"P0 is {P0!r} and forgetting {forgetting!r}; expected P0 > 0 and 0 < forgetting <= 1.")
    n_axes, _, n = X.shape
    theta, P = np.empty((n_axes, n)), np.empty((n_axes, n, n))
    bunches = -(-n_axes // ABREAST)
    threads = min(n_jobs or os.cpu_count() or 1, bunches)
    bounds = np.minimum(ABREAST * np.linspace(0, bunches, threads + 1).astype(int), n_axes)
    pieces = [slice(a, b) for a, b in itertools.pairwise(bounds)]  # numba releases the GIL in each
    with ThreadPoolExecutor(threads) as pool:
        list(pool.map(lambda s: _run_axes(X[s], y[s], theta[s], P[s], float(P0), float(forgetting)), pieces))
    # a NaN in any sample makes the estimate NaN, so the samples need not be checked beforehand
    if not np.isfinite(theta).all() and not (np.isfinite(X).all() and np.isfinite(y).all()):
        raise ValueError("X or y holds NaN or infinite values; remove such samples.")
    return theta, P


class Abreast(NamedTuple):
    """Axes that are processed together.  The axis is the last index, so that inner loops run over axes."""

    theta: Array  # theta, gain (n, L): estimates and scratch space
    x: Array  # x, e (TOGETHER, n, L), (TOGETHER, L): rows of regressors and targets, which become innovations
    gain: Array
    ud: Array  # (n (n + 1) / 2, L): the rows of `covariance` up to the diagonal, one after the other
    e: Array
    f: Array  # f, g, alpha, shift (L,): scratch
    g: Array
    alpha: Array
    shift: Array


@njit(cache=True, nogil=True, error_model="numpy")
def _run_axes(X, y, theta, P, p0, forgetting):
    """Process the axes in groups, each group through all of its samples; theta and P receive the result."""
    n_axes, n_samples, n = X.shape
    for first in range(0, n_axes, ABREAST):
        lanes = min(ABREAST, n_axes - first)
        size = n, lanes
        a = Abreast(
            np.zeros(size), np.empty((TOGETHER, n, lanes)), np.empty(size), np.zeros((n * (n + 1) // 2, lanes)),
            np.empty((TOGETHER, lanes)), np.empty(lanes), np.empty(lanes), np.empty(lanes), np.empty(lanes),
        )  # fmt: skip
        for j in range(n):
            a.ud[j * (j + 3) // 2] = p0
        for begin in range(0, n_samples, TOGETHER):
            count = min(TOGETHER, n_samples - begin)
            for i in range(lanes):
                rows, targets = X[first + i, begin : begin + count], y[first + i, begin : begin + count]
                for t in range(count):
                    a.e[t, i] = targets[t]
                    for k in range(n):
                        a.x[t, k, i] = rows[t, k]
            for t in range(count):
                if forgetting != 1.0:
                    _inflate(a.ud, n, 1.0 / forgetting, WIND_UP * p0)
                _update(a.theta, a.x[t], a.gain, a.ud, a.e[t], a.f, a.g, a.alpha, a.shift)
        for i in range(lanes):
            for k in range(n):
                theta[first + i, k] = a.theta[k, i]
            _covariance(a.ud, i, P[first + i])


@part
def _inflate(ud, n, factor, ceiling):
    """`covariance.inflate` for several axes at once."""
    for j in range(n):
        row = ud[j * (j + 3) // 2]
        for i in range(row.size):
            row[i] = min(row[i] * factor, ceiling) if row[i] < ceiling else row[i]


@part
def _update(theta, x, gain, ud, e, f, g, alpha, shift):
    """Update every axis by one row: `covariance.measurement_update`, and theta += gain e.

    These are the same operations in the same order, so the numbers are the same.  The fields of `Abreast` are passed
    one by one: if they were read from the tuple in here, the compiler could not see that they do not move.
    """
    n, lanes = theta.shape
    for k in range(n):
        for i in range(lanes):
            e[i] -= x[k, i] * theta[k, i]
    for i in range(lanes):
        alpha[i] = 1.0
    row = 0
    for j in range(n):
        for i in range(lanes):
            f[i] = x[j, i]
        for k in range(0, j - 1, 2):  # two at a time, because starting a short inner loop costs as much as running it
            for i in range(lanes):
                f[i] = f[i] + ud[row + k, i] * x[k, i] + ud[row + k + 1, i] * x[k + 1, i]
        if j % 2:
            for i in range(lanes):
                f[i] += ud[row + j - 1, i] * x[j - 1, i]
        for i in range(lanes):
            d = ud[row + j, i]
            now = d * f[i]
            before = alpha[i]
            after = before + f[i] * now
            alpha[i] = after
            ud[row + j, i] = d * (before / after)
            gain[j, i] = now
            g[i] = now
            shift[i] = -f[i] / before
        for k in range(j):
            for i in range(lanes):
                u = ud[row + k, i]
                old = gain[k, i]
                ud[row + k, i] = u + shift[i] * old
                gain[k, i] = old + g[i] * u
        row += j + 1
    for k in range(n):
        for i in range(lanes):
            theta[k, i] += gain[k, i] / alpha[i] * e[i]


@part
def _covariance(ud, axis, p):
    """P = U D U' of one axis, exactly symmetric."""
    n = p.shape[0]
    for i in range(n):
        for j in range(i + 1):
            total = 0.0
            for k in range(i, n):  # column k of U is stored in row k; its diagonal is one
                row = k * (k + 1) // 2
                a = ud[row + i, axis] if k > i else 1.0
                b = ud[row + j, axis] if k > j else 1.0
                total += a * ud[row + k, axis] * b
            p[i, j] = p[j, i] = total
