"""Looking: every candidate on a model by its projected signature, and where its refit should start."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from whsklearn.effects.codes import COULOMB
from whsklearn.gap.evidence import delta_bic_of
from whsklearn.gap.plants import chain_evidence as rules
from whsklearn.gap.plants.chain_candidates import Candidate, Scales, catalogue_for
from whsklearn.gap.plants.chain_fit import SOFTENED, climb, cost, refit, rms_dx, shortened
from whsklearn.gap.plants.chain_law import is_line
from whsklearn.gap.plants.chain_model import ChainModel, Setting, Term
from whsklearn.gap.plants.chain_screening import SOFT, Screened, Tangent, refine_scan, screen, tangent_of
from whsklearn.gap.values import Look

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

# near neighbours, of which neither is told without having tried the other
PARTNERS = {"actuator_lag": "input_delay", "input_delay": "actuator_lag"}
SCREEN_SAMPLES = 6000  # of a longer record, to try sizes on
SURE_TO_SHOW = 1e9  # delta BIC of an effect that the model's own numbers cannot make
# what a soft sign looks like, and a wave that would fit single reversals
SOFT_ITSELF = ("stribeck", "presliding_hysteresis", "disturbance_tone")


@dataclass(frozen=True)
class Start:
    """Where a refit begins: a candidate's best shape, the model it is added to, what it promises (delta BIC)."""

    screened: Screened
    model: ChainModel
    promise: float


def looks_at(s: Setting, m: ChainModel, z: Scales, *, quick: bool) -> list[Look]:
    """Every candidate at its best start; ``quick``: by one linear look only, as for surrogates.

    Scores are taken under the sharp sign, under a soft one, by trial sizes, and for tones without the colour of the
    noise, whose model takes a tone for a resonance.
    """
    kinds = candidates_for(s, m)
    value = m.cost if np.isfinite(m.cost) else cost(s, m)
    tangent = tangent_of(s, m, z)
    screened = screen(s, tangent, kinds, z)
    starts = starts_of(s, tangent, screened, m, z)
    if not quick:
        soft = tangent_of(s, m, z, SOFT)
        linear = [k for k in kinds if k.linear and k.name not in SOFT_ITSELF]
        starts += starts_of(s, soft, screen(s, soft, linear, z), m, z, soft=True)
        white = replace(m, ar=np.zeros_like(m.ar))
        tones = tangent_of(s, white, z)
        tone_kinds = [k for k in kinds if k.name == "disturbance_tone"]
        starts += starts_of(s, tones, screen(s, tones, tone_kinds, z), white, z)
        starts += [Start(c, m, p) for p, c in from_sizes(s, m, value, [k for k in kinds if k.linear == 0], z)]
    return as_looks(screened, starts, int(s.fit.sum()))


def candidates_for(s: Setting, m: ChainModel) -> list[Candidate]:
    """The catalogue but for what the law holds, and for what an axis has once: a play, a limit, a delay.

    Stribeck's excess stands on dry friction, so without that it is no candidate: a wide one would pass for it.
    """
    once = {t.name for t in m.terms if t.kind.linear == 0}
    dry = {int(c) for c in s.law.codes} | {t.kind.code for t in m.terms}
    kinds = [k for k in catalogue_for(s.law.codes, bends=is_line(s.law)) if k.name not in once]
    return kinds if COULOMB in dry else [k for k in kinds if k.name != "stribeck"]


def as_looks(screened: list[Screened], starts: list[Start], n: int) -> list[Look]:
    """A `Look` for every start, the most promising of a variant twice at the most, and one for whatever has none."""
    absorbed = {c.term.kind.label for c in screened if c.left < rules.ABSORBED}
    out: list[Look] = []
    seen: dict[str, int] = {}
    best = max((x.promise for x in starts), default=0.0)
    for x in sorted(starts, key=lambda x: -x.promise):
        kind = x.screened.term.kind
        if x.promise < 0.0 or kind.label in absorbed or seen.get(kind.label, 0) == 2:
            continue
        seen[kind.label] = seen.get(kind.label, 0) + 1
        out.append(_look(kind, x, x.promise, n))
    for name, other in PARTNERS.items():
        has = [k for k in out if k.name == name]
        partners = [x for x in starts if x.screened.term.kind.name == other]
        if has and partners and not any(k.name == other for k in out):
            out.append(_look(partners[0].screened.term.kind, partners[0], max(0.5 * best, 1.0), n))
    for c in screened:
        if not any(k.name == c.name for k in out):
            expected = 0.0 if c.left < rules.ABSORBED else SURE_TO_SHOW
            out.append(Look(c.name, 0.0, None, c.term.kind.n_estimated, c.term.kind.scanned, expected))
    return out


def _look(kind: Candidate, x: Start, promise: float, n: int) -> Look:
    """Its gain is the share of the sum of squares that would give as much delta BIC as the start promises."""
    paid = promise + kind.n_estimated * np.log(n) + 2.0 * np.log(max(kind.scanned, 1))
    return Look(kind.name, float(-np.expm1(-paid / n)), x, kind.n_estimated, kind.scanned, SURE_TO_SHOW)


def starts_of(
    s: Setting, tangent: Tangent, screened: list[Screened], at: ChainModel, z: Scales, *, soft: bool = False
) -> list[Start]:
    """The best scores of one way of looking, with scans refined."""
    n = int(s.fit.sum())
    ranked = sorted(screened, key=lambda c: -promise_of(c, tangent, n))[: rules.LOOKS_OF_ONE_KIND]
    seen = [c for c in ranked if c.left >= rules.ABSORBED and c.gain > 0.0]
    worth = [c for c in seen if promise_of(c, tangent, n) > rules.LITTLE_PROMISE]
    return [Start(replace(refine_scan(s, tangent, c, z), soft=soft), at, promise_of(c, tangent, n)) for c in worth]


def promise_of(c: Screened, tangent: Tangent, n: int) -> float:
    """Delta BIC that a linear look expects."""
    value = float(tangent.errors @ tangent.errors)
    kind = c.term.kind
    return delta_bic_of(n, value, max(value - c.gain, 1e-3 * value), kind.n_estimated, kind.scanned)


def from_sizes(
    s: Setting, m: ChainModel, value: float, kinds: list[Candidate], z: Scales
) -> list[tuple[float, Screened]]:
    """Candidates whose size is a shape, from every size of the grid by a few steps: most of what they do is to turn
    single signs, which no slope shows.

    A size is held against the model under the sharp sign and, with the same few steps, under a soft one: the
    first sees what turns signs, the second what moves the blocks first.  The two best sizes of each are kept.
    """
    short = shortened(s, SCREEN_SAMPLES)
    if short is not s:
        value = cost(short, m)
    soft_value = climb(short, softened(short, m), z, steps=4, capped=False)[1]
    n = int(short.fit.sum())
    longer = s.fit.sum() / n
    out = []
    for kind in kinds:
        found = []
        for shape in kind.shapes(z):
            fitted, soft_now = climb(short, softened(short, m.plus(Term(kind, shape))), z, steps=4, capped=False)
            now = min(cost(short, fitted.at(m.kappa)), value * soft_now / soft_value)
            found.append((now, fitted.terms[-1]))
        found.sort(key=lambda f: f[0])
        for now, term in found[:2]:
            promise = longer * delta_bic_of(n, value, now, kind.n_estimated, 1)
            out.append((promise, Screened(term, max(value - now, 0.0), 1.0, np.empty(0), soft=True)))
    return out


def softened(s: Setting, m: ChainModel) -> ChainModel:
    """The model under a sign that is no sharper than thirty times rms dx."""
    return m.at(min(m.kappa, SOFTENED / rms_dx(s, m)))


def refined(s: Setting, start: Start, z: Scales) -> tuple[ChainModel, float]:
    """The candidate fitted together with the model, and the sum of squares."""
    c = start.screened
    quick = start.promise < rules.MODEST_PROMISE
    fitted, now = refit(s, start.model.plus(c.term), z, quick=quick, soft=c.soft)
    if c.term.kind.name == "parameter_change":
        fitted, now = _walk_time(s, fitted, now, z)
    return fitted, now


def _walk_time(s: Setting, m: ChainModel, value: float, z: Scales) -> tuple[ChainModel, float]:
    """The time of a change, moved while the sum of squares falls; the rest stays."""
    step = 0.01 * z.seconds
    last = m.terms[-1]
    best, least = last.q[1], value
    while step >= 0.5 * z.dt:
        for shift in (-step, step):
            time = min(max(best + shift, 0.02 * z.seconds), 0.98 * z.seconds)
            moved = replace(m, terms=(*m.terms[:-1], Term(last.kind, (last.q[0], time))))
            now = cost(s, moved)
            if now < least:
                best, least = time, now
        step *= 0.5
    moved = replace(m, terms=(*m.terms[:-1], Term(last.kind, (last.q[0], best))))
    return refit(s, moved, z)


def elsewhere(s: Setting, minima: list[ChainModel], looks: list[Look], z: Scales) -> list[Look]:
    """The most promising candidate from other minima of the base model; tried while nothing closes the gap."""
    tops = [k for k in looks if k.start is not None][:1]
    out = []
    for m in minima:
        tangent = tangent_of(s, m, z)
        for k in tops:
            again = screen(s, tangent, [k.start.screened.term.kind], z)
            if again and again[0].gain > 0.0:
                start = Start(refine_scan(s, tangent, again[0], z), m, k.start.promise)
                out.append(replace(k, start=start, costly=True))
    return out
