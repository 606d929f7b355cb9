"""The two linear blocks of a chain along a record.

L1 in one shared kernel: x from (1), its increment, and how certain its sign is; the starts, the scale of kappa, the
least-squares rows for a fixed L1 and the free run all begin with it.  L2's denominator where outputs are known.
"""

from __future__ import annotations

import math

import numpy as np

from whsklearn._numba import njit, part
from whsklearn.effects.base import Array, Bools, Integers
from whsklearn.recursion.rows.predictor import clear, push

LARGEST = 1e30  # bound of x, so that a diverging free run stays finite
KNOWN = np.zeros((0, 0))  # the covariance of a block whose parameters are exact


def increment_rms(theta: Array, dims: Integers, u: Array, restart: Bools) -> float:
    """Root mean square of dx = x(t) - x(t-1), which sets the scale of kappa."""
    return first_block(theta, dims, u, restart, KNOWN)[1]


def first_block(theta: Array, dims: Integers, u: Array, restart: Bools, spread: Array) -> tuple[Array, float]:
    """x, dx = x(t) - x(t-1), and |E sign(dx)| if (a, b) has a covariance; and the root mean square of dx.

    Of the natural parameters ``theta`` only (a, b) is used. ``restart`` (n,): where an experiment begins; its past is
    unknown. ``spread`` is (n_1, n_1), or (0, 0) if there is no covariance; then the signals are (2, n), else (3, n).
    """
    na, nb, n1 = int(dims[0]), int(dims[1]), len(spread)
    signals = np.empty((3 if n1 else 2, len(u)))
    past = np.zeros(na), np.zeros(nb + 1), np.zeros((nb + 1, n1)), np.zeros(n1)
    return signals, float(_fill(signals, theta[: na - 1], theta[na - 1 : na - 1 + nb], u, restart, spread, past))


@njit(error_model="numpy", counted=False, short=True)
def _fill(out, a, b, u, restart, spread, past):
    """Write the signals into ``out``; return the rms of dx."""
    u_past, x_past, g_past, g = past
    na, nb, n1 = a.size + 1, b.size, spread.shape[0]
    power = 0.0
    for t in range(u.shape[0]):
        if restart[t]:
            clear(u_past)
            clear(x_past)
            for j in range(nb + 1):
                for k in range(n1):
                    g_past[j, k] = 0.0
        x = u_past[0]
        for i in range(1, na):
            x += a[i - 1] * u_past[i]
        for j in range(nb):
            x -= b[j] * x_past[j]
        x = min(max(x, -LARGEST), LARGEST)
        dx = x - x_past[0]
        out[0, t] = x
        out[1, t] = dx
        power += dx * dx
        if n1 > 0:
            variance = _advance_gradient(g_past, g, na, b, u_past, x_past, spread)
            out[2, t] = math.erf(abs(dx) / math.sqrt(2.0 * variance + 1e-300))
        for j in range(nb, 0, -1):
            x_past[j] = x_past[j - 1]
        x_past[0] = x
        push(u_past, u[t])
    return math.sqrt(power / max(u.shape[0], 1))


@part
def _advance_gradient(past, g, na, b, u_past, x_past, spread):
    """Advance the sensitivities of x to (a, b) by one sample; return the variance of dx."""
    n1 = g.size
    variance = 0.0
    for k in range(n1):
        new = u_past[k + 1] if k < na - 1 else -x_past[k - (na - 1)]
        for j in range(b.size):
            new -= b[j] * past[j, k]
        g[k] = min(max(new, -1e60), 1e60)
    for i in range(n1):
        for j in range(n1):
            variance += spread[i, j] * (g[i] - past[0, i]) * (g[j] - past[0, j])
    for k in range(n1):
        for j in range(b.size, 0, -1):
            past[j, k] = past[j - 1, k]
        past[0, k] = g[k]
    return variance


@njit(cache=True, error_model="numpy")
def ahead(v, d, y, restart, horizon):
    """y(t) = v(t) - sum d_n y(t-n) from the outputs up to t - horizon, which are known."""
    out = np.zeros(v.size)
    run = np.zeros(v.size)
    begin = 0
    for t in range(v.size):
        if restart[t]:
            begin = t
        first = max(begin, t - horizon + 1)
        for i in range(first, t + 1):
            s = v[i]
            for k in range(d.size):
                j = i - 1 - k
                if j >= begin:
                    s -= d[k] * (run[j] if j >= first else y[j])
            run[i] = s
        out[t] = run[t]
    return out
