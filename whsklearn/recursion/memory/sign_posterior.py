"""Posterior of the parameters of a law that jumps with sign(dx), over the few signs in doubt.

The likelihood is a staircase in (a, b), with a step wherever a sign flips, so neither its mode nor a
Gaussian around the mode describes it.  (a, b) is therefore sampled, with the other parameters projected
out (`log_density`), by tempered sequential Monte Carlo (Del Moral, Doucet, Jasra 2006, JRSS B 68(3))
with differential-evolution moves (ter Braak 2006, Statistics and Computing 16).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from whsklearn._numba import njit, part, piece
from whsklearn.effects.base import Array, Integers
from whsklearn.recursion.memory.linearised import Signs
from whsklearn.recursion.rows.covariance import factors_of_inverse, times
from whsklearn.systems.stability import is_stable

# --- log density of (a, b) for a law that jumps with sign(dx), over the few signs in doubt --------------------------
# Given phi = (a, b), it is known which signs flip, and the linear parameters r = (w, c, d) are projected out:
#
#     log p(phi) = -(N - n_r)/2 log S(phi) - log|H(phi)|/2,    S = min_r sum of squares, H its curvature,
#
# both from M of `linearised` updated by the rows that the flipped signs enter.
RADIUS = 0.999  # largest radius of the poles of L1


class SignProblem(NamedTuple):
    """Arguments of `log_density`: the signs of `linearised.Signs`, and the rows that they enter, each row once."""

    matrix: Array  # (n + 1, n + 1): [J e]' W [J e] with the signs frozen
    theta: Array  # (n,): parameters at which it is linearised
    dims: Integers  # (5,): as in `predictor`
    count: float  # type: ignore[assignment]  # samples after forgetting; the tuple's own is not used
    dx: Array  # dx, sign, scale, gradient, curvature, height: as in `Signs`
    sign: Array
    scale: Array
    gradient: Array
    curvature: Array
    height: Array
    rows: Array  # (R, n + 1): rows of [J e] that a sign in doubt enters
    row: Integers  # (E, n_c): indices of the rows that each sign enters; -1 for none
    reach: Array  # (E,): how far (a, b) may move, measured by ``metric``, before a sign can flip; in ascending order
    # (n_1, n_1): defines the distance sqrt(delta' metric delta); the inverse of the first particles' covariance
    metric: Array


def posed(matrix: Array, theta: Array, dims: Integers, count: float, signs: Signs) -> SignProblem:
    """Build the problem of these signs; two of them may enter the same row."""
    at, index = np.unique(signs.at.ravel(), return_inverse=True)
    index = index.reshape(signs.at.shape)
    rows = np.zeros((at.size, theta.size + 1))
    rows[index.ravel()] = signs.rows.reshape(-1, theta.size + 1)
    n1 = signs.gradient.shape[1]
    row, reach, metric = np.where(signs.at < 0, -1, index), np.zeros(signs.dx.size), np.zeros((n1, n1))
    same = map(np.ascontiguousarray, signs[:6])
    return SignProblem._make((matrix, theta, dims, float(count), *same, rows, row, reach, metric))


def by_reach(p: SignProblem, covariance: Array) -> SignProblem:
    """The same problem with its signs in order of reach, so that most particles check only a few of 500.

    ``covariance`` is that of (a, b).  With its root L, a step delta of length r changes dx by at most
    r (|L'g| + |L'H L| r / 2), so no sign that is skipped could have flipped.
    """
    root = np.linalg.cholesky(covariance)
    slope = np.sqrt(np.sum((p.gradient @ root) ** 2, axis=1))
    bend = np.sqrt(np.sum((root.T @ p.curvature @ root) ** 2, axis=(1, 2)))
    away = np.abs(p.dx)
    reach = 2.0 * away / np.maximum(slope + np.sqrt(slope**2 + 2.0 * bend * away), 1e-300)
    reach[p.sign != np.sign(p.dx)] = 0.0  # already flipped at the linearisation point
    order = np.argsort(reach, kind="stable")
    asked = {
        name: getattr(p, name)[order] for name in ("dx", "sign", "scale", "gradient", "curvature", "height", "row")
    }
    metric = np.asarray(np.linalg.inv(covariance), dtype=np.float64)
    return p._replace(**asked, reach=(1.0 - 1e-9) * reach[order], metric=metric)


@part
def turn(delta, p, matrix, change, touched):
    """M at (a, b) = theta_0 + delta: find the signs that flip, and change the rows that they enter."""
    before, theta, _, _, all_dx, sign, scale, gradient, curvature, height, rows, enters, reach, metric = p
    n, n1, nw, nc = theta.size, gradient.shape[1], height.shape[1], enters.shape[1]
    w, c = theta[n1 : n1 + nw], theta[n1 + nw : n1 + nw + nc - 1]
    for j in range(n + 1):
        for k in range(n + 1):
            matrix[j, k] = before[j, k]
    n_touched, size = 0, 0.0
    for k in range(n1):
        for j in range(n1):
            size += delta[k] * metric[k, j] * delta[j]
    size = np.sqrt(max(size, 0.0))
    for t in range(all_dx.size):
        if reach[t] > size:
            break
        dx = all_dx[t]
        for k in range(n1):
            slope = gradient[t, k]
            for j in range(n1):
                slope += 0.5 * curvature[t, k, j] * delta[j]
            dx += slope * delta[k]
        jump = (1.0 if dx > 0.0 else -1.0) - sign[t]
        if jump == 0.0:
            continue
        jump *= scale[t]
        dv = 0.0
        for k in range(nw):
            dv += w[k] * height[t, k] * jump
        for m in range(nc):
            i = enters[t, m]
            if i < 0:
                continue
            if change[i, 0] == 0.0:
                change[i, 0] = 1.0
                touched[n_touched] = i
                n_touched += 1
            factor = 1.0 if m == 0 else c[m - 1]
            change[i, n] -= factor * dv
            for k in range(nw):
                change[i, n1 + k] += factor * height[t, k] * jump
            if m > 0:
                change[i, n1 + nw + m - 1] += dv
    stop = n1 + nw + nc - 1
    for s in range(n_touched):
        i = touched[s]
        d, row = change[i], rows[i]
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
def log_density(delta, p, matrix, change, touched, low, rest, b):
    """Return (log p(phi), S); ``rest`` receives the best r - r_0, ``low`` the Cholesky factor of H, ``b`` L1's b."""
    n, n1, nb = p.theta.size, delta.size, b.size
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
    s = max(s, 1e-14 * p.matrix[n, n])  # in a record without noise, only rounding errors remain
    return -0.5 * (p.count - nr) * np.log(s) - curvature, s


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

    ``start``: as returned by `frozen`. ``rough``: use fewer sweeps, for a mean that only serves as the next starting
    point.
    """
    n1 = problem.gradient.shape[1]
    if not n1 or not problem.dx.size:
        return start
    spread = WIDTH**2 * start.covariance[:n1, :n1]
    try:
        root = np.linalg.cholesky(spread + 1e-12 * np.diag(np.diag(spread)))
        problem = by_reach(problem, spread)
    except np.linalg.LinAlgError:  # all particles of the previous round were in one plane
        return None
    centre = start.mean[:n1] - problem.theta[:n1]
    first = centre + rng.standard_normal((PARTICLES, n1)) @ root.T
    swarm = new_swarm(first, problem)
    sweeps = (ROUGH_SWEEPS, ROUGH_FINAL_SWEEPS) if rough else (SWEEPS, FINAL_SWEEPS)
    final = tempered(problem, swarm, centre, rng, sweeps)
    if final is None or not (swarm.numbers[:, 0] > NONE).all():
        return None
    mean, covariance = final
    # and that of r given phi: the mean of sigma^2 H^-1 over the particles
    half = np.linalg.inv(swarm.low)
    variance = swarm.numbers[:, 1] / (max(problem.count - problem.theta.size, 1.0) * PARTICLES)
    covariance[n1:, n1:] += np.einsum("s,ski,skj->ij", variance, half, half)
    if not np.isfinite(covariance).all():
        return None
    return Gaussian(problem.theta + mean, covariance)


class Swarm(NamedTuple):
    """Particles, one entry each, and scratch space."""

    delta: Array  # (S, n): phi of each particle and the best other parameters for it, relative to theta_0
    numbers: Array  # (S, 3): log p(phi), the sum of squares S, and the log density of the first particles
    low: Array  # (S, n_r, n_r): Cholesky factor of H
    matrix: Array  # matrix, change, touched: scratch space of `turn`
    change: Array
    touched: Integers
    trial: Array  # a particle that is tried, its r, its b and its Cholesky factor


def new_swarm(first: Array, p: SignProblem) -> Swarm:
    """Particles at ``first`` whose densities have not been computed yet."""
    count, n1 = first.shape
    n, rows = p.theta.size, p.rows.shape[0]
    delta, numbers = np.zeros((count, n)), np.zeros((count, 3))
    delta[:, :n1] = first
    numbers[:, 0] = -np.inf
    scratch = np.empty((n + 1, n + 1)), np.zeros((rows, n + 1)), np.empty(rows, dtype=np.int64)
    trial = np.zeros(n + int(p.dims[1]) + (n - n1) ** 2)
    return Swarm(delta, numbers, np.zeros((count, n - n1, n - n1)), *scratch, trial)


def tempered(
    problem: SignProblem, swarm: Swarm, centre: Array, rng: np.random.Generator, sweeps: tuple[int, int]
) -> tuple[Array, Array] | None:
    """Temper and move the particles, in place; return mean and covariance over the last sweeps, or None on failure."""
    move(problem, swarm, centre, np.zeros((PARTICLES, 4)), 0.0, -1)
    swarm.numbers[swarm.numbers[:, 0] == -np.inf, 0] = NONE
    each, last = sweeps
    beta, weight, parent, kept = 0.0, np.empty(PARTICLES), np.empty(PARTICLES, dtype=np.int64), []
    for _ in range(MOST_TEMPERATURES):
        beta = next_temperature(beta, swarm.numbers[:, 0] - swarm.numbers[:, 2], weight)
        resample(weight, rng.random(), parent)
        for values in swarm[:3]:
            values[:] = values[parent]
        for sweep in range(each if beta < 1.0 else each + last):
            move(problem, swarm, centre, rng.random((PARTICLES, 4)), beta, sweep)
            if sweep >= each:
                kept.append(swarm.delta.copy())
        if beta == 1.0:
            everyone = np.concatenate(kept)
            with np.errstate(over="ignore", invalid="ignore"):  # particles may have diverged; the caller checks
                mean = everyone.mean(axis=0)
                return mean, (everyone - mean).T @ (everyone - mean) / len(everyone)
    return None


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


def resample(weight: Array, u: float, parent: Integers) -> None:
    """Systematic resampling."""
    passed = np.cumsum(weight)
    marks = (np.arange(weight.size) + u) / weight.size * passed[-1]
    parent[:] = np.minimum(np.searchsorted(passed, marks), weight.size - 1)


@part
def log_first(delta, centre, metric):
    """Log density of the first particles, without the constant."""
    s = 0.0
    for i in range(delta.size):
        for j in range(delta.size):
            s += metric[i, j] * (delta[i] - centre[i]) * (delta[j] - centre[j])
    return -0.5 * s


@njit(error_model="numpy", counted=False, short=True)
def move(p, swarm, centre, uniform, beta, sweep):
    """One differential-evolution move of each particle at the temperature ``beta``; none before the first sweep.

    The density is called in one place only, because a second call would double the code to be compiled.
    """
    delta, numbers, lows, matrix, change, touched, scratch = swarm
    count, n1, nb = delta.shape[0], centre.size, p.dims[1]
    nr = delta.shape[1] - n1
    trial, rest, b = piece(scratch, 0, (n1,)), piece(scratch, n1, (nr,)), piece(scratch, n1 + nr, (nb,))
    low = piece(scratch, n1 + nr + nb, (nr, nr))
    for i in range(count):
        j = (i + 1 + int(uniform[i, 0] * (count - 1))) % count
        k = (i + 1 + int(uniform[i, 1] * (count - 1))) % count
        stride = STRIDES[(sweep + i) % 3] if sweep >= 0 else 0.0
        for m in range(n1):
            trial[m] = delta[i, m] + stride * (delta[j, m] - delta[k, m])
        there, s = log_density(trial, p, matrix, change, touched, low, rest, b)
        away = log_first(trial, centre, p.metric)
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
                lows[i, m, q] = low[m, q]
