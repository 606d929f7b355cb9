"""The published method: the regressors of an auxiliary model, with (7) to (14) applied to them to the letter.

The regressors (6) and the order of theta are in `whsklearn.recursion.rows.auxiliary_model`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from whsklearn._numba import njit
from whsklearn.recursion.rows.auxiliary_model import auxiliary_size, rebuild, row
from whsklearn.recursion.rows.covariance import inflate, measurement_update
from whsklearn.recursion.rows.predictor import push

Array = NDArray[np.float64]

__all__ = ["BLOCK", "GRADIENT", "REEVALUATED", "Published", "auxiliary_size", "rebuild", "row", "run_pseudolinear"]

BLOCK, REEVALUATED, GRADIENT = 0, 1, 2


class Published(NamedTuple):
    """theta of (6), factorised P, the auxiliary state before the window, [loss, count], and r of the gradient."""

    theta: Array
    ud: Array
    before: Array
    loss: Array
    power: Array


@njit(error_model="numpy", short=True)
def run_pseudolinear(model, recent, since, forgetting, ceiling, law, p, mode, samples):
    """Run theta, P and the auxiliary model through samples; all state arrays change in place.

    ``mode`` is BLOCK for (7)-(9), REEVALUATED for (10)-(14) with each row rebuilt from the newest
    theta, and GRADIENT for the stochastic gradient.  Every window starts from ``before``, the
    auxiliary state before its first sample.  The weights are those of the paper, 1 per innovation,
    times the user's.  ``law`` is (dims, codes, shapes, key).  ``recent`` and ``samples`` are
    `Samples`, the former newest first.
    """
    theta, ud, before, loss, power = model
    recent_u, recent_y, recent_weight = recent
    u, y, weights = samples
    dims, codes, shapes, key = law
    n = theta.size
    m = u.shape[1]
    work = np.empty(before.size)
    phi = np.empty(n)
    gain = np.empty(n)
    start = np.empty(n)
    step = np.empty(n)
    for t in range(y.size):
        push(recent_u, u[t])
        for k in range(recent_y.size - 1, 0, -1):
            recent_y[k] = recent_y[k - 1]
            recent_weight[k] = recent_weight[k - 1]
        recent_y[0] = y[t]
        recent_weight[0] = weights[t]
        since += 1
        window = min(p, since)
        if forgetting != 1.0:
            inflate(ud, 1.0 / forgetting, ceiling)
        start[:] = theta
        step[:] = 0.0
        newest = 0.0
        span = 0.0
        for i in range(window):
            if i == 0 or mode == REEVALUATED:
                work[:] = before
                for k in range(window - 1, window - 1 - i, -1):
                    rebuild(theta, dims, codes, shapes, key, work, recent_u, (k + 1) * m)
            else:
                rebuild(start, dims, codes, shapes, key, work, recent_u, (window - i + 1) * m)
            now = window - 1 - i
            weight = recent_weight[now]
            if weight == 0.0:
                continue
            row(dims, codes, shapes, key, work, recent_u, (now + 2) * m, recent_y, now + 1, phi)
            e = recent_y[now]
            for k in range(n):
                e -= phi[k] * theta[k]
            if mode == GRADIENT:
                newest = 0.0
                for k in range(n):
                    step[k] += weight * phi[k] * e
                    newest += weight * phi[k] * phi[k]
                span += newest
            else:
                measurement_update(ud, phi, 1.0 / weight, gain)
                for k in range(n):
                    theta[k] += gain[k] * e
            if now == 0:
                loss[0] = forgetting * loss[0] + weight * e * e
                loss[1] = forgetting * loss[1] + 1.0
        if mode == GRADIENT:
            power[0] = forgetting * power[0] + newest
            size = max(power[0], span)  # as in `run_gradient`
            if size > 0.0:
                for k in range(n):
                    theta[k] += step[k] / size
        if since >= p:
            rebuild(theta, dims, codes, shapes, key, before, recent_u, p * m)
    return since
