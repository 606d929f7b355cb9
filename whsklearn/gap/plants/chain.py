"""A Wiener-Hammerstein chain as a plant: u in, y out, two linear blocks and a law between them."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from whsklearn.effects import Quantization
from whsklearn.estimators import _model as wh
from whsklearn.gap.data_check import Problem
from whsklearn.gap.diagnosis import NamedEffect
from whsklearn.gap.plant import PlantDefaults
from whsklearn.gap.plants import chain_evidence as rules
from whsklearn.gap.plants import chain_pictures, chain_structure
from whsklearn.gap.plants.chain_base import Base, base_of
from whsklearn.gap.plants.chain_candidates import BETWEEN, FoundEffect, own_attribute
from whsklearn.gap.plants.chain_check import check_chain
from whsklearn.gap.plants.chain_fit import fit_base, refit
from whsklearn.gap.plants.chain_law import LawChoice, bent
from whsklearn.gap.plants.chain_model import SKIP, ChainModel, Setting, free_run
from whsklearn.gap.plants.chain_noise import ahead_errors, coarse_grid, quietest_band
from whsklearn.gap.plants.chain_objections import beside_turned
from whsklearn.gap.plants.chain_view import ChainView, surrogate_setting
from whsklearn.gap.record import held_out_blocks, rms
from whsklearn.gap.values import Linearised
from whsklearn.systems.wiener_hammerstein import WienerHammersteinSystem

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

# at rest nothing moves in a chain whose |sgn(dx)| is always one: a constant of v is one of y through L2
ALIASES = {
    "output_offset": ("asymmetric_coulomb",),
    "asymmetric_coulomb": ("output_offset",),
    "input_offset": ("output_offset", "asymmetric_coulomb"),
}
COMMONER = {"cogging": ("gravity_imbalance",), "presliding_hysteresis": ("stribeck",)}


class ChainPlant(PlantDefaults):
    """u -> L1 -> law -> L2 -> y, whose input and output are logged.

    Parameters
    ----------
    u, y : ndarray of shape (n,)
    base : (LawChoice, tuple of int, int)
        Law and orders (n_a, n_b, n_c, n_d) of the base model, and how many of its two blocks have a direct path: the
        law stands between delays, so which one cannot be told.
    tolerance : float
        Smallest change of the output worth a name, share of its rms.
    dt : float
        Sampling time; one where the log has no time, so that frequencies are in cycles a sample.
    given_model : WienerHammersteinSystem, optional
        What is handed back if nothing can be diagnosed.
    """

    units = logged = ("", "")
    own_units: ClassVar[dict[str, str]] = {}
    gap_word = "one-step error"
    whole = "output"
    horizon_unit = "samples"

    def __init__(
        self, u: Array, y: Array, base: tuple[LawChoice, tuple[int, ...], int], *, tolerance: float, dt: float = 1.0,
        given_model: Any = None,
    ):  # fmt: skip
        self.u, self.y = (np.array(v, dtype=float) for v in (u, y))  # a pass takes arrays that may be written
        self.law, self.orders, self.direct = base
        self.tolerance, self.dt, self.given_model = tolerance, dt, given_model
        self.scale = rms(self.y) if self.y.size and np.isfinite(self.y).all() else 1.0
        self.horizons = (1.0, 10.0, float(self.y.size))
        self.headline = float(self.y.size)
        self._larger: chain_structure.Structure | None = None
        self._folded: ChainModel | None = None
        self._on_whole: dict[int, tuple[ChainModel, ChainModel]] = {}

    def check(self) -> list[Problem]:
        """See `whsklearn.gap.plants.chain_check.check_chain`."""
        return check_chain(self.u, self.y)

    # --- models and views -------------------------------------------------------------------
    def setting(self, n: int | None = None) -> Setting:
        """The first n samples, their split, orders and law as fits take them."""
        n = self.u.size if n is None else n
        held, train = held_out_blocks(n)
        skipped = np.arange(n) < SKIP
        law = self.law.first()
        dims = np.array([*self.orders, len(law)], dtype=np.int64)
        u = np.concatenate([self.u[self.direct :], np.zeros(self.direct)])[:n]
        return Setting(
            np.ascontiguousarray(u), self.y[:n], self.dt, dims, law, train & ~skipped, np.where(skipped, -1, held)
        )

    def base(self, rng: np.random.Generator) -> ChainModel:
        """The least of the base model's minima; the others are kept for candidates to start from."""
        long = self.u.size > rules.LONG_RECORD
        found: Base = base_of(self.setting(rules.SEARCHED if long else None), self.law, rng)
        self._views = [ChainView(found.setting, found.scales, found.minima[1:])]
        if long:
            whole = dataclasses.replace(self.setting(), law=found.setting.law, dims=found.setting.dims)
            scales = dataclasses.replace(found.scales, n=self.u.size)
            self._views.append(ChainView(whole, scales))
        self._base, self._folded = found.minima[0], found.folded
        return self._base

    def verdict_view(self, base: ChainModel) -> Any:
        """The whole record."""
        return self.whole_view

    def view(self, model: ChainModel, after: Any | None) -> ChainView | None:
        """The view after the one given, the first after none."""
        later = 0 if after is None else next(i for i, v in enumerate(self._views) if v is after) + 1
        return self._views[later] if later < len(self._views) else None

    @property
    def whole_view(self) -> ChainView:
        """Of the whole record."""
        return self._views[-1]

    def settle(self, model: ChainModel) -> ChainModel:
        """The model fitted to the whole record's training part; blocks anew where its errors still follow something.

        A strong effect bends the base model's blocks so far that no refit from there comes back.
        """
        view = self.whole_view
        model = view.fit(model)
        left = view.left(model)
        if left.p_value > rules.STILL_LEFT or left.share < rules.LEFT_SHARE or model.on is None:
            return model
        short = self._views[0]
        anew = fit_base(short.setting, np.random.default_rng(0), n_starts=48, terms=model.terms)[0][0]
        other = view.fit(anew)
        return other if other.cost < rules.BETTER_ANEW * model.cost else model

    def on_record(self, model: ChainModel) -> ChainModel:
        """A model fitted to the whole record's training part: a base model may be found on its first part."""
        if model.on is self.whole_view.setting or not any(model.on is v.setting for v in self._views):
            return model  # of another record it keeps its numbers
        if id(model) not in self._on_whole:
            self._on_whole[id(model)] = model, self.whole_view.fit(model)
        return self._on_whole[id(model)][1]

    def surrogate(self, model: ChainModel, rng: np.random.Generator) -> ChainPlant:
        """The plant of a record that the model made, with the least noise that any model or the spectrum allows.

        What generic functions still find in the model's errors is no noise: a wrong repair would else be held against
        a floor as high as its own error, and seem to close all.
        """
        same = self.law, self.orders, self.direct
        other = ChainPlant(self.u, self.y, same, tolerance=self.tolerance, dt=self.dt)
        s = self.whole_view.setting
        most = quietest_band(s.y)
        if self._larger is not None:
            at = self._larger.setting
            miss = (at.y - free_run(at, self._larger.model))[at.fit]
            most = min(most, rms(miss))
        fitted = self.on_record(model)
        made = surrogate_setting(s, fitted, rng, most=most, share=self.whole_view.noise_share(fitted))
        other._views = [self.whole_view.of_surrogate(made)]
        other.y = made.y
        other._on_whole = {id(model): (model, fitted)}
        return other

    def falls_short(self, base: ChainModel, model: ChainModel) -> str:
        """What the base model's orders and law lack, where that explains more than the effects found."""
        view = self._views[0]
        model = model if model.on is view.setting else view.fit(model)
        left = view.left(model)
        if left.p_value > rules.LEFT_OVER or left.share < rules.LEFT_SHARE:
            return ""
        s = view.setting
        start = base if base.on is s else view.fit(base)
        self._larger = chain_structure.larger_base(s, start, view.scales)
        if not chain_structure.too_small(model.cost, self._larger):
            return ""
        return chain_structure.sentence(self._larger, s.dims)

    def follows(self, model: ChainModel) -> float:
        """Share of the base model's gap that generic functions still find in what a model leaves; 0 if by chance."""
        view = self.whole_view
        model = self.on_record(model)
        left = view.left(model)
        remains = left.share * view.rms(view.gap(model)) ** 2
        before = view.rms(view.gap(self.on_record(self._base))) ** 2
        explained = max(before - view.rms(view.gap(model)) ** 2, 0.0)
        share = remains / max(explained + remains, 1e-300) if len(model.terms) > model.n_base else left.share
        if left.p_value < rules.FOLLOWS_SURE:
            return float(share)
        return float(share) if left.p_value < rules.FOLLOWS_LIKELY and share > rules.FOLLOWS_MUCH else 0.0

    def read_off(self, model: ChainModel) -> list[Any]:
        """A lost sign; the grid of the readings, where rounding is a good part of what is left."""
        if self._folded is not None and len(model.terms) == model.n_base:
            turned = FoundEffect("sensor_rectification", "sensor", "y = (1 - f) q + f |q|", {"fraction": 1.0})
            return [NamedEffect(turned, {}, float(self.y.size), rules.SIGN_SEEN, 1.0)]
        step = coarse_grid(self.whole_view.setting, self.on_record(model))
        if not step:
            return []
        grid = FoundEffect("quantization", "sensor", "y = s round(q / s)", {"step": step})
        return [NamedEffect(grid, {}, float(self.y.size), rules.GRID_SEEN, 0.0)]

    def as_given(self, base: ChainModel) -> tuple[ChainPlant, ChainModel]:
        """The base model of the readings as they are, where their sign was lost."""
        return self, base if self._folded is None else self._folded

    def aliases(self, name: str) -> tuple[str, ...]:
        """Names that no record of a chain tells from ``name``."""
        return own_attribute(name, "aliases") or ALIASES.get(name, ())

    def commoner(self, name: str) -> tuple[str, ...]:
        """Names preferred to ``name`` on a tie."""
        return own_attribute(name, "commoner") or COMMONER.get(name, ())

    def linearised(self, model: ChainModel) -> Linearised:
        """Of all samples but the first ones."""
        return self._everything().linearised(self._final(model))

    # --- proof --------------------------------------------------------------------------------
    def simulate(self, model: ChainModel, horizon: float) -> Array:
        """Prediction ``horizon`` samples ahead; over the whole record, the free run."""
        s, model = self.whole_view.setting, self.on_record(model)
        if model.on is not None and model.on.law is not s.law:  # of another record: its own law and orders
            s = dataclasses.replace(s, law=model.on.law, dims=model.on.dims)
        return free_run(s, model) if horizon >= s.y.size else s.y - ahead_errors(s, model, int(horizon))

    def measured(self, *models: ChainModel) -> tuple[Array, NDArray[np.bool_]]:
        """(output, held-out samples), without those on the wrong side of a reversal of x.

        Of two models, samples beside a reversal that only one of them has, and those that the second misses by more
        than six robust deviations: there an error is the sign's height, and on which side a model stands is chance.
        A few of them make up most of a mean square.
        """
        s = self.whole_view.setting
        held = s.held >= 0
        if len(models) == 2 and models[0] is not models[1]:
            base, model = (self.on_record(m) for m in models)
            miss = np.abs(s.y - free_run(s, model))
            far = miss > rules.WRONG_SIDE * rules.MAD * float(np.median(miss[held]))
            held &= ~beside_turned(s, base, model) & ~far
        return s.y, held

    def figures(self, base: ChainModel, model: ChainModel) -> tuple[float, float, float]:
        """(one-step error before, after, what of it is noise), in the output's unit."""
        view, base, model = self.whole_view, self.on_record(base), self.on_record(model)
        floor = min(view.floor(base), view.floor(model))
        if self._larger is not None:
            floor = min(floor, float(np.sqrt(self._larger.cost / self._larger.setting.fit.sum())))
        return view.rms(view.gap(base)), view.rms(view.gap(model)), floor

    # --- report -------------------------------------------------------------------------------
    def gap_to_locate(self, model: ChainModel) -> Array:
        """The one-step errors, held to six robust deviations."""
        e = self.whole_view.gap(self.on_record(model))[SKIP:]
        limit = rules.WRONG_SIDE * rules.MAD * float(np.median(np.abs(e))) + 1e-300
        return np.clip(e, -limit, limit)

    def signals(self, model: ChainModel) -> dict[str, tuple[Array, str]]:
        """Name -> (signal at the judged samples, unit)."""
        axes = chain_pictures.axes(self.whole_view.setting, self.on_record(model))
        return {k: (v[SKIP:], unit) for k, (v, unit) in self._with_units(axes).items()}

    def _with_units(self, axes: dict[str, tuple[Array, str]]) -> dict[str, tuple[Array, str]]:
        known = {"input": self.units[0], "output": self.units[1]}
        return {k: (v, known.get(k, unit)) for k, (v, unit) in axes.items()}

    def regressors(self, model: ChainModel) -> tuple[dict[str, tuple[float, Array]], Array, float]:
        """None: a chain's numbers are not regression coefficients of its error."""
        return {}, self.gap_to_locate(model), self.dt

    def residual_tests(self, base: ChainModel, model: ChainModel) -> list[dict[str, Any]]:
        """Whiteness and generic functions, before and after."""
        return chain_pictures.residual_tests(self.whole_view, self.on_record(base), self.on_record(model))

    def parameters(self, model: ChainModel) -> dict[str, float]:
        """Natural parameters by name."""
        s = self.whole_view.setting
        na, nb, nc, nd, _ = (int(i) for i in s.dims)
        names = [f"a_{i}" for i in range(2, na + 1)] + [f"b_{i}" for i in range(1, nb + 1)] + list(s.law.labels)
        names += [f"c_{i}" for i in range(2, nc + 1)] + [f"d_{i}" for i in range(1, nd + 1)]
        return dict(zip(names, map(float, model.theta), strict=True))

    def notes(self, base: ChainModel, model: ChainModel) -> list[str]:
        """Remarks on how the record was used."""
        s = self.whole_view.setting
        long = [
            f"Names were looked for in the first {rules.SEARCHED} samples, their numbers fitted to all {s.u.size}; "
            "what only the whole record shows had one more round."
        ]
        return [
            *(long if len(self._views) > 1 else []),
            "Noise enters as equation error; under the right model the one-step errors are white.",
            "Errors before and after leave out samples on the wrong side of a reversal (beside one that only one of "
            "the two models has, or beyond six robust deviations): a few of them, which no fit can rule out, would "
            "make up most of the mean square.",
            "The noise floor is the error of the repaired model against a record that it made itself, with the least "
            "noise that any fitted model, or the quietest band of the output's spectrum, allows.",
            f"{int(s.fit.sum())} samples in five parts are used for fitting, the {int((s.held >= 0).sum())} "
            "between them for judging.",
        ]

    def pictures(self, base: ChainModel, model: ChainModel) -> dict[str, Any]:
        """Series that the page draws."""
        series = chain_pictures.pictures(self.whole_view, self.on_record(base), self.on_record(model))
        return series | {"axes": self._with_units(series["axes"])}

    def _everything(self) -> ChainView:
        s = self.whole_view.setting
        return ChainView(s.on_all(int(np.argmax(s.fit))), self.whole_view.scales)

    def _final(self, model: ChainModel) -> ChainModel:
        """The model fitted to all samples."""
        return refit(self._everything().setting, model, self.whole_view.scales)[0] if model.terms else model

    def system(self, model: ChainModel) -> WienerHammersteinSystem:
        """The repaired system with its effects and the grid of its readings."""
        s = self.whole_view.setting
        final = self._final(self.on_record(model))
        structure = wh.Structure(s.dims, 1, s.law, -1 if s.law.key is None else s.law.key)
        named = wh.named(final.theta, structure)
        law = s.law.reweighted(final.theta[structure.slices()[2]])
        for t in final.terms:
            law = bent(law, t.name, t.q[0]) if t.kind.variant == BETWEEN else law
        effects = [e for e in (t.kind.of_library(t.q) for t in final.terms) if e is not None]
        grid = coarse_grid(s, final)
        if grid:
            effects.append(Quantization(grid))
        return WienerHammersteinSystem(
            named["a"], wh.inside(named["b"]), named["c"], wh.inside(named["d"]), law, effects=effects, dt=self.dt,
            direct=self.direct,
        )  # fmt: skip
