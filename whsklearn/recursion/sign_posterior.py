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

from whsklearn._numba import njit
from whsklearn.systems.stability import is_stable

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from whsklearn.recursion.linearised_memory import Signs

    Array = NDArray[np.float64]

PARTICLES = 96
WIDTH = 2.0  # of the first particles, in standard deviations with the signs frozen
SWEEPS = 3  # moves of each particle at each temperature
FINAL_SWEEPS = 12  # at the last one, all of which the mean and the covariance are taken over
MOST_SWEEPS = 90  # in all: a posterior that is not reached by then is given up
STRIDES = (0.9, 0.4, 0.15)  # of the moves, in differences of two particles
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
    n = theta.size
    scale = 1.0 / np.sqrt(np.maximum(np.diag(matrix)[:n], 1e-200))
    values, vectors = np.linalg.eigh(matrix[:n, :n] * np.outer(scale, scale))
    inverse = (vectors / np.maximum(values, 1e-13)) @ vectors.T * np.outer(scale, scale)
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
    first = start.mean[:n1] - problem.theta[:n1] + rng.standard_normal((PARTICLES, n1)) @ root.T
    uniform = rng.random((MOST_SWEEPS, PARTICLES, 4))
    mean, covariance = np.zeros(problem.theta.size), np.zeros((problem.theta.size, problem.theta.size))
    centre = start.mean[:n1] - problem.theta[:n1]
    if not run_particles(problem, first, centre, np.linalg.inv(spread), uniform, mean, covariance):
        return None
    if not np.isfinite(covariance).all():
        return None
    return Gaussian(problem.theta + mean, covariance)


@njit(cache=True, error_model="numpy")
def turn(delta, p, matrix, change, touched):
    """M at (a, b) = theta_0 + delta: the signs that turn, and what they change in the rows they enter."""
    n, n1, nw, nc = p.theta.size, p.gradient.shape[1], p.height.shape[1], p.row.shape[1]
    w, c = p.theta[n1 : n1 + nw], p.theta[n1 + nw : n1 + nw + nc - 1]
    matrix[:] = p.matrix
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
        d[:] = 0.0


@njit(cache=True, error_model="numpy")
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


@njit(cache=True, error_model="numpy")
def log_first(delta, centre, precision):
    """Log density of the first particles, without its constant."""
    s = 0.0
    for i in range(delta.size):
        for j in range(delta.size):
            s += precision[i, j] * (delta[i] - centre[i]) * (delta[j] - centre[j])
    return -0.5 * s


@njit(cache=True, error_model="numpy")
def next_temperature(beta, gain, weight):
    """The next beta, at which half of the particles still count; ``weight`` receives theirs."""
    count = gain.size
    low, high = 0.0, 1.0 - beta
    step = high
    for _ in range(40):
        top = np.max(gain) * step
        one, two = 0.0, 0.0
        for i in range(count):
            weight[i] = np.exp(step * gain[i] - top)
            one += weight[i]
            two += weight[i] * weight[i]
        if one * one >= 0.5 * count * two:
            if step == 1.0 - beta or high - low < 1e-3 * high:
                break
            low = step
        else:
            high = step
        step = 0.5 * (low + high)
    return 1.0 if step == 1.0 - beta else beta + step


@njit(cache=True, error_model="numpy")
def resample(weight, u, parent):
    """Systematic resampling."""
    total = np.sum(weight)
    j, passed = 0, weight[0]
    for i in range(weight.size):
        mark = (i + u) / weight.size * total
        while passed < mark and j < weight.size - 1:
            j += 1
            passed += weight[j]
        parent[i] = j


@njit(cache=True, error_model="numpy")
def run_particles(p, first, centre, precision, uniform, mean, covariance):
    """Temper, move, and sum up; False if the sweeps did not suffice."""
    count, n1 = first.shape
    n = p.theta.size
    nr = n - n1
    matrix, low, rest = np.empty((n + 1, n + 1)), np.zeros((nr, nr)), np.empty(nr)
    change, touched = np.zeros((p.rows.shape[0], n + 1)), np.empty(p.rows.shape[0], dtype=np.int64)
    now, full, squares = np.empty((count, n)), np.empty(count), np.empty(count)
    begin, gain, weight = np.empty(count), np.empty(count), np.empty(count)
    parent, trial = np.empty(count, dtype=np.int64), np.empty(n1)
    for i in range(count):
        full[i], squares[i] = log_density(first[i], p, matrix, change, touched, low, rest)
        now[i, :n1], now[i, n1:] = first[i], rest
        begin[i] = log_first(first[i], centre, precision)
        if full[i] == -np.inf:
            full[i] = -1e300
    beta, sweep, left, summed = 0.0, 0, 0, 0
    origin = now[0].copy()
    while True:
        if left == 0:
            if beta == 1.0:
                break
            for i in range(count):
                gain[i] = full[i] - begin[i]
            beta = next_temperature(beta, gain, weight)
            resample(weight, uniform[sweep, 0, 3], parent)
            now, full, squares, begin = now[parent], full[parent], squares[parent], begin[parent]
            left = SWEEPS + FINAL_SWEEPS if beta == 1.0 else SWEEPS
            if beta == 1.0:
                origin[:] = now[0]
        if sweep == uniform.shape[0]:
            return False
        for i in range(count):
            j = (i + 1 + int(uniform[sweep, i, 0] * (count - 1))) % count
            k = (i + 1 + int(uniform[sweep, i, 1] * (count - 1))) % count
            stride = STRIDES[(sweep + i) % 3]
            for m in range(n1):
                trial[m] = now[i, m] + stride * (now[j, m] - now[k, m])
            there, s = log_density(trial, p, matrix, change, touched, low, rest)
            if there == -np.inf:
                continue
            away = log_first(trial, centre, precision)
            ratio = beta * (there - full[i]) + (1.0 - beta) * (away - begin[i])
            if np.log(uniform[sweep, i, 2]) < ratio:
                full[i], squares[i], begin[i] = there, s, away
                now[i, :n1], now[i, n1:] = trial, rest
        if beta == 1.0 and left <= FINAL_SWEEPS:
            for i in range(count):
                for m in range(n):
                    trial_m = now[i, m] - origin[m]
                    mean[m] += trial_m
                    for q in range(n):
                        covariance[m, q] += trial_m * (now[i, q] - origin[q])
            summed += count
        sweep += 1
        left -= 1
    mean /= summed
    for m in range(n):
        for q in range(n):
            covariance[m, q] = covariance[m, q] / summed - mean[m] * mean[q]
    mean += origin
    # what r is uncertain by once phi is known, over the particles as they are
    for i in range(count):
        log_density(now[i, :n1].copy(), p, matrix, change, touched, low, rest)
        variance = squares[i] / (max(p.count - n, 1.0) * count)
        for q in range(nr):
            rest[:] = 0.0
            rest[q] = 1.0
            for m in range(nr):
                s = rest[m]
                for k in range(m):
                    s -= low[m, k] * rest[k]
                rest[m] = s / low[m, m]
            for m in range(nr - 1, -1, -1):
                s = rest[m]
                for k in range(m + 1, nr):
                    s -= low[k, m] * rest[k]
                rest[m] = s / low[m, m]
            for m in range(nr):
                covariance[n1 + m, n1 + q] += variance * rest[m]
    return True
