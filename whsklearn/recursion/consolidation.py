"""Gauss-Newton over the samples kept in memory: a window re-run at full length.

A recursion keeps the information of early samples linearised where the parameters were
then.  Re-running the stored samples with the newest parameters puts it right, as the
window of p samples does for the newest ones.  What lies before the memory enters as a
Gaussian prior (theta_0, information), as in moving-horizon estimation (Rao, Rawlings,
Mayne 2003, IEEE TAC 48(2)).
"""

from __future__ import annotations

import numpy as np
from numba import njit

from whsklearn._delay_line import push
from whsklearn.recursion.predictor import advance, predict
from whsklearn.systems.stability import is_stable

HUGE = 1e290


@njit(cache=True, error_model="numpy")
def replay(
    theta, dims, codes, shapes, kappa, origin, memory_u, memory_y, restarts, fill, history, tail, forgetting,
    information, slope, state,
):  # fmt: skip
    """Weighted sum of squared innovations of the memory, its Gauss-Newton matrix and slope.

    ``memory_u[:history]`` precede the first sample, which is ``memory_u[history]``.  The
    last ``tail - 1`` samples count as far as the windows of p have used them.  ``state``
    receives what holds before the first sample of the next window.
    """
    n = theta.size
    na, nd = dims[0], dims[3]
    psi = np.empty(n)
    information[:] = 0.0
    slope[:] = 0.0
    state[:] = origin
    now = origin.copy()
    u_past = np.zeros(na)
    y_past = np.zeros(max(nd, 1))
    m = memory_u.shape[1]
    for i in range(na):
        u_past[i] = memory_u[history - 1 - i // m, i % m]
    for i in range(nd):
        y_past[i] = memory_y[history - 1 - i]
    total = 0.0
    for t in range(fill):
        if restarts[t]:
            now[:] = 0.0
            u_past[:] = 0.0
            y_past[:] = 0.0
        age = fill - 1 - t
        if t == 0 or restarts[t]:
            state[:] = now
        weight = 1.0 if age >= tail - 1 else (age + 1.0) / tail
        if forgetting != 1.0:
            weight *= forgetting**age
        e = memory_y[history + t] - predict(theta, dims, now, y_past, 0, psi)
        total += weight * e * e
        if not total < HUGE:
            return np.inf
        for i in range(n):
            g = weight * psi[i]
            slope[i] += g * e
            for j in range(i + 1):
                information[i, j] += g * psi[j]
        advance(theta, dims, codes, shapes, kappa, now, u_past, 0)
        if age == tail - 1:  # the later ones belong to the next window
            state[:] = now
        push(u_past, memory_u[history + t])
        for i in range(nd - 1, 0, -1):
            y_past[i] = y_past[i - 1]
        y_past[0] = memory_y[history + t]
    for i in range(n):
        for j in range(i):
            information[j, i] = information[i, j]
    return total


@njit(cache=True, error_model="numpy")
def refine(
    theta, dims, codes, shapes, kappa, origin, memory_u, memory_y, restarts, fill, history, tail, forgetting,
    prior_theta, prior_information, iterations, information, state,
):  # fmt: skip
    """Levenberg-Marquardt steps (Marquardt 1963) on ``theta`` in place; returns the cost reached."""
    n = theta.size
    na, nb = dims[0], dims[1]
    slope = np.empty(n)
    trial = np.empty(n)
    slope_t = np.empty(n)
    information_t = np.empty((n, n))
    state_t = np.empty(state.size)
    damping = 1e-3
    cost = replay(
        theta, dims, codes, shapes, kappa, origin, memory_u, memory_y, restarts, fill, history, tail, forgetting,
        information, slope, state,
    )  # fmt: skip
    cost += _add_prior(theta, prior_theta, prior_information, information, slope)
    if not cost < HUGE:
        return np.inf
    for _ in range(iterations):
        solved = solve_damped(information, slope, damping, trial)
        for i in range(n):
            trial[i] += theta[i]
        cost_t = np.inf
        if solved and is_stable(trial[na - 1 : na - 1 + nb], 0.999):
            cost_t = replay(
                trial, dims, codes, shapes, kappa, origin, memory_u, memory_y, restarts, fill, history, tail,
                forgetting, information_t, slope_t, state_t,
            )  # fmt: skip
            cost_t += _add_prior(trial, prior_theta, prior_information, information_t, slope_t)
        if cost_t < cost:
            gain = 1.0 - cost_t / cost
            theta[:] = trial
            cost = cost_t
            slope[:] = slope_t
            information[:] = information_t
            state[:] = state_t
            damping = max(damping * 0.1, 1e-9)
            if gain < 1e-6:
                break
        else:
            damping *= 10.0
            if damping > 1e6:
                break
    return cost


@njit(cache=True, error_model="numpy")
def _add_prior(theta, prior_theta, prior_information, information, slope):
    """Add the prior's part to the Gauss-Newton matrix and slope; returns its part of the cost."""
    n = theta.size
    cost = 0.0
    for i in range(n):
        pull = 0.0
        for j in range(n):
            pull += prior_information[i, j] * (theta[j] - prior_theta[j])
            information[i, j] += prior_information[i, j]
        slope[i] -= pull
        cost += pull * (theta[i] - prior_theta[i])
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
