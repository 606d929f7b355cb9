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
from numpy.typing import NDArray

from whsklearn._numba import njit, part
from whsklearn.recursion.memory.cost import (
    AT,
    COST,
    DAMPING,
    HUGE,
    ITERATION,
    PHASE,
    TOTAL,
    Memory,
    Work,
    replay_part,
)
from whsklearn.recursion.memory.predictor_block import Segment
from whsklearn.recursion.rows.predictor import Law
from whsklearn.systems.stability import is_stable

Array = NDArray[np.float64]

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


@njit(error_model="numpy")
def _refine_part(theta, law, kappa, memory, prior, iterations, information, state, work):
    memory, prior, work = Memory(*memory), Prior(*prior), Work(work[0], Segment(*work[1]), *work[2:])
    n, at, trial = theta.size, work.at, work.trial
    na, nb = law[0][0], law[0][1]
    while at[PHASE] != DONE:
        if at[PHASE] == PROPOSAL:
            at[AT] = 0
            at[TOTAL] = np.inf
            if at[ITERATION] == iterations:
                at[PHASE] = DONE
                break
            at[ITERATION] += 1
            solved = solve_damped(information, work.slope, at[DAMPING], trial)
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
        matrix = information if first else work.trial_information
        slope = work.slope if first else work.trial_slope
        end = state if first else work.trial_state
        if not replay_part(where, law, kappa, memory, work, matrix, slope, end):
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
                work.slope[i] = slope[i]
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
    n = theta.size
    cost = 0.0
    for i in range(n):
        pull = 0.0
        for j in range(n):
            pull += prior.information[i, j] * (theta[j] - prior.theta[j])
            information[i, j] += prior.information[i, j]
        slope[i] -= pull
        cost += pull * (theta[i] - prior.theta[i])
    return cost


@part
def solve_damped(matrix, right, damping, solution):
    """Solve (A + damping diag A) s = r by Cholesky; return False if A is not positive definite."""
    n = right.size
    low = np.empty((n, n))
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
