"""Fits of the free run: a base model starts from divisions of the best linear model, other models from their values.

Signs are sharpened in steps.  Under a soft sign the error is smooth in the numbers of L1; under the true sign it is the
error of the system itself.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from whsklearn.effects import FrictionLaw
from whsklearn.gap.least_squares import least_squares
from whsklearn.gap.plants import chain_model as cm
from whsklearn.gap.plants.chain_candidates import Term
from whsklearn.gap.plants.chain_model import ChainModel, Record
from whsklearn.recursion.batch.best_linear import IOData, Ratio, best_linear
from whsklearn.recursion.batch.block_split import Orders, divisions, padded
from whsklearn.recursion.batch.exchanged_roots import exchanged
from whsklearn.recursion.memory.starts import random_stable
from whsklearn.systems.stability import is_stable

Array = NDArray[np.float64]

SOFT = (3.0, 10.0, 30.0)  # kappa times rms dx
N_RANDOM = 16  # starts besides the divisions, for blocks that are far from those of a linear model
KEPT, POLISHED = 6, 2  # minima under a soft sign that are sharpened, and those that are fitted until they converge
N_HOPS, HOP = 2, 1.0  # trials of neighbouring valleys, and their distance in standard errors
DIFFERENT = 1e-3  # share of the sum of squares by which two minima differ
LEAST_DROP = 1e-6  # of the sum of squares in one step of a fit
UNSEEN = 1e-12  # share of the largest column below which a column is rounding error


def cost(s: Record, m: ChainModel) -> float:
    """Sum of squares over the samples of the fit under the true sign, with outliers capped."""
    return cm.deviance(cm.left(s, m)[s.fit])


def climb(s: Record, m: ChainModel, sharpness: float, steps: int, *, robust: bool = True) -> ChainModel:
    """The model fitted at a sharpness (kappa times rms dx) with its noise colour unchanged."""
    kappa, z = sharpness / cm.rms_dx(s, m), cm.sizes(s, m)
    low, high = cm.bounds(m, z)
    x = np.clip(cm.to_vector(m), low, high)
    sigma = np.sqrt(cm.variance_of(cm.left(s, cm.from_vector(m, x), kappa)[s.fit]))

    def errors(x: Array) -> Array:
        e = cm.left(s, cm.from_vector(m, x), kappa)[s.fit] / sigma
        return np.copysign(np.sqrt(cm.capped(e**2)), e) if robust else e

    def slopes(x: Array) -> Array:
        """Derivatives of `errors`; a capped error is the root of its cost, so its slope is e w(e) over that root."""
        at = cm.from_vector(m, x)
        out = cm.sensitivities(s, at, kappa)[s.fit] / sigma
        size = np.linalg.norm(out, axis=0)
        out[:, size <= UNSEEN * size.max(initial=0.0)] = 0.0  # a kink far from every x is rounding only
        if robust:
            e = cm.left(s, at, kappa)[s.fit] / sigma
            out *= (cm.share(e**2) * np.abs(e) / np.maximum(np.sqrt(cm.capped(e**2)), 1e-150))[:, None]
        return out

    near = 1e-6 * np.maximum(np.abs(x), 0.05)
    try:
        found = least_squares(errors, x, near, (low, high), max_iterations=steps, tolerance=LEAST_DROP, slopes=slopes)
    except (ValueError, np.linalg.LinAlgError):
        return m
    return cm.from_vector(m, found.x)


def coloured(s: Record, m: ChainModel) -> ChainModel:
    """The model with the noise colour of its residual."""
    white = dataclasses.replace(m, ar=np.zeros_like(m.ar))
    e = cm.left(s, white)
    return dataclasses.replace(m, ar=cm.colour([e[piece][cm.SKIP :] for piece in cm.pieces_of(s.seen)]))


def sharpened(
    s: Record, m: ChainModel, rungs: Iterable[float] = cm.HARD, steps: int = 8, *, robust: bool = True
) -> ChainModel:
    """The model fitted rung by rung, with its noise colour updated after each; the best one under the true sign."""
    best: tuple[float, ChainModel] | None = None
    for rung in rungs:
        m = coloured(s, climb(s, m, rung, steps, robust=robust))
        value = cost(s, m)
        if best is None or value < best[0]:
            best = value, m
    assert best is not None
    return best[1]


def polished(s: Record, m: ChainModel, hops: int = N_HOPS) -> ChainModel:
    """The model at its minimum: refitted through a soft sign, from its present values, and from nearby ones.

    Every sample close to a reversal makes a valley of its own.  The hops, which are a few standard errors long and
    always the same, try the neighbouring valleys.
    """
    ways = [m, sharpened(s, m, (30.0, 150.0, cm.SHARPEST)), sharpened(s, m, (cm.SHARPEST,), 10)]
    # not capped, so that a sample on the wrong side pulls the model across
    ways += [sharpened(s, sharpened(s, m, cm.HARD, robust=False), (cm.SHARPEST,))]
    best = min((cost(s, w), i, w) for i, w in enumerate(ways))
    rng = np.random.default_rng(0)
    for i in range(hops):
        near = sharpened(s, moved(s, best[2], HOP, rng), (100.0, cm.SHARPEST), 6, robust=False)
        best = min(best, (cost(s, near), 3 + i, near))
    return best[2]


def moved(s: Record, m: ChainModel, far: float, rng: np.random.Generator) -> ChainModel:
    """The model with numbers drawn from their covariance, scaled by ``far`` standard errors."""
    rows = cm.sensitivities(s, m, 30.0 / cm.rms_dx(s, m))[s.fit]
    scale = np.linalg.norm(rows, axis=0)
    seen = scale > UNSEEN * scale.max(initial=0.0)  # a number on which no error depends has no covariance: it stays
    scale = np.where(seen, scale, np.inf)
    _, values, axes = np.linalg.svd(rows / scale, full_matrices=False)
    sigma = far * np.sqrt(cm.variance_of(cm.left(s, m)[s.fit]))
    step = axes.T @ (rng.standard_normal(values.size) / np.maximum(values, 1e-3 * values[0])) * sigma / scale
    low, high = cm.bounds(m, cm.sizes(s, m))
    return cm.from_vector(m, np.clip(cm.to_vector(m) + step, low, high))


# --- starts ---------------------------------------------------------------------------------------
def of_dx(law: FrictionLaw) -> bool:
    """Whether a law depends on dx alone, so that its linear part is a difference."""
    return bool(np.all(law([-1.0, 0.5, 2.0], 0.0) == 0.0))


def linear_model(s: Record, u: Array, extra_poles: int = 0) -> Ratio:
    """The best linear model from u to y with the chain's numbers of poles and zeros, its delays and its difference."""
    na, nb, nc, nd, _ = (int(i) for i in s.dims)
    return best_linear(_data(s, u), nb + nd + extra_poles, na + nc - 2 + (1 if extra_poles else 0))


def misfit(s: Record, ratio: Ratio, u: Array) -> float:
    """Mean square residual of a linear model."""
    data = _data(s, u)
    return float(np.mean((data.y - ratio.run(data))[data.counts] ** 2))


def _data(s: Record, u: Array) -> IOData:
    late = np.concatenate([np.zeros(2), u[:-2]])
    late = np.diff(late, prepend=0.0) if of_dx(s.law) else late
    counts = s.fit & (np.arange(u.size) >= cm.SKIP)
    return IOData(np.ascontiguousarray(late[None, :]), s.y - s.y[counts].mean(), np.array([0, u.size]), counts)


def divided(s: Record, ratio: Ratio, terms: tuple[Term, ...] = ()) -> list[Array]:
    """theta for every division of a linear model's poles and zeros between the blocks; weights by least squares."""
    na, nb, nc, nd, _ = (int(i) for i in s.dims)
    out = []
    for one, two in divisions(ratio, Orders(na - 1, nb, nc - 1, nd)):
        a, c = padded(one, na - 1, nb), padded(two, nc - 1, nd)
        out.append(weighed(s, np.concatenate([a.b[1:], a.a[1:]]), np.concatenate([c.b[1:], c.a[1:]]), terms))
    return out


def weighed(s: Record, first: Array, second: Array, terms: tuple[Term, ...] = ()) -> Array:
    """theta of two blocks with the weights that fit y best under a soft sign, together with these effects."""
    nw = int(s.dims[4])
    m = ChainModel(np.concatenate([first, np.zeros(nw), second]), tuple(t for t in terms if not t.kind.folds))
    kappa = 1.0 / cm.rms_dx(s, m)
    plain = cm.simulate(s, m, kappa)[2]
    rows = np.empty((s.u.size, nw))
    for i in range(nw):
        theta = m.theta.copy()
        theta[s.blocks[2].start + i] = 1.0
        rows[:, i] = cm.simulate(s, dataclasses.replace(m, theta=theta), kappa)[2] - plain
    theta, rows = m.theta.copy(), rows[s.fit]
    if np.abs(rows).max(initial=0.0) < 1e12:
        size = np.maximum(np.linalg.norm(rows, axis=0), 1e-300)
        theta[s.blocks[2]] = np.linalg.lstsq(rows / size, (s.y - plain)[s.fit], rcond=1e-4)[0] / size
    return theta


def random_thetas(s: Record, rng: np.random.Generator, n: int) -> list[Array]:
    """theta of random stable blocks; weights by least squares."""
    na, nb, nc, nd, _ = (int(i) for i in s.dims)
    return [
        weighed(
            s, np.concatenate([rng.normal(0.0, 1.0, na - 1), random_stable(nb, rng)]),
            np.concatenate([rng.normal(0.0, 1.0, nc - 1), random_stable(nd, rng)]),
        )
        for _ in range(n)
    ]  # fmt: skip


def ranked(s: Record, models: Iterable[ChainModel], sharpness: float, steps: int) -> list[ChainModel]:
    """Stable starts after a few steps under a soft sign and white noise; the best of each minimum comes first."""
    found = []
    for m in models:
        if not np.all(np.isfinite(m.theta)) or not _stable(s, m.theta):
            continue
        m = climb(s, m, sharpness, steps, robust=False)
        e = cm.left(s, m, sharpness / cm.rms_dx(s, m))[s.fit]
        value = float(e @ e)
        if np.isfinite(value) and _stable(s, m.theta):
            found.append((value, m))
    found.sort(key=lambda f: f[0])
    out: list[tuple[float, ChainModel]] = []
    for value, m in found:
        if not out or value > out[-1][0] * (1.0 + DIFFERENT):
            out.append((value, m))
    return [m for _, m in out]


def _stable(s: Record, theta: Array) -> bool:
    _, b, _, _, d = s.blocks
    return all(is_stable(np.ascontiguousarray(theta[part]), 0.9999) for part in (b, d))


def minima(s: Record, starts: Iterable[ChainModel]) -> list[ChainModel]:
    """Distinct minima that the starts lead to, best first; the best is fitted until it converges."""
    out = sharpest(s, ranked(s, starts, SOFT[0], 8)[:KEPT], neighbours=True)
    return [polished(s, m) for m in out[:1]] + out[1:]


def sharpest(s: Record, soft: list[ChainModel], *, neighbours: bool = False) -> list[ChainModel]:
    """Sharpen models found under a soft sign, best first; with ``neighbours``, also those with exchanged roots."""
    softer = sorted((sharpened(s, m, SOFT[1:]) for m in soft), key=lambda m: cost(s, m))
    if neighbours:
        dims = tuple(map(int, s.dims))
        others = [dataclasses.replace(m, theta=t) for m in softer[:1] for t in exchanged(m.theta, dims)]
        softer += [sharpened(s, m, SOFT[1:]) for m in ranked(s, others, SOFT[1], 6)[:2]]
        softer.sort(key=lambda m: cost(s, m))
    return sorted((sharpened(s, m) for m in softer[:POLISHED]), key=lambda m: cost(s, m))


def base_starts(s: Record, rng: np.random.Generator) -> list[ChainModel]:
    """Starting models: the divisions of the best linear model, and random blocks."""
    thetas = [*divided(s, linear_model(s, s.u)), *random_thetas(s, rng, N_RANDOM)]
    return [ChainModel(t) for t in thetas]
