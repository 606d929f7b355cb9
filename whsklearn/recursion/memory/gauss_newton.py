"""Gauss-Newton over the samples in memory: the window re-run, extended to the whole memory.

A recursion keeps the information of early samples linearised at the parameters of that
time.  Re-running the stored samples with the newest parameters corrects this, as the
window of p samples does for the newest ones.  The samples before the memory enter as a
Gaussian prior (theta_0, information), as in moving-horizon estimation (Rao, Rawlings,
Mayne 2003, IEEE TAC 48(2)).

Like a re-run itself (`replay_part`), it can be done in parts, so that no sample has to wait for it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from whsklearn._numba import njit, part
from whsklearn.effects.base import Array, Bools, Integers
from whsklearn.recursion.memory.predictor_block import (
    LENGTH,
    Segment,
    along,
    begin,
    dot,
    forget,
    keep,
    move_on,
    new_segment,
    predict_segment,
)
from whsklearn.recursion.rows.predictor import Law, parameter_count, state_size
from whsklearn.systems.stability import is_stable

# --- re-run the samples in memory with given parameters: squared errors and their Gauss-Newton matrix ---------------
# A re-run of thousands of samples may take longer than a control loop can wait, so it can be done in
# parts.  `Work` holds its progress and the number of samples that it may still read.

HUGE = 1e290
COST_OF_PASS = 64.0  # the start and end of a pass, and the step that follows, count as this many samples
UNBOUNDED = 1e18

# entries of ``Work.at``: sample, sum of squares, budget in samples | phase, iteration, damping, cost of `refine_part` |
# samples read in all
AT, TOTAL, BUDGET, PHASE, ITERATION, DAMPING, COST, SPENT, SIZE = range(9)


class Memory(NamedTuple):
    """Samples as a re-run reads them."""

    origin: Array  # (n_state,): state before the first sample
    # u, y (history + m, n_inputs), (history + m,): the first ``history`` precede the first sample, which is
    # ``u[history]``
    u: Array
    y: Array
    restart: Bools  # (m,): where an experiment begins
    fill: int  # fill, history: the number of samples to read, and the number that precede them
    history: int
    tail: int  # the last ``tail - 1`` samples count only in part, as far as the windows of p samples have used them
    weights: Array  # (fill,): weight of each sample: the user's, reduced by forgetting


class Work(NamedTuple):
    """The progress of a re-run."""

    at: Array  # (SIZE,): the numbers named above
    segment: Segment  # signals of the samples that are being read, preceded by those before them
    weighted: Array  # (3, LENGTH): weights, weighted errors, and a weighted row of psi
    slope: Array  # slope, trial, trial_slope (n,)
    trial: Array
    trial_slope: Array
    trial_information: Array  # (n, n)
    trial_state: Array  # (n_state,)


def new_work(dims: Integers, n_inputs: int, segment: Segment | None = None) -> Work:
    """Work that has not started and has no budget; a row that cannot wait has its ``segment`` made before."""
    n = int(parameter_count(dims))
    slopes = np.zeros(n), np.zeros(n), np.zeros(n)
    end, segment = np.zeros(int(state_size(dims))), segment or new_segment(dims, n_inputs)
    return Work(np.zeros(SIZE), segment, np.zeros((3, LENGTH)), *slopes, np.zeros((n, n)), end)


@part
def replay_part(theta, law, kappa, memory, work, information, slope, state):
    """Continue a re-run until the budget is spent, for at least one segment; return True when it has finished.

    ``work``: ``at``, ``segment`` and ``weighted`` of `Work`; passing on more of it doubles the code to be compiled.

    It starts over if ``at[AT]`` is 0.  The weighted sum of squares is then in ``at[TOTAL]``, next to its
    Gauss-Newton matrix and slope, and ``state`` is the state before the first sample of the next window.  It stops only
    between segments, whose bounds depend on the record alone, so the sums do not depend on how the work was divided.

    It is inlined into its only caller; compiling it separately as well would take twice as long.
    """
    at, segment, weighted = work
    signals, psi, _, places = segment
    origin, u, y, restarts, fill, history, tail, weights = memory
    m, n = u.shape[1], theta.size
    past = signals.shape[1] - LENGTH
    if at[AT] == 0:
        at[BUDGET] -= COST_OF_PASS
        at[SPENT] += COST_OF_PASS
        at[TOTAL] = 0.0
        for i in range(n):
            slope[i] = 0.0
            for j in range(n):
                information[i, j] = 0.0
        begin(signals, places, origin, u, y, history)
    handover = max(fill - tail + 1, 0)
    t = int(at[AT])
    while t < fill:
        if restarts[t]:
            forget(signals)
        if t == handover or (t > handover and restarts[t]):
            keep(signals, places, state)
        count = _end_of_segment(t, fill, handover, restarts) - t
        for i in range(count):
            signals[signals.shape[0] - 1, past + i] = y[history + t + i]
            for j in range(m):
                signals[j, past + i] = u[history + t + i, j]
        predict_segment(theta, law, kappa, m, segment, count)
        at[TOTAL] += _add_squares(t, count, fill, tail, weights, psi, weighted, information, slope)
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
def _add_squares(t, count, fill, tail, weights, psi, weighted, information, slope):
    """Add sum w psi psi', below the diagonal, and sum w e psi; return sum w e^2."""
    w, g, row_weighted = along(weighted, 0, count), along(weighted, 1, count), along(weighted, 2, count)
    e = along(psi, slope.size, count)
    for i in range(count):
        w[i] = min((fill - t - i) / tail, 1.0) * weights[t + i]
        g[i] = w[i] * e[i]
    for i in range(slope.size):
        row = along(psi, i, count)
        slope[i] += dot(g, row)
        for k in range(count):
            row_weighted[k] = w[k] * row[k]
        for j in range(i + 1):
            information[i, j] += dot(row_weighted, along(psi, j, count))
    return dot(g, e)


FIRST_RUN, PROPOSAL, TRIAL, DONE = range(4)


class Prior(NamedTuple):
    """Summary of the samples before the memory: mean of shape (n,) and information of shape (n, n)."""

    theta: Array
    information: Array


def refine_part(
    theta: Array, law: Law, kappa: float, memory: Memory, prior: Prior, iterations: int, information: Array,
    state: Array, work: Work,
) -> bool:  # fmt: skip
    """Continue Levenberg-Marquardt steps (Marquardt 1963) on ``theta``, in place, as far as the budget allows.

    It starts over if ``work.at[PHASE]`` and ``work.at[AT]`` are 0.  It returns True when it has finished; then
    ``work.at[COST]``, the Gauss-Newton matrix, the slope (``work.slope``) and the state are those of the result.
    """
    # Plain tuples: Numba takes twice as long to unpack named ones, and that call cost as much as reading 150 samples.
    plain = (work.at, tuple(work.segment), *work[2:])
    return bool(_refine_part(theta, law, kappa, tuple(memory), tuple(prior), iterations, information, state, plain))


@njit(error_model="numpy", counted=False)
def _refine_part(theta, law, kappa, memory, prior, iterations, information, state, work):
    at, segment, weighted, climb, trial, trial_slope, trial_information, trial_state = work
    n, na, nb = theta.size, law[0][0], law[0][1]
    while at[PHASE] != DONE:
        if at[PHASE] == PROPOSAL:
            at[AT] = 0
            at[TOTAL] = np.inf
            if at[ITERATION] == iterations:
                at[PHASE] = DONE
                break
            at[ITERATION] += 1
            solved = solve_damped(information, climb, at[DAMPING], trial, trial_information)
            for i in range(n):
                trial[i] += theta[i]
            if solved and is_stable(trial[na - 1 : na - 1 + nb], 0.999):
                at[PHASE] = TRIAL
            else:
                _judge(at, np.inf)
            continue
        # one call for both kinds of run; with two, the re-run would be inlined twice and take twice as long to compile
        first = at[PHASE] == FIRST_RUN
        where = theta if first else trial
        matrix = information if first else trial_information
        slope = climb if first else trial_slope
        end = state if first else trial_state
        if not replay_part(where, law, kappa, memory, (at, segment, weighted), matrix, slope, end):
            return False
        cost = at[TOTAL] + _add_prior(where, prior, matrix, slope)
        if first:
            at[COST] = cost
            at[DAMPING] = 1e-3
            at[ITERATION] = 0
            at[PHASE] = PROPOSAL
            if not cost < HUGE:
                at[COST] = np.inf
                at[PHASE] = DONE
        elif _judge(at, cost):
            for i in range(n):
                theta[i] = trial[i]
                climb[i] = slope[i]
                for j in range(n):
                    information[i, j] = matrix[i, j]
            for i in range(state.size):
                state[i] = end[i]
    return True


@part
def _judge(at, cost):
    """Decide whether to accept a trial; set the damping and the next phase, which is the end if the gain is small."""
    at[PHASE] = PROPOSAL
    if cost < at[COST]:
        if 1.0 - cost / at[COST] < 1e-6:
            at[PHASE] = DONE
        at[COST] = cost
        at[DAMPING] = max(at[DAMPING] * 0.1, 1e-9)
        return True
    at[DAMPING] *= 10.0
    if at[DAMPING] > 1e6:
        at[PHASE] = DONE
    return False


@part
def _add_prior(theta, prior, information, slope):
    """Add the prior's part to the Gauss-Newton matrix and slope; return its part of the cost."""
    mean, known = prior
    n = theta.size
    cost = 0.0
    for i in range(n):
        pull = 0.0
        for j in range(n):
            pull += known[i, j] * (theta[j] - mean[j])
            information[i, j] += known[i, j]
        slope[i] -= pull
        cost += pull * (theta[i] - mean[i])
    return cost


@part
def solve_damped(matrix, right, damping, solution, low):
    """Solve (A + damping diag A) s = r by Cholesky, into ``low``; return False if A is not positive definite."""
    n = right.size
    for i in range(n):
        for j in range(i + 1):
            s = matrix[i, j]
            if i == j:
                s += damping * s
            for k in range(j):
                s -= low[i, k] * low[j, k]
            if i == j:
                if not s > 1e-14 * matrix[i, i]:
                    return False
                low[i, i] = np.sqrt(s)
            else:
                low[i, j] = s / low[j, j]
    for i in range(n):
        s = right[i]
        for k in range(i):
            s -= low[i, k] * solution[k]
        solution[i] = s / low[i, i]
    for i in range(n - 1, -1, -1):
        s = solution[i]
        for k in range(i + 1, n):
            s -= low[k, i] * solution[k]
        solution[i] = s / low[i, i]
    return True
