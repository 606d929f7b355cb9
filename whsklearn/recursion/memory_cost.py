"""A re-run of the samples kept in memory with given parameters: squared errors and their Gauss-Newton matrix.

A re-run of thousands of samples may take longer than a control loop can wait, so it can be done in
parts: `work` holds where it stands and how many samples it may still read.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from whsklearn._numba import njit
from whsklearn.recursion.predictor import parameter_count
from whsklearn.recursion.predictor_block import LENGTH, dot, empty_rows, forget, keep, move_on, predict_stretch, restore

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

HUGE = 1e290
COST_OF_PASS = 64.0  # samples that the beginning and end of a pass count for, with the step that follows from it
UNBOUNDED = 1e18

# the head of ``work``: sample, sum of squares, budget in samples | phase, iteration, damping, cost (`gauss_newton`) |
# samples read in all
AT, TOTAL, BUDGET, PHASE, ITERATION, DAMPING, COST, SPENT, HEAD = range(9)


class Memory(NamedTuple):
    """Samples as a re-run reads them.

    Attributes
    ----------
    origin : ndarray of shape (n_state,)
        State before the first of them.
    u, y : ndarrays of shape (history + m, n_inputs), (history + m,)
        The first ``history`` precede the first sample, which is ``u[history]``.
    restart : ndarray of bool, shape (m,)
        Where an experiment begins.
    fill, history : int
        How many samples are read, and how many precede them.
    tail : int
        The last ``tail - 1`` samples count as far as the windows of p have used them.
    weights : ndarray of shape (fill,)
        Of each sample: the user's, and what forgetting has left of it.
    """

    origin: Array
    u: Array
    y: Array
    restart: NDArray[np.bool_]
    fill: int
    history: int
    tail: int
    weights: Array


@njit(cache=True, error_model="numpy")
def work_size(dims, n_state):
    """Length of ``work``: its head, n + n + n + n n numbers of a trial, two states, past u and y."""
    n = parameter_count(dims)
    return HEAD + n * (n + 3) + 2 * n_state + dims[0] + dims[3]


def new_work(dims, n_state):
    """Work that has not begun and has no budget."""
    return np.zeros(work_size(dims, n_state))


@njit(cache=True, error_model="numpy")
def replay_part(theta, law, kappa, memory, information, slope, state, work):
    """Go on with a `replay` until the budget is spent, for one stretch at least; True at its end.

    It begins where ``work[AT]`` is 0 and leaves the sum in ``work[TOTAL]``.  It stops between
    stretches only, whose bounds the record sets, so the sums are the same however it was divided.
    """
    dims, codes, shapes = law
    fill, tail, restarts, weights = memory.fill, memory.tail, memory.restart, memory.weights
    past = work[work.size - memory.origin.size - dims[0] - dims[3] :]
    if work[AT] == 0:
        work[BUDGET] -= COST_OF_PASS
        work[SPENT] += COST_OF_PASS
        work[TOTAL] = 0.0
        information[:] = 0.0
        slope[:] = 0.0
        begin_past(past, dims, memory.origin, memory.u, memory.y, memory.history)
    rows = empty_rows(dims, memory.u.shape[1])
    load_past(past, dims, rows)
    errors, weighted = np.empty(LENGTH), np.empty((2, LENGTH))
    handover = max(fill - tail + 1, 0)
    t = int(work[AT])
    while t < fill:
        if restarts[t]:
            forget(rows)
        if t == handover or (t > handover and restarts[t]):
            keep(rows, state)
        stop = _end_of_stretch(t, fill, handover, restarts)
        e = errors[: stop - t]
        here = memory.history + t
        load_samples(rows, memory.u[here : here + e.size], memory.y[here : here + e.size])
        predict_stretch(theta, dims, codes, shapes, kappa, rows, e)
        w, g = weighted[0, : e.size], weighted[1, : e.size]
        for i in range(e.size):
            w[i] = min((fill - t - i) / tail, 1.0) * weights[t + i]
            g[i] = w[i] * e[i]
        work[TOTAL] += dot(g, e)
        if not work[TOTAL] < HUGE:
            work[TOTAL] = np.inf
            return True
        _add_squares(rows[6], w, g, information, slope)
        move_on(rows, e.size)
        work[BUDGET] -= e.size
        work[SPENT] += e.size
        t = stop
        if work[BUDGET] <= 0.0:
            break
    work[AT] = t
    save_past(past, dims, rows)
    if t < fill:
        return False
    if handover == fill:
        keep(rows, state)
    for i in range(theta.size):
        for j in range(i):
            information[j, i] = information[i, j]
    return True


@njit(cache=True, error_model="numpy")
def _end_of_stretch(t, fill, handover, restarts):
    """Where the stretch that begins at ``t`` ends: next mark, new experiment, state to hand over."""
    stop = min((t // LENGTH + 1) * LENGTH, fill)
    if t < handover < stop:
        stop = handover
    for i in range(t + 1, stop):
        if restarts[i]:
            return i
    return stop


@njit(cache=True, error_model="numpy")
def _add_squares(psi, w, g, information, slope):
    """Add sum w psi psi', below the diagonal, and sum g psi."""
    m = w.size
    weighted = np.empty(m)
    for i in range(slope.size):
        row = psi[i, :m]
        slope[i] += dot(g, row)
        for k in range(m):
            weighted[k] = w[k] * row[k]
        for j in range(i + 1):
            information[i, j] += dot(weighted, psi[j, :m])


@njit(cache=True, error_model="numpy")
def begin_past(past, dims, origin, memory_u, memory_y, history):
    """The state, u and y before the memory's first sample."""
    m, u0, y0 = memory_u.shape[1], origin.size, origin.size + dims[0]
    past[:u0] = origin
    for i in range(dims[0]):
        past[u0 + i] = memory_u[history - 1 - i // m, i % m]
    for i in range(dims[3]):
        past[y0 + i] = memory_y[history - 1 - i]


@njit(cache=True, error_model="numpy")
def load_past(past, dims, rows):
    """Put state, u and y where a stretch finds its past."""
    u, y = rows[0], rows[5]
    m, y0 = u.shape[0], past.size - dims[3]
    u0 = y0 - dims[0]
    restore(rows, past[:u0])
    for i in range(dims[0]):
        u[i % m, dims[0] // m - 1 - i // m] = past[u0 + i]
    for i in range(dims[3]):
        y[dims[3] - 1 - i] = past[y0 + i]


@njit(cache=True, error_model="numpy")
def save_past(past, dims, rows):
    """The reverse of `load_past`."""
    u, y = rows[0], rows[5]
    m, y0 = u.shape[0], past.size - dims[3]
    u0 = y0 - dims[0]
    keep(rows, past[:u0])
    for i in range(dims[0]):
        past[u0 + i] = u[i % m, dims[0] // m - 1 - i // m]
    for i in range(dims[3]):
        past[y0 + i] = y[dims[3] - 1 - i]


@njit(cache=True, error_model="numpy")
def load_samples(rows, new_u, new_y):
    """Put new samples behind the past of u and y."""
    u, y = rows[0], rows[5]
    u0, y0 = u.shape[1] - LENGTH, y.size - LENGTH
    for i in range(new_y.size):
        y[y0 + i] = new_y[i]
        for j in range(u.shape[0]):
            u[j, u0 + i] = new_u[i, j]


@njit(cache=True, error_model="numpy")
def replay(theta, law, kappa, memory, information, slope, state):
    """Weighted sum of squared innovations of the memory, its Gauss-Newton matrix and slope.

    ``law`` is (dims, codes, shapes).  ``state`` receives what holds before the first sample of the next window.
    """
    work = np.zeros(work_size(law[0], memory.origin.size))
    work[BUDGET] = UNBOUNDED
    replay_part(theta, law, kappa, memory, information, slope, state, work)
    return work[TOTAL]
