"""Whole re-runs of a memory, without a budget."""

from __future__ import annotations

import numpy as np

from whsklearn.recursion.memory.gauss_newton import BUDGET, COST, UNBOUNDED, Prior, new_work, refine_part


def replay(theta, law, kappa, memory, information, slope, state):
    """The weighted sum of squares; its Gauss-Newton matrix, slope and last state in place."""
    work, n = new_work(law[0], memory.u.shape[1]), theta.size
    work.at[BUDGET] = UNBOUNDED
    nothing = Prior(theta, np.zeros((n, n)))
    assert refine_part(theta, law, kappa, memory, nothing, 0, information, state, work)
    slope[:] = work.slope
    return np.float64(work.at[COST])


def refine(theta, law, kappa, memory, prior, iterations, information, state):
    """The cost that Levenberg-Marquardt reaches."""
    work = new_work(law[0], memory.u.shape[1])
    work.at[BUDGET] = UNBOUNDED
    assert refine_part(theta, law, kappa, memory, prior, iterations, information, state, work)
    return np.float64(work.at[COST])
