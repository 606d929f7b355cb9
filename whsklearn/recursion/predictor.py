"""The one-step predictor of a Wiener-Hammerstein system and its exact gradient.

y_hat(t) = sum c_m v(t-m) - sum d_n y(t-n), with x and v simulated from u alone by (1)
and a law that is linear in its weights.  The parameters are

    theta = [a_2 .. a_na, b_1 .. b_nb, w_1 .. w_K, c_2 .. c_nc, d_1 .. d_nd]

and psi(t) = d y_hat(t) / d theta comes from sensitivity filters run beside x and v:

    dx(t)/da_i = u(t-i) - sum_j b_j dx(t-j)/da_i,
    dx(t)/db_i = -x(t-i) - sum_j b_j dx(t-j)/db_i,
    dv(t)      = f_x dx(t) + f_dx (dx(t) - dx(t-1)),   dv(t)/dw_k = f_k.

What must be known of the past is one flat array, laid out by `state_size`:

    x(t-1) .. x(t-nx) | their gradients | v(t-1) .. v(t-nc) | their gradients

``dims`` is (n_a, n_b, n_c, n_d, K) everywhere.  A system of m inputs has m numerators over one
denominator; they are interleaved as u is, u_1(t-1) .. u_m(t-1), u_1(t-2) .., and dims[0] is
m times n_a then.
"""

from __future__ import annotations

import numpy as np
from numba.extending import register_jitable  # type: ignore[import-untyped]

from whsklearn._numba import njit, part
from whsklearn.effects.terms import term
from whsklearn.recursion.delay_line import clear, push


@register_jitable
def parameter_count(dims):
    """Number of entries of theta."""
    return dims[0] - 1 + dims[1] + dims[4] + dims[2] - 1 + dims[3]


@register_jitable
def state_size(dims):
    """Length of the flat state of one model."""
    n1 = dims[0] - 1 + dims[1]
    nx = max(dims[1], 1)
    return nx * (1 + n1) + dims[2] * (1 + n1 + dims[4])


@part
def predict(theta, dims, state, y_past, first, psi):
    """y_hat(t) from the state and y(t-1), ... at y_past[first], ...; psi receives its gradient."""
    na, nb, nc, nd, nw = dims[0], dims[1], dims[2], dims[3], dims[4]
    n1 = na - 1 + nb
    nv = n1 + nw
    nx = max(nb, 1)
    v0 = nx * (1 + n1)
    g0 = v0 + nc
    y_hat = state[v0]
    for k in range(nv):
        psi[k] = state[g0 + k]
    for m in range(1, nc):
        c = theta[nv + m - 1]
        v = state[v0 + m]
        y_hat += c * v
        psi[nv + m - 1] = v
        row = g0 + m * nv
        for k in range(nv):
            psi[k] += c * state[row + k]
    j = nv + nc - 1
    for i in range(nd):
        y_hat -= theta[j + i] * y_past[first + i]
        psi[j + i] = -y_past[first + i]
    return y_hat


@part
def advance(theta, dims, codes, shapes, kappa, state, u_past, first):
    """Take the state one sample on, from u(t-1), ... at u_past[first], ...; returns dx = x(t) - x(t-1)."""
    na, nb, nc, nw = dims[0], dims[1], dims[2], dims[4]
    n1 = na - 1 + nb
    nv = n1 + nw
    nx = max(nb, 1)
    v0 = nx * (1 + n1)
    g0 = v0 + nc

    for k in range(v0 + nc - 1, v0, -1):
        state[k] = state[k - 1]
    for k in range(g0 + nc * nv - 1, g0 + nv - 1, -1):
        state[k] = state[k - nv]

    x = u_past[first]
    for i in range(1, na):
        x += theta[i - 1] * u_past[first + i]
    for j in range(nb):
        x -= theta[na - 1 + j] * state[j]
    x_old = state[0]
    dx = x - x_old

    v = 0.0
    f_x = 0.0
    f_dx = 0.0
    for k in range(nw):
        w = theta[n1 + k]
        f, fx, fdx = term(codes[k], shapes[k, 0], shapes[k, 1], shapes[k, 2], x, dx, kappa)
        v += w * f
        f_x += w * fx
        f_dx += w * fdx
        state[g0 + n1 + k] = f
    state[v0] = v

    f_x += f_dx
    for k in range(n1):
        g = u_past[first + k + 1] if k < na - 1 else -state[k - (na - 1)]
        for j in range(nb):
            g -= theta[na - 1 + j] * state[nx + j * n1 + k]
        g_old = state[nx + k]
        state[g0 + k] = f_x * g - f_dx * g_old
        for j in range(nx - 1, 0, -1):
            state[nx + j * n1 + k] = state[nx + (j - 1) * n1 + k]
        state[nx + k] = g
    for j in range(nx - 1, 0, -1):
        state[j] = state[j - 1]
    state[0] = x
    return dx


@njit(cache=True, error_model="numpy")
def record_errors(theta, dims, codes, shapes, kappa, u, y, restart, errors, jacobian):
    """Prediction errors over a record and, where ``jacobian`` has rows, psi for every sample.

    ``restart[t]`` is True where an experiment begins, with nothing known of its past.
    """
    n = parameter_count(dims)
    state = np.zeros(state_size(dims))
    nd = dims[3]
    u_past = np.zeros(dims[0])
    y_past = np.zeros(max(nd, 1))
    psi = np.empty(n)
    keep = jacobian.shape[0] > 0
    for t in range(len(u)):
        if restart[t]:
            clear(state)
            clear(u_past)
            clear(y_past)
        errors[t] = y[t] - predict(theta, dims, state, y_past, 0, psi)
        if keep:
            for k in range(n):
                jacobian[t, k] = psi[k]
        advance(theta, dims, codes, shapes, kappa, state, u_past, 0)
        push(u_past, u[t])
        for i in range(nd - 1, 0, -1):
            y_past[i] = y_past[i - 1]
        y_past[0] = y[t]
    return errors


@njit(cache=True, error_model="numpy")
def record_regressors(theta, dims, codes, shapes, kappa, u, y, restart, rows):
    """Rows of the model that is linear once L1 is fixed: f_k(t-m) for m = 1..n_c, then -y(t-n)."""
    na, nb, nc, nd, nw = dims[0], dims[1], dims[2], dims[3], dims[4]
    b0 = na - 1
    u_past = np.zeros(na)
    x_past = np.zeros(max(nb, 1))
    f = np.zeros((nc, nw))
    since = 0
    for t in range(len(u)):
        if restart[t]:
            clear(u_past)
            clear(x_past)
            for m in range(nc):
                clear(f[m])
            since = 0
        for m in range(nc):
            for k in range(nw):
                rows[t, m * nw + k] = f[m, k]
        for i in range(nd):
            rows[t, nc * nw + i] = -y[t - 1 - i] if i < since else 0.0
        x = u_past[0]
        for i in range(1, na):
            x += theta[i - 1] * u_past[i]
        for j in range(nb):
            x -= theta[b0 + j] * x_past[j]
        dx = x - x_past[0]
        for m in range(nc - 1, 0, -1):
            for k in range(nw):
                f[m, k] = f[m - 1, k]
        for k in range(nw):
            f[0, k] = term(codes[k], shapes[k, 0], shapes[k, 1], shapes[k, 2], x, dx, kappa)[0]
        for j in range(max(nb, 1) - 1, 0, -1):
            x_past[j] = x_past[j - 1]
        x_past[0] = x
        push(u_past, u[t])
        since += 1


@njit(cache=True, error_model="numpy")
def motion(theta, dims, u, restart):
    """Root mean square of dx = x(t) - x(t-1), which sets the scale of kappa."""
    na, nb = dims[0], dims[1]
    u_past = np.zeros(na)
    x_past = np.zeros(max(nb, 1))
    power = 0.0
    for t in range(len(u)):
        if restart[t]:
            clear(u_past)
            clear(x_past)
        x = u_past[0]
        for i in range(1, na):
            x += theta[i - 1] * u_past[i]
        for j in range(nb):
            x -= theta[na - 1 + j] * x_past[j]
        dx = x - x_past[0]
        power += dx * dx
        for j in range(max(nb, 1) - 1, 0, -1):
            x_past[j] = x_past[j - 1]
        x_past[0] = x
        push(u_past, u[t])
    return np.sqrt(power / max(len(u), 1))
