"""Fits: from many starts for the base model, from where one stands for a candidate."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import numpy as np

from whsklearn.gap.plants import chain_evidence as rules
from whsklearn.gap.plants.chain_candidates import Scales
from whsklearn.gap.plants.chain_model import (
    ChainModel,
    Setting,
    Term,
    chain,
    coloured,
    from_vector,
    jacobian,
    raw_errors,
    signal_scales,
    stable_blocks,
    to_vector,
)
from whsklearn.gap.record import rms
from whsklearn.recursion.exchanged_roots import exchanged
from whsklearn.recursion.starts import least_squares_start, random_start, term_scales

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

LADDER = (1.0, 3.0, 10.0, 30.0, 100.0, 300.0, 1000.0)  # kappa times rms dx
SOFT_RUNGS = (30.0, 100.0, 300.0, 1000.0)  # the same for a model near its minimum, by way of soft signs
SOFTENED = 30.0  # the same at which a sign has a slope that derivatives may be taken of
MULTISTART_SAMPLES = 2500  # of a longer record, on which the starts are sorted


def weights_of(e: Array) -> tuple[Array, float]:
    """(weight of every error, variance of the sound ones): a sample on the wrong side of a sign is an outlier.

    The density is a Gaussian over a low floor, w = g / (g + exp(-CAP / 2)) with g = exp(-e^2 / 2 s^2), and s^2 the
    weighted mean square (expectation-maximisation).
    """
    variance = float(np.mean(e**2)) + 1e-300
    for _ in range(12):
        g = np.exp(-0.5 * e**2 / variance)
        w = g / (g + np.exp(-0.5 * rules.CAP))
        new = float(np.sum(w * e**2) / max(np.sum(w), 1.0)) + 1e-300
        done = abs(new - variance) < 1e-4 * variance
        variance = new
        if done:
            break
    return w, variance


def deviance(e: Array) -> tuple[float, Array]:
    """(sum of squares that has the same likelihood, weights)."""
    w, variance = weights_of(e)
    floor = np.exp(-0.5 * rules.CAP)
    capped = -2.0 * np.log((np.exp(-0.5 * e**2 / variance) + floor) / (1.0 + floor))
    n = e.size
    return n * variance * float(np.exp(np.mean(capped) - 1.0)), w


def _plain(e: Array) -> tuple[float, Array]:
    """(sum of squares, equal weights)."""
    return float(e @ e), np.ones_like(e)


def cost(s: Setting, m: ChainModel) -> float:
    """Sum of squares over the samples of the fit, outliers capped."""
    return deviance(coloured(raw_errors(s, m), m.ar)[s.fit])[0]


def rms_dx(s: Setting, m: ChainModel) -> float:
    """Root mean square of dx, never zero."""
    return max(rms(np.diff(chain(s, m)[0])), 1e-12)


def climb(
    s: Setting,
    m: ChainModel,
    z: Scales,
    *,
    steps: int = 12,
    tolerance: float = 1e-6,
    capped: bool = True,
) -> tuple[ChainModel, float]:
    """Levenberg-Marquardt at the model's sharpness; (model, sum of squares)."""
    measure = deviance if capped else _plain
    x = to_vector(m, z)
    base = raw_errors(s, m)
    e = coloured(base, m.ar)[s.fit]
    best, w = measure(e)
    damping = 1e-3
    for _ in range(steps):
        root = np.sqrt(w)
        rows = jacobian(s, m, z, base)[s.fit] * root[:, None]
        scale = np.maximum(np.linalg.norm(rows, axis=0), 1e-9 * np.sqrt(len(e)))
        rows /= scale
        normal, slope = rows.T @ rows, rows.T @ (root * e)
        improved = False
        for _ in range(7):
            move = np.linalg.solve(normal + damping * np.eye(len(slope)), slope) / scale
            trial = from_vector(m, x - move, z)
            if stable_blocks(s, trial.theta):
                trial_base = raw_errors(s, trial)
                trial_e = coloured(trial_base, trial.ar)[s.fit]
                now, trial_w = measure(trial_e)
                if now < best:
                    improved = True
                    break
            damping = max(damping, 1e-6) * 6.0
        if not improved:
            break
        gain = (best - now) / max(best, 1e-300)
        m, x, base, e, best, w = trial, to_vector(trial, z), trial_base, trial_e, now, trial_w
        damping = max(damping / 8.0, 1e-9)
        if gain < tolerance:
            break
    return m, best


def sharpen(
    s: Setting,
    m: ChainModel,
    z: Scales,
    rungs: tuple[float, ...] = LADDER,
    *,
    steps: int = 8,
    capped_from: float = 0.0,
) -> tuple[ChainModel, float]:
    """Climb over ever sharper signs; the rung with the least capped sum of squares answers.

    On the rungs below ``capped_from`` no sample is taken for an outlier: under a soft sign those beside a reversal
    tell on which side of it the model is.
    """
    best: tuple[ChainModel, float] | None = None
    for relative in rungs:
        capped = relative >= capped_from
        m, value = climb(s, m.at(relative / rms_dx(s, m)), z, steps=steps, capped=capped)
        value = value if capped else cost(s, m)
        if best is None or value < best[1]:
            best = m, value
    assert best is not None
    return best


def shortened(s: Setting, n: int) -> Setting:
    """The first n samples."""
    if s.u.size <= n:
        return s
    return dataclasses.replace(s, u=s.u[:n], y=s.y[:n], fit=s.fit[:n], held=s.held[:n])


def start_thetas(s: Setting, rng: np.random.Generator, n_starts: int) -> list[Array]:
    """Random stable blocks, weights, c and d from least squares, the most promising first."""
    restart = np.zeros(s.u.size, dtype=bool)
    restart[0] = True
    kernel = (s.dims, s.law.codes, s.law.shapes)
    u = np.ascontiguousarray(s.u[:, None])
    scales = term_scales(kernel, u, s.y, restart, rng)
    dims = tuple(int(d) for d in s.dims)
    out = [least_squares_start(random_start(dims, rng, scales), kernel, u, s.y, restart) for _ in range(n_starts)]
    return [t for t in out if np.isfinite(t).all() and stable_blocks(s, t)]


def fit_base(
    s: Setting, rng: np.random.Generator, *, n_starts: int = 24, keep: int = 4, terms: tuple[Term, ...] = ()
) -> list[tuple[ChainModel, float]]:
    """Separate minima of the model with these effects on the whole fit, the least first."""
    short = shortened(s, MULTISTART_SAMPLES)
    return minima_from(s, start_thetas(short, rng, n_starts), keep=keep, terms=terms)


def minima_from(
    s: Setting, thetas: list[Array], *, keep: int = 4, terms: tuple[Term, ...] = ()
) -> list[tuple[ChainModel, float]]:
    """Separate minima of the model with these effects from given starts, the least first."""
    short = shortened(s, MULTISTART_SAMPLES)
    first: list[tuple[float, ChainModel]] = []
    for theta in thetas:
        m = ChainModel(theta, terms, ar=np.zeros(0))
        m = m.at(1.0 / rms_dx(short, m))
        z = signal_scales(short, m)
        m, value = climb(short, m, z, steps=6, tolerance=1e-3)
        first.append((value, m))
    first.sort(key=lambda f: f[0])
    second: list[tuple[float, ChainModel]] = []
    for _, m in separate(first, 1e-4)[: 3 * keep]:
        m, value = sharpen(short, m, signal_scales(short, m), (1.0, 3.0, 10.0), steps=10)
        second.append((value, m))
    second.sort(key=lambda f: f[0])
    second += [f for _, m in separate(second, 1e-3)[:2] for f in _other_sides(short, m)]
    second.sort(key=lambda f: f[0])
    out = []
    long = s.u.size > 3 * MULTISTART_SAMPLES
    rungs = (30.0, 300.0, 1000.0) if long else LADDER[2:]
    for _, m in separate(second, 1e-3)[: 2 if long else keep]:
        full = dataclasses.replace(m, ar=ChainModel(m.theta).ar)
        z = signal_scales(s, full)
        ways = [sharpen(s, full, z, rungs, steps=6 if long else 10), sharpen(s, full, z, SOFT_RUNGS, capped_from=50.0)]
        out.append(min(ways, key=lambda w: w[1]))
    return sorted(out, key=lambda f: f[1])


def _other_sides(s: Setting, m: ChainModel) -> list[tuple[float, ChainModel]]:
    """What a minimum becomes with zeros or poles in the other block."""
    kernel = (s.dims, s.law.codes, s.law.shapes)
    restart = np.zeros(s.u.size, dtype=bool)
    restart[0] = True
    u = np.ascontiguousarray(s.u[:, None])
    out = []
    for theta in exchanged(m.theta, tuple(int(d) for d in s.dims)):
        start = dataclasses.replace(m, theta=least_squares_start(theta, kernel, u, s.y, restart))
        if not np.isfinite(start.theta).all() or not stable_blocks(s, start.theta):
            continue
        start = start.at(1.0 / rms_dx(s, start))
        found, value = climb(s, start, signal_scales(s, start), steps=6, tolerance=1e-3)
        found, value = sharpen(s, found, signal_scales(s, found), (1.0, 3.0, 10.0), steps=6)
        out.append((value, found))
    return out


def separate(found: list[tuple[float, ChainModel]], share: float) -> list[tuple[float, ChainModel]]:
    """Those whose sums of squares differ by more than a share, the least of each."""
    out: list[tuple[float, ChainModel]] = []
    for value, m in found:
        if not out or value > out[-1][0] * (1.0 + share):
            out.append((value, m))
    return out


def refit(
    s: Setting, m: ChainModel, z: Scales, *, thorough: bool = False, quick: bool = False, soft: bool = False
) -> tuple[ChainModel, float]:
    """The joint refit of a model that stands near its minimum; ``soft`` also goes there by way of soft signs."""
    here = climb(s, m, z, steps=10) if np.isfinite(m.kappa) else None
    if quick and here is not None:
        return here
    rungs = (3.0, 10.0, 30.0, 100.0, 300.0, 1000.0) if thorough else (30.0, 150.0, 1000.0)
    ways = [sharpen(s, m, z, rungs, steps=10 if thorough else 6)]
    if soft:
        ways.append(sharpen(s, m, z, SOFT_RUNGS, capped_from=50.0))
    return min(ways if here is None else [*ways, here], key=lambda w: w[1])
