"""Refit the whole chain with a strong effect inside, since blocks fitted without it do not return to their true values.

An effect that acts on the input alone is applied to the input, and the best linear model from the result to the output
is divided between the blocks.  A coupling is a pair of poles split off a linear model that has two more.  The sign that
a sensor loses is retrieved from y^2.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from typing import Any

import numpy as np

from whsklearn.effects import FrictionLaw, Power
from whsklearn.effects.base import Array, rms
from whsklearn.gap.plants import chain_model as cm
from whsklearn.gap.plants.chain_fit import (
    KEPT,
    base_starts,
    climb,
    cost,
    divided,
    linear_model,
    minima,
    misfit,
    ranked,
    sharpened,
    sharpest,
    weighed,
)
from whsklearn.gap.plants.chain_looks import kinds, softly
from whsklearn.gap.plants.chain_model import ChainCandidate, ChainHypothesis, ChainTerm, Record
from whsklearn.gap.search import WORTH_FITTING
from whsklearn.gap.tangent import Look
from whsklearn.recursion.batch.best_linear import Ratio

NUDGES = (0.7, 0.87, 1.15, 1.4)  # factors by which a shape moves to another minimum
ONE_SIDED = -0.3  # of rms: if the sign was lost, the lowest hundredth of the readings is noise alone
FOLDS = ((0.5,), (1.0,))  # fractions from which a fold of the distorted base is fitted


def is_strong(kind: ChainCandidate, s: Record) -> bool:
    """Whether a candidate may distort the blocks so much that the chain is refitted: true unless it is additive.

    A force on L1 is strong as well, since a linear base does not show which of its blocks is L1.
    """
    if kind.folds:
        return float(np.quantile(s.y, 0.01)) > ONE_SIDED * rms(s.y)
    return kind.linear == 0 or kind.pulls


def promising(s: Record, m: ChainHypothesis, looks: list[Look], among: Any = None) -> list[ChainTerm]:
    """Starts of all strong candidates and of the best others, at the shapes that either look prefers.

    ``looks``: from `whsklearn.gap.plants.chain_looks.look`; a second look under a softer sign is taken here. ``among``:
    the names to be fitted; by default all.
    """
    out: list[ChainTerm] = []
    for one in (sorted((k for k in looks if k.start is not None), key=lambda k: -k.score), softly(s, m)):
        starts = [k.start for k in one if (among is None or k.name in among) and not k.start.kind.folds]
        weak = [t for t in starts if not is_strong(t.kind, s)][:KEPT]
        out += [t for t in starts if (is_strong(t.kind, s) or t in weak) and t not in out]
    return out


def beside_the_best(
    s: Record, grown: list[tuple[ChainCandidate, ChainHypothesis]], among: Any = None
) -> Iterator[tuple[ChainCandidate, ChainHypothesis]]:
    """Fit the other strong candidates from the blocks of the best one, if that is strong.

    What a lag and a delay make of the blocks is the same, but the search may reach it with one of them only; the record
    would then seem to tell them apart.
    """
    kind, top = min(grown, key=lambda pair: cost(s, pair[1]), default=(None, None))
    if kind is None or top is None or not is_strong(kind, s):
        return
    bare, z = top.without(len(top.terms) - 1), cm.sizes(s, top)
    for other in kinds(s, bare):
        if other != kind and is_strong(other, s) and not other.folds and (among is None or other.name in among):
            sizes = (0.0,) * other.linear
            starts = best(s, [bare.with_term(ChainTerm(other, (*sizes, *shape))) for shape in other.shapes(z)], 1)
            yield from ((other, sharpened(s, m, cm.RUNGS[1:], 6)) for m in starts)


def fitted(s: Record, models: list[ChainHypothesis], term: ChainTerm) -> ChainHypothesis:
    """The best of several models with an effect, which starts from the size that a look gives it."""
    z = cm.sizes(s, models[0])
    bounds = [term.kind.range_of(i, z) for i in range(len(term.q))]
    term = ChainTerm(term.kind, tuple(float(np.clip(v, *b)) for v, b in zip(term.q, bounds, strict=True)))
    ways = [sharpened(s, m.with_term(term), cm.RUNGS[1:], 6) for m in models]
    if term.kind.linear:
        ways.append(sharpened(s, models[0].with_term(term), cm.HARD[1:], 8))
    out = min(ways, key=lambda m: cost(s, m))
    return walked(s, out) if term.kind.scanned == "step" else out


def walked(s: Record, m: ChainHypothesis) -> ChainHypothesis:
    """The model with the instant of its last effect moved, in smaller and smaller steps, while the residual falls."""
    kind, last = m.terms[-1].kind, len(m.terms) - 1
    i = kind.fields.index(kind.cls.scanned())
    low, high = kind.range_of(i, cm.sizes(s, m))
    best, step = (cost(s, m), m), 0.02 * (high - low)
    while step >= 0.5 * s.dt:
        before = best[0]
        for shift in (-step, step):
            term = best[1].terms[-1]
            other = m.replaced(last, term.with_slot(i, np.clip(term.q[i] + shift, low, high)))
            best = min(best, (cost(s, other), other), key=lambda b: b[0])
        step *= 0.5 if best[0] == before else 1.0
    return sharpened(s, best[1], cm.HARD[1:], 6)


def nudged(s: Record, m: ChainHypothesis) -> ChainHypothesis:
    """The model with the shape of its last effect moved to a better local minimum; play and delays have many.

    A fit under softer signs may return to where it came from, so the others are also fitted beside the moved shape.
    """
    term = m.terms[-1]
    if term.kind.linear:
        return m
    best, z = (cost(s, m), m), cm.sizes(s, m)
    low, high = term.kind.range_of(0, z)
    for _ in range(KEPT):
        here, before = best[1].terms[-1], best[0]
        q = here.q[0]
        for first in (*(q * f for f in NUDGES), *((q - s.dt, q + s.dt) if term.kind.delays else ())):
            there = best[1].with_terms((*m.terms[:-1], here.with_slot(0, np.clip(first, low, high))))
            for other in (sharpened(s, there, cm.RUNGS[1:], 6), sharpened(s, there, robust=False, held=True)):
                best = min(best, (cost(s, other), other), key=lambda b: b[0])
        if best[0] > 0.99 * before:
            break
    return best[1]


def fitted_anew(
    s: Record, m: ChainHypothesis, others: list[ChainHypothesis], strong: list[ChainCandidate], rng: np.random.Generator
) -> Iterator[tuple[ChainCandidate, ChainHypothesis]]:
    """The models with a strong candidate as the last effect, fitted from starts of its own that are stable.

    They are fitted under a soft sign first.  Those that explain much less under the next one than the best do are not
    sharpened further: under the softest, the softness itself is most of the residual.
    """

    def residual(m: ChainHypothesis) -> float:
        return softened(s, climb(s, m, cm.RUNGS[1], 8, robust=False), cm.RUNGS[1])

    soft = [(kind, ranked(s, starts_of(s, m, others, kind, rng), cm.RUNGS[0], 8)) for kind in strong]
    whole = residual(m)
    gone = {kind: whole - residual(found[0]) for kind, found in soft if found}
    least = max(WORTH_FITTING * max(gone.values(), default=0.0), 0.0)
    for kind, found in soft:
        if found and gone[kind] >= least:
            keep = max(kind.n_numbers, 1) * KEPT  # a resonance has more local minima than a width
            yield kind, sharpest(s, found[:keep])[0]


def starts_of(
    s: Record, m: ChainHypothesis, others: list[ChainHypothesis], kind: ChainCandidate, rng: np.random.Generator
) -> list[ChainHypothesis]:
    """The starts of a strong candidate: those with the least residual before a fit."""
    z = cm.sizes(s, m)
    starts: list[ChainHypothesis] = []
    sizes = (0.0,) if kind.pulls else ()
    terms = [ChainTerm(kind, (*sizes, *shape)) for shape in (FOLDS if kind.folds else kind.shapes(z))]
    starts += [o.with_term(term) for o in (m, *others) for term in terms]
    if kind.pulls:
        for theta in divided(s, linear_model(s, s.u)):
            starts += [dataclasses.replace(m.with_term(term), theta=theta) for term in terms]
    elif kind.at == "input" or kind.cls.place == "drive":
        linear = [(linear_model(s, applied(s, term)), term) for term in terms]
        linear.sort(key=lambda pair: misfit(s, pair[0], applied(s, pair[1])))
        for ratio, term in linear[:KEPT]:
            more = m.with_term(term)
            starts += [dataclasses.replace(more, theta=t) for t in divided(s, ratio, more.terms)]
    if kind.folds:
        fold = ChainTerm(kind, (1.0,))
        starts += [dataclasses.replace(b.with_term(fold), n_base=m.n_base) for b in unfolded(s, m, rng)]
    elif "frequency" in kind.fields:
        starts += [*split_off(s, m, kind), *(t for o in (m, *others) for t in pulled_out(s, o, kind))]
    return best(s, starts, max(kind.n_numbers, 1) * 2 * KEPT)


def best(s: Record, starts: list[ChainHypothesis], n: int) -> list[ChainHypothesis]:
    """The starts with the least residual under a soft sign, before a fit."""
    scored = [(softened(s, m), i) for i, m in enumerate(starts) if np.all(np.isfinite(m.theta))]
    return [starts[i] for _, i in sorted(scored)[:n]]


def softened(s: Record, m: ChainHypothesis, sharpness: float = cm.RUNGS[0]) -> float:
    """Mean square residual of a model under a soft sign."""
    white = dataclasses.replace(m, ar=np.zeros_like(m.ar))
    e = cm.left(s, white, sharpness / cm.rms_dx(s, white))[s.fit]
    return float(np.mean(e**2))


def applied(s: Record, term: ChainTerm) -> Array:
    """The input after an effect that acts on it: the output of a chain without blocks, its two delays removed."""
    plain = dataclasses.replace(s, dims=np.array([1, 0, 1, 0, 1]), law=FrictionLaw([Power(1.0, 1.0)]))
    late = cm.simulate(plain, ChainHypothesis(np.ones(1), (term,)), u=np.concatenate([s.u, np.zeros(2)]))[2]
    return np.ascontiguousarray(late[2:])


def split_off(s: Record, m: ChainHypothesis, kind: ChainCandidate) -> Iterator[ChainHypothesis]:
    """Models with a pair of poles of a larger linear model as a resonance and the other poles divided."""
    ratio = linear_model(s, s.u, 2)
    poles, zeros = np.roots(ratio.a), np.roots(ratio.b)
    real = [i for i, r in enumerate(zeros) if abs(r.imag) < 1e-9]
    for pole, term in resonances(s, m, poles, kind):
        rest = poles[(np.abs(poles - pole) > 1e-9) & (np.abs(poles - np.conj(pole)) > 1e-9)]
        for kept in [np.delete(zeros, i) for i in real] or [zeros]:
            more = m.with_term(term)
            for theta in divided(s, Ratio(np.atleast_1d(np.real(np.poly(kept))), np.real(np.poly(rest))), more.terms):
                yield dataclasses.replace(more, theta=theta)


def pulled_out(s: Record, m: ChainHypothesis, kind: ChainCandidate) -> Iterator[ChainHypothesis]:
    """Models in which a pair of poles moves from a block to the resonance, because the block may have absorbed them."""
    a, b, _, c, d = s.blocks
    first = kind.at != "output"
    zeros, block = (a, b) if first else (c, d)
    for pole, term in resonances(s, m, np.roots(np.concatenate([[1.0], m.theta[block]])), kind):
        rest = np.real(np.polydiv(np.concatenate([[1.0], m.theta[block]]), np.poly([pole, np.conj(pole)]))[0])[1:]
        poles = np.concatenate([rest, np.zeros(2)])
        for zero in (m.theta[zeros], np.zeros(zeros.stop - zeros.start)):
            own, other = np.concatenate([zero, poles]), m.theta[c.start :] if first else m.theta[: b.stop]
            more = m.with_term(term)
            one, two = (own, other) if first else (other, own)
            yield dataclasses.replace(more, theta=weighed(s, one, two, more.terms))


def resonances(s: Record, m: ChainHypothesis, poles: Any, kind: ChainCandidate) -> Iterator[tuple[complex, ChainTerm]]:
    """The pairs of poles that can belong to a resonance, and the numbers of that resonance."""
    z = cm.sizes(s, m)
    (low, high), (least, most) = kind.range_of(0, z), kind.range_of(1, z)
    for pole in poles[np.imag(poles) > 1e-9]:
        w = np.log(pole)  # per sample: -zeta w_0 + i w_0 sqrt(1 - zeta^2)
        shape = (float(abs(w)) / (2 * np.pi * s.dt), float(-w.real / abs(w)))
        if low < shape[0] < high and least < shape[1] < most:
            yield complex(pole), ChainTerm(kind, shape)


def unfolded(s: Record, m: ChainHypothesis, rng: np.random.Generator) -> list[ChainHypothesis]:
    """Minima of the model in front of a sensor that loses the sign.

    With y = |h * u|, the leading direction of the matrix E y^2 u u' is h (Netrapalli, Jain and Sanghavi 2015, Phase
    retrieval using alternating minimization, IEEE Trans. Signal Processing 63(18)).  From there, the sign of h * u and
    the least-squares h are computed in turn; finally the chain's own output replaces h * u.
    """
    rows = np.column_stack([np.concatenate([np.zeros(i), s.u[:-i]]) for i in range(1, cm.SKIP + 1)])
    n = np.count_nonzero(s.seen)
    white = np.linalg.qr(rows * s.seen[:, None])[0] * np.sqrt(n)
    moment = (white * (s.y**2 - np.mean(s.y[s.seen] ** 2))[:, None]).T @ white / n
    values, axes = np.linalg.eigh(moment)
    tries = []
    for h in [*axes.T[np.argsort(-values)[:3]], *rng.standard_normal((KEPT, cm.SKIP))]:
        sign = np.sign(white @ h)
        for _ in range(cm.SKIP):  # alternating projections converge after about ten passes
            h, before = white.T @ (sign * s.y) / n, sign
            sign = np.sign(white @ h)
            if np.array_equal(sign, before):
                break
        tries.append((float(np.mean((s.y - np.abs(white @ h))[s.seen] ** 2)), sign))
    sign = min(tries, key=lambda t: t[0])[1]
    found: list[ChainHypothesis] = []
    for _ in range(3):
        straight = s.with_output(sign * s.y)
        found = minima(straight, base_starts(straight, rng))
        if not found:
            return []
        new = np.sign(cm.simulate(straight, found[0])[2])
        if np.mean((new != sign)[s.seen]) < 0.002:
            break
        sign = new
    return [dataclasses.replace(f, terms=m.terms) for f in found]
