"""One pass over the catalogue: screen every candidate on a model, refit the most promising."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from whsklearn.effects.terms import COULOMB
from whsklearn.gap.blocks.candidates import Candidate, Scales
from whsklearn.gap.blocks.fit import climb, cost, refit, rms_dx, shortened
from whsklearn.gap.blocks.model import BlockModel, Setting, Term
from whsklearn.gap.blocks.score import ABSORBED, SOFT, Screened, Stand, refine_scan, screen, take_stand
from whsklearn.gap.blocks.trial import Round, Trial, delta_bic, weigh

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

NEED = 30.0  # delta BIC for a name
MAX_REFITS = 7
HOPELESS = 0.1  # of the best so far: what promises less is not refitted
# near neighbours, of which neither is told without having tried the other
PARTNERS = (("actuator_lag", "input_delay"), ("input_delay", "actuator_lag"))
SCREEN_SAMPLES = 6000  # of a longer record, to try sizes on


def try_all(
    s: Setting,
    m: BlockModel,
    value: float,
    kinds: list[Candidate],
    z: Scales,
    *,
    others: list[BlockModel] | None = None,
) -> Round:
    """Screen all candidates on a model, refit the best.

    Stribeck's excess stands on dry friction, so without that it is no candidate: a wide one would pass for it.
    """
    dry = {int(c) for c in s.law.codes} | {t.kind.code for t in m.terms}
    if COULOMB not in dry:
        kinds = [k for k in kinds if k.name != "stribeck"]
    screened, worth = promising(s, m, value, kinds, z)
    tried: dict[str, Trial] = {}
    visible = {c.term.kind.label: c.left for c in screened}
    for promise, c, start in worth:
        label = c.term.kind.label
        if promise < 0.0 or visible.get(label, 1.0) < ABSORBED:
            continue
        if label not in tried and len(tried) >= MAX_REFITS:
            continue
        if promise < HOPELESS * max((t.delta_bic for t in tried.values()), default=0.0):
            continue
        one = refit_trial(s, start, value, c, z, quick=promise < 15.0)
        if label not in tried or one.cost < tried[label].cost:
            tried[label] = one
    for name, other_name in PARTNERS:
        if any(t.name == name for t in tried.values()) and not any(t.name == other_name for t in tried.values()):
            found = [c for _, c, _ in worth if c.term.kind.name == other_name]
            if found:
                one = refit_trial(s, m, value, found[0], z)
                tried[one.kind.label] = one
    trials = sorted(tried.values(), key=lambda t: -t.delta_bic)
    for i, t in enumerate(trials[:2]):
        if t.delta_bic < 0.5 * NEED:
            break
        for other in others or []:
            again = _from_elsewhere(s, other, t, value, z)
            if again is not None and again.cost < trials[i].cost:
                trials[i] = again
    for t in trials:
        weigh(s, m, t)
    trials.sort(key=lambda t: -t.delta_bic)
    return Round(m, value, screened, trials)


def promising(
    s: Setting, m: BlockModel, value: float, kinds: list[Candidate], z: Scales
) -> tuple[list[Screened], list[tuple[float, Screened, BlockModel]]]:
    """(every candidate's score, those worth a refit with what they promise and the model to start from).

    Scores are taken under the sharp sign, under a soft one, by trial sizes, and for tones without the colour of
    the noise, whose model takes a tone for a resonance.
    """
    n = int(s.fit.sum())
    worth = []

    def look(at: BlockModel, stand: Stand, some: list[Candidate], *, soft: bool = False) -> list[Screened]:
        found = screen(s, stand, some, z)
        for c in _best(found, stand, n):
            worth.append((_promise(c, stand, n), replace(refine_scan(s, stand, c, z), soft=soft), at))
        return found

    screened = look(m, take_stand(s, m, z), kinds)
    look(m, take_stand(s, m, z, SOFT), [k for k in kinds if k.linear and k.name not in _SOFT_ITSELF], soft=True)
    white = replace(m, ar=np.zeros_like(m.ar))
    look(white, take_stand(s, white, z), [k for k in kinds if k.name == "disturbance_tone"])
    worth += [(promise, c, m) for promise, c in from_sizes(s, m, value, [k for k in kinds if k.linear == 0], z)]
    return screened, sorted(worth, key=lambda w: -w[0])


# what a soft sign looks like, and a wave that would fit single reversals
_SOFT_ITSELF = ("stribeck", "presliding_hysteresis", "disturbance_tone")


def _best(screened: list[Screened], stand: Stand, n: int) -> list[Screened]:
    """Those worth a refit."""
    ranked = sorted(screened, key=lambda c: -_promise(c, stand, n))
    return [c for c in ranked[:MAX_REFITS] if c.left >= ABSORBED and c.gain > 0.0 and _promise(c, stand, n) > -5.0]


def from_sizes(
    s: Setting, m: BlockModel, value: float, kinds: list[Candidate], z: Scales
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
            promise = longer * delta_bic(n, value, now, kind.n_estimated, 1)
            out.append((promise, Screened(term, max(value - now, 0.0), 1.0, np.empty(0), soft=True)))
    return out


def softened(s: Setting, m: BlockModel) -> BlockModel:
    """The model under a sign that is no sharper than thirty times rms dx."""
    return m.at(min(m.kappa, 30.0 / rms_dx(s, m)))


def _promise(c: Screened, stand: Stand, n: int) -> float:
    kind = c.term.kind
    value = float(stand.errors @ stand.errors)
    return delta_bic(n, value, max(value - c.gain, 1e-3 * value), kind.n_estimated, kind.scanned)


def refit_trial(s: Setting, m: BlockModel, value: float, c: Screened, z: Scales, *, quick: bool = False) -> Trial:
    """The candidate fitted together with the model."""
    kind = c.term.kind
    fitted, now = refit(s, m.plus(c.term), z, quick=quick, soft=c.soft)
    if kind.is_free(kind.linear) is False and kind.name == "parameter_change":
        fitted, now = _walk_time(s, fitted, now, z)
    n = int(s.fit.sum())
    return Trial(c, fitted, now, delta_bic(n, value, now, kind.n_estimated, kind.scanned))


def _from_elsewhere(s: Setting, other: BlockModel, t: Trial, value: float, z: Scales) -> Trial | None:
    """The same candidate from another minimum of the base model."""
    stand = take_stand(s, other, z)
    again = screen(s, stand, [t.kind], z)
    if not again or again[0].gain <= 0.0:
        return None
    fitted, now = refit(s, other.plus(refine_scan(s, stand, again[0], z).term), z)
    n = int(s.fit.sum())
    return Trial(again[0], fitted, now, delta_bic(n, value, now, t.kind.n_estimated, t.kind.scanned))


def _walk_time(s: Setting, m: BlockModel, value: float, z: Scales) -> tuple[BlockModel, float]:
    """The time of a change, moved while the sum of squares falls; the rest stays."""
    step = 0.01 * z.seconds
    last = m.terms[-1]
    best, least = last.q[1], value
    while step >= 0.5 * z.dt:
        for shift in (-step, step):
            time = min(max(best + shift, 0.02 * z.seconds), 0.98 * z.seconds)
            trial = BlockModel(m.theta, (*m.terms[:-1], Term(last.kind, (last.q[0], time))), m.ar, m.kappa)
            now = cost(s, trial)
            if now < least:
                best, least = time, now
        step *= 0.5
    moved = BlockModel(m.theta, (*m.terms[:-1], Term(last.kind, (last.q[0], best))), m.ar, m.kappa)
    return refit(s, moved, z)
