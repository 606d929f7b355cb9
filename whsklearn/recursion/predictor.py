"""The one-step predictor of a Wiener-Hammerstein system and its exact gradient.

y_hat(t) = sum c_m v(t-m) - sum d_n y(t-n), with x and v simulated from u alone by (1)
and a law that is linear in its weights.  The parameters are

    theta = [a_2 .. a_na, b_1 .. b_nb, w_1 .. w_K, c_2 .. c_nc, d_1 .. d_nd]

and psi(t) = d y_hat(t) / d theta comes from sensitivity filters run beside x and v:

    dx(t)/da_i = u(t-i) - sum_j b_j dx(t-j)/da_i,
    dx(t)/db_i = -x(t-i) - sum_j b_j dx(t-j)/db_i,
    dv(t)      = f_x dx(t) + f_dx (dx(t) - dx(t-1)),   dv(t)/dw_k = f_k.

What must be known of the past is one flat array, laid out by `state_size` and read through `past_of`:

    x(t-1) .. x(t-nx) | their gradients | v(t-1) .. v(t-nc) | their gradients

``dims`` is (n_a, n_b, n_c, n_d, K) everywhere.  A system of m inputs has m numerators over one
denominator; they are interleaved as u is, u_1(t-1) .. u_m(t-1), u_1(t-2) .., and dims[0] is
m times n_a then.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numba.extending import register_jitable  # type: ignore[import-untyped]

from whsklearn._numba import njit, part
from whsklearn.effects.terms import term
from whsklearn.recursion.delay_line import clear, push

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]


class Past(NamedTuple):
    """What must be known of the past, newest first.

    Attributes
    ----------
    x, x_by : ndarrays of shape (nx,), (nx, n_1)
        x(t-1), ... and d x / d (a, b).
    v, v_by : ndarrays of shape (nc,), (nc, n_1 + K)
        v(t-1), ... and d v / d (a, b, w).
    """

    x: Array
    x_by: Array
    v: Array
    v_by: Array


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
def past_of(state, dims):
    """The flat state as `Past`, in the same memory.

    Indices of a table's own are known to be positive; worked out within one flat array they are not, and looking after
    that took half of the time of a sample.
    """
    nb, nc = dims[1], dims[2]
    n1, nx = dims[0] - 1 + nb, max(nb, 1)
    v0, nv = nx * (1 + n1), n1 + dims[4]
    g0 = v0 + nc
    return Past(state[:nx], state[nx:v0].reshape((nx, n1)), state[v0:g0], state[g0 : g0 + nc * nv].reshape((nc, nv)))


# Written into their callers: a call hands over some forty numbers, and a quarter of the time went there.
@njit(cache=False, error_model="numpy", forceinline=True)
def predict(theta, dims, past, y_past, first, psi):
    """y_hat(t) from the past and y(t-1), ... at y_past[first], ...; psi receives its gradient."""
    nc, nd, nv = dims[2], dims[3], past.v_by.shape[1]
    y_hat = past.v[0]
    for k in range(nv):
        psi[k] = past.v_by[0, k]
    for m in range(1, nc):
        c = theta[nv + m - 1]
        y_hat += c * past.v[m]
        psi[nv + m - 1] = past.v[m]
        for k in range(nv):
            psi[k] += c * past.v_by[m, k]
    j = nv + nc - 1
    for i in range(nd):
        y_hat -= theta[j + i] * y_past[first + i]
        psi[j + i] = -y_past[first + i]
    return y_hat


@njit(cache=False, error_model="numpy", forceinline=True)
def advance(theta, dims, codes, shapes, kappa, past, u_past, first, answers=True):
    """Take the past one sample on, from u(t-1), ... at u_past[first], ...; returns dx = x(t) - x(t-1).

    Where v(t) will be too old for the next `predict` it need not answer: the law is the dearest part.
    """
    x, x_by, v, v_by = past
    na, nb, nw = dims[0], dims[1], dims[4]
    nx, n1, nc, nv = x.size, x_by.shape[1], v.size, v_by.shape[1]
    new = u_past[first]
    for i in range(1, na):
        new += theta[i - 1] * u_past[first + i]
    for j in range(nb):
        new -= theta[na - 1 + j] * x[j]
    dx = new - x[0]

    for m in range(nc - 1, 0, -1):
        v[m] = v[m - 1]
        for k in range(nv):
            v_by[m, k] = v_by[m - 1, k]
    newest = 0.0
    f_x = 0.0
    f_dx = 0.0
    for k in range(nw if answers else 0):
        w = theta[n1 + k]
        f, fx, fdx = term(codes[k], shapes[k, 0], shapes[k, 1], shapes[k, 2], new, dx, kappa)
        newest += w * f
        f_x += w * fx
        f_dx += w * fdx
        v_by[0, n1 + k] = f
    v[0] = newest
    f_x += f_dx
    for k in range(n1):
        g = u_past[first + k + 1] if k < na - 1 else -x[k - (na - 1)]
        for j in range(nb):
            g -= theta[na - 1 + j] * x_by[j, k]
        v_by[0, k] = f_x * g - f_dx * x_by[0, k]
        for j in range(nx - 1, 0, -1):
            x_by[j, k] = x_by[j - 1, k]
        x_by[0, k] = g
    for j in range(nx - 1, 0, -1):
        x[j] = x[j - 1]
    x[0] = new
    return dx


@njit(cache=True, error_model="numpy")
def record_errors(theta, dims, codes, shapes, kappa, u, y, restart, errors, jacobian):
    """Prediction errors over a record and, where ``jacobian`` has rows, psi for every sample.

    ``restart[t]`` is True where an experiment begins, with nothing known of its past.
    """
    n = parameter_count(dims)
    state = np.zeros(state_size(dims))
    past = past_of(state, dims)
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
        errors[t] = y[t] - predict(theta, dims, past, y_past, 0, psi)
        if keep:
            for k in range(n):
                jacobian[t, k] = psi[k]
        advance(theta, dims, codes, shapes, kappa, past, u_past, 0)
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
