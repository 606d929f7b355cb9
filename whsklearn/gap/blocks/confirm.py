"""Whether a name stands against chance: equal chances for the model without it, single samples, twins."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from whsklearn.gap.blocks.candidates import Candidate, Scales
from whsklearn.gap.blocks.fit import CAP, refit, weights_of
from whsklearn.gap.blocks.model import BlockModel, Setting, coloured, raw_errors
from whsklearn.gap.blocks.rounds import from_sizes, refit_trial
from whsklearn.gap.blocks.score import refine_scan, remainder, screen, take_stand
from whsklearn.gap.blocks.trial import Found, Round, Trial, behind, turned
from whsklearn.gap.blocks.twin import twin
from whsklearn.systems.block_effects import TONE_U

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

N_TWINS = 2


def confirmed(s: Setting, found: Found, one: Round, best: Trial, need: float, rng: np.random.Generator) -> bool:
    """Whether the name stands after the model without it has had the same chances, and against its twins."""
    starts = (best.model.without(len(best.model.terms) - 1), found.model)
    fits = [refit(s, m, found.scales, thorough=True, soft=True) for m in starts]
    bare, value = min(fits, key=lambda f: f[1])
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
    if moves_x(best.kind) and beside_reversals(s, found.model, best.model) < need:
        best.reason = "nearly all of its evidence lies beside five reversals, which may have come right by chance"
        return False
    if best.kind.linear and (1.0 - few_samples(s, found.model, best.model)) * best.delta_bic < 0.5 * need:
        best.reason = "nearly all of its evidence lies in five samples, such as reversals that came right by chance"
        return False
    null = max(_twin_score(s, found.model, best.kind, found.scales, rng) for _ in range(N_TWINS))
    limit = max(need, 3.0 * null)
    if best.delta_bic < limit:
        best.reason = f"evidence {best.delta_bic:.0f} is below the {limit:.0f} that chance may reach"
        return False
    return True


def moves_x(kind: Candidate) -> bool:
    """Whether the effect stands before the law, so that it turns signs."""
    from whsklearn.effects import get_effect

    return get_effect(kind.name).place in ("drive", "transmission") or kind.code == TONE_U


def beside_reversals(s: Setting, before: BlockModel, after: BlockModel) -> float:
    """Evidence that is left without the five reversals which tell most of those that one model has and the other not.

    A base model that stands a little beside the truth misses a few, and any number that moves x can mend those.
    """
    e0, e1 = (coloured(raw_errors(s, m), m.ar) for m in (before, after))
    gain = np.where(s.fit, pointwise(e0, s.fit) - pointwise(e1, s.fit), 0.0)
    last = behind(gain.size, turned(s, before, after))
    of_each = np.bincount(last[last >= 0], gain[last >= 0])
    return float(gain.sum() - np.sort(np.maximum(of_each, 0.0))[-5:].sum())


def pointwise(e: Array, fit: NDArray[np.bool_]) -> Array:
    """What each error costs, -2 ln of its density, outliers capped."""
    variance = weights_of(e[fit])[1]
    floor = np.exp(-0.5 * CAP)
    return np.log(variance) - 2.0 * np.log((np.exp(-0.5 * e**2 / variance) + floor) / (1.0 + floor))


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
        found = [c for _, c in from_sizes(other, fitted, value, [kind], z)]
    else:
        stand = take_stand(other, fitted, z)
        found = [refine_scan(other, stand, c, z) for c in screen(other, stand, [kind], z)]
    return max((refit_trial(other, fitted, value, c, z).delta_bic for c in found), default=0.0)
