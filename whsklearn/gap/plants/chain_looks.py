"""The look at a chain: every candidate at every shape as a column of the free run, in the record and in own records.

A column is the change of the whitened free run by a small effect (by one of its actual size if the size is a shape),
under a sign soft enough to have a slope.  The null rows are the residuals of records that the model simulated, after
a refit like that of the record.  These null worlds are exact, because a chain is simulated from its input alone.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.signal import lfilter

from whsklearn.effects.base import Array
from whsklearn.gap.calibration import N_NULL, gain
from whsklearn.gap.nameless import without_name
from whsklearn.gap.plants import chain_model as cm
from whsklearn.gap.plants.chain_fit import SOFT, climb, coloured, sharpened
from whsklearn.gap.plants.chain_model import ChainCandidate, ChainHypothesis, ChainTerm, Record, Sizes, catalogue
from whsklearn.gap.record import rms
from whsklearn.gap.tangent import Family, Look, Tangent, strongest_lines, with_p_values

SLOPED = SOFT[-1]  # kappa times rms dx at which a sign has a slope
VERY_SOFT = 8.0  # the same for a sign that still resolves an eighth of rms dx
SMALL = 1e-6  # of the size of v: a linear effect is tried at this size
WRONG_SIDE = 6.0  # deviations beyond which a sample is on the wrong side of a sign; none of 1e8 Gaussian samples is
N_HILLS = 8  # of a nameless function, between the quantiles of its signal
N_TIMES = 12  # hills over the record
N_LAGS = 6  # of a nameless dependence on past inputs


@dataclass
class Scene:
    """A record under a fitted model, with everything that all families share."""

    record: Record
    model: ChainHypothesis
    sizes: Sizes
    kappa: float
    x: Array
    v: Array
    y: Array

    @classmethod
    def of(cls, s: Record, m: ChainHypothesis, sharpness: float = SLOPED) -> Scene:
        """The scene at the sharpness at which columns are computed."""
        kappa = sharpness / cm.rms_dx(s, m)
        return cls(s, m, cm.sizes(s, m), kappa, *cm.simulate(s, m, kappa))

    def seen(self, change: Array) -> Array:
        """The change of the errors due to a change of y_hat, at the samples that count."""
        return cm.whiten(np.clip(np.nan_to_num(change), -1e12, 1e12), self.model.ar)[self.record.fit]

    def columns(self, kind: ChainCandidate, shapes: list[tuple[float, ...]]) -> Array:
        """Columns of one candidate at several shapes, shape (n, s, 1 or 2)."""
        size = SMALL * self.sizes.v if kind.linear else 1.0
        sizes_of = size * np.eye(kind.linear) if kind.linear else np.zeros((1, 0))
        grown = [self.model.plus(ChainTerm(kind, (*q, *shape))) for shape in shapes for q in sizes_of]
        change = (cm.outputs(self.record, grown, self.kappa) - self.y) / size
        return self.seen(change.T).reshape(-1, len(shapes), len(sizes_of))

    def blocks(self, kind: ChainCandidate, tangent: Tangent) -> Iterator[tuple[Any, Array, float]]:
        """All shapes of a candidate with their columns."""
        shapes = tones(self, kind, tangent) if kind.scanned == "time" else kind.shapes(self.sizes)
        if shapes:
            yield shapes, self.columns(kind, shapes), 1.0


def tones(scene: Scene, kind: ChainCandidate, tangent: Tangent) -> list[tuple[float, ...]]:
    """The strongest line of the record and of every null row."""
    s, (low, high) = scene.record, kind.range_of(2, scene.sizes)
    return [(f,) for f in strongest_lines(tangent.rows, s.fit, s.dt, low, 0.98 * high)]


def family(scene: Scene, kind: ChainCandidate) -> Family:
    """One candidate with all its shapes."""

    def start(shape: tuple[float, ...], size: Array) -> ChainTerm:
        return ChainTerm(kind, (*(map(float, size) if kind.linear else ()), *shape))

    return Family(
        kind.name, lambda tangent: scene.blocks(kind, tangent), start, kind.n_numbers,
        positive=kind.linear == 0 or kind.positive,
    )  # fmt: skip


# --- functions without a name --------------------------------------------------------------------
def hills(signal: Array, n: int = N_HILLS) -> Array:
    """Triangles between the quantiles of a signal; shape (n_samples, n)."""
    knots = np.unique(np.quantile(signal, np.linspace(0.005, 0.995, n)))
    out = [np.interp(signal, knots, np.eye(knots.size)[i]) for i in range(knots.size)]
    return np.column_stack(out)


def nameless(scene: Scene) -> Iterator[Array]:
    """Columns of generic functions at every port, one kind after the other; shape (n, k) each."""
    s, m = scene.record, scene.model
    u, x, v = s.u, scene.x, scene.v
    dx = np.diff(x, prepend=0.0)
    sign = np.tanh(scene.kappa * dx)
    time = np.linspace(-1.0, 1.0, u.size)

    def at_law(f: Array) -> Array:
        _, _, _, up, down = s.blocks
        c, d = np.concatenate([[0.0, 1.0], m.theta[up]]), np.concatenate([[1.0], m.theta[down]])
        return np.asarray(lfilter(c, d, f, axis=0))

    def at_input(f: Array) -> Array:
        small = SMALL * scene.sizes.u / max(rms(f), 1e-300)
        moved = [cm.simulate(s, m, scene.kappa, u=u + small * g)[2] for g in f.T]
        return (np.array(moved).T - scene.y[:, None]) / small

    def lags(f: Array, n: int) -> Array:
        return np.column_stack([np.concatenate([np.zeros(i), f[:-i]]) for i in range(1, n + 1)])

    yield at_law(hills(x))
    yield at_law(hills(dx))
    yield at_law(np.column_stack([x * dx, x * sign, u * dx, np.abs(u) * sign, x * u, x * np.abs(dx), x * x]))
    yield at_law(np.column_stack([time, time**2, hills(time, N_TIMES) * dx[:, None]]))
    yield at_law(hills(time, N_TIMES) * sign[:, None])
    yield at_law(np.column_stack([lags(v, 3), lags(x, 2)]))
    yield at_input(hills(u))
    yield at_input(lags(u, N_LAGS))
    yield hills(scene.y)
    yield np.column_stack([scene.y[:, None] * f for f in (lags(u, 2), lags(scene.y, 1), time[:, None])])


@dataclass(frozen=True)
class Seen:
    """The result of a look at a model."""

    looks: list[Look]
    share: float  # share of the mean square residual that nameless functions explain, beyond their share in own records
    p_value: float  # the smallest p-value of all looks, for the hypothesis that nothing is missing


def own_errors(s: Record, m: ChainHypothesis, rng: np.random.Generator) -> Array:
    """Residuals of records simulated with the model, refitted at the same sharpness; shape (m, n)."""
    rows = []
    for _ in range(N_NULL):
        other = cm.made(s, m, rng)
        rows.append(cm.left(other, sharpened(other, coloured(other, m), (cm.SHARPEST,), 6))[s.fit])
    return np.array(rows)


def look(s: Record, m: ChainHypothesis, rng: np.random.Generator) -> Seen:
    """Look at every candidate and every nameless function beside the model's own numbers.

    A candidate is looked at under a sign that has a slope and under the sign itself.  The first sees effects that turn
    signs; to the second a small effect turns none, and no slope that the errors lack stands in the column of an effect
    on the drive.
    """
    scene = Scene.of(s, m)
    e, null = cm.left(s, m)[s.fit], own_errors(s, m, rng)
    rows = np.array([cm.clipped(r) for r in null])

    def tangent_of(at: Scene) -> Tangent:
        return Tangent(cm.clipped(e), rows, cm.sensitivities(s, m, at.kappa, (at.x, at.v, at.y))[s.fit], float(e.size))

    tangent = tangent_of(scene)
    views = [(scene, tangent), (sharp := Scene.of(s, m, np.inf), tangent_of(sharp))]
    looks = [either([t.look(family(at, kind)) for at, t in views]) for kind in kinds(s, m)]
    together = []
    for f in nameless(scene):
        columns = np.column_stack([scene.seen(g) for g in f.T])
        columns /= np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
        together.append(columns)
        looks.append(tangent.look(without_name(columns)))
    looks.append(reversals(e, null))
    found = with_p_values([k for k in looks if k is not None])
    power, _, _ = tangent.taken(without_name(together[0]), np.column_stack(together)[:, None, :])
    share = power[0] / np.maximum(tangent.power, 1e-300)
    beyond = max(0.0, float(share[0] - share[1:].mean()) / max(1.0 - float(share[1:].mean()), 1e-3))
    smallest = min(k.p_value for k in found)
    return Seen(found, beyond, smallest)


def either(looks: list[Look | None]) -> Look | None:
    """The best of several looks at one candidate; every null row too is taken at its best."""
    found = [k for k in looks if k is not None]
    if not found:
        return None
    return dataclasses.replace(max(found, key=lambda k: k.gain), null=np.max([k.null for k in found], axis=0))


def softly(s: Record, m: ChainHypothesis) -> list[Look]:
    """Look at every candidate under a very soft sign, without a null.

    The sign is so soft that the error of a sample on the wrong side shows by how far it is off.  The derivative by the
    sharpness, which is the effect of the softness itself, is treated as a column of the model.
    """
    m = climb(s, m, VERY_SOFT, 6, robust=False)
    scene = Scene.of(s, m, VERY_SOFT)
    e = cm.left(s, m, scene.kappa)[s.fit]
    plane = [cm.sensitivities(s, m, scene.kappa)[s.fit]]
    plane += [scene.seen(cm.simulate(s, m, f * scene.kappa)[2] - scene.y)[:, None] for f in (0.6, 0.8, 1.3, 2.0)]
    tangent = Tangent(e, np.zeros((0, e.size)), np.hstack(plane), float(e.size))
    found = [tangent.look(family(scene, kind)) for kind in kinds(s, m)]
    return sorted((k for k in found if k is not None), key=lambda k: -k.gain)


def kinds(s: Record, m: ChainHypothesis) -> list[ChainCandidate]:
    """The catalogue without what the chain has and can have only once: play, a limit, or a delay at its port."""
    once = {(t.kind.code) for t in m.terms if t.kind.linear == 0 or not t.kind.cls.repeats}
    return [k for k in catalogue(s.law) if k.code not in once]


def reversals(e: Array, null: Array) -> Look:
    """Compare the numbers of samples on the wrong side of a sign in the record and in own ones; it shows small play."""
    counts = np.array([np.sum(np.abs(r) > WRONG_SIDE * np.sqrt(cm.variance_of(r))) for r in (e, *null)], dtype=float)
    excess = max(counts[0] - float(counts[1:].mean()), 0.0)
    return Look("", counts[0], counts[1:], None, 1, float(np.sqrt(excess * cm.CAP * cm.variance_of(e) / e.size)))


def gained(s: Record, before: ChainHypothesis, after: ChainHypothesis) -> float:
    """The gain g of one model over another."""
    return gain(cm.deviance(cm.left(s, before)[s.fit]), cm.deviance(cm.left(s, after)[s.fit]), float(s.fit.sum()))
