"""Recursive least squares on given rows: RLS, block MILS (7)-(9), sub-innovations (10)-(14).

With given rows the block update and the p scalar updates give the same numbers (block
inversion lemma), so both are computed by scalar updates.  `block_update` is (7)-(9) to the
letter, for readers who want to check this.
"""

from __future__ import annotations

import functools

import numpy as np
from numba.extending import register_jitable  # type: ignore[import-untyped]

from whsklearn._inputs import LARGEST
from whsklearn._numba import njit, part
from whsklearn.recursion.rows.covariance import inflate, measurement_update


@part
def _silent(recent, targets):
    """Return whether all rows and targets of the window are zero."""
    for i in range(targets.size):
        if targets[i] != 0.0:
            return False
        for k in range(recent.shape[1]):
            if recent[i, k] != 0.0:
                return False
    return True


@njit(cache=True, error_model="numpy")
def run_rows(theta, ud, loss, recent, targets, since, forgetting, ceiling, p, variance, rows, y):
    """Update theta and P by each row and the p - 1 before it; all state arrays change in place.

    ``theta``, ``ud`` (n,), (n, n): parameters and factorised covariance.
    ``loss`` (2,): weighted sum of squared innovations, and sum of the weights.
    ``recent``, ``targets`` (p, n), (p,): the latest rows and targets, at index t mod p.
    ``since``: number of rows since the experiment began.
    ``ceiling``: limit up to which forgetting inflates P.
    ``variance``: noise variance of one update: p if a row is to count once in all, 1 for the published equations.
    ``rows``, ``y`` (m, n), (m,): new rows and targets, in time order.
    Returns ``since`` after the last row.
    """
    gain = np.empty(theta.size)
    phi = np.empty(theta.size)
    for t in range(y.size):
        at = since % p
        for k in range(theta.size):
            recent[at, k] = rows[t, k]
        targets[at] = y[t]
        since += 1
        _learn_window(theta, ud, loss, recent, targets, since, forgetting, ceiling, p, variance, gain, phi)
    return since


@part
def _learn_window(theta, ud, loss, recent, targets, since, forgetting, ceiling, p, variance, gain, phi):
    """The updates of one row, the ``since``-th; ``gain`` and ``phi`` are scratch."""
    n = theta.size
    if targets[(since - 1) % p] == 0.0 and _silent(recent, targets):
        return  # an idle axis holds no information: it must neither lower the noise variance nor cause forgetting
    if forgetting != 1.0:
        inflate(ud, 1.0 / forgetting, ceiling)
        loss[0] *= forgetting
        loss[1] *= forgetting
    window = min(p, since)
    for i in range(window):
        at = (since - window + i) % p
        e = targets[at]
        for k in range(n):
            phi[k] = recent[at, k]
            e -= phi[k] * theta[k]
        # sum of e^2 / alpha is the residual sum of squares of the final estimate (Ljung 1999, ch. 11)
        loss[0] += e * e / measurement_update(ud, phi, variance, gain)
        loss[1] += 1.0 / variance
        for k in range(n):
            theta[k] += gain[k] * e


# Numbers of one_row, stored in front of theta, U and D, loss, rows and targets.  SINCE is the last row that was learnt;
# it is stored here because an interrupt can lose a function's return value.  BUSY is not 0 while another thread holds
# the state.
SINCE, BUSY, FORGETTING, CEILING, WINDOW, VARIANCE, N_SETTINGS = range(7)


@register_jitable
def pack_size(n, p):
    """Length of the one array of `one_row`."""
    return N_SETTINGS + n + n * n + 2 + p * n + p + 2 * n


@register_jitable
def unpacked(flat, n, p):
    """(theta, ud, loss, recent, targets) of `run_rows` and scratch (gain, phi), as views of the one array."""
    theta = N_SETTINGS + n
    ud = theta + n * n
    recent = ud + 2 + p * n
    targets = recent + p
    return (
        flat[N_SETTINGS:theta],
        flat[theta:ud].reshape((n, n)),
        flat[ud : ud + 2],
        flat[ud + 2 : recent].reshape((p, n)),
        flat[recent:targets],
        flat[targets : targets + n],
        flat[targets + n : targets + 2 * n],
    )


@functools.cache
def one_row():
    """`run_rows` for one row, with everything it needs in one array; compiled at the first request.

    It is called as ``(flat, since, rows, y)``.  Passing an argument costs a twentieth of a microsecond, so there are
    few.  Its signature is explicit, so it accepts only writable float64 arrays in C order and raises TypeError for
    others; the caller need not check their flags.

    It returns ``since``.  It returns -1 and changes nothing if a shape is wrong, if a number is not finite or absurdly
    large, or if another thread holds the state (BUSY is set, or that thread has learnt a row that has not been reported
    yet).  The interpreter lock is held throughout, so threads need no other lock, which would cost as much as the row.
    """
    # It makes no array and returns none, so references to its arguments need not be counted.  Numba allocates a counter
    # for each array otherwise, which was a sixth of a call (0.49 us with it, 0.41 without).
    kernel = njit(
        "int64(float64[::1], int64, float64[:, ::1], float64[::1])", error_model="numpy", short=True, counted=False
    )
    return kernel(_one_row)


def _one_row(flat, since, rows, y):
    n, p = rows.shape[1], int(flat[WINDOW])
    if rows.shape[0] != 1 or y.size != 1 or flat.size != pack_size(n, p):
        return -1
    if flat[BUSY] != 0.0 or (flat[SINCE] >= 0.0 and flat[SINCE] != since):
        return -1
    if not abs(y[0]) <= LARGEST:
        return -1
    for k in range(n):
        if not abs(rows[0, k]) <= LARGEST:
            return -1
    theta, ud, loss, recent, targets, gain, phi = unpacked(flat, n, p)
    at = since % p
    for k in range(n):
        recent[at, k] = rows[0, k]
    targets[at] = y[0]
    since += 1
    _learn_window(
        theta, ud, loss, recent, targets, since, flat[FORGETTING], flat[CEILING], p, flat[VARIANCE], gain, phi
    )
    flat[SINCE] = since
    return since


@njit(cache=True, error_model="numpy")
def run_gradient(theta, loss, recent, targets, since, power, forgetting, p, rows, y):
    """Multi-innovation stochastic gradient: theta += Phi E / r, r(t) = lambda r(t-1) + |phi(t)|^2.

    Ding and Chen 2007, Automatica 43(1), 1-14.  ``power`` is an array of one number, which
    holds r.
    """
    n = theta.size
    step = np.empty(n)
    for t in range(y.size):
        at = since % p
        square = 0.0
        for k in range(n):
            recent[at, k] = rows[t, k]
            square += rows[t, k] * rows[t, k]
        targets[at] = y[t]
        since += 1
        power[0] = forgetting * power[0] + square
        step[:] = 0.0
        span = 0.0
        window = min(p, since)
        for i in range(window):
            at = (since - window + i) % p
            e = targets[at]
            for k in range(n):
                e -= recent[at, k] * theta[k]
            for k in range(n):
                step[k] += recent[at, k] * e
                span += recent[at, k] * recent[at, k]
            if i == window - 1:
                loss[0] = forgetting * loss[0] + e * e
                loss[1] = forgetting * loss[1] + 1.0
        # with forgetting, r may fall below |Phi(p, t)|^2, and the step would then overshoot and diverge
        size = max(power[0], span)
        if size > 0.0:
            for k in range(n):
                theta[k] += step[k] / size
    return since


def block_update(theta, p_matrix, phi, y, variance=1.0):
    """(7)-(9) to the letter: theta(t) and P(t) from theta(t-1), P(t-1), phi(p, t) and Y(p, t).

    ``theta``, ``p_matrix`` (n,), (n, n): theta(t-1) and P(t-1). ``phi`` (n, p): the p regressors as columns. ``y``
    (p,): Y(p, t). ``variance``: replaces the entries of I_p in (8).
    """
    s = variance * np.eye(y.size) + phi.T @ p_matrix @ phi
    gain = np.linalg.solve(s, phi.T @ p_matrix).T
    return theta + gain @ (y - phi.T @ theta), p_matrix - gain @ phi.T @ p_matrix
