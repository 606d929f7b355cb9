"""The one-step predictor and its gradient over a segment of samples, one signal after the other.

What `predictor` says sample by sample, the same equations and the same flat state, for parameters
that do not change meanwhile.  Signal by signal the inner loops run along time, where the processor
takes several samples at once.  Each signal is a row that begins with its past, oldest first: as
many samples as the lags reach back.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from whsklearn._numba import njit, part
from whsklearn.effects.terms import term

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

LENGTH = 128  # samples of a segment: all its signals stay in the fastest cache


class Segment(NamedTuple):
    """Room for the signals of a segment.

    Attributes
    ----------
    signals : ndarray of shape (n_inputs + 3 + 2 n_1 + K, past + LENGTH)
        A row each: u, x, its gradients by (a, b), v, its gradients by (a, b, w), y; the past first, oldest first.
    psi : ndarray of shape (n + 1, LENGTH)
        d y_hat / d theta, and below it the prediction error.
    slopes : ndarray of shape (2, LENGTH)
        f_x + f_dx and -f_dx.
    """

    signals: Array
    psi: Array
    slopes: Array


def new_segment(dims: NDArray[np.int64], n_inputs: int) -> Segment:
    """A segment with nothing before it."""
    na, nb, nc, nd, nw = (int(i) for i in dims)
    n1, past = na - 1 + nb, max(na // n_inputs, nb, nc, nd, 1)
    signals = np.zeros((n_inputs + 3 + 2 * n1 + nw, past + LENGTH))
    return Segment(signals, np.zeros((n1 + nw + nc - 1 + nd + 1, LENGTH)), np.zeros((2, LENGTH)))


@part
def begin(signals, dims, state, u, y, history):
    """The past of every signal: of u and y their first ``history`` samples, else the flat state of `predictor`."""
    na, nb, nc, nd, nw = dims[0], dims[1], dims[2], dims[3], dims[4]
    m, n1, nx, last = u.shape[1], na - 1 + nb, max(nb, 1), signals.shape[1] - LENGTH - 1
    nv = n1 + nw
    x0, v0 = m, m + 1 + n1
    y0 = v0 + 1 + nv
    for i in range(na):
        signals[i % m, last - i // m] = u[history - 1 - i // m, i % m]
    at = 0
    for j in range(nx):
        signals[x0, last - j] = state[at]
        at += 1
    for j in range(nx):
        for k in range(n1):
            signals[x0 + 1 + k, last - j] = state[at]
            at += 1
    for j in range(nc):
        signals[v0, last - j] = state[at]
        at += 1
    for j in range(nc):
        for k in range(nv):
            signals[v0 + 1 + k, last - j] = state[at]
            at += 1
    for i in range(nd):
        signals[y0, last - i] = y[history - 1 - i]


@part
def keep(signals, dims, m, state):
    """The flat state from the past of x, v and their gradients; ``m`` inputs."""
    na, nb, nc, nw = dims[0], dims[1], dims[2], dims[4]
    n1, nx, last = na - 1 + nb, max(nb, 1), signals.shape[1] - LENGTH - 1
    at = 0
    for first, lags, n in ((m, nx, n1), (m + 1 + n1, nc, n1 + nw)):
        for j in range(lags):
            state[at] = signals[first, last - j]
            at += 1
        for j in range(lags):
            for k in range(n):
                state[at] = signals[first + 1 + k, last - j]
                at += 1


@part
def forget(signals):
    """An experiment begins: nothing is known of the past."""
    for k in range(signals.shape[0]):
        for i in range(signals.shape[1] - LENGTH):
            signals[k, i] = 0.0


@part
def move_on(signals, n):
    """After a segment of ``n`` samples its last ones are the past."""
    for k in range(signals.shape[0]):
        for i in range(signals.shape[1] - LENGTH):
            signals[k, i] = signals[k, n + i]


@part
def delayed(signals, k, lag, n):
    """Signal ``k`` of the ``n`` samples, ``lag`` samples before."""
    first = signals.shape[1] - LENGTH - lag
    return signals[k, first : first + n]


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
    """psi and prediction errors of ``n`` samples; u of ``m`` inputs, y and the past must be in ``segment.signals``."""
    dims = law[0]
    signals, psi = segment.signals, segment.psi
    n1, nc, nd = dims[0] - 1 + dims[1], dims[2], dims[3]
    nv, v0 = n1 + dims[4], m + 1 + n1
    y0 = v0 + 1 + nv
    _filter_input(theta, dims, signals, m, n)
    _apply_law(theta, law, kappa, signals, m, segment.slopes, n)
    for k in range(nv):
        out = psi[k, :n]
        put(out, delayed(signals, v0 + 1 + k, 1, n))
        for j in range(1, nc):
            add(out, theta[nv + j - 1], delayed(signals, v0 + 1 + k, j + 1, n))
    errors = psi[psi.shape[0] - 1, :n]
    y, v = delayed(signals, y0, 0, n), delayed(signals, v0, 1, n)
    for i in range(n):
        errors[i] = y[i] - v[i]
    for j in range(nc - 1 + nd):
        out = psi[nv + j, :n]
        if j < nc - 1:
            put(out, delayed(signals, v0, j + 2, n))
        else:
            past = delayed(signals, y0, j - nc + 2, n)
            for i in range(n):
                out[i] = -past[i]
        add(errors, -theta[nv + j], out)


@part
def _filter_input(theta, dims, signals, m, n):
    """Give x of (1) and its gradients by a_2 .. and b_1 .. over ``n`` samples."""
    na, nb = dims[0], dims[1]
    b = theta[na - 1 : na - 1 + nb]
    # the first row is x = sum a_i u(t-i) - sum b_j x(t-j), the others its gradients, of u(t-i) and -x(t-j) alone
    for k in range(na + nb):
        out = delayed(signals, m + k, 0, n)
        if k == 0:
            put(out, delayed(signals, 0, 1, n))
            for i in range(1, na):
                add(out, theta[i - 1], delayed(signals, i % m, 1 + i // m, n))
        elif k < na:
            put(out, delayed(signals, k % m, 1 + k // m, n))
        else:
            x = delayed(signals, m, 1 + k - na, n)
            for i in range(n):
                out[i] = -x[i]
        through_denominator(delayed(signals, m + k, nb, nb + n), b)


@part
def _apply_law(theta, law, kappa, signals, m, slopes, n):
    """Give v = sum w_k f_k(x, x(t) - x(t-1)) and its gradients over ``n`` samples."""
    dims, codes, shapes = law
    n1 = dims[0] - 1 + dims[1]
    v0 = m + 1 + n1
    old, now, v = delayed(signals, m, 1, n), delayed(signals, m, 0, n), delayed(signals, v0, 0, n)
    by_now, by_old = slopes[0], slopes[1]
    for i in range(n):
        v[i] = by_now[i] = by_old[i] = 0.0
    for k in range(codes.size):
        w, code, s0, s1, s2 = theta[n1 + k], codes[k], shapes[k, 0], shapes[k, 1], shapes[k, 2]
        value = delayed(signals, v0 + 1 + n1 + k, 0, n)
        for i in range(n):
            f, f_x, f_dx = term(code, s0, s1, s2, now[i], now[i] - old[i], kappa)
            value[i] = f
            v[i] += w * f
            by_now[i] += w * (f_x + f_dx)
            by_old[i] -= w * f_dx
    for k in range(n1):
        out, g, g_old = (
            delayed(signals, v0 + 1 + k, 0, n),
            delayed(signals, m + 1 + k, 0, n),
            delayed(signals, m + 1 + k, 1, n),
        )
        for i in range(n):
            out[i] = by_now[i] * g[i] + by_old[i] * g_old[i]


@part
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


@njit(cache=False, error_model="numpy", fastmath={"reassoc", "contract"})
def dot(a, b):
    """Inner product, summed in the order that suits the processor."""
    s = 0.0
    for i in range(a.size):
        s += a[i] * b[i]
    return s
