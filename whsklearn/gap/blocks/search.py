"""The search: take the effect that stands out, look again; exchange, prune."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from whsklearn.gap.blocks.alike import simplest
from whsklearn.gap.blocks.candidates import Candidate, catalogue_for
from whsklearn.gap.blocks.confirm import confirmed
from whsklearn.gap.blocks.fit import fit_base, refit
from whsklearn.gap.blocks.model import BlockModel, Setting, signal_scales
from whsklearn.gap.blocks.rounds import NEED, try_all
from whsklearn.gap.blocks.score import FITS, remainder
from whsklearn.gap.blocks.stretch import LONG, carried_over, first_stretch, speaks
from whsklearn.gap.blocks.trial import Found, delta_bic, objection, worsened


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
    if s.u.size > LONG:
        part = search(first_stretch(s), rng, max_effects=max_effects, tolerance=tolerance, need=need)
        found = carried_over(s, part)
        if part.interrupted or not speaks(found):
            return found
        most = min(max_effects, len(found.taken) + 1)
    else:
        minima = fit_base(s, rng)
        base, value = minima[0]
        found = Found(base, value, minima, signal_scales(s, base), base, value)
        found.base_left = found.left = remainder(s, base, found.scales)
        most = max_effects
    progress("search")
    try:
        while len(found.taken) < most and take_one(s, found, rng, tolerance, need):
            if len(found.taken) > 1:
                exchange(s, found, catalogue_for(s.law.codes), need, tolerance)
        prune(s, found, need)
        retreat(s, found)
        found.left = remainder(s, found.model, found.scales)
    except KeyboardInterrupt:
        found.interrupted = True
    return found


def take_one(s: Setting, found: Found, rng: np.random.Generator, tolerance: float, need: float) -> bool:
    """One round: whether an effect earned its name, which is then in the model."""
    z = found.scales
    once = {t.name for t in found.taken if t.kind.linear == 0}  # of a play, a limit or a delay an axis has one
    kinds = [k for k in catalogue_for(s.law.codes) if k.name not in once]
    others = [] if found.taken else [m for m, c in found.minima[1:3] if c < 4.0 * found.cost]
    one = try_all(s, found.model, found.cost, kinds, z, others=others)
    found.rounds.append(one)
    for t in one.trials:
        t.reason = objection(s, t, z, need, tolerance)
    sound = [t for t in one.trials if not t.reason]
    if not sound or sound[0].delta_bic < 0.6 * one.trials[0].delta_bic:
        return False
    best = simplest(s, found.model, sound, z)
    sure = confirmed(s, found, one, best, need, rng)
    for t in one.trials:  # the model before may be a better one now, and less is evidence
        t.reason = t.reason if t is best else objection(s, t, z, need, tolerance)
    if not sure:
        return False
    one.taken = best
    found.taken.append(best)
    found.model, found.cost = best.model, best.cost
    renew(s, found, rng)
    return True


def renew(s: Setting, found: Found, rng: np.random.Generator) -> None:
    """Search the blocks anew with the effects in place, if the errors still follow something.

    A strong effect bends the base model's blocks so far that no refit from there comes back.
    """
    found.left = remainder(s, found.model, found.scales)
    if found.left.p_value > FITS or found.left.share < 0.02:
        return
    model, value = fit_base(s, rng, n_starts=96, terms=found.model.terms)[0]
    if value < 0.98 * found.cost:
        n, last = int(s.fit.sum()), found.taken[-1]
        last.delta_bic += float(n * np.log(found.cost / value))
        last.model, last.cost = model, value
        found.model, found.cost = model, value


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
        evidence = delta_bic(n, value, found.cost, kind.n_estimated, kind.scanned)
        if evidence < need:
            found.model, found.cost = smaller, value
            del found.taken[i]


def retreat(s: Setting, found: Found) -> None:
    """Take effects back, the last first, while the repaired model runs worse over held-out samples than the base."""
    while found.taken and worsened(s, found.base, found.model) > 1.01:
        found.taken.pop()
        found.model = found.model.without(len(found.model.terms) - 1)
        found.model, found.cost = refit(s, found.model, found.scales) if found.taken else (found.base, found.base_cost)
