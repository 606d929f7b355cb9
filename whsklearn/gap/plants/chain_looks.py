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

from whsklearn.effects import Scales
from whsklearn.effects.base import Array, rms
from whsklearn.gap.calibration import N_NULL, gain
from whsklearn.gap.nameless import HATS, generic_basis, hats, without_name
from whsklearn.gap.plants import chain_model as cm
from whsklearn.gap.plants.chain_fit import climb, coloured, sharpened
from whsklearn.gap.plants.chain_model import ChainCandidate, ChainHypothesis, ChainTerm, Record, Sizes, catalogue
from whsklearn.gap.record import OUTLYING
from whsklearn.gap.tangent import Family, Look, Tangent, strongest_lines, with_p_values

SLOPED, VERY_SOFT = cm.RUNGS[2], cm.RUNGS[1]  # kappa times rms dx at which a sign has a slope; at which it has a form


@dataclass
class Softened:
    """A record under a fitted model at one sharpness of the signs, with everything that all families share."""

    record: Record
    model: ChainHypothesis
    sizes: Sizes
    kappa: float
    run: tuple[Array, Array, Array]  # x, v, y_hat
    tangent: Tangent

    @classmethod
    def of(
        cls, s: Record, m: ChainHypothesis, sharpness: float, left: Array, null: Array, softer: tuple[float, ...] = ()
    ) -> Softened:
        """The scene of these errors of the record and of own records, at a sharpness.

        Signs that are these factors softer or sharper add a column to those of the model: the effect of the sharpness.
        """
        kappa = sharpness / cm.rms_dx(s, m)
        run = cm.simulate(s, m, kappa)
        other = [cm.simulate(s, m, f * kappa)[2] - run[2] for f in softer]
        own = cm.sensitivities(s, m, kappa, run)
        own *= cm.units_of(s, m, own, run)
        plane = np.column_stack([own, *(cm.whiten(c, m.ar) for c in other)])[s.fit]
        return cls(s, m, cm.sizes(s, m), kappa, run, Tangent(left, null, plane, float(left.size)))

    def seen(self, change: Array) -> Array:
        """The change of the errors due to a change of y_hat, shape (n, ...), at the samples that count."""
        return cm.whiten(cm.finite(change), self.model.ar)[self.record.fit]

    def look(self, kind: ChainCandidate) -> Look | None:
        """Look at one candidate with all its shapes."""

        def blocks(tangent: Tangent) -> Iterator[tuple[Any, Array, float]]:
            s, shapes = self.record, kind.shapes(self.sizes)
            if kind.scanned == "time":  # the strongest line of the record and of every null row
                low, high = kind.range_of(2, self.sizes)
                shapes = [(f,) for f in strongest_lines(tangent.rows, s.fit, s.dt, low, 0.98 * high)]
            if shapes:
                yield shapes, self.columns(kind, shapes), 1.0

        def start(shape: tuple[float, ...], size: Array) -> ChainTerm:
            return ChainTerm(kind, (*(map(float, size) if kind.linear else ()), *shape))

        positive = kind.linear == 0 or kind.positive
        return self.tangent.look(Family(kind.name, blocks, start, kind.n_numbers, positive=positive))

    def columns(self, kind: ChainCandidate, shapes: list[tuple[float, ...]]) -> Array:
        """Columns of one candidate at several shapes, shape (n, s, 1 or 2)."""
        size = cm.SMALL * self.sizes.v if kind.linear else 1.0
        sizes_of = size * np.eye(kind.linear) if kind.linear else np.zeros((1, 0))
        grown = [self.model.with_term(ChainTerm(kind, (*q, *shape))) for shape in shapes for q in sizes_of]
        change = (cm.outputs(self.record, grown, self.kappa) - self.run[2]) / size
        return self.seen(change.T).reshape(-1, len(shapes), len(sizes_of))

    def nameless(self) -> Iterator[Look]:
        """Look at nameless functions of the signals where they act: at the law and the reading, or, soft, at the input.

        A revolution of x is 2 pi rms, by which its waves are counted.
        """
        s, z, (x, _, y) = self.record, self.sizes, self.run
        if np.isinf(self.kappa):
            _, _, _, up, down = s.blocks
            c, d = ([*first, *self.model.theta[part]] for first, part in (([0.0, 1.0], up), ([1.0], down)))
            scales = Scales(reach=z.x_peak / z.x, speed=2.0 * z.dx, torque=z.u, centre=0.0)
            basis = generic_basis(scales, x / z.x, np.diff(x, prepend=0.0), s.u)
            changes = [lfilter(c, d, f, axis=0) for _, f in basis] + [around(y)]
        else:
            late = np.column_stack([np.concatenate([np.zeros(i), s.u[:-i]]) for i in range(1, cm.AR_ORDER)])
            changes = [self._at_input(f) for f in (around(s.u), late)]
        for f in changes:
            columns = self.seen(f)
            look = self.tangent.look(without_name(columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-300)))
            if look is not None:  # many columns explain much by chance
                beyond = max(look.gain - float(look.null.mean()), 0.0) / max(look.gain, 1e-300)
                yield dataclasses.replace(look, size=look.size * float(np.sqrt(beyond)))

    def _at_input(self, f: Array) -> Array:
        small = cm.SMALL * self.sizes.u / max(rms(f), 1e-300)
        moved = [cm.simulate(self.record, self.model, self.kappa, u=self.record.u + small * g)[2] for g in f.T]
        return (np.array(moved).T - self.run[2][:, None]) / small


def around(signal: Array) -> Array:
    """Functions of one signal, each around one of its values."""
    low, high = np.quantile(signal, [0.005, 0.995])
    return hats((2.0 * signal - low - high) / max(high - low, 1e-300), 2.0 * HATS[0])


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
    e, null = cm.left(s, m)[s.fit], own_errors(s, m, rng)
    rows = np.array([cm.clipped(r) for r in null])
    views = [Softened.of(s, m, sharpness, cm.clipped(e), rows) for sharpness in (SLOPED, np.inf)]
    nameless = [k for at in views for k in at.nameless()]
    beyond = max((k.score for k in nameless), default=0.0)
    named = [either([at.look(kind) for at in views]) for kind in kinds(s, m)]
    found = with_p_values([*(k for k in named if k is not None), *nameless, reversals(e, null)])
    return Seen(found, float(-np.expm1(-max(beyond, 0.0) / e.size)), min(k.p_value for k in found))


def either(looks: list[Look | None]) -> Look | None:
    """The best of several looks at one candidate; every null row too is taken at its best."""
    found = [k for k in looks if k is not None]
    if not found:
        return None
    return dataclasses.replace(max(found, key=lambda k: k.gain), null=np.max([k.null for k in found], axis=0))


def softly(s: Record, m: ChainHypothesis) -> list[Look]:
    """Look at every candidate under a very soft sign, without a null.

    The sign is so soft that the error of a sample on the wrong side shows by how far it is off.
    """
    m = climb(s, m, VERY_SOFT, 6, robust=False)
    e = cm.left(s, m, VERY_SOFT / cm.rms_dx(s, m))[s.fit]
    scene = Softened.of(s, m, VERY_SOFT, e, np.zeros((0, e.size)), (0.6, 0.8, 1.3, 2.0))
    return sorted((k for kind in kinds(s, m) if (k := scene.look(kind)) is not None), key=lambda k: -k.gain)


def kinds(s: Record, m: ChainHypothesis) -> list[ChainCandidate]:
    """The catalogue without what the chain has and can have only once: play, a limit, or a delay at its port."""
    once = {(t.kind.code) for t in m.terms if t.kind.linear == 0 or not t.kind.cls.repeats}
    return [k for k in catalogue(s.law) if k.code not in once]


def reversals(e: Array, null: Array) -> Look:
    """Compare the numbers of samples on the wrong side of a sign in the record and in own ones; it shows small play."""
    counts = np.array([np.sum(np.abs(r) > OUTLYING * np.sqrt(cm.variance_of(r))) for r in (e, *null)], dtype=float)
    excess = max(counts[0] - float(counts[1:].mean()), 0.0)
    return Look("", counts[0], counts[1:], None, 1, float(np.sqrt(excess * cm.CAP * cm.variance_of(e) / e.size)))


def gained(s: Record, before: ChainHypothesis, after: ChainHypothesis) -> float:
    """The gain g of one model over another."""
    return gain(cm.deviance(cm.left(s, before)[s.fit]), cm.deviance(cm.left(s, after)[s.fit]), float(s.fit.sum()))
