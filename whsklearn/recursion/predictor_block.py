"""The one-step predictor and its gradient over a stretch of samples, one signal after the other.

What `predictor` says sample by sample, the same equations and the same flat state, for parameters
that do not change meanwhile.  Signal by signal the inner loops run along time, where the processor
takes several samples at once.  Each signal is a row that begins with its past, oldest first: as
many samples as the lags reach back.
"""

from __future__ import annotations

import numpy as np

from whsklearn._numba import njit
from whsklearn.effects.terms import term

LENGTH = 128  # samples of a stretch: all its rows stay in the fastest cache


@njit(cache=True, error_model="numpy")
def empty_rows(dims, n_inputs):
    """Rows of u, x, its gradients, v, its gradients and y; of psi; of f_x + f_dx and -f_dx."""
    na, nb, nc, nd, nw = dims[0], dims[1], dims[2], dims[3], dims[4]
    n1, nx = na - 1 + nb, max(nb, 1)
    return (
        np.zeros((n_inputs, na // n_inputs + LENGTH)),
        np.zeros(nx + LENGTH),
        np.zeros((n1, nx + LENGTH)),
        np.zeros(nc + LENGTH),
        np.zeros((n1 + nw, nc + LENGTH)),
        np.zeros(nd + LENGTH),
        np.empty((n1 + nw + nc - 1 + nd, LENGTH)),
        np.empty((2, LENGTH)),
    )


@njit(cache=True, error_model="numpy")
def restore(rows, state):
    """The past of x, v and their gradients from the flat state, laid out as `predictor` says."""
    _, x, dx, v, dv, _, _, _ = rows
    nx, nc, n1, nv = x.size - LENGTH, v.size - LENGTH, dx.shape[0], dv.shape[0]
    v0 = nx * (1 + n1)
    for j in range(nx):
        x[nx - 1 - j] = state[j]
        for k in range(n1):
            dx[k, nx - 1 - j] = state[nx + j * n1 + k]
    for j in range(nc):
        v[nc - 1 - j] = state[v0 + j]
        for k in range(nv):
            dv[k, nc - 1 - j] = state[v0 + nc + j * nv + k]


@njit(cache=True, error_model="numpy")
def keep(rows, state):
    """The flat state from the past of x, v and their gradients."""
    _, x, dx, v, dv, _, _, _ = rows
    nx, nc, n1, nv = x.size - LENGTH, v.size - LENGTH, dx.shape[0], dv.shape[0]
    v0 = nx * (1 + n1)
    for j in range(nx):
        state[j] = x[nx - 1 - j]
        for k in range(n1):
            state[nx + j * n1 + k] = dx[k, nx - 1 - j]
    for j in range(nc):
        state[v0 + j] = v[nc - 1 - j]
        for k in range(nv):
            state[v0 + nc + j * nv + k] = dv[k, nc - 1 - j]


@njit(cache=True, error_model="numpy")
def forget(rows):
    """An experiment begins: nothing is known of the past."""
    u, x, dx, v, dv, y, _, _ = rows
    x[: x.size - LENGTH] = 0.0
    v[: v.size - LENGTH] = 0.0
    y[: y.size - LENGTH] = 0.0
    for many in (u, dx, dv):
        many[:, : many.shape[1] - LENGTH] = 0.0


@njit(cache=True, error_model="numpy")
def move_on(rows, n):
    """After a stretch of ``n`` samples its last ones are the past."""
    u, x, dx, v, dv, y, _, _ = rows
    for row in (x, v, y):
        for i in range(row.size - LENGTH):
            row[i] = row[n + i]
    for many in (u, dx, dv):
        for k in range(many.shape[0]):
            for i in range(many.shape[1] - LENGTH):
                many[k, i] = many[k, n + i]


@njit(cache=True, error_model="numpy")
def predict_stretch(theta, dims, codes, shapes, kappa, rows, errors):
    """Prediction errors of as many samples as ``errors`` has; psi is in the rows of that name.

    u, y and every signal's past must be in ``rows``.
    """
    _, _, _, v, dv, y, psi, _ = rows
    nc, nd, n, nv = dims[2], dims[3], errors.size, dv.shape[0]
    _filter_input(theta, dims, rows, n)
    _apply_law(theta, dims, codes, shapes, kappa, rows, n)
    j = nv + nc - 1
    for k in range(nv):
        out = psi[k, :n]
        out[:] = dv[k, nc - 1 : nc - 1 + n]
        for m in range(1, nc):
            add(out, theta[nv + m - 1], dv[k, nc - 1 - m : nc - 1 - m + n])
    for i in range(n):
        errors[i] = y[nd + i] - v[nc - 1 + i]
    for m in range(1, nc):
        out = psi[nv + m - 1, :n]
        out[:] = v[nc - 1 - m : nc - 1 - m + n]
        add(errors, -theta[nv + m - 1], out)
    for m in range(nd):
        out = psi[j + m, :n]
        for i in range(n):
            out[i] = -y[nd - 1 - m + i]
        add(errors, -theta[j + m], out)


@njit(cache=True, error_model="numpy")
def _filter_input(theta, dims, rows, n):
    """Give x of (1) and its gradients by a_2 .. and b_1 .. over ``n`` samples."""
    u, x, dx, _, _, _, _, _ = rows
    na, nb = dims[0], dims[1]
    m, nx, newest = u.shape[0], x.size - LENGTH, u.shape[1] - LENGTH - 1
    b = theta[na - 1 : na - 1 + nb]
    now = x[nx : nx + n]
    now[:] = u[0, newest : newest + n]
    for i in range(1, na):
        first = newest - i // m
        add(now, theta[i - 1], u[i % m, first : first + n])
    through_denominator(x[nx - nb : nx + n], b)
    for k in range(dx.shape[0]):
        out = dx[k, nx : nx + n]
        if k < na - 1:
            first = newest - (k + 1) // m
            out[:] = u[(k + 1) % m, first : first + n]
        else:
            first = nx - 1 - (k - (na - 1))
            for i in range(n):
                out[i] = -x[first + i]
        through_denominator(dx[k, nx - nb : nx + n], b)


@njit(cache=True, error_model="numpy")
def _apply_law(theta, dims, codes, shapes, kappa, rows, n):
    """Give v = sum w_k f_k(x, x(t) - x(t-1)) and its gradients over ``n`` samples."""
    _, x, dx, v, dv, _, _, slopes = rows
    nx, nc, n1 = x.size - LENGTH, dims[2], dx.shape[0]
    old, now, v_now = x[nx - 1 : nx - 1 + n], x[nx : nx + n], v[nc : nc + n]
    by_now, by_old = slopes[0, :n], slopes[1, :n]
    v_now[:] = 0.0
    by_now[:] = 0.0
    by_old[:] = 0.0
    for k in range(codes.size):
        w, code, s0, s1, s2 = theta[n1 + k], codes[k], shapes[k, 0], shapes[k, 1], shapes[k, 2]
        value = dv[n1 + k, nc : nc + n]
        for i in range(n):
            f, f_x, f_dx = term(code, s0, s1, s2, now[i], now[i] - old[i], kappa)
            value[i] = f
            v_now[i] += w * f
            by_now[i] += w * (f_x + f_dx)
            by_old[i] -= w * f_dx
    for k in range(n1):
        out, g_now, g_old = dv[k, nc : nc + n], dx[k, nx : nx + n], dx[k, nx - 1 : nx - 1 + n]
        for i in range(n):
            out[i] = by_now[i] * g_now[i] + by_old[i] * g_old[i]


@njit(cache=True, error_model="numpy")
def through_denominator(row, b):
    """row(t) -= sum b_j row(t-j), in place; the row begins with as many past samples as b has."""
    nb = b.size
    if nb == 2:  # the paper's order, with the past in registers
        older, old, b1, b2 = row[0], row[1], b[0], b[1]
        for i in range(2, row.size):
            new = (row[i] - b2 * older) - b1 * old
            row[i] = new
            older, old = old, new
        return
    for i in range(nb, row.size):
        s = row[i]
        for j in range(nb - 1, -1, -1):
            s -= b[j] * row[i - 1 - j]
        row[i] = s


@njit(cache=True, error_model="numpy")
def add(out, factor, row):
    """out += factor row."""
    for i in range(out.size):
        out[i] += factor * row[i]


@njit(cache=True, error_model="numpy", fastmath={"reassoc", "contract"})
def dot(a, b):
    """Inner product, summed in the order that suits the processor."""
    s = 0.0
    for i in range(a.size):
        s += a[i] * b[i]
    return s
