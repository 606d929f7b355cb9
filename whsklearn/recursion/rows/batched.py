"""Recursive least squares for many axes at once, on all cores of one process."""

from __future__ import annotations

import itertools
import os
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import ArrayLike

from whsklearn._inputs import check_whole, real_array
from whsklearn._numba import njit, part
from whsklearn.effects.base import Array
from whsklearn.recursion.rows.covariance import WIND_UP
from whsklearn.recursion.rows.lanes import LANES, gather, put, take


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
    if n_jobs is not None:
        check_whole("n_jobs", n_jobs, 1)
    n_axes, _, n = X.shape
    theta, P = np.empty((n_axes, n)), np.empty((n_axes, n, n))
    bunches = -(-n_axes // LANES)
    threads = min(n_jobs or os.cpu_count() or 1, bunches)
    bounds = np.minimum(LANES * np.linspace(0, bunches, threads + 1).astype(int), n_axes).tolist()
    missing = max(LANES - n_axes, 0)
    rows, targets = (np.concatenate([z, np.zeros((missing, *z.shape[1:]))]) if missing else z for z in (X, y))

    def run(piece: tuple[int, int]) -> None:  # numba releases the GIL in it
        _run_axes(rows, targets, *piece, theta, P, float(P0), float(forgetting))

    with ThreadPoolExecutor(threads) as pool:
        list(pool.map(run, itertools.pairwise(bounds)))
    # a NaN in any sample makes the estimate NaN, so the samples need not be checked beforehand
    if not np.isfinite(theta).all() and not (np.isfinite(X).all() and np.isfinite(y).all()):
        raise ValueError("X or y holds NaN or infinite values; remove such samples.")
    return theta, P


@njit(cache=True, nogil=True, error_model="numpy")
def _run_axes(X, y, begin, end, theta, P, p0, forgetting):
    """Process axes ``begin`` to ``end`` in groups, each through all of its samples; theta and P receive the result.

    X and y are contiguous and have at least LANES axes: a last group that is smaller starts earlier.
    """
    n_axes, n_samples, n = X.shape
    rows, targets, one = X.reshape(X.size), y.reshape(y.size), np.ones(1)
    estimate, gain, x = np.empty(n * LANES), np.empty(n * LANES), np.empty(n * LANES)
    ud = np.empty((n * (n + 1) // 2, LANES))  # the rows of `covariance` up to the diagonal, one after the other
    flat = ud.reshape(ud.size)
    for first in range(begin, end, LANES):
        group = min(first, n_axes - LANES)
        estimate[:] = 0.0
        ud[:] = 0.0
        for j in range(n):
            ud[j * (j + 3) // 2] = p0
        for t in range(n_samples):
            if forgetting != 1.0:
                _inflate(ud, n, 1.0 / forgetting, WIND_UP * p0)
            at = group * n_samples + t
            alpha, e = gather(one, 0, 0), gather(targets, at, n_samples)
            for k in range(n):
                now = gather(rows, at * n + k, n_samples * n)
                put(x, k, now)
                e = e - now * take(estimate, k)
            alpha = _update(flat, x, gain, alpha, n)
            for k in range(n):
                put(estimate, k, take(estimate, k) + take(gain, k) / alpha * e)
        for axis in range(first, min(first + LANES, end)):
            lane = axis - group
            for k in range(n):
                theta[axis, k] = estimate[k * LANES + lane]
            _covariance(ud, lane, P[axis])


@part
def _inflate(ud, n, factor, ceiling):
    """`covariance.inflate` for several axes at once."""
    for j in range(n):
        row = ud[j * (j + 3) // 2]
        for i in range(row.size):
            row[i] = min(row[i] * factor, ceiling) if row[i] < ceiling else row[i]


@part
def _update(ud, x, gain, alpha, n):
    """`covariance.measurement_update` of every axis by its row ``x`` with noise variance ``alpha``; returns the last.

    The operations and their order are the same, so the numbers are the same, but the division of the gain by the
    variance that is returned is left to the caller.
    """
    row = 0
    for j in range(n):
        f = take(x, j)
        for k in range(0, j - 1, 2):  # two at a time: a turn of a loop costs as much as what is in it
            f = f + take(ud, row + k) * take(x, k) + take(ud, row + k + 1) * take(x, k + 1)
        if j % 2:
            f = f + take(ud, row + j - 1) * take(x, j - 1)
        d = take(ud, row + j)
        g = d * f
        before = alpha
        alpha = before + f * g
        put(ud, row + j, d * (before / alpha))
        put(gain, j, g)
        shift = -f / before
        for k in range(j):
            u, s = take(ud, row + k), take(gain, k)
            put(ud, row + k, u + shift * s)
            put(gain, k, s + g * u)
        row += j + 1
    return alpha


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
