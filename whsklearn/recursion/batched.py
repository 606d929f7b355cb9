"""Recursive least squares for many axes at once, on all cores of one process."""

from __future__ import annotations

import itertools
import os
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING

import numpy as np

from whsklearn._inputs import real_array
from whsklearn._numba import njit
from whsklearn.recursion.covariance import WIND_UP, covariance, inflate, measurement_update

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

__all__ = ["least_squares_of_many"]


def least_squares_of_many(
    X: ArrayLike, y: ArrayLike, *, P0: float = 1e6, forgetting: float = 1.0, n_jobs: int | None = None
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
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
        Threads; as many as there are cores by default.  The result does not depend on it.

    Returns
    -------
    theta : ndarray of shape (n_axes, n_params)
    P : ndarray of shape (n_axes, n_params, n_params)
        In units of the noise variance.

    Raises
    ------
    ValueError
        If shapes do not fit, a value is not finite or a setting is out of range.

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
    if not (np.isfinite(X).all() and np.isfinite(y).all()):
        raise ValueError("X or y holds NaN or infinite values; leave such samples out.")
    if not 0 < P0 < np.inf or not 0 < forgetting <= 1:
        raise ValueError(f"P0 is {P0!r} and forgetting {forgetting!r}; expected P0 > 0 and 0 < forgetting <= 1.")
    n_axes, _, n = X.shape
    theta, ud = np.zeros((n_axes, n)), np.repeat(P0 * np.eye(n)[None], n_axes, axis=0)
    threads = min(n_jobs or os.cpu_count() or 1, n_axes)
    bounds = np.linspace(0, n_axes, threads + 1).astype(int)
    pieces = [slice(a, b) for a, b in itertools.pairwise(bounds)]  # numba releases the GIL in each
    with ThreadPoolExecutor(threads) as pool:
        list(pool.map(lambda s: _run_axes(X[s], y[s], theta[s], ud[s], float(forgetting), WIND_UP * P0), pieces))
    return theta, np.array([covariance(factors) for factors in ud])


@njit(cache=True, nogil=True)
def _run_axes(X, y, theta, ud, forgetting, ceiling):
    """One axis after another through all of its samples; theta and ud change in place."""
    n_axes, n_samples, n = X.shape
    gain = np.empty(n)
    for axis in range(n_axes):
        for t in range(n_samples):
            if forgetting != 1.0:
                inflate(ud[axis], 1.0 / forgetting, ceiling)
            e = y[axis, t]
            for k in range(n):
                e -= X[axis, t, k] * theta[axis, k]
            measurement_update(ud[axis], X[axis, t], 1.0, gain)
            for k in range(n):
                theta[axis, k] += gain[k] * e
