"""The view of a chain: its whitened one-step prediction errors, outliers capped."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from whsklearn.gap.evidence import Limits
from whsklearn.gap.plant import ViewDefaults
from whsklearn.gap.plants import chain_evidence as rules
from whsklearn.gap.plants import chain_objections as objections
from whsklearn.gap.plants.chain_candidates import Scales
from whsklearn.gap.plants.chain_fit import SOFTENED, deviance, refit, rms_dx, weights_of
from whsklearn.gap.plants.chain_looks import elsewhere, looks_at, refined
from whsklearn.gap.plants.chain_model import (
    ChainModel,
    Setting,
    bounds_of,
    chain,
    coloured,
    free_run,
    free_slots,
    from_vector,
    jacobian,
    raw_errors,
    to_vector,
)
from whsklearn.gap.plants.chain_noise import gain_behind
from whsklearn.gap.plants.chain_remainder import Remainder, remainder, whiteness
from whsklearn.gap.record import rms
from whsklearn.gap.values import Linearised, Look, ModelErrors

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]


@dataclass(eq=False)
class ChainView(ViewDefaults):
    """One record, or its first part, under one split.

    Attributes
    ----------
    setting : Setting
    scales : Scales
    minima : list of ChainModel
        Other minima of the base model.
    quick : bool
        Whether one linear look is enough, as for a surrogate.
    """

    setting: Setting
    scales: Scales
    minima: list[ChainModel] = field(default_factory=list)
    quick: bool = False
    limits: Limits = rules.CAPPED
    _left: dict[int, tuple[ChainModel, Remainder]] = field(default_factory=dict, repr=False)
    _objections: dict[int, tuple[ChainModel, str]] = field(default_factory=dict, repr=False)

    def fit(self, model: ChainModel) -> ChainModel:
        """The model refitted to the training part; as it is where that has been done."""
        if model.on is self.setting:
            return model
        fitted, value = refit(self.setting, model, self.scales)
        return fitted.fitted(self.setting, value)

    def gap(self, model: ChainModel) -> Array:
        """Whitened one-step errors A(q) (y - y_hat), in the output's unit; shape (n,)."""
        return coloured(raw_errors(self.setting, model), model.ar)

    def rms(self, gap: Array) -> float:
        """Root mean square over the samples of the fit, outliers capped: on the wrong side of a reversal is chance."""
        e = gap[self.setting.fit]
        return float(np.sqrt(deviance(e)[0] / e.size))

    def floor(self, model: ChainModel) -> float:
        """What of the gap follows no function of the chain's signals: its rms without what generic functions take."""
        return self.rms(self.gap(model)) * self.noise_share(model)

    def noise_share(self, model: ChainModel) -> float:
        """Rms of what no generic function finds, over the rms of the gap."""
        left = self.left(model)
        return float(np.sqrt(1.0 - min(left.share, rules.MOST_FOLLOWS))) if left.p_value < rules.STILL_LEFT else 1.0

    def left(self, model: ChainModel) -> Remainder:
        """The test of what is left, computed once a model."""
        if id(model) not in self._left:
            self._left[id(model)] = model, remainder(self.setting, model, self.scales)
        return self._left[id(model)][1]

    def quiet(self, model: ChainModel, least: float) -> bool:
        """Whether chance explains what is left: generic functions find nothing in it, and it is white.

        A free run that misses less than ``least`` is quiet whatever a test sees.
        """
        s = self.setting
        miss = (s.y - free_run(s, model))[s.held >= 0]
        if rms(miss) < least:
            return True
        left, added = self.left(model), len(model.terms) > model.n_base
        if left.p_value < (rules.STILL_LEFT if added else rules.LEFT_OVER) and left.share > rules.LEFT_SHARE:
            return False
        return added or whiteness(raw_errors(s, model)[s.fit]).p_value >= rules.LEFT_OVER

    def look(self, model: ChainModel) -> list[Look]:
        """See `whsklearn.gap.plants.chain_looks.looks_at`."""
        looks = looks_at(self.setting, model, self.scales, quick=self.quick)
        if not self.quick and len(model.terms) == model.n_base:
            looks += elsewhere(self.setting, self.minima, looks, self.scales)
        return looks

    def refine(self, model: ChainModel, look: Look) -> ChainModel:
        """The model with the candidate, all numbers fitted together."""
        fitted, value = refined(self.setting, look.start, self.scales)
        return fitted.fitted(self.setting, value, before=model)

    def compare(self, models: Sequence[ChainModel], best: int) -> list[ModelErrors]:
        """Errors of the fit whose squares sum to the capped ones; held-out ones held to four deviations.

        Samples beside a reversal that only one of two models has say nothing: one is off by the sign's height, and
        which one is chance.  There a model is given the errors of the first.
        """
        s = self.setting
        all_errors = [self.gap(m) for m in models]
        first = all_errors[0]
        held = s.held >= 0
        sigma = rules.MAD * float(np.median(np.abs(first[held]))) + 1e-300
        out = []
        for m, e in zip(models, all_errors, strict=True):
            plain = np.where(objections.beside_turned(s, models[0], m), first, e)[held]
            fitted, within = _capped(e[s.fit]), np.clip(plain / sigma, -rules.HELD_TO, rules.HELD_TO)
            out.append(ModelErrors(fitted, within, s.held[held], float(fitted.size)))
        return out

    def explained(self, before: ChainModel, after: ChainModel) -> float:
        """Rms change of the free run by what was added."""
        s = self.setting
        without = after.without(len(after.terms) - 1) if len(after.terms) > len(before.terms) else before
        return rms(free_run(s, after) - free_run(s, without))

    def objection(self, model: ChainModel, index: int) -> str:
        """What is unphysical in a term's numbers, or what speaks against the last one on a closer look."""
        why = objections.unphysical(model.terms[index], self.scales)
        before = model.before
        if why or before is None or index != len(model.terms) - 1 or len(before.terms) != index:
            return why
        if id(model) not in self._objections:  # a closer look costs two refits
            why = objections.on_a_closer_look(self.setting, before, model, self.scales, self.limits.least)
            self._objections[id(model)] = model, why
        return self._objections[id(model)][1]

    def same_signature(self, a: ChainModel, b: ChainModel) -> bool:
        """Whether no such record tells the last effects of two models apart."""
        return objections.same_signature(self.setting, a, b, self.scales)

    def replaceable(self, model: ChainModel, index: int) -> bool:
        """Every effect but the last, which has just been chosen."""
        return index < len(model.terms) - 1

    def surrogate(self, model: ChainModel, rng: np.random.Generator) -> ChainView:
        """The view of a record that the model itself made of the same input."""
        return self.of_surrogate(surrogate_setting(self.setting, model, rng))

    def of_surrogate(self, setting: Setting) -> ChainView:
        """The view of a record in which nothing is missing: one linear look is enough."""
        return ChainView(setting, self.scales, quick=True, limits=self.limits)

    def linearised(self, model: ChainModel) -> Linearised:
        """Weighted errors and their derivatives under a soft sign."""
        s, z = self.setting, self.scales
        soft = model.at(min(model.kappa, SOFTENED / rms_dx(s, model)))
        e = coloured(raw_errors(s, model), model.ar)[s.fit]
        root = np.sqrt(weights_of(e)[0])
        rows = jacobian(s, soft, z, raw_errors(s, soft))[s.fit] * root[:, None]
        x = to_vector(model, z)
        low, high = np.full(x.size, -np.inf), np.full(x.size, np.inf)
        for i, (effect, j) in enumerate(free_slots(model), start=model.theta.size):
            b = bounds_of(model.terms[effect], j, z)
            low[i], high[i] = np.log(b) if np.isfinite(b[0]) and b[0] > 0 else b
        return Linearised(x, low, high, root * e, rows, lambda v: from_vector(model, v, z))


def _capped(e: Array) -> Array:
    """Errors held to four robust deviations, scaled so that their squares sum to the capped sum of squares."""
    limit = rules.HELD_TO * rules.MAD * float(np.median(np.abs(e))) + 1e-300
    held = np.clip(e, -limit, limit)
    return held * float(np.sqrt(deviance(e)[0] / max(float(held @ held), 1e-300)))


def surrogate_setting(
    s: Setting, m: ChainModel, rng: np.random.Generator, *, most: float = np.inf, share: float = 1.0
) -> Setting:
    """The setting with an output that the model made, with noise of the colour of its errors.

    The noise has the size of the errors times ``share``, and ``most`` (rms at the output) at the most.  Over the
    held-out samples it has the size that is expected of it, so that a floor read off this one record has no error of
    sampling.
    """
    from scipy.signal import lfilter

    from whsklearn.estimators._model import inside

    errors = coloured(raw_errors(s, m), m.ar)[s.fit]
    variance = (
        weights_of(errors)[1] * errors.size / max(errors.size - (m.theta.size + len(free_slots(m)) + m.ar.size), 1)
    )
    colour = np.concatenate([[1.0], inside(np.ascontiguousarray(m.ar, dtype=float))])
    white = rng.standard_normal(s.u.size)
    clean = chain(s, m, free=True)[2]
    noisy = chain(s, m, free=True, noise=lfilter([1.0], colour, white))[2] - clean
    held = s.held >= 0
    expected = share * float(np.sqrt(variance)) * gain_behind(s, m, colour)
    size = min(expected, most) / max(rms(noisy[held]), 1e-300)
    noise = size * lfilter([1.0], colour, white)
    return dataclasses.replace(s, y=np.ascontiguousarray(chain(s, m, free=True, noise=noise)[2]))
