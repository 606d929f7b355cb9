"""The one-step predictor of a Wiener-Hammerstein system and its exact gradient.

y_hat(t) = sum c_m v(t-m) - sum d_n y(t-n), with x and v simulated from u alone by (1)
and a law that is linear in its weights.  The parameters are

    theta = [a_2 .. a_na, b_1 .. b_nb, w_1 .. w_K, c_2 .. c_nc, d_1 .. d_nd]

and psi(t) = d y_hat(t) / d theta comes from sensitivity filters run beside x and v:

    dx(t)/da_i = u(t-i) - sum_j b_j dx(t-j)/da_i,
    dx(t)/db_i = -x(t-i) - sum_j b_j dx(t-j)/db_i,
    dv(t)      = f_x dx(t) + f_dx (dx(t) - dx(t-1)),   dv(t)/dw_k = f_k.

The required past is one flat array, laid out by `state_size` and read through `past_of`:

    x(t-1) .. x(t-nx) | their gradients | v(t-1) .. v(t-nc) | their gradients

``dims`` is (n_a, n_b, n_c, n_d, K) everywhere.  A system with m inputs has m numerators over one
denominator.  They are interleaved as u is, u_1(t-1) .. u_m(t-1), u_1(t-2) .., and dims[0] is then
m times n_a.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba.extending import register_jitable  # type: ignore[import-untyped]

from whsklearn._numba import njit, part, piece, view
from whsklearn.effects.base import Array, Integers
from whsklearn.effects.equations import smooth_sign
from whsklearn.effects.rows import directed_term

Law = tuple[Integers, Integers, Array]  # dims, codes, shapes

LEAST_MOTION = 1e-30  # rms of dx below which the axis is at rest, in any unit
ROWS = 64  # rows of a line along a record before the line starts over


class Past(NamedTuple):
    """The required past, newest first; a line has room for new samples in front of it."""

    x: Array  # x, x_by (nx,), (nx, n_1): x(t-1), ... and d x / d (a, b)
    x_by: Array
    v: Array  # v, v_by (nc,), (nc, n_1 + K): v(t-1), ... and d v / d (a, b, w)
    v_by: Array


@register_jitable
def parameter_count(dims):
    """Number of entries of theta."""
    return dims[0] - 1 + dims[1] + dims[4] + dims[2] - 1 + dims[3]


@register_jitable
def state_size(dims, room=0):
    """Length of the flat state of one model, or of one with ``room`` more rows."""
    n1 = dims[0] - 1 + dims[1]
    return (room + max(dims[1], 1)) * (1 + n1) + (room + dims[2]) * (1 + n1 + dims[4])


@view
def past_of(state, at, dims, room):
    """The flat state from index ``at`` on as `Past`, in the same memory.

    With ``room`` for as many samples in front, time advances by a row and nothing is shifted.  The compiler knows that
    the indices of a table are positive.  It cannot know this for indices computed within one flat array, and checking
    them took half the time of a sample.
    """
    n1 = dims[0] - 1 + dims[1]
    nx, nc, nv = room + max(dims[1], 1), room + dims[2], n1 + dims[4]
    v0 = at + nx * (1 + n1)
    x, x_by = piece(state, at, (nx,)), piece(state, at + nx, (nx, n1))
    return Past(x, x_by, piece(state, v0, (nc,)), piece(state, v0 + nc, (nc, nv)))


@part
def copy_past(source, at, target, to, past):
    """Copy as many rows as ``past`` has, from ``at`` to ``to``; oldest first, because they may overlap."""
    for j in range(past.x.size - 1, -1, -1):
        target.x[to + j] = source.x[at + j]
        for k in range(past.x_by.shape[1]):
            target.x_by[to + j, k] = source.x_by[at + j, k]
    for j in range(past.v.size - 1, -1, -1):
        target.v[to + j] = source.v[at + j]
        for k in range(past.v_by.shape[1]):
            target.v_by[to + j, k] = source.v_by[at + j, k]


@view
def by_block(theta, dims):
    """(a, b, w, c, d) of the parameters, or of any array with one entry for each, as views like `past_of`."""
    a, b, c, d, w = dims[0] - 1, dims[1], dims[2] - 1, dims[3], dims[4]
    return (
        piece(theta, 0, (a,)), piece(theta, a, (b,)), piece(theta, a + b, (w,)), piece(theta, a + b + w, (c,)),
        piece(theta, a + b + w + c, (d,)),
    )  # fmt: skip


# Inlined into their callers: a call passes some forty numbers, which took a quarter of the time.  With max(at, 0) the
# compiler knows that a row index is not negative and need not check it at each access, which saves a tenth.
@njit(cache=False, error_model="numpy", forceinline=True)
def predict(blocks, line, at, y_past, psi, psi_blocks):
    """y_hat of the sample whose past begins at row ``at``, from that past and y(t-1), ...; psi receives its gradient.

    psi is passed block by block too.
    """
    at = max(at, 0)
    c, d = blocks[3], blocks[4]
    psi_c, psi_d = psi_blocks[3], psi_blocks[4]
    v, v_by = line.v, line.v_by
    nv = v_by.shape[1]
    y_hat = v[at]
    for k in range(nv):
        psi[k] = v_by[at, k]
    for m in range(c.size):
        older = at + 1 + m
        y_hat += c[m] * v[older]
        psi_c[m] = v[older]
        for k in range(nv):
            psi[k] += c[m] * v_by[older, k]
    for i in range(d.size):
        y_hat -= d[i] * y_past[i]
        psi_d[i] = -y_past[i]
    return y_hat


@njit(cache=False, error_model="numpy", forceinline=True)
def advance(blocks, line, at, u_past):
    """Compute x and its gradient in row ``at``, from the older rows behind it and u(t-1), ..."""
    at = max(at, 0)
    a, b = blocks[0], blocks[1]
    x, x_by = line.x, line.x_by
    na1, nb, last = a.size, b.size, at + 1
    new = u_past[0]
    for i in range(na1):
        new += a[i] * u_past[i + 1]
    for j in range(nb):
        new -= b[j] * x[last + j]
    x[at] = new
    for k in range(x_by.shape[1]):
        g = u_past[k + 1] if k < na1 else -x[last + k - na1]
        for j in range(nb):
            g -= b[j] * x_by[last + j, k]
        x_by[at, k] = g


@njit(cache=False, error_model="numpy", forceinline=True)
def respond(blocks, codes, shapes, kappa, line, at):
    """Compute v and its gradient in row ``at`` from x there and in the row behind it.

    This is the law, the most expensive part.
    """
    at = max(at, 0)
    w = blocks[2]
    x, x_by, v, v_by = line
    n1 = x_by.shape[1]
    now = x[at]
    dx = now - x[at + 1]
    newest = 0.0
    f_x = 0.0
    f_dx = 0.0
    s, ds = smooth_sign(dx, kappa)
    for k in range(w.size):
        f, fx, fdx = directed_term(codes[k], shapes[k, 0], shapes[k, 1], shapes[k, 2], now, dx, s, ds)
        newest += w[k] * f
        f_x += w[k] * fx
        f_dx += w[k] * fdx
        v_by[at, n1 + k] = f
    v[at] = newest
    f_x += f_dx
    for k in range(n1):
        v_by[at, k] = f_x * x_by[at, k] - f_dx * x_by[at + 1, k]


@njit(error_model="numpy", short=True)
def record_errors(theta, dims, codes, shapes, kappa, u, y, restart, errors, jacobian):
    """Prediction errors over a record and, if ``jacobian`` has rows, psi for every sample.

    ``restart[t]`` is True where an experiment begins; its past is unknown.
    """
    n = parameter_count(dims)
    past = past_of(np.zeros(state_size(dims)), 0, dims, 0)
    line, at = past_of(np.zeros(state_size(dims, ROWS)), 0, dims, ROWS), ROWS
    nd = dims[3]
    u_past = np.zeros(dims[0])
    y_past = np.zeros(max(nd, 1))
    psi = np.empty(n)
    blocks, psi_blocks = by_block(theta, dims), by_block(psi, dims)
    keep = jacobian.shape[0] > 0
    for t in range(len(u)):
        if restart[t]:
            at = ROWS
            copy_past(past, 0, line, at, past)
            clear(u_past)
            clear(y_past)
        errors[t] = y[t] - predict(blocks, line, at, y_past, psi, psi_blocks)
        if keep:
            for k in range(n):
                jacobian[t, k] = psi[k]
        if at == 0:
            at = ROWS
            copy_past(line, 0, line, at, past)
        at -= 1
        advance(blocks, line, at, u_past)
        respond(blocks, codes, shapes, kappa, line, at)
        push(u_past, u[t])
        for i in range(nd - 1, 0, -1):
            y_past[i] = y_past[i - 1]
        y_past[0] = y[t]
    return errors


@part
def push(past, newest):
    """Put the newest sample, one number per input, in front of the older ones."""
    m = newest.size
    for i in range(past.size - 1, m - 1, -1):
        past[i] = past[i - m]
    for i in range(m):
        past[i] = newest[i]


@part
def clear(past):
    """Forget the past samples."""
    for i in range(past.size):
        past[i] = 0.0
