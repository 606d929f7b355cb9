"""Gauss-Newton over the samples kept in memory: a window re-run at full length.

A recursion keeps the information of early samples linearised where the parameters were
then.  Re-running the stored samples with the newest parameters puts it right, as the
window of p samples does for the newest ones.  What lies before the memory enters as a
Gaussian prior (theta_0, information), as in moving-horizon estimation (Rao, Rawlings,
Mayne 2003, IEEE TAC 48(2)).

Like a re-run itself (`replay`) it can be done in parts, so that no sample has to wait for it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from whsklearn._numba import njit
from whsklearn.recursion.memory_cost import (
    AT,
    BUDGET,
    COST,
    DAMPING,
    HEAD,
    HUGE,
    ITERATION,
    PHASE,
    TOTAL,
    UNBOUNDED,
    replay_part,
    work_size,
)
from whsklearn.systems.stability import is_stable

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

FIRST_RUN, PROPOSAL, TRIAL, DONE = range(4)


class Prior(NamedTuple):
    """What lies before the memory: mean of shape (n,) and information of shape (n, n)."""

    theta: Array
    information: Array


@njit(cache=True, error_model="numpy")
def refine_part(theta, law, kappa, memory, prior, iterations, information, state, work):
    """Go on with a `refine` as far as the budget allows; True at its end, with ``work[COST]`` reached.

    It begins where ``work[PHASE]`` and ``work[AT]`` are 0.
    """
    n = theta.size
    na, nb = law[0][0], law[0][1]
    slope = work[HEAD : HEAD + n]
    trial = work[HEAD + n : HEAD + 2 * n]
    slope_t = work[HEAD + 2 * n : HEAD + 3 * n]
    information_t = work[HEAD + 3 * n : HEAD + 3 * n + n * n].reshape(n, n)
    state_t = work[HEAD + 3 * n + n * n : HEAD + 3 * n + n * n + state.size]
    while work[PHASE] != DONE:
        if work[PHASE] == PROPOSAL:
            work[AT] = 0
            work[TOTAL] = np.inf
            if work[ITERATION] == iterations:
                work[PHASE] = DONE
                break
            work[ITERATION] += 1
            solved = solve_damped(information, slope, work[DAMPING], trial)
            for i in range(n):
                trial[i] += theta[i]
            if solved and is_stable(trial[na - 1 : na - 1 + nb], 0.999):
                work[PHASE] = TRIAL
            else:
                _judge(work, np.inf)
            continue
        # one call for both kinds of run: the compiler would write the whole re-run out twice, and take twice as long
        first = work[PHASE] == FIRST_RUN
        at = theta if first else trial
        information_at = information if first else information_t
        slope_at = slope if first else slope_t
        if not replay_part(at, law, kappa, memory, information_at, slope_at, state if first else state_t, work):
            return False
        cost = work[TOTAL] + _add_prior(at, prior, information_at, slope_at)
        if first:
            work[COST] = cost
            work[DAMPING] = 1e-3
            work[ITERATION] = 0
            work[PHASE] = PROPOSAL
            if not cost < HUGE:
                work[COST] = np.inf
                work[PHASE] = DONE
        elif _judge(work, cost):
            theta[:] = trial
            slope[:] = slope_t
            information[:] = information_t
            state[:] = state_t
    return True


@njit(cache=True, error_model="numpy")
def _judge(work, cost):
    """Whether a trial is taken; sets damping and phase, which is the end where it gains next to nothing."""
    work[PHASE] = PROPOSAL
    if cost < work[COST]:
        if 1.0 - cost / work[COST] < 1e-6:
            work[PHASE] = DONE
        work[COST] = cost
        work[DAMPING] = max(work[DAMPING] * 0.1, 1e-9)
        return True
    work[DAMPING] *= 10.0
    if work[DAMPING] > 1e6:
        work[PHASE] = DONE
    return False


@njit(cache=True, error_model="numpy")
def refine(theta, law, kappa, memory, prior, iterations, information, state):
    """Levenberg-Marquardt steps (Marquardt 1963) on ``theta`` in place; returns the cost reached."""
    work = np.zeros(work_size(law[0], memory.origin.size))
    work[BUDGET] = UNBOUNDED
    refine_part(theta, law, kappa, memory, prior, iterations, information, state, work)
    return work[COST]


@njit(cache=True, error_model="numpy")
def _add_prior(theta, prior, information, slope):
    """Add the prior's part to the Gauss-Newton matrix and slope; returns its part of the cost."""
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


@njit(cache=True, error_model="numpy")
def solve_damped(matrix, right, damping, solution):
    """Solve (A + damping diag A) s = r by Cholesky; False where A is not positive definite."""
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
