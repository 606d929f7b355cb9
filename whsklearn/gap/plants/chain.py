"""A Wiener-Hammerstein chain as a plant: input u, output y, and two linear blocks with a law between them."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any

import numpy as np

from whsklearn.effects import FrictionLaw, Quantization, as_law, get_effect
from whsklearn.effects.base import Array, Bools, rms
from whsklearn.effects.law import has_knots, without_knots
from whsklearn.gap.calibration import GATE, N_NULL, p_value
from whsklearn.gap.data_check import FEWEST_SAMPLES, FLAT, SPIKE, DataProblem, flat_share
from whsklearn.gap.diagnosis import ALPHA, NamedEffect
from whsklearn.gap.filters import whiteness
from whsklearn.gap.localisation import spectra
from whsklearn.gap.plant import Figures, Gap, Linearised, Plant, Reading, Told
from whsklearn.gap.plants import chain_model as cm
from whsklearn.gap.plants.chain_anew import beside_the_best, fitted, fitted_anew, is_strong, nudged, promising
from whsklearn.gap.plants.chain_fit import (
    base_starts,
    cost,
    falls_short,
    least,
    minima,
    polished,
    sharpened,
    with_knots,
)
from whsklearn.gap.plants.chain_looks import SLOPED, Seen, gained, kinds, look
from whsklearn.gap.plants.chain_model import ChainHypothesis, Record
from whsklearn.gap.record import HELD_OUT, OUTLYING
from whsklearn.gap.search import LEAST_SHARE, STILL, WORTH_FITTING
from whsklearn.gap.tangent import Look
from whsklearn.systems.wiener_hammerstein import WienerHammersteinSystem

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray


# a chain at rest whose |sgn(dx)| is always one does not move: through L2, a constant of v is a constant of y
ALIASES = {
    "output_offset": ("asymmetric_coulomb",),
    "asymmetric_coulomb": ("output_offset",),
    "input_offset": ("output_offset", "asymmetric_coulomb"),
}
SEARCHED = 8000  # samples of a longer record in which effects are searched for, to save time
UNEXPLAINED = 0.1  # of the output's rms: a free run that leaves less has blocks near the true ones
AT_BOUND = 1.02  # ratio to the end of a range within which a shape counts as being at the end


class ChainPlant(Plant):
    """u -> L1 -> law -> L2 -> y with logged input and output.

    ``base``: law (the knots of a named one are placed by the record), orders (n_a, n_b, n_c, n_d) of the base model,
    and the number of its two blocks that have a direct path. The law lies between delays, so no record shows which of
    the two blocks it is. ``dt``: one if the log has no time, so that frequencies are in cycles per sample. ``at`` (n,):
    place of every sample on the grid of ``dt``, if the log has holes. ``given_model``: returned if nothing can be
    diagnosed.
    """

    units = logged = ("", "")
    gap_word = "whitened error"
    whole = "output"
    horizon_unit = "samples"
    exact = True

    def __init__(
        self, u: Array, y: Array, base: tuple[str | FrictionLaw | None, tuple[int, ...], int], *, tolerance: float,
        dt: float = 1.0, at: NDArray[np.intp] | None = None, given_model: Any = None,
    ):  # fmt: skip
        self.u, self.y = (np.array(v, dtype=float) for v in (u, y))  # the compiled pass needs writable arrays
        law, self.orders, self.direct = base
        self.law = as_law(law)
        self.placed = not (isinstance(law, str) and has_knots(self.law.terms))
        self.at = np.arange(self.u.size) if at is None else at
        self.length = int(self.at[-1]) + 1 if self.at.size else 0
        self.tolerance, self.dt, self.given_model, self.own_units = tolerance, dt, given_model, {}
        self.scale = rms(self.y) if self.y.size and np.isfinite(self.y).all() else 1.0
        self.horizons = (1.0, 10.0, float(self.length))
        self.headline = float(self.length)
        self._others: list[ChainHypothesis] = []
        self._near: set[str] = set()
        self._known: dict[tuple[int, str], tuple[ChainHypothesis, Any]] = {}

    def check(self) -> list[DataProblem]:
        """See `whsklearn.gap.plants.chain.check_chain`; holes may not be longer than what was logged."""
        found = check_chain(self.u, self.y)
        if self.length - self.u.size > self.u.size:  # holes cost time and show nothing
            text = (
                f"{self.length - self.u.size} samples are missing in the holes of the log, which has {self.u.size}. "
                "Cut it at the longest hole and pass one part."
            )
            found.append(DataProblem("data-holes", "More is missing than was logged", text))
        return found

    # --- models -----------------------------------------------------------------------------------
    def readings(self, n: int | None = None) -> Record:
        """The record in the form that fits take, or the part of it up to its n-th logged sample."""
        n = self.length if n is None else int(self.at[n - 1]) + 1
        law = self.law if self.placed else without_knots(self.law)
        dims = np.array([*self.orders, len(law)], dtype=np.int64)
        seen = np.zeros(self.length, dtype=bool)
        seen[self.at] = True
        u, y = (np.interp(np.arange(self.length), self.at, v) for v in (self.u, self.y))
        u = np.concatenate([u[self.direct :], np.zeros(self.direct)])
        return Record.of(u[:n], y[:n], self.dt, dims, law, seen[:n])

    def base(self, rng: np.random.Generator) -> ChainHypothesis:
        """The best of the base model's minima; the others are kept as starts for candidates."""
        s = self.readings(min(self.u.size, SEARCHED))
        found = minima(s, base_starts(s, rng))
        if not self.placed:
            for _ in range(2):
                s, found = with_knots(s, found[0], self.law)
            found[0] = least(s, found[0])
        self.record, self._others = s, found[1:]
        self.everything = s if s.u.size == self.length else dataclasses.replace(self.readings(), law=s.law, dims=s.dims)
        self.n_effective = float(s.fit.sum())
        self.unit = cm.loudness(found[0].ar)  # so that errors are in the unit of the output
        self._first = rms(self.errors(found[0]))
        return found[0]

    def _once(self, what: str, model: ChainHypothesis, computed: Callable[[], Any]) -> Any:
        """What was computed for a model before; the model stays there, so that no other gets its id."""
        key = id(model), what
        if key not in self._known:
            self._known[key] = model, computed()
        return self._known[key][1]

    def settled(self, model: ChainHypothesis) -> ChainHypothesis:
        """The model fitted until it converges, to the least minimum nearby."""
        out: ChainHypothesis = self._once("settled", model, lambda: least(self.record, polished(self.record, model)))
        return self._once("settled", out, lambda: out)

    def part(self, model: ChainHypothesis) -> ChainHypothesis:
        """The model fitted to the first part of the record, which is not used to judge it."""
        s = self.everything
        early = dataclasses.replace(s, fit=s.fit & ~self._later())
        return self._once("part", model, lambda: sharpened(early, model, (cm.SHARPEST,), 12))

    def _later(self) -> Bools:
        """The last `HELD_OUT` of the logged samples, which judge a model that is fitted to the others."""
        seen = self.everything.seen
        return np.asarray(np.cumsum(seen) - seen >= (1.0 - HELD_OUT) * self.u.size)

    def errors(self, model: ChainHypothesis) -> Array:
        """Whitened errors of the free run with outliers capped, in the unit of the output."""
        return self.unit * cm.held(cm.left(self.record, model)[self.record.fit])

    # --- the search -------------------------------------------------------------------------------
    def seen(self, model: ChainHypothesis, rng: np.random.Generator) -> Seen:
        """The look at a model, computed once."""
        return self._once("seen", model, lambda: look(self.record, model, rng))

    def looks(
        self, model: ChainHypothesis, rng: np.random.Generator, beside: ChainHypothesis | None = None
    ) -> list[Look]:
        """Look at every candidate beside the model, in the record and in the model's own records.

        Strong candidates are refitted if anything is missing, and beside the base model in any case: the blocks absorb
        most of a lag, and a lost sign leaves so large a residual that it may pass for noise.  The gate keeps the
        significance level: past it, something has been shown to be missing.
        """
        seen = self.seen(model, rng)
        looks = [dataclasses.replace(k, size=k.size * self.unit) for k in seen.looks]
        shown = seen.p_value <= GATE
        # an effect that is tried again beside others competes with those that came close to it before
        among = self._near if beside and shown else None
        strong = [k for k in kinds(self.record, model) if shown or k.folds or not model.terms]
        strong = [k for k in strong if is_strong(k, self.record) and (among is None or k.name in among)]
        others = self._others if not model.terms else []
        starts = promising(self.record, model, seen.looks, among) if shown else []
        grown = [(t.kind, fitted(self.record, [model], t)) for t in starts]
        best = min((m for _, m in grown), key=lambda m: cost(self.record, m), default=model)
        if not shown or self._may_be_bent(best, rng):
            grown += fitted_anew(self.record, model, others, strong, rng)
            additive = [t for t in starts if others and not is_strong(t.kind, self.record)]
            grown += [(t.kind, fitted(self.record, others, t)) for t in additive]
        grown += beside_the_best(self.record, grown, among)
        anew, missing = [pair for pair in grown if is_strong(pair[0], self.record)], seen.p_value
        if anew and missing > ALPHA:
            missing = min(missing, 2.0 * self._p_anew(model, anew, len(looks), rng))  # two tests
        before = rms(self.errors(model))
        out: dict[str, Look] = {}
        for kind, m in grown:
            g = gained(self.record, model, m)
            null = max((k.null for k in looks if k.name == kind.name), key=np.mean, default=np.zeros(2))
            size = before * np.sqrt(max(0.0, -np.expm1(-g / self.n_effective)))
            p = max(missing, p_value(g, null, len(looks)))
            if kind.name not in out or g > out[kind.name].gain:
                out[kind.name] = Look(kind.name, g, null, m, kind.n_numbers, float(size), 1.0, p)
        ranked = sorted(out.values(), key=lambda k: -k.score)
        self._near |= {k.name for k in ranked if k.size**2 > WORTH_FITTING * ranked[0].size ** 2}
        return sorted([*(k for k in looks if k.name not in out), *ranked], key=lambda k: -k.score)

    def p_of_all(self, model: ChainHypothesis, rng: np.random.Generator) -> float:
        """The smallest p-value of the look: the errors are whitened, so that no colour hides an effect."""
        return self.seen(self.settled(model), rng).p_value

    def _may_be_bent(self, model: ChainHypothesis, rng: np.random.Generator) -> bool:
        """Whether the blocks may be so distorted that no effect fits from their present values.

        A large residual passes for noise of its own colour, and a look at it then says little.
        """
        s = self.record
        run = (s.y - cm.chain_free_run(s, model))[s.fit]
        return rms(run) > UNEXPLAINED * self.scale or self.seen(model, rng).p_value <= GATE

    def _p_anew(self, model: ChainHypothesis, grown: list[Any], families: int, rng: np.random.Generator) -> float:
        """p-value of the best of these fits among fits of its candidate to the model's own records."""
        kind, best = min(grown, key=lambda pair: cost(self.record, pair[1]))
        size, g, others = gained(self.record, model, best), [], [] if model.terms else self._others
        if p_value(size, np.zeros(N_NULL), families) > GATE:  # nor could it be small in any records
            return 1.0
        for _ in range(N_NULL):
            other = cm.made(self.record, model, rng)
            own = sharpened(other, model, (cm.SHARPEST,))
            ways = [own, *(m for _, m in fitted_anew(other, own, others, [kind], rng))]
            g.append(max(gained(other, own, w) for w in ways))
        return p_value(size, np.array(g), families)

    def refine(self, model: ChainHypothesis, look: Look) -> ChainHypothesis:
        """The candidate fitted together with the model until it converges."""
        s = self.record
        if isinstance(look.start, ChainHypothesis):
            return polished(s, nudged(s, look.start))
        return polished(s, fitted(s, [model], look.start))

    def objection(self, model: ChainHypothesis, grown: ChainHypothesis) -> str:
        """The physical objection to an effect's parameters, or that it explains too little beside the others."""
        term = grown.terms[-1]
        z = cm.sizes(self.record, grown)
        for i in term.kind.free:
            value, (low, high) = term.q[i], term.kind.range_of(i, z)
            name = term.kind.fields[i].replace("_", " ")
            if term.kind.ratios(i) and not AT_BOUND * low < value < high / AT_BOUND:
                return f"its {name} is at the end of the range that such a record can show"
            if name == "damping ratio" and 2.0 * value**2 > 1.0:  # its response has no peak
                return "a pair of poles with so much damping is not a resonance: the orders are too low"
        if term.kind.positive and term.q[0] < 0.0:
            return f"its {term.kind.fields[0].replace('_', ' ')} would be negative"
        if model.terms and self.size(self.errors(model), self.errors(grown)) < STILL * self._first:
            # as little may be due to the form of the first effect: a delay between samples is interpolated
            return "it explains too little of the residual beside the others"
        return ""

    def aliases(self, name: str) -> tuple[str, ...]:
        """Names that no record of a chain can distinguish from ``name``."""
        cls: Any = get_effect(name)
        return tuple(cls.aliases) if cls.evaluate is not None else ALIASES.get(name, ())

    # --- proof ------------------------------------------------------------------------------------
    def follows(self, model: ChainHypothesis) -> float:
        """Share of a model's mean square residual that nameless functions explain beyond chance."""
        _, seen = self._known.get((id(model), "seen"), (None, None))
        if seen is None or min((k.p_value for k in seen.looks if not k.name), default=1.0) > GATE:
            return 0.0
        return min(float(seen.share), 0.99)

    def figures(self, base: ChainHypothesis, model: ChainHypothesis, nameless: float = 0.0) -> Figures:
        """Whitened error before, after, and the part that is noise, in the unit of the output."""
        before, after = (rms(self.errors(m)) for m in (base, model))
        return Figures(before, after, after * float(np.sqrt(1.0 - self.follows(model))), nameless)

    def shown_by(self, model: ChainHypothesis) -> float:
        """Errors are in the unit of the output under the colour of the base model's residual, in which an effect that
        is missing may be the loudest part: noise of 3 % of the output was stated as 13 %.
        """
        return cm.loudness(model.ar) / self.unit

    def simulate(self, model: ChainHypothesis, horizon: float) -> Array:
        """Prediction ``horizon`` samples ahead by the model fitted to the first part; over the whole, its free run."""
        s, model = self.everything, self.part(model)
        run = cm.chain_free_run(s, model)
        if horizon >= s.y.size:
            return run
        return s.y - np.convolve(cm.left(s, model), cm.response(model.ar, int(horizon)))[: s.y.size]

    def measured(self, *models: ChainHypothesis) -> tuple[Array, Bools]:
        """(output, mask of held-out samples), without those that are on the wrong side of a sign under the last model.

        No fit can avoid a few of them, and they would make up most of a mean square.
        """
        s = self.everything
        judged = s.fit & self._later()
        if len(models) == 2 and models[0] is not models[1]:
            judged &= ~self._turned(models[1])
        return s.y, judged

    def _turned(self, model: ChainHypothesis) -> Bools:
        """Samples that follow one on the wrong side of a sign, while the colour remembers it."""
        e = cm.left(self.everything, self.part(model))
        far = np.abs(e) > cm.clip_at(e[self.everything.seen])
        return np.convolve(far, np.ones(cm.AR_ORDER))[: far.size] > 0.5

    def made(self, model: ChainHypothesis, rng: np.random.Generator) -> ChainPlant:
        """The plant of a record made by the model, with the unexplained part of its errors as noise."""
        base = self.law, self.orders, self.direct
        other = ChainPlant(self.u, self.y, base, tolerance=self.tolerance, dt=self.dt, at=self.at)
        s, fitted = self.everything, self.part(model)
        quiet = cm.chain_free_run(s, fitted)
        noise = cm.made(s, fitted, rng).y - quiet
        # scaled to the size expected over the judged samples, because a floor has no sampling error
        size = cm.loudness(fitted.ar) * np.sqrt(cm.variance_of(cm.left(s, fitted)[s.fit]) * (1.0 - self.follows(model)))
        other.everything = other.record = s.with_output(quiet + noise * size / rms(noise[self.measured()[1]]))
        other._known = {(id(model), "part"): (model, fitted)}
        return other

    def reading(self, base: ChainHypothesis, model: ChainHypothesis) -> Reading:
        """The grid of the readings, if rounding is a considerable part of the residual.

        Also what the base model lacks in its orders and law, if that explains more than the effects found.
        """
        shortfall = falls_short(self.record, base, model) if self.follows(model) else ""
        step = coarse_grid(self.record, model, self.tolerance)
        grid = [NamedEffect(Quantization(step), {}, float(self.y.size), 0.0)] if step else []
        return Reading(grid, shortfall)

    # --- report -----------------------------------------------------------------------------------
    def linearised(self, model: ChainHypothesis) -> Linearised:
        """Residual and derivatives at all samples except the first ones, under a soft sign."""
        s = self.everything
        m = self.final(model)
        e = cm.left(s, m)[s.fit]
        rows = cm.sensitivities(s, m, SLOPED / cm.rms_dx(s, m))[s.fit]
        return Linearised(
            cm.to_vector(m), *cm.bounds(m, cm.sizes(s, m)), cm.held(e), rows, lambda v: cm.from_vector(m, v)
        )

    def final(self, model: ChainHypothesis) -> ChainHypothesis:
        """The model fitted to all samples."""
        if self.everything is self.record:
            return model
        return self._once("final", model, lambda: sharpened(self.everything, model, (cm.SHARPEST,), 12))

    def gap(self, model: ChainHypothesis) -> Gap:
        """Whitened errors with outliers capped; the numbers of a chain are not regression coefficients of its error."""
        signals = signals_of(self.record, model, self.units)
        return Gap(self.errors(model), self.dt, {k: (v[self.record.fit], unit) for k, (v, unit) in signals.items()}, {})

    def units_at(self, joint: str) -> tuple[str, str]:
        """None: x and v have no units, whatever the units of the log are."""
        return "", ""

    def numbers(self, model: ChainHypothesis) -> dict[str, tuple[float, str]]:
        """Natural parameters by name; they have no units."""
        return {k: (v, "") for k, v in cm.numbers_of(self.record, model).items()}

    def told(self, base: ChainHypothesis, model: ChainHypothesis) -> Told:
        """Whiteness before and after, remarks, and the series that the page draws."""
        tests = [
            whiteness(cm.clipped(cm.left(self.record, m)[self.record.fit]), f"outliers clipped, {word}", cm.AR_ORDER)
            for word, m in (("before", base), ("after", model))
        ]
        return Told(tests, self._notes(), self._pictures(base, model))

    def _notes(self) -> list[str]:
        """Remarks on how the record was used."""
        holes = len(cm.pieces_of(self.everything.seen)) - 1
        passed = (
            f"All segments are used: the model runs through {holes} hole{'s' if holes > 1 else ''} under an "
            f"interpolated input, and the {cm.SKIP} samples after a hole, where its state is not known, do not count."
        )
        long = f"Effects were searched for in the first {SEARCHED} samples and fitted to all {self.u.size}."
        return [
            *([passed] if holes else []),
            *([long] if self.record is not self.everything else []),
            "All errors are those of the free run, whitened by an autoregression of the residual. Null "
            "distributions come from records simulated with the model.",
            f"Errors before and after exclude samples on the wrong side of a sign (beyond {OUTLYING:.0f} robust "
            f"deviations, and {cm.AR_ORDER - 1} more samples): no fit can avoid a few of them, and they would make up "
            "most of the mean square.",
            f"For the proof all numbers are fitted to the first {100 * (1.0 - HELD_OUT):.0f} % of the record; the rest "
            "judges them. Which effects are present was decided on the whole record.",
        ]

    def _pictures(self, base: ChainHypothesis, model: ChainHypothesis) -> dict[str, Any]:
        """Measured output and free runs, the gap over time, and its spectra by frequency and by order of x."""
        s, whole = self.record, self.everything
        runs = {word: self.simulate(m, self.headline) for word, m in (("before", base), ("after", model))}
        drawn = s.fit | (np.arange(s.u.size) < cm.SKIP)  # the spectra skip the first ones themselves
        errors = (cm.left(s, m) * drawn for m in (base, model))
        unit = cm.loudness(model.ar)
        before, after = (unit * np.clip(e, -cm.clip_at(e[drawn]), cm.clip_at(e[drawn])) for e in errors)
        x = cm.simulate(s, base)[0]
        return {
            "gap_time": np.arange(s.u.size) * s.dt, "usable": s.fit, "units": ("", ""), "what": "whitened error",
            "output": "output", "window": 200, "clock": "s" if s.dt != 1.0 else "samples",
            **spectra(before, after, s.dt, x, np.linspace(0.3, 12.0, 160) / max(rms(x), 1e-12), cm.SKIP),
            "time": np.arange(self.length) * self.dt, "measured": np.where(whole.seen, whole.y, np.nan),
            "runs": runs, "held": self.measured()[1], "beside_turned": self._turned(model),
            "axes": signals_of(whole, base, self.units),
            "floor": self.shown_by(model) * self.figures(base, model).floor,
        }  # fmt: skip

    def system(self, model: ChainHypothesis) -> WienerHammersteinSystem:
        """The repaired system with its effects and the grid of its readings."""
        s = self.everything
        final = cm.stable(s, self.final(model))
        a, b, w, c, d = (final.theta[part].copy() for part in s.blocks)
        grid = coarse_grid(s, final, self.tolerance)
        effects = [*(t.effect for t in final.terms), *([Quantization(grid)] if grid else [])]
        return WienerHammersteinSystem(
            np.append(1.0, a), b, np.append(1.0, c), d, s.law.reweighted(w),
            effects=effects, dt=self.dt, direct=self.direct,
        )  # fmt: skip


# --- the record itself ----------------------------------------------------------------------------
def check_chain(u: Array, y: Array) -> list[DataProblem]:
    """Problems of a record; all of them are fatal.

    >>> import numpy as np
    >>> [p.code for p in check_chain(np.ones(1000), np.random.default_rng(0).normal(size=1000))]
    ['data-no-drive']
    """
    bad = [name for name, x in (("input", u), ("output", y)) if not np.all(np.isfinite(x))]
    if bad:
        text = f"The {' and the '.join(bad)} holds values that are missing or not finite; repair or remove them."
        return [DataProblem("data-not-finite", "Missing values", text)]
    if u.size < FEWEST_SAMPLES:
        text = (
            f"{u.size} samples; at least {FEWEST_SAMPLES} are needed to distinguish an effect from noise. Log longer."
        )
        return [DataProblem("data-too-short", "Record too short", text)]
    if np.ptp(u) == 0 or np.mean(np.diff(u) == 0) > 1.0 - FLAT:
        text = "The input is constant or changes in fewer than 2 % of the samples; pick the input that was applied."
        return [DataProblem("data-no-drive", "The input does not change", text)]
    if np.ptp(y) == 0 or np.mean(np.diff(y) == 0) > 1.0 - FLAT:
        text = "The output is constant or changes in fewer than 2 % of the samples; pick the measured output."
        return [DataProblem("data-not-moving", "The output does not change", text)]
    out = []
    share = flat_share(y)
    if share > FLAT > 1.0 / np.unique(y).size:  # of fewer values each is there as often
        text = (
            f"The output is at its extreme for {100 * share:.0f} % of the record. Either the log clips it, or the "
            "plant stops there, like a tank that overflows. A chain of this kind does not: pass the part before it."
        )
        out.append(DataProblem("data-clipped-position", "The output stops at its extreme", text))
    jumps = np.abs(y - np.median(y))
    spikes = int(np.sum(jumps > SPIKE * (np.quantile(jumps, 0.99) + 1e-300)))
    if spikes:
        text = f"{spikes} samples of the output are far away from all others; repair the outliers."
        out.append(DataProblem("data-spikes", "Outliers in the output", text))
    return out


def coarse_grid(s: Record, m: ChainHypothesis, tolerance: float) -> float:
    """Step of the grid of the readings if rounding is worth naming and a considerable part of the residual, else 0."""
    rounding = s.step**2 / 12.0
    if rounding <= (tolerance * rms(s.y[s.seen])) ** 2:
        return 0.0
    white = (1.0 + float(m.ar @ m.ar)) * rounding  # A(q) on white rounding errors
    return s.step if white > LEAST_SHARE * cm.variance_of(cm.left(s, m)[s.fit]) else 0.0


def signals_of(s: Record, m: ChainHypothesis, units: tuple[str, str]) -> dict[str, tuple[Array, str]]:
    """The signals that the gap may follow, delayed by one sample like the output of L2."""
    x, _, y_hat = cm.simulate(s, m)
    dx = np.diff(x, prepend=x[:1])
    out: dict[str, tuple[Any, str]] = {"time": (np.arange(s.u.size) * s.dt, "s" if s.dt != 1.0 else "samples")}
    late = {"input": (s.u, units[0]), "x": (x, ""), "dx": (dx, "")}
    out |= {k: (np.concatenate([v[:1], v[:-1]]), unit) for k, (v, unit) in late.items()}
    return out | {"output": (y_hat, units[1])}
