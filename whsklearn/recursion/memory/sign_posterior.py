"""Posterior of the parameters of a law that jumps with sign(dx), over the few signs in doubt.

The likelihood is a staircase in (a, b), with a step wherever a sign flips, so neither its mode nor a
Gaussian around the mode describes it.  (a, b) is therefore sampled, with the other parameters projected
out (`sign_density`), by tempered sequential Monte Carlo (Del Moral, Doucet, Jasra 2006, JRSS B 68(3))
with differential-evolution moves (ter Braak 2006, Statistics and Computing 16).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from whsklearn._numba import njit, part
from whsklearn.recursion.memory.sign_density import SignProblem, by_reach, log_density
from whsklearn.recursion.rows.covariance import factors_of_inverse, times

Array = NDArray[np.float64]

PARTICLES = 96
WIDTH = 2.0  # spread of the first particles, in standard deviations with the signs frozen
SWEEPS = 12  # moves of each particle at each temperature; with three, one of 100 streams stayed in a worse mode
FINAL_SWEEPS = 60  # moves at the last temperature; the mean and the covariance are taken over all of them
ROUGH_SWEEPS, ROUGH_FINAL_SWEEPS = 4, 8  # the same if only the location is needed
MOST_TEMPERATURES = 30  # if the posterior is not reached by then, sampling is abandoned
STRIDES = (0.9, 0.4, 0.15)  # length of the moves, as multiples of the difference of two particles
NONE = -1e300  # log density of a particle that has none, because its L1 is unstable


class Gaussian(NamedTuple):
    """Mean and covariance of the parameters."""

    mean: Array
    covariance: Array


def frozen(matrix: Array, theta: Array, count: float) -> Gaussian | None:
    """Least squares with the signs as they are; None if the noise variance is not known yet."""
    n = theta.size
    # uses kernels that the re-run has already called; LAPACK, which no other piece of a page uses, took 70 us to start
    ud = factors_of_inverse(np.ascontiguousarray(matrix[:n, :n]))
    inverse = np.array([times(ud, row) for row in np.eye(n)])
    step = inverse @ matrix[:n, n]
    squares = max(matrix[n, n] - step @ matrix[:n, n], 1e-14 * matrix[n, n])
    if count <= n or not squares > 0.0 or not np.isfinite(step).all():
        return None
    return Gaussian(theta + step, squares / (count - n) * inverse)


def sample(problem: SignProblem, start: Gaussian, rng: np.random.Generator, *, rough: bool = False) -> Gaussian | None:
    """Mean and covariance over the signs in doubt; None if the particles did not reach the posterior.

    Parameters
    ----------
    problem : SignProblem
    start : Gaussian
        As returned by `frozen`.
    rng : numpy.random.Generator
    rough : bool, default=False
        Use fewer sweeps, for a mean that only serves as the next starting point.
    """
    n1 = problem.gradient.shape[1]
    if not n1 or not problem.dx.size:
        return start
    spread = WIDTH**2 * start.covariance[:n1, :n1]
    try:
        root = np.linalg.cholesky(spread + 1e-12 * np.diag(np.diag(spread)))
        precision = np.asarray(np.linalg.inv(spread), dtype=np.float64)
        problem = by_reach(problem, spread)
    except np.linalg.LinAlgError:  # all particles of the previous round were in one plane
        return None
    centre = start.mean[:n1] - problem.theta[:n1]
    first = centre + rng.standard_normal((PARTICLES, n1)) @ root.T
    swarm = new_swarm(first, problem)
    sweeps = (ROUGH_SWEEPS, ROUGH_FINAL_SWEEPS) if rough else (SWEEPS, FINAL_SWEEPS)
    final = tempered(problem, swarm, centre, precision, rng, sweeps)
    if final is None or not (swarm.numbers[:, 0] > NONE).all():
        return None
    mean, covariance = final
    covariance[n1:, n1:] += rest_covariance(problem, swarm)
    if not np.isfinite(covariance).all():
        return None
    return Gaussian(problem.theta + mean, covariance)


class Swarm(NamedTuple):
    """Particles, one entry each, and scratch space.

    Attributes
    ----------
    delta : ndarray of shape (S, n)
        phi of each particle and the best other parameters for it, relative to theta_0.
    numbers : ndarray of shape (S, 3)
        log p(phi), the sum of squares S, and the log density of the first particles.
    low : ndarray of shape (S, n_r, n_r)
        Cholesky factor of H.
    matrix, change, touched
        Scratch space of `turn`.
    """

    delta: Array
    numbers: Array
    low: Array
    matrix: Array
    change: Array
    touched: NDArray[np.int64]


def new_swarm(first: Array, p: SignProblem) -> Swarm:
    """Particles at ``first`` whose densities have not been computed yet."""
    count, n1 = first.shape
    n, rows = p.theta.size, p.rows.shape[0]
    delta, numbers = np.zeros((count, n)), np.zeros((count, 3))
    delta[:, :n1] = first
    numbers[:, 0] = -np.inf
    scratch = np.empty((n + 1, n + 1)), np.zeros((rows, n + 1)), np.empty(rows, dtype=np.int64)
    return Swarm(delta, numbers, np.zeros((count, n - n1, n - n1)), *scratch)


def tempered(
    problem: SignProblem,
    swarm: Swarm,
    centre: Array,
    precision: Array,
    rng: np.random.Generator,
    sweeps: tuple[int, int],
) -> tuple[Array, Array] | None:
    """Temper and move the particles, in place; return mean and covariance over the last sweeps, or None on failure."""
    move(problem, swarm, centre, precision, np.zeros((PARTICLES, 4)), 0.0, -1)
    swarm.numbers[swarm.numbers[:, 0] == -np.inf, 0] = NONE
    each, last = sweeps
    beta, weight, parent, kept = 0.0, np.empty(PARTICLES), np.empty(PARTICLES, dtype=np.int64), []
    for _ in range(MOST_TEMPERATURES):
        beta = next_temperature(beta, swarm.numbers[:, 0] - swarm.numbers[:, 2], weight)
        resample(weight, rng.random(), parent)
        for values in swarm[:3]:
            values[:] = values[parent]
        for sweep in range(each if beta < 1.0 else each + last):
            move(problem, swarm, centre, precision, rng.random((PARTICLES, 4)), beta, sweep)
            if sweep >= each:
                kept.append(swarm.delta.copy())
        if beta == 1.0:
            everyone = np.concatenate(kept)
            with np.errstate(over="ignore", invalid="ignore"):  # particles may have diverged; the caller checks
                mean = everyone.mean(axis=0)
                return mean, (everyone - mean).T @ (everyone - mean) / len(everyone)
    return None


def rest_covariance(problem: SignProblem, swarm: Swarm) -> Array:
    """Covariance of r given phi: the mean of sigma^2 H^-1 over the particles."""
    half = np.linalg.inv(swarm.low)
    variance = swarm.numbers[:, 1] / (max(problem.count - problem.theta.size, 1.0) * len(half))
    return np.einsum("s,ski,skj->ij", variance, half, half)


def next_temperature(beta: float, gain: Array, weight: Array) -> float:
    """The next beta, at which half of the particles still count; ``weight`` receives their weights."""
    low, high = 0.0, 1.0 - beta
    step = high
    for _ in range(40):
        np.exp(step * (gain - gain.max()), out=weight)
        if weight.sum() ** 2 >= 0.5 * gain.size * (weight @ weight):
            if step == 1.0 - beta or high - low < 1e-3 * high:
                break
            low = step
        else:
            high = step
        step = 0.5 * (low + high)
    return 1.0 if step == 1.0 - beta else beta + step


def resample(weight: Array, u: float, parent: NDArray[np.int64]) -> None:
    """Systematic resampling."""
    passed = np.cumsum(weight)
    marks = (np.arange(weight.size) + u) / weight.size * passed[-1]
    parent[:] = np.minimum(np.searchsorted(passed, marks), weight.size - 1)


@part
def log_first(delta, centre, precision):
    """Log density of the first particles, without the constant."""
    s = 0.0
    for i in range(delta.size):
        for j in range(delta.size):
            s += precision[i, j] * (delta[i] - centre[i]) * (delta[j] - centre[j])
    return -0.5 * s


@njit(error_model="numpy", short=True)
def move(p, swarm, centre, precision, uniform, beta, sweep):
    """One differential-evolution move of each particle at the temperature ``beta``; none before the first sweep.

    The density is called in one place only, because a second call would double the code to be compiled.
    """
    delta, numbers = swarm.delta, swarm.numbers
    count, n1 = delta.shape[0], centre.size
    nr = delta.shape[1] - n1
    trial, rest, low = np.empty(n1), np.empty(nr), np.zeros((nr, nr))
    for i in range(count):
        j = (i + 1 + int(uniform[i, 0] * (count - 1))) % count
        k = (i + 1 + int(uniform[i, 1] * (count - 1))) % count
        stride = STRIDES[(sweep + i) % 3] if sweep >= 0 else 0.0
        for m in range(n1):
            trial[m] = delta[i, m] + stride * (delta[j, m] - delta[k, m])
        there, s = log_density(trial, p, swarm.matrix, swarm.change, swarm.touched, low, rest)
        away = log_first(trial, centre, precision)
        if sweep >= 0:
            ratio = beta * (there - numbers[i, 0]) + (1.0 - beta) * (away - numbers[i, 2])
            if there == -np.inf or not np.log(uniform[i, 2]) < ratio:
                continue
        numbers[i, 0], numbers[i, 1], numbers[i, 2] = there, s, away
        for m in range(n1):
            delta[i, m] = trial[m]
        for m in range(nr):
            delta[i, n1 + m] = rest[m]
            for q in range(nr):
                swarm.low[i, m, q] = low[m, q]
