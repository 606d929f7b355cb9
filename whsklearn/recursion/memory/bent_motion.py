"""The second derivatives of dx with respect to (a, b), from the gradients that have already been computed.

With x = A/B u, each gradient G_k = d dx / d theta_k is a signal filtered by 1/B, and therefore

    d^2 dx / d theta_k d b_j = -F_k(t - j) - [theta_k is a b_i] F_j(t - i),        B(q) F_k = G_k,

and all other second derivatives are zero, because dx is linear in a.  They are needed because a sign that is
passed on from page to page is evaluated at parameters estimated later than its own page.  On 20,000 samples of
Example 5.1 the estimate after the first page is 0.005 from the truth.  There the error of dx from the gradient
alone is up to 8e-5, while the posterior determines dx to 1e-4.  The sign of one of 512 samples came out wrong,
which cost 15 units of log density at the truth.
"""

from __future__ import annotations

from collections.abc import Generator

import numpy as np
from numpy.typing import NDArray

from whsklearn._numba import njit

Array = NDArray[np.float64]

PIECE = 512  # samples that are filtered between two rows


@njit(error_model="numpy", short=True)
def filter_gradients(gradient, restart, b, begin, stop, out):
    """Compute F of the samples from ``begin`` to ``stop``, from rest at the start of an experiment.

    F of the earlier samples must be in ``out`` already.
    """
    since = 0
    for t in range(begin - 1, max(begin - 1 - b.size, -1), -1):
        since += 1
        if restart[t]:
            break
    for t in range(begin, stop):
        if restart[t]:
            since = 0
        for k in range(gradient.shape[1]):
            value = gradient[t, k]
            for j in range(min(b.size, since)):
                value -= b[j] * out[t - 1 - j, k]
            out[t, k] = value
        since += 1


def curvature_steps(
    gradient: Array, restart: NDArray[np.bool_], experiment: NDArray[np.int64], b: Array, chosen: NDArray[np.intp]
) -> Generator[None, None, Array]:
    """Second derivatives of dx with respect to (a, b) at some samples, in parts.

    F before the first sample is unknown and taken as zero, so in a page that does not begin at rest the curvature at
    the first samples is too small.

    Parameters
    ----------
    gradient : ndarray of shape (n, n_1)
        d dx / d(a, b) of all samples.
    restart : ndarray of shape (n,)
        Where an experiment begins.
    experiment : ndarray of shape (n,)
        The experiment to which each sample belongs.
    b : ndarray
        Denominator of L1 without its leading one; the last part of (a, b).
    chosen : ndarray of int, shape (E,)
        Indices of the samples.

    Returns
    -------
    ndarray of shape (E, n_1, n_1)
    """
    n1 = gradient.shape[1]
    bent = np.zeros((chosen.size, n1, n1))
    yield
    filtered = np.empty_like(gradient)
    yield
    for begin in range(0, len(gradient), PIECE):
        filter_gradients(gradient, restart, b, begin, min(begin + PIECE, len(gradient)), filtered)
        yield
    for j in range(b.size):
        before = chosen - 1 - j
        there = before >= 0
        there &= experiment[before] == experiment[chosen]
        term = filtered[before] * there[:, None]
        bent[:, :, n1 - b.size + j] -= term
        bent[:, n1 - b.size + j, :] -= term
        yield
    return bent
