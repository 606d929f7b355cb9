"""What speaks against an effect of a chain: unphysical numbers, single reversals, a base model with equal chances."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from whsklearn.effects import get_effect
from whsklearn.effects.codes import TONE_U
from whsklearn.gap.evidence import delta_bic_of
from whsklearn.gap.plants import chain_evidence as rules
from whsklearn.gap.plants.chain_candidates import Candidate, Scales
from whsklearn.gap.plants.chain_fit import refit, weights_of
from whsklearn.gap.plants.chain_model import ChainModel, Setting, Term, chain, coloured, free_run, raw_errors
from whsklearn.gap.plants.chain_screening import Tangent, coherence, signature, tangent_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]


def unphysical(term: Term, z: Scales) -> str:
    """What is wrong with the sign or the range of a term's numbers; empty if nothing."""
    kind, q = term.kind, term.q
    if kind.positive and q[0] <= 0:
        return f"its size would be {q[0]:.3g}, and a physical one is positive"
    for j in range(kind.linear, kind.n_numbers):
        low, high = kind.ranges(z)[j - kind.linear]
        full = kind.name == "sensor_rectification" and q[j] > rules.WHOLE_FOLD
        if kind.is_free(j) and not full and (q[j] <= low * (1 + 1e-6) or q[j] >= high * (1 - 1e-6)):
            return f"its {kind.fields[j]} runs to the end of the plausible range"
    return ""


def on_a_closer_look(s: Setting, before: ChainModel, model: ChainModel, z: Scales, need: float) -> str:
    """Why the model's last effect may be chance; empty if nothing speaks against it."""
    if worsened(s, before, model) > rules.RUNS_WORSE:
        return "the free run over held-out samples is worse with it"
    kind = model.terms[-1].kind
    n = int(s.fit.sum())
    evidence = delta_bic_of(n, before.cost, model.cost, kind.n_estimated, kind.scanned)
    if evidence > rules.BEYOND_DOUBT * need:
        return ""
    if moves_x(kind) and beside_reversals(s, before, model) < need:
        return "nearly all of its evidence lies beside five reversals, which may have come right by chance"
    if kind.linear and (1.0 - few_samples(s, before, model)) * evidence < rules.WITHOUT_FEW * need:
        return "nearly all of its evidence lies in five samples, such as reversals that came right by chance"
    bare = min(refit(s, m, z, thorough=True, soft=True)[1] for m in (model.without(len(model.terms) - 1), before))
    if delta_bic_of(n, min(bare, before.cost), model.cost, kind.n_estimated, kind.scanned) < need:
        return "the model without it, given the same chances, explains as much"
    return ""


def moves_x(kind: Candidate) -> bool:
    """Whether the effect stands before the law, so that it turns signs."""
    return get_effect(kind.name).place in ("drive", "transmission") or kind.code == TONE_U


def turned(s: Setting, a: ChainModel, b: ChainModel) -> NDArray[np.intp]:
    """Samples at which x moves one way under one model and the other way under the other."""
    steps = [np.diff(chain(s, m)[0], prepend=0.0) for m in (a, b)]
    return np.flatnonzero(np.sign(steps[0]) != np.sign(steps[1]))


def behind(n: int, events: NDArray[np.intp]) -> NDArray[np.intp]:
    """For each of n samples, which event L2 still remembers, by number; -1 for none."""
    if not events.size:
        return np.full(n, -1)
    time = np.arange(n)
    last = np.searchsorted(events, time, side="left") - 1
    return np.where((last >= 0) & (time - events[last] <= rules.SIGN_REMEMBERED), last, -1)


def beside_turned(s: Setting, a: ChainModel, b: ChainModel) -> NDArray[np.bool_]:
    """Samples beside a reversal that one of two models has and the other not."""
    return behind(s.u.size, turned(s, a, b)) >= 0


def beside_reversals(s: Setting, before: ChainModel, after: ChainModel) -> float:
    """Evidence that is left without the five reversals which tell most of those that one model has and the other not.

    A base model that stands a little beside the truth misses a few, and any number that moves x can mend those.
    """
    e0, e1 = (coloured(raw_errors(s, m), m.ar) for m in (before, after))
    gain = np.where(s.fit, pointwise(e0, s.fit) - pointwise(e1, s.fit), 0.0)
    last = behind(gain.size, turned(s, before, after))
    of_each = np.bincount(last[last >= 0], gain[last >= 0])
    return float(gain.sum() - np.sort(np.maximum(of_each, 0.0))[-rules.FEW_EVENTS :].sum())


def pointwise(e: Array, fit: NDArray[np.bool_]) -> Array:
    """What each error costs, -2 ln of its density, outliers capped."""
    variance = weights_of(e[fit])[1]
    floor = np.exp(-0.5 * rules.CAP)
    return np.log(variance) - 2.0 * np.log((np.exp(-0.5 * e**2 / variance) + floor) / (1.0 + floor))


def few_samples(s: Setting, before: ChainModel, after: ChainModel) -> float:
    """Share of the drop of the capped sum of squares that five samples make up."""
    e0, e1 = (coloured(raw_errors(s, m), m.ar)[s.fit] for m in (before, after))
    limits = [rules.WRONG_SIDE * rules.MAD * np.median(np.abs(e)) + 1e-300 for e in (e0, e1)]
    gain = np.clip(e0, -limits[0], limits[0]) ** 2 - np.clip(e1, -limits[1], limits[1]) ** 2
    return float(min(np.sort(gain)[-rules.FEW_EVENTS :].sum() / max(gain.sum(), 1e-300), 1.0))


def worsened(s: Setting, before: ChainModel, after: ChainModel) -> float:
    """Mean square of the free run over held-out samples, over that before; beside turned reversals left out."""
    plain = (s.held >= 0) & ~beside_turned(s, before, after)
    miss0, miss1 = ((s.y - free_run(s, m))[plain] for m in (before, after))
    limit = rules.WRONG_SIDE * rules.MAD * np.median(np.abs(miss0)) + 1e-300
    return float(np.mean(np.clip(miss1, -limit, limit) ** 2) / np.mean(np.clip(miss0, -limit, limit) ** 2))


def same_signature(s: Setting, a: ChainModel, b: ChainModel, z: Scales) -> bool:
    """Whether the last effects of two models leave coherent signatures beyond the model's own parameters."""
    tangent = tangent_of(s, a.without(len(a.terms) - 1), z)
    one, other = (_signature(s, tangent, m.terms[-1], z) for m in (a, b))
    return coherence(one, other) >= rules.SAME_SIGNATURE


def _signature(s: Setting, tangent: Tangent, term: Term, z: Scales) -> Array:
    """What an effect does beyond the model's own parameters, at its fitted shape."""
    columns = tangent.leftover(signature(s, tangent, term.kind, term.q[term.kind.linear :], z))
    return columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
