"""The search: screen, refit the best, take the one that stands out, look again; exchange and prune."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from whsklearn.effects.terms import COULOMB
from whsklearn.gap.blocks.candidates import Candidate, Scales, catalogue_for
from whsklearn.gap.blocks.fit import climb, cost, fit_base, refit, rms_dx, shortened
from whsklearn.gap.blocks.model import BlockModel, Setting, Term, coloured, free_run, raw_errors, signal_scales
from whsklearn.gap.blocks.score import (
    ABSORBED,
    SOFT,
    Remainder,
    Screened,
    Stand,
    coherence,
    refine_scan,
    remainder,
    screen,
    signature,
    take_stand,
)
from whsklearn.gap.blocks.twin import twin

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

NEED = 30.0  # delta BIC for a name
MARGIN = 10.0  # delta BIC over the next name
SIMILAR = 0.97  # coherence of two signatures that no record like this one tells apart
QUIET = 1e-4  # p-value below which something is left
MAX_REFITS = 7
N_TWINS = 2
# near neighbours, of which neither is told without having tried the other
PARTNERS = (("actuator_lag", "input_delay"), ("input_delay", "actuator_lag"))
SCREEN_SAMPLES = 6000  # of a longer record, to try sizes on


@dataclass
class Trial:
    """A candidate refitted on top of a model."""

    screened: Screened
    model: BlockModel
    cost: float
    delta_bic: float
    moved: float = 0.0  # rms change of the simulated output, share of rms y
    better: float = 0.0  # share of held-out blocks improved
    held_gain: float = 0.0
    worse: float = 1.0  # held-out mean square of the free run, over that without the effect
    reason: str = ""

    @property
    def kind(self) -> Candidate:
        """What was tried."""
        return self.screened.term.kind

    @property
    def name(self) -> str:
        """Canonical name."""
        return self.kind.name


@dataclass
class Round:
    """One pass over the catalogue."""

    before: BlockModel
    cost: float
    screened: list[Screened]
    trials: list[Trial]
    taken: Trial | None = None


@dataclass
class Found:
    """Where the search ended."""

    base: BlockModel
    base_cost: float
    minima: list[tuple[BlockModel, float]]
    scales: Scales
    model: BlockModel
    cost: float
    rounds: list[Round] = field(default_factory=list)
    taken: list[Trial] = field(default_factory=list)
    left: Remainder | None = None
    base_left: Remainder | None = None
    interrupted: bool = False


def delta_bic(n: int, before: float, after: float, numbers: int, places: int) -> float:
    """n ln(before / after) - p ln n - 2 ln(places), sums of squares on n samples."""
    return float(n * np.log(before / max(after, 1e-300)) - numbers * np.log(n) - 2 * np.log(max(places, 1)))


def held_errors(s: Setting, m: BlockModel) -> tuple[Array, NDArray[np.intp]]:
    """Whitened prediction errors of the held-out samples and their blocks."""
    mask = s.held >= 0
    return coloured(raw_errors(s, m), m.ar)[mask], s.held[mask]


def weigh(s: Setting, before: BlockModel, trial: Trial) -> None:
    """What held-out samples and the free run say of a trial."""
    e0, block = held_errors(s, before)
    e1, _ = held_errors(s, trial.model)
    limit = 6.0 * 1.4826 * np.median(np.abs(e0)) + 1e-300  # a sample beside a reversal is off by the sign's height
    e0, e1 = np.clip(e0, -limit, limit), np.clip(e1, -limit, limit)
    wins = [np.sum(e1[block == i] ** 2) < np.sum(e0[block == i] ** 2) for i in np.unique(block)]
    trial.better = float(np.mean(wins))
    trial.held_gain = 1.0 - float(e1 @ e1) / max(float(e0 @ e0), 1e-300)
    run, held = free_run(s, trial.model), s.held >= 0
    apart = run - free_run(s, trial.model.without(len(trial.model.terms) - 1))
    trial.moved = float(np.sqrt(np.mean(apart**2) / np.mean(s.y**2)))
    miss0, miss1 = ((s.y - r)[held] for r in (free_run(s, before), run))
    limit = 6.0 * 1.4826 * np.median(np.abs(miss0)) + 1e-300
    trial.worse = float(np.mean(np.clip(miss1, -limit, limit) ** 2) / np.mean(np.clip(miss0, -limit, limit) ** 2))


def objection(s: Setting, trial: Trial, z: Scales, need: float, tolerance: float) -> str:
    """Why a trial earns no name; empty if it does."""
    if trial.delta_bic < need:
        return f"evidence {trial.delta_bic:.0f} is below the {need:.0f} that chance may reach"
    if trial.moved < tolerance:
        return f"it moves the output by {100 * trial.moved:.2f} % of its rms, below the tolerance"
    if trial.held_gain <= 0 or trial.better < 0.6:
        return f"it improves only {100 * trial.better:.0f} % of the held-out blocks"
    if trial.worse > 1.01:
        return "the free run over held-out samples is worse with it"
    kind, q = trial.kind, trial.model.terms[-1].q
    if kind.positive and q[0] <= 0:
        return f"its size would be {q[0]:.3g}, and a physical one is positive"
    for j in range(kind.linear, kind.n_numbers):
        low, high = kind.ranges(z)[j - kind.linear]
        full = kind.name == "sensor_rectification" and q[j] > 0.5
        if kind.is_free(j) and not full and (q[j] <= low * (1 + 1e-6) or q[j] >= high * (1 - 1e-6)):
            return f"its {kind.fields[j]} runs to the end of the plausible range"
    return ""


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
    stand = take_stand(s, m, z)
    screened = screen(s, stand, kinds, z)
    n = int(s.fit.sum())
    worth = [(_promise(c, stand, n), refine_scan(s, stand, c, z)) for c in _best(screened, stand, n)]
    soft = take_stand(s, m, z, SOFT)
    more = screen(s, soft, [k for k in kinds if k.linear and k.name not in _SOFT_ITSELF], z)
    worth += [(_promise(c, soft, n), refine_scan(s, soft, c, z)) for c in _best(more, soft, n)]
    worth += _from_sizes(s, m, value, [k for k in kinds if k.linear == 0], z)
    worth.sort(key=lambda w: -w[0])
    tried: dict[str, Trial] = {}
    visible = {c.term.kind.label: c.left for c in screened}
    for promise, c in worth:
        label = c.term.kind.label
        if promise < 0.0 or visible.get(label, 1.0) < ABSORBED:
            continue
        if label not in tried and len(tried) >= MAX_REFITS:
            continue
        one = _refit_trial(s, m, value, c, z, quick=promise < 15.0)
        if label not in tried or one.cost < tried[label].cost:
            tried[label] = one
    for name, other_name in PARTNERS:
        if any(t.name == name for t in tried.values()) and not any(t.name == other_name for t in tried.values()):
            found = [c for _, c in worth if c.term.kind.name == other_name]
            if found:
                one = _refit_trial(s, m, value, found[0], z)
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


_SOFT_ITSELF = ("stribeck", "presliding_hysteresis")  # what a soft sign looks like


def _best(screened: list[Screened], stand: Stand, n: int) -> list[Screened]:
    """Those worth a refit."""
    ranked = sorted(screened, key=lambda c: -_promise(c, stand, n))
    return [c for c in ranked[:MAX_REFITS] if c.left >= ABSORBED and c.gain > 0.0 and _promise(c, stand, n) > -5.0]


def _from_sizes(
    s: Setting, m: BlockModel, value: float, kinds: list[Candidate], z: Scales
) -> list[tuple[float, Screened]]:
    """Candidates whose size is a shape, from every size of the grid by a few steps: most of what they do is to turn
    single signs, which no slope shows.
    """
    short = shortened(s, SCREEN_SAMPLES)
    if short is not s:
        value = cost(short, m)
    n = int(short.fit.sum())
    longer = s.fit.sum() / n
    out = []
    for kind in kinds:
        found = []
        for shape in kind.shapes(z):
            start = m.plus(Term(kind, shape))
            start = start.at(min(m.kappa, 60.0 / rms_dx(short, start)))
            fitted, _ = climb(short, start, z, steps=4)
            found.append((cost(short, fitted.at(m.kappa)), fitted.terms[-1]))
        found.sort(key=lambda f: f[0])
        now, term = found[0]
        promise = longer * delta_bic(n, value, now, kind.n_numbers, 1)
        out.append((promise, Screened(term, max(value - now, 0.0), 1.0, np.empty(0))))
    return out


def _promise(c: Screened, stand: Stand, n: int) -> float:
    kind = c.term.kind
    value = float(stand.errors @ stand.errors)
    return delta_bic(n, value, max(value - c.gain, 1e-3 * value), kind.n_numbers, kind.scanned)


def _refit_trial(s: Setting, m: BlockModel, value: float, c: Screened, z: Scales, *, quick: bool = False) -> Trial:
    kind = c.term.kind
    fitted, now = refit(s, m.plus(c.term), z, quick=quick)
    if kind.is_free(kind.linear) is False and kind.name == "parameter_change":
        fitted, now = _walk_time(s, fitted, now, z)
    n = int(s.fit.sum())
    return Trial(c, fitted, now, delta_bic(n, value, now, kind.n_numbers, kind.scanned))


def _from_elsewhere(s: Setting, other: BlockModel, t: Trial, value: float, z: Scales) -> Trial | None:
    """The same candidate from another minimum of the base model."""
    stand = take_stand(s, other, z)
    again = screen(s, stand, [t.kind], z)
    if not again or again[0].gain <= 0.0:
        return None
    fitted, now = refit(s, other.plus(refine_scan(s, stand, again[0], z).term), z)
    n = int(s.fit.sum())
    return Trial(again[0], fitted, now, delta_bic(n, value, now, t.kind.n_numbers, t.kind.scanned))


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


def search(
    s: Setting,
    rng: np.random.Generator,
    *,
    max_effects: int = 3,
    tolerance: float = 0.003,
    need: float = NEED,
    progress: Callable[[str], None] = lambda _: None,
) -> Found:
    """Find what the base model lacks; an interruption keeps the finished rounds."""
    progress("base model")
    minima = fit_base(s, rng)
    base, value = minima[0]
    z = signal_scales(s, base)
    found = Found(base, value, minima, z, base, value)
    kinds = catalogue_for(s.law.codes)
    found.base_left = found.left = remainder(s, base, z)
    progress("search")
    try:
        for number in range(max_effects):
            others = [m for m, c in minima[1:3] if c < 4.0 * value] if number == 0 else []
            one = try_all(s, found.model, found.cost, kinds, z, others=others)
            found.rounds.append(one)
            for t in one.trials:
                t.reason = objection(s, t, z, need, tolerance)
            sound = [t for t in one.trials if not t.reason]
            if not sound or sound[0].delta_bic < 0.6 * one.trials[0].delta_bic:
                break
            if not confirmed(s, found, one, sound[0], need, rng):
                break
            one.taken = sound[0]
            found.taken.append(sound[0])
            found.model, found.cost = sound[0].model, sound[0].cost
            if number > 0:
                exchange(s, found, kinds, need, tolerance)
        prune(s, found, need)
        found.left = remainder(s, found.model, z)
    except KeyboardInterrupt:
        found.interrupted = True
    return found


def confirmed(s: Setting, found: Found, one: Round, best: Trial, need: float, rng: np.random.Generator) -> bool:
    """Whether the name stands after the model without it has had the same chances, and against its twins."""
    bare, value = refit(s, best.model.without(len(best.model.terms) - 1), found.scales, thorough=True)
    n = int(s.fit.sum())
    if value < found.cost:
        for t in one.trials:
            t.delta_bic -= float(n * np.log(found.cost / value))
        found.cost, found.model = value, bare
        one.cost, one.before = value, bare
        if not found.taken:
            found.base, found.base_cost = bare, value
            found.base_left = found.left = remainder(s, bare, found.scales)
    if best.delta_bic > 10.0 * need:
        return True
    if best.kind.linear and (1.0 - few_samples(s, found.model, best.model)) * best.delta_bic < 0.5 * need:
        best.reason = "nearly all of its evidence lies in five samples, such as reversals that came right by chance"
        return False
    null = max(_twin_score(s, found.model, best.kind, found.scales, rng) for _ in range(N_TWINS))
    limit = max(need, 3.0 * null)
    if best.delta_bic < limit:
        best.reason = f"evidence {best.delta_bic:.0f} is below the {limit:.0f} that chance may reach"
        return False
    return True


def few_samples(s: Setting, before: BlockModel, after: BlockModel) -> float:
    """Share of the drop of the capped sum of squares that five samples make up."""
    e0, e1 = (coloured(raw_errors(s, m), m.ar)[s.fit] for m in (before, after))
    limits = [6.0 * 1.4826 * np.median(np.abs(e)) + 1e-300 for e in (e0, e1)]
    gain = np.clip(e0, -limits[0], limits[0]) ** 2 - np.clip(e1, -limits[1], limits[1]) ** 2
    return float(min(np.sort(gain)[-5:].sum() / max(gain.sum(), 1e-300), 1.0))


def _twin_score(s: Setting, m: BlockModel, kind: Candidate, z: Scales, rng: np.random.Generator) -> float:
    """Evidence for the effect on a record in which it is not there."""
    other = twin(s, m, rng)
    fitted, value = refit(other, m, z)
    if kind.linear == 0:
        found = [c for _, c in _from_sizes(other, fitted, value, [kind], z)]
    else:
        stand = take_stand(other, fitted, z)
        found = [refine_scan(other, stand, c, z) for c in screen(other, stand, [kind], z)]
    return max((_refit_trial(other, fitted, value, c, z).delta_bic for c in found), default=0.0)


def exchange(s: Setting, found: Found, kinds: list[Candidate], need: float, tolerance: float) -> None:
    """Try every earlier effect against all others in its place: it was chosen when more was missing."""
    for i in range(len(found.taken) - 1):
        without, value = refit(s, found.model.without(i), found.scales)
        one = try_all(s, without, value, kinds, found.scales)
        for t in one.trials:
            t.reason = objection(s, t, found.scales, need, tolerance)
        best = next((t for t in one.trials if not t.reason), None)
        if best is None or best.cost > found.cost * (1 - 1e-4):
            continue
        terms = list(best.model.terms)
        terms.insert(i, terms.pop())
        found.model = BlockModel(best.model.theta, tuple(terms), best.model.ar, best.model.kappa)
        found.cost = best.cost
        found.taken[i] = best
        found.rounds[i].trials = one.trials


def prune(s: Setting, found: Found, need: float) -> None:
    """Drop effects that the others have made needless."""
    n = int(s.fit.sum())
    for i in reversed(range(len(found.taken))):
        if len(found.taken) < 2:
            return
        kind = found.taken[i].kind
        smaller, value = refit(s, found.model.without(i), found.scales)
        evidence = delta_bic(n, value, found.cost, kind.n_numbers, kind.scanned)
        if evidence < need:
            found.model, found.cost = smaller, value
            del found.taken[i]


def aliases_of(s: Setting, one: Round, taken: Trial, z: Scales) -> tuple[list[str], list[str]]:
    """(names that no such record tells from the one taken, names that this record leaves open)."""
    i = len(taken.model.terms) - 1
    stand = take_stand(s, taken.model.without(i), z)
    mine = signature_of(s, stand, taken.model.terms[i], z)
    alike: list[str] = []
    close: list[str] = []
    for t in one.trials:
        if t.name == taken.name or taken.delta_bic - t.delta_bic >= MARGIN:
            continue
        c = coherence(mine, signature_of(s, stand, t.model.terms[-1], z))
        (alike if c >= SIMILAR else close).append(t.name)
    return list(dict.fromkeys(alike)), [n for n in dict.fromkeys(close) if n not in alike]


def signature_of(s: Setting, stand: Stand, term: Term, z: Scales) -> Array:
    """What an effect does beyond the model's own parameters, at its fitted shape."""
    columns = stand.leftover(signature(s, stand, term.kind, term.q[term.kind.linear :], z))
    return columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
