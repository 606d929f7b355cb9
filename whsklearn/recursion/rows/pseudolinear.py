"""The published method: the regressors of an auxiliary model, with (7) to (14) applied to them to the letter."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from whsklearn._numba import njit, part
from whsklearn.effects.base import Array
from whsklearn.effects.codes import VISCOUS
from whsklearn.effects.rows import term
from whsklearn.recursion.rows.covariance import inflate, measurement_update
from whsklearn.recursion.rows.predictor import push

# --- the auxiliary model: the regressors (6) from estimates of x and v, which are rebuilt from theta ----------------
# theta holds products, in the paper's order:
#
#     [g a_1 .. g a_na, g b_1 + g, g b_2 .. g b_nb, other weights, c_2 .. c_nc, d_1 .. d_nd]
#
# where g is the weight of the key term, gamma_6 (x - x(t-1)).  If the key term is linear in x
# itself, the entry of b_1 is g b_1.
#
# The auxiliary state is x_hat(t-1) .. x_hat(t-nx), nx = max(n_b, 1) + 1, then
# v_hat(t-1) .. v_hat(t-nc).
SMALLEST_KEY = 1e-9
LARGEST_SIGNAL = 1e6


def auxiliary_size(dims):
    """Length of the auxiliary state."""
    return max(dims[1], 1) + 1 + dims[2]


@part
def row(dims, codes, shapes, key, state, u_past, first_u, y_past, first_y, phi):
    """phi(t) of (6), from the auxiliary state, u(t-2), ... at ``first_u`` and y(t-1), ... at ``first_y``."""
    na, nb, nc, nd, nw = dims[0], dims[1], dims[2], dims[3], dims[4]
    nx = max(nb, 1) + 1
    for i in range(na):
        phi[i] = u_past[first_u + i]
    for j in range(nb):
        phi[na + j] = -state[1 + j]
    differs = codes[key] == VISCOUS
    if differs and nb == 0:
        phi[0] -= state[1]  # no b_1 to share the term -g x(t-2) with
    j = na + nb
    for k in range(nw):
        if k != key:
            phi[j] = term(codes[k], shapes[k, 0], shapes[k, 1], shapes[k, 2], state[0], state[0] - state[1], math.inf)[
                0
            ]
            j += 1
    for m in range(1, nc):
        phi[j] = state[nx + m]
        j += 1
    for i in range(nd):
        phi[j + i] = -y_past[first_y + i]


@part
def rebuild(theta, dims, codes, shapes, key, state, u_past, first):
    """Advance the auxiliary state by one sample: x_hat(t) and v_hat(t), with the products in theta undone."""
    na, nb, nc, nw = dims[0], dims[1], dims[2], dims[4]
    nx = max(nb, 1) + 1
    g = theta[0]
    if abs(g) < SMALLEST_KEY:
        g = SMALLEST_KEY if g >= 0.0 else -SMALLEST_KEY
    x = u_past[first]
    for i in range(1, na):
        x += theta[i] / g * u_past[first + i]
    differs = codes[key] == VISCOUS
    for j in range(nb):
        b = theta[na + j] / g
        if j == 0 and differs:
            b -= 1.0
        x -= b * state[j]
    # interim estimates may be unstable; the saturation only keeps them finite
    x = min(max(x, -LARGEST_SIGNAL), LARGEST_SIGNAL)
    dx = x - state[0]
    v = 0.0
    j = na + nb
    for k in range(nw):
        f = term(codes[k], shapes[k, 0], shapes[k, 1], shapes[k, 2], x, dx, math.inf)[0]
        if k == key:
            v += g * f
        else:
            v += theta[j] * f
            j += 1
    for k in range(nx - 1, 0, -1):
        state[k] = state[k - 1]
    state[0] = x
    for k in range(nx + nc - 1, nx, -1):
        state[k] = state[k - 1]
    state[nx] = v


@njit(cache=True, error_model="numpy")
def rows_along(theta, dims, codes, shapes, key, state, past_u, past_y, u, y, restart):
    """Rows of (6), with the auxiliary model run at a fixed theta."""
    out = np.empty((y.size, theta.size))
    for t in range(y.size):
        if restart[t]:
            state[:] = 0.0
            past_u[:] = 0.0
            past_y[:] = 0.0
        row(dims, codes, shapes, key, state, past_u, u.shape[1], past_y, 0, out[t])
        rebuild(theta, dims, codes, shapes, key, state, past_u, 0)
        push(past_u, u[t])
        push(past_y, y[t : t + 1])
    return out


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

    The three modes share one loop over a window, so that they differ in the update alone.
    """
    theta, ud, before, loss, power = model
    recent_u, recent_y, recent_weight = recent
    u, y, weights = samples
    dims, codes, shapes, key = law
    n, m = theta.size, u.shape[1]
    work, phi, gain, start, step = np.empty(before.size), np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    for t in range(y.size):
        push(recent_u, u[t])
        push(recent_y, y[t : t + 1])
        push(recent_weight, weights[t : t + 1])
        since += 1
        window = min(p, since)
        if forgetting != 1.0:
            inflate(ud, 1.0 / forgetting, ceiling)
        start[:] = theta
        step[:] = 0.0
        newest = span = 0.0
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
