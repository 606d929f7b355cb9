"""Posterior of the parameters of a law that jumps with sign(dx), over the few signs in doubt.

The likelihood is a staircase in (a, b): it steps wherever a sign turns, so neither its mode nor
any Gaussian about it says what the record says.  Given phi = (a, b) the turned signs are known,
and what is linear beside them, r = (w, c, d), is projected out:

    log p(phi) = -(N - n_r)/2 log S(phi) - log|H(phi)|/2,    S = min_r sum of squares, H its curvature,

both from M of `linearised_memory` updated by the rows that the turned signs enter.  phi is
sampled by tempered sequential Monte Carlo (Del Moral, Doucet, Jasra 2006, JRSS B 68(3)) with
differential-evolution moves (ter Braak 2006, Statistics and Computing 16).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from whsklearn._numba import njit, part
from whsklearn.recursion.steps import in_one
from whsklearn.systems.stability import is_stable

if TYPE_CHECKING:
    from collections.abc import Generator

    from numpy.typing import NDArray

    from whsklearn.recursion.linearised_memory import Signs

    Array = NDArray[np.float64]

PARTICLES = 96
WIDTH = 2.0  # of the first particles, in standard deviations with the signs frozen
SWEEPS = 3  # moves of each particle at each temperature
FINAL_SWEEPS = 12  # at the last one, all of which the mean and the covariance are taken over
MOST_SWEEPS = 90  # in all: a posterior that is not reached by then is given up
STRIDES = (0.9, 0.4, 0.15)  # of the moves, in differences of two particles
NONE = -1e300  # log density of a particle where there is none: an unstable L1
RADIUS = 0.999  # of the poles of L1, at most


class Problem(NamedTuple):
    """What `log_density` asks: the signs of `linearised_memory.Signs`, and each row they enter once.

    Attributes
    ----------
    matrix : ndarray of shape (n + 1, n + 1)
        [J e]' W [J e] with the signs frozen.
    theta : ndarray of shape (n,)
        Where it is linearised.
    dims : ndarray of shape (5,)
        As everywhere.
    count : float
        Samples, as far as forgetting has left them.
    dx, sign, scale, gradient, height
        As in `Signs`.
    rows : ndarray of shape (R, n + 1)
        Rows of [J e] that a sign in doubt enters.
    row : ndarray of shape (E, n_c)
        Which of them each sign enters; -1 for none.
    """

    matrix: Array
    theta: Array
    dims: NDArray[np.int64]
    count: float  # type: ignore[assignment]  # samples, as everywhere here; the tuple's own method is not used
    dx: Array
    sign: Array
    scale: Array
    gradient: Array
    height: Array
    rows: Array
    row: NDArray[np.int64]


class Gaussian(NamedTuple):
    """Mean and covariance of the parameters."""

    mean: Array
    covariance: Array


def posed(matrix: Array, theta: Array, dims: NDArray[np.int64], count: float, signs: Signs) -> Problem:
    """The problem of these signs; two of them may enter one row."""
    at, index = np.unique(signs.at.ravel(), return_inverse=True)
    index = index.reshape(signs.at.shape)
    rows = np.zeros((at.size, theta.size + 1))
    rows[index.ravel()] = signs.rows.reshape(-1, theta.size + 1)
    return Problem(
        matrix, theta, dims, float(count), signs.dx, signs.sign, signs.scale, np.ascontiguousarray(signs.gradient),
        np.ascontiguousarray(signs.height), rows, np.where(signs.at < 0, -1, index),
    )  # fmt: skip


def frozen(matrix: Array, theta: Array, count: float) -> Gaussian | None:
    """Least squares with the signs as they are; None where nothing is known of the noise yet."""
    return in_one(frozen_steps(matrix, theta, count))


def frozen_steps(matrix: Array, theta: Array, count: float) -> Generator[None, None, Gaussian | None]:
    """`frozen` in parts."""
    n = theta.size
    scale = 1.0 / np.sqrt(np.maximum(np.diag(matrix)[:n], 1e-200))
    around = np.outer(scale, scale)
    yield
    values, vectors = np.linalg.eigh(matrix[:n, :n] * around)
    yield
    inverse = (vectors / np.maximum(values, 1e-13)) @ vectors.T * around
    yield
    step = inverse @ matrix[:n, n]
    squares = max(matrix[n, n] - step @ matrix[:n, n], 1e-14 * matrix[n, n])
    if count <= n or not squares > 0.0 or not np.isfinite(step).all():
        return None
    return Gaussian(theta + step, squares / (count - n) * inverse)


def sample(problem: Problem, start: Gaussian, rng: np.random.Generator) -> Gaussian | None:
    """Mean and covariance over the signs in doubt; None where the particles did not reach the posterior.

    Parameters
    ----------
    problem : Problem
    start : Gaussian
        As `frozen` gives it.
    rng : numpy.random.Generator
    """
    n1 = problem.gradient.shape[1]
    if not n1 or not problem.dx.size:
        return start
    spread = WIDTH**2 * start.covariance[:n1, :n1]
    root = np.linalg.cholesky(spread + 1e-12 * np.diag(np.diag(spread)))
    centre = start.mean[:n1] - problem.theta[:n1]
    first = centre + rng.standard_normal((PARTICLES, n1)) @ root.T
    uniform = rng.random((MOST_SWEEPS, PARTICLES, 4))
    swarm = new_swarm(first, problem)
    final = tempered(problem, swarm, centre, np.asarray(np.linalg.inv(spread), dtype=np.float64), uniform)
    if final is None or not (swarm.numbers[:, 0] > NONE).all():
        return None
    mean, covariance = final
    covariance[n1:, n1:] += rest_covariance(problem, swarm)
    if not np.isfinite(covariance).all():
        return None
    return Gaussian(problem.theta + mean, covariance)


class Swarm(NamedTuple):
    """Particles, an entry each, and scratch.

    Attributes
    ----------
    delta : ndarray of shape (S, n)
        Their phi, and the rest that is best with it, from theta_0.
    numbers : ndarray of shape (S, 3)
        log p(phi), the squares S, log density of the first particles.
    low : ndarray of shape (S, n_r, n_r)
        Cholesky factor of H.
    matrix, change, touched
        Scratch of `turn`.
    """

    delta: Array
    numbers: Array
    low: Array
    matrix: Array
    change: Array
    touched: NDArray[np.int64]


def new_swarm(first: Array, p: Problem) -> Swarm:
    """Particles that stand at ``first`` and know nothing of it yet."""
    count, n1 = first.shape
    n, rows = p.theta.size, p.rows.shape[0]
    delta, numbers = np.zeros((count, n)), np.zeros((count, 3))
    delta[:, :n1] = first
    numbers[:, 0] = -np.inf
    scratch = np.empty((n + 1, n + 1)), np.zeros((rows, n + 1)), np.empty(rows, dtype=np.int64)
    return Swarm(delta, numbers, np.zeros((count, n - n1, n - n1)), *scratch)


def tempered(
    problem: Problem, swarm: Swarm, centre: Array, precision: Array, uniform: Array
) -> tuple[Array, Array] | None:
    """Temper and move the particles, in place: mean and covariance over the last sweeps; None if they did not do."""
    stay = np.zeros_like(uniform[0])
    move(problem, swarm, centre, precision, stay, 0.0, -1)
    swarm.numbers[swarm.numbers[:, 0] == -np.inf, 0] = NONE
    beta, left, weight, parent = 0.0, 0, np.empty(PARTICLES), np.empty(PARTICLES, dtype=np.int64)
    kept = []
    for sweep, numbers in enumerate(uniform):
        if left == 0:
            beta = next_temperature(beta, swarm.numbers[:, 0] - swarm.numbers[:, 2], weight)
            resample(weight, numbers[0, 3], parent)
            for values in swarm[:3]:
                values[:] = values[parent]
            left = SWEEPS + FINAL_SWEEPS if beta == 1.0 else SWEEPS
        move(problem, swarm, centre, precision, numbers, beta, sweep)
        if beta == 1.0 and left <= FINAL_SWEEPS:
            kept.append(swarm.delta.copy())
        left -= 1
        if left == 0 and beta == 1.0:
            everyone = np.concatenate(kept)
            with np.errstate(over="ignore", invalid="ignore"):  # particles that ran away; the caller asks
                mean = everyone.mean(axis=0)
                return mean, (everyone - mean).T @ (everyone - mean) / len(everyone)
    return None


def rest_covariance(problem: Problem, swarm: Swarm) -> Array:
    """What r is uncertain by once phi is known: mean of sigma^2 H^-1 over the particles."""
    half = np.linalg.inv(swarm.low)
    variance = swarm.numbers[:, 1] / (max(problem.count - problem.theta.size, 1.0) * len(half))
    return np.einsum("s,ski,skj->ij", variance, half, half)


def next_temperature(beta: float, gain: Array, weight: Array) -> float:
    """The next beta, at which half of the particles still count; ``weight`` receives theirs."""
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
def turn(delta, p, matrix, change, touched):
    """M at (a, b) = theta_0 + delta: the signs that turn, and what they change in the rows they enter."""
    n, n1, nw, nc = p.theta.size, p.gradient.shape[1], p.height.shape[1], p.row.shape[1]
    w, c = p.theta[n1 : n1 + nw], p.theta[n1 + nw : n1 + nw + nc - 1]
    for j in range(n + 1):
        for k in range(n + 1):
            matrix[j, k] = p.matrix[j, k]
    n_touched = 0
    for t in range(p.dx.size):
        dx = p.dx[t]
        for k in range(n1):
            dx += p.gradient[t, k] * delta[k]
        jump = (1.0 if dx > 0.0 else -1.0) - p.sign[t]
        if jump == 0.0:
            continue
        jump *= p.scale[t]
        dv = 0.0
        for k in range(nw):
            dv += w[k] * p.height[t, k] * jump
        for m in range(nc):
            i = p.row[t, m]
            if i < 0:
                continue
            if change[i, 0] == 0.0:
                change[i, 0] = 1.0
                touched[n_touched] = i
                n_touched += 1
            factor = 1.0 if m == 0 else c[m - 1]
            change[i, n] -= factor * dv
            for k in range(nw):
                change[i, n1 + k] += factor * p.height[t, k] * jump
            if m > 0:
                change[i, n1 + nw + m - 1] += dv
    stop = n1 + nw + nc - 1
    for s in range(n_touched):
        i = touched[s]
        d, row = change[i], p.rows[i]
        d[0] = 0.0
        for j in range(n1, n + 1):
            if stop <= j < n:
                continue
            for k in range(n + 1):
                matrix[j, k] += d[j] * (row[k] + d[k])
            for k in range(n + 1):
                matrix[k, j] += row[k] * d[j]
        for k in range(n + 1):
            d[k] = 0.0


@part
def log_density(delta, p, matrix, change, touched, low, rest):
    """(log p(phi), S); ``rest`` receives what r - r_0 is best, ``low`` the Cholesky factor of H."""
    n, n1 = p.theta.size, delta.size
    nb = p.dims[1]
    b = np.empty(nb)
    for j in range(nb):
        b[j] = p.theta[n1 - nb + j] + delta[n1 - nb + j]
    if not is_stable(b, RADIUS):
        return -np.inf, np.inf
    turn(delta, p, matrix, change, touched)
    s = matrix[n, n]
    for i in range(n1):
        pull = -2.0 * matrix[i, n]
        for j in range(n1):
            pull += matrix[i, j] * delta[j]
        s += pull * delta[i]
    curvature = 0.0
    nr = n - n1
    for i in range(nr):
        for j in range(i + 1):
            h = matrix[n1 + i, n1 + j]
            for k in range(j):
                h -= low[i, k] * low[j, k]
            if i == j:
                if not h > 1e-14 * matrix[n1 + i, n1 + i]:
                    return -np.inf, np.inf
                low[i, i] = np.sqrt(h)
                curvature += np.log(low[i, i])
            else:
                low[i, j] = h / low[j, j]
        q = matrix[n1 + i, n]
        for j in range(n1):
            q -= matrix[n1 + i, j] * delta[j]
        for k in range(i):
            q -= low[i, k] * rest[k]
        rest[i] = q / low[i, i]
        s -= rest[i] * rest[i]
    for i in range(nr - 1, -1, -1):
        r = rest[i]
        for k in range(i + 1, nr):
            r -= low[k, i] * rest[k]
        rest[i] = r / low[i, i]
    s = max(s, 1e-14 * p.matrix[n, n])  # a record without noise: what is left is rounding
    return -0.5 * (p.count - nr) * np.log(s) - curvature, s


@part
def log_first(delta, centre, precision):
    """Log density of the first particles, without its constant."""
    s = 0.0
    for i in range(delta.size):
        for j in range(delta.size):
            s += precision[i, j] * (delta[i] - centre[i]) * (delta[j] - centre[j])
    return -0.5 * s


@njit(error_model="numpy")
def move(p, swarm, centre, precision, uniform, beta, sweep):
    """One differential-evolution move of each particle at the temperature ``beta``; before the first sweep none.

    One call of the density for all, since a second would double what the compiler has to write.
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
