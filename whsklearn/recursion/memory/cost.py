"""Re-run the samples in memory with given parameters: squared errors and their Gauss-Newton matrix.

A re-run of thousands of samples may take longer than a control loop can wait, so it can be done in
parts.  `Work` holds its progress and the number of samples that it may still read.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from whsklearn._numba import part
from whsklearn.recursion.memory.predictor_block import (
    LENGTH,
    Segment,
    begin,
    dot,
    forget,
    keep,
    move_on,
    new_segment,
    predict_segment,
)
from whsklearn.recursion.rows.predictor import parameter_count, state_size

Array = NDArray[np.float64]

HUGE = 1e290
COST_OF_PASS = 64.0  # the start and end of a pass, and the step that follows, count as this many samples
UNBOUNDED = 1e18

# entries of ``Work.at``: sample, sum of squares, budget in samples | phase, iteration, damping, cost (`gauss_newton`) |
# samples read in all
AT, TOTAL, BUDGET, PHASE, ITERATION, DAMPING, COST, SPENT, SIZE = range(9)


class Memory(NamedTuple):
    """Samples as a re-run reads them.

    Attributes
    ----------
    origin : ndarray of shape (n_state,)
        State before the first sample.
    u, y : ndarrays of shape (history + m, n_inputs), (history + m,)
        The first ``history`` precede the first sample, which is ``u[history]``.
    restart : ndarray of bool, shape (m,)
        Where an experiment begins.
    fill, history : int
        The number of samples to read, and the number that precede them.
    tail : int
        The last ``tail - 1`` samples count only in part, as far as the windows of p samples have used them.
    weights : ndarray of shape (fill,)
        Weight of each sample: the user's, reduced by forgetting.
    """

    origin: Array
    u: Array
    y: Array
    restart: NDArray[np.bool_]
    fill: int
    history: int
    tail: int
    weights: Array


class Work(NamedTuple):
    """The progress of a re-run.

    Attributes
    ----------
    at : ndarray of shape (SIZE,)
        The numbers named above.
    segment : Segment
        Signals of the samples that are being read, preceded by those before them.
    weighted : ndarray of shape (3, LENGTH)
        Weights, weighted errors, and a weighted row of psi.
    slope, trial, trial_slope : ndarrays of shape (n,)
    trial_information : ndarray of shape (n, n)
    trial_state : ndarray of shape (n_state,)
    """

    at: Array
    segment: Segment
    weighted: Array
    slope: Array
    trial: Array
    trial_slope: Array
    trial_information: Array
    trial_state: Array


def new_work(dims: NDArray[np.int64], n_inputs: int) -> Work:
    """Work that has not started and has no budget."""
    n = int(parameter_count(dims))
    slopes = np.zeros(n), np.zeros(n), np.zeros(n)
    return Work(
        np.zeros(SIZE), new_segment(dims, n_inputs), np.zeros((3, LENGTH)), *slopes, np.zeros((n, n)),
        np.zeros(int(state_size(dims))),
    )  # fmt: skip


@part
def replay_part(theta, law, kappa, memory, work, information, slope, state):
    """Continue a re-run until the budget is spent, for at least one segment; return True when it has finished.

    It starts over if ``work.at[AT]`` is 0.  The weighted sum of squares is then in ``work.at[TOTAL]``, next to its
    Gauss-Newton matrix and slope, and ``state`` is the state before the first sample of the next window.  It stops only
    between segments, whose bounds depend on the record alone, so the sums do not depend on how the work was divided.

    It is inlined into its only caller; compiling it separately as well would take twice as long.
    """
    at, signals, psi, places = work.at, work.segment.signals, work.segment.psi, work.segment.places
    fill, tail, restarts = memory.fill, memory.tail, memory.restart
    m, n = memory.u.shape[1], theta.size
    past = signals.shape[1] - LENGTH
    if at[AT] == 0:
        at[BUDGET] -= COST_OF_PASS
        at[SPENT] += COST_OF_PASS
        at[TOTAL] = 0.0
        for i in range(n):
            slope[i] = 0.0
            for j in range(n):
                information[i, j] = 0.0
        begin(signals, places, memory.origin, memory.u, memory.y, memory.history)
    handover = max(fill - tail + 1, 0)
    t = int(at[AT])
    while t < fill:
        if restarts[t]:
            forget(signals)
        if t == handover or (t > handover and restarts[t]):
            keep(signals, places, state)
        count = _end_of_segment(t, fill, handover, restarts) - t
        for i in range(count):
            signals[signals.shape[0] - 1, past + i] = memory.y[memory.history + t + i]
            for j in range(m):
                signals[j, past + i] = memory.u[memory.history + t + i, j]
        predict_segment(theta, law, kappa, m, work.segment, count)
        at[TOTAL] += _add_squares(t, count, memory, psi, work.weighted, information, slope)
        if not at[TOTAL] < HUGE:
            at[TOTAL] = np.inf
            return True
        move_on(signals, count)
        at[BUDGET] -= count
        at[SPENT] += count
        t += count
        if at[BUDGET] <= 0.0:
            break
    at[AT] = t
    if t < fill:
        return False
    if handover == fill:
        keep(signals, places, state)
    for i in range(n):
        for j in range(i):
            information[j, i] = information[i, j]
    return True


@part
def _end_of_segment(t, fill, handover, restarts):
    """End of the segment that begins at ``t``: the next mark, a new experiment, or the state to hand over."""
    stop = min((t // LENGTH + 1) * LENGTH, fill)
    if t < handover < stop:
        stop = handover
    for i in range(t + 1, stop):
        if restarts[i]:
            return i
    return stop


@part
def _add_squares(t, count, memory, psi, weighted, information, slope):
    """Add sum w psi psi', below the diagonal, and sum w e psi; return sum w e^2."""
    w, g, row_weighted = weighted[0, :count], weighted[1, :count], weighted[2, :count]
    e = psi[slope.size, :count]
    for i in range(count):
        w[i] = min((memory.fill - t - i) / memory.tail, 1.0) * memory.weights[t + i]
        g[i] = w[i] * e[i]
    for i in range(slope.size):
        row = psi[i, :count]
        slope[i] += dot(g, row)
        for k in range(count):
            row_weighted[k] = w[k] * row[k]
        for j in range(i + 1):
            information[i, j] += dot(row_weighted, psi[j, :count])
    return dot(g, e)
