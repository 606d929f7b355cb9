"""The one-step predictor and its gradient over a segment of samples, one signal after the other.

These are the equations and the flat state of `predictor`, for parameters that do not change within the
segment.  Signal by signal, the inner loops run along time, and the processor handles several samples at
once.  Each signal is a row that begins with its past, oldest first: as many samples as the lags reach back.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from whsklearn._numba import njit, part, piece, view
from whsklearn.effects.base import Array, Integers
from whsklearn.effects.codes import COULOMB, STRIBECK_TANH, VISCOUS
from whsklearn.effects.equations import coulomb, reduced_stribeck, smooth_sign, viscous
from whsklearn.effects.rows import term

LENGTH = 128  # samples of a segment, few enough for all its signals to stay in the fastest cache


class Segment(NamedTuple):
    """Arrays for the signals of a segment."""

    # (n_inputs + 3 + 2 n_1 + K, past + LENGTH): one row each: u, x, its gradients with respect to (a, b), v, its
    # gradients with respect to (a, b, w), y. The past comes first, oldest sample first.
    signals: Array
    psi: Array  # (n + 1, LENGTH): d y_hat / d theta, and below it the prediction error
    slopes: Array  # (2, LENGTH): f_x + f_dx and -f_dx
    # (2, n_state): row and column of ``signals`` that hold each number of the flat state of `predictor`
    places: Integers


def new_segment(dims: Integers, n_inputs: int) -> Segment:
    """A segment with nothing before it."""
    na, nb, nc, nd, nw = dims.tolist()
    n1, past = na - 1 + nb, max(na // n_inputs, nb, nc, nd, 1)
    rows, columns = [], []
    for first, lags, n in ((n_inputs, max(nb, 1), n1), (n_inputs + 1 + n1, nc, n1 + nw)):
        rows += [first] * lags + [first + 1 + k for _ in range(lags) for k in range(n)]
        columns += [past - 1 - j for j in range(lags)] + [past - 1 - j for j in range(lags) for _ in range(n)]
    places = np.array([rows, columns])
    signals = np.zeros((n_inputs + 3 + 2 * n1 + nw, past + LENGTH))
    return Segment(signals, np.zeros((n1 + nw + nc - 1 + nd + 1, LENGTH)), np.zeros((2, LENGTH)), places)


@part
def begin(signals, places, state, u, y, history):
    """Fill in the past of every signal: u and y from ``history``, the others from the state of `predictor`."""
    past, m = signals.shape[1] - LENGTH, u.shape[1]
    for i in range(min(past, history)):
        for k in range(m):
            signals[k, past - 1 - i] = u[history - 1 - i, k]
        signals[signals.shape[0] - 1, past - 1 - i] = y[history - 1 - i]
    for k in range(state.size):
        signals[places[0, k], places[1, k]] = state[k]


@part
def keep(signals, places, state):
    """Write the past of x, v and their gradients into the flat state."""
    for k in range(state.size):
        state[k] = signals[places[0, k], places[1, k]]


@part
def forget(signals):
    """Clear the past, because an experiment begins."""
    for k in range(signals.shape[0]):
        for i in range(signals.shape[1] - LENGTH):
            signals[k, i] = 0.0


@part
def move_on(signals, n):
    """Make the last samples of a segment of ``n`` samples the past of the next one."""
    for k in range(signals.shape[0]):
        for i in range(signals.shape[1] - LENGTH):
            signals[k, i] = signals[k, n + i]


@view
def delayed(signals, k, lag, n):
    """Signal ``k`` of the ``n`` samples, delayed by ``lag`` samples."""
    return piece(signals, (k + 1) * signals.shape[1] - LENGTH - lag, (n,))


@view
def along(rows, k, n):
    """The first ``n`` entries of row ``k``."""
    return piece(rows, k * rows.shape[1], (n,))


@part
def put(out, row):
    """out = row."""
    for i in range(out.size):
        out[i] = row[i]


@part
def add(out, factor, row):
    """out += factor row."""
    for i in range(out.size):
        out[i] += factor * row[i]


@part
def predict_segment(theta, law, kappa, m, segment, n):
    """Compute psi and the prediction errors of ``n`` samples.

    u of ``m`` inputs, y and the past must be in ``segment.signals``.
    """
    dims = law[0]
    signals, psi, slopes, _ = segment
    n1, nc, nd = dims[0] - 1 + dims[1], dims[2], dims[3]
    nv, v0 = n1 + dims[4], m + 1 + n1
    y0 = v0 + 1 + nv
    _filter_input(theta, dims, signals, m, n)
    _apply_law(theta, law, kappa, signals, m, slopes, n)
    for k in range(nv):
        out = along(psi, k, n)
        put(out, delayed(signals, v0 + 1 + k, 1, n))
        for j in range(1, nc):
            add(out, theta[nv + j - 1], delayed(signals, v0 + 1 + k, j + 1, n))
    errors = along(psi, psi.shape[0] - 1, n)
    y, v = delayed(signals, y0, 0, n), delayed(signals, v0, 1, n)
    for i in range(n):
        errors[i] = y[i] - v[i]
    for j in range(nc - 1 + nd):
        out = along(psi, nv + j, n)
        if j < nc - 1:
            put(out, delayed(signals, v0, j + 2, n))
        else:
            past = delayed(signals, y0, j - nc + 2, n)
            for i in range(n):
                out[i] = -past[i]
        add(errors, -theta[nv + j], out)


@part
def _filter_input(theta, dims, signals, m, n):
    """Compute x of (1) and its gradients with respect to a_2 .. and b_1 .. over ``n`` samples."""
    na, nb = dims[0], dims[1]
    b = piece(theta, na - 1, (nb,))
    # the first row is x = sum a_i u(t-i) - sum b_j x(t-j); the others are its gradients, from u(t-i) and -x(t-j) alone
    for k in range(na + nb):
        out = delayed(signals, m + k, 0, n)
        if k == 0:
            put(out, delayed(signals, 0, 1, n))
            for i in range(1, na):
                add(out, theta[i - 1], delayed(signals, i % m, 1 + i // m, n))
            through_denominator(signals[m : m + 1], b, n)
        elif k < na:
            put(out, delayed(signals, k % m, 1 + k // m, n))
        else:
            x = delayed(signals, m, 1 + k - na, n)
            for i in range(n):
                out[i] = -x[i]
    through_denominator(signals[m + 1 : m + na + nb], b, n)


@part
def _apply_law(theta, law, kappa, signals, m, slopes, n):
    """Compute v = sum w_k f_k(x, x(t) - x(t-1)) and its gradients over ``n`` samples."""
    dims, codes, shapes = law
    n1 = dims[0] - 1 + dims[1]
    v0 = m + 1 + n1
    old, now, v = delayed(signals, m, 1, n), delayed(signals, m, 0, n), delayed(signals, v0, 0, n)
    by_now, by_old = slopes[0], slopes[1]
    for i in range(n):
        v[i] = by_now[i] = by_old[i] = 0.0
    for k in range(codes.size):
        w, code, s0, s1, s2 = theta[n1 + k], codes[k], shapes[k, 0], shapes[k, 1], shapes[k, 2]
        out = delayed(signals, v0 + 1 + n1 + k, 0, n), v, by_now, by_old
        # the laws of the paper; if the compiler knows the term, the loop takes two thirds of the time
        if code == VISCOUS:
            for i in range(n):
                _add_term(viscous(now[i] - old[i]), w, i, out)
        elif code == COULOMB:
            for i in range(n):
                s, ds = smooth_sign(now[i] - old[i], kappa)
                _add_term(coulomb(s, ds), w, i, out)
        elif code == STRIBECK_TANH:
            for i in range(n):
                _add_term(reduced_stribeck(s0, now[i] - old[i]), w, i, out)
        else:
            for i in range(n):
                _add_term(term(code, s0, s1, s2, now[i], now[i] - old[i], kappa), w, i, out)
    for k in range(n1):
        out, g, g_old = (
            delayed(signals, v0 + 1 + k, 0, n),
            delayed(signals, m + 1 + k, 0, n),
            delayed(signals, m + 1 + k, 1, n),
        )
        for i in range(n):
            out[i] = by_now[i] * g[i] + by_old[i] * g_old[i]


@part
def _add_term(term_there, w, i, out):
    """Store a term's value f at sample i, add w f to v, and add its slopes in x(t) and in x(t-1) to those of v."""
    f, f_x, f_dx = term_there
    value, v, by_now, by_old = out
    value[i] = f
    v[i] += w * f
    by_now[i] += w * (f_x + f_dx)
    by_old[i] -= w * f_dx


@part
def through_denominator(rows, b, n):
    """row(t) -= sum b_j row(t-j) over ``n`` samples, in place; each row begins with its past."""
    nb, first, k = b.size, rows.shape[1] - LENGTH, 0
    # the paper's order, with the past in registers; three rows at once, because each sum waits for the one before it
    while nb == 2 and k + 3 <= rows.shape[0]:
        p, q, r = rows[k], rows[k + 1], rows[k + 2]
        p2, p1, q2, q1, r2, r1 = p[first - 2], p[first - 1], q[first - 2], q[first - 1], r[first - 2], r[first - 1]
        b1, b2 = b[0], b[1]
        for i in range(first, first + n):
            p0, q0, r0 = (p[i] - b2 * p2) - b1 * p1, (q[i] - b2 * q2) - b1 * q1, (r[i] - b2 * r2) - b1 * r1
            p[i], q[i], r[i] = p0, q0, r0
            p2, p1, q2, q1, r2, r1 = p1, p0, q1, q0, r1, r0
        k += 3
    for row in rows[k:]:
        if nb == 2:
            older, old, b1, b2 = row[first - 2], row[first - 1], b[0], b[1]
            for i in range(first, first + n):
                new = (row[i] - b2 * older) - b1 * old
                row[i] = new
                older, old = old, new
            continue
        for i in range(first, first + n):
            s = row[i]
            for j in range(nb - 1, -1, -1):
                s -= b[j] * row[i - 1 - j]
            row[i] = s


@njit(cache=False, error_model="numpy", fastmath={"reassoc", "contract"})
def dot(a, b):
    """Inner product, summed in the order that suits the processor."""
    s = 0.0
    for i in range(a.size):
        s += a[i] * b[i]
    return s
