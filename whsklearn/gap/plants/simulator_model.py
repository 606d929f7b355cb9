"""A user's own simulator with effects: the model that the engine extends, and how its numbers are fitted.

The simulator refits itself; the numbers of an effect are fitted here, together with its own if they can be set.
Otherwise the error is that after a refit, and its derivatives are those without a refit, with the influence of the
simulator's own numbers projected out (variable projection with a black box inside; Golub, Pereyra 2003, Inverse
Problems 19(2), R1-R26).
"""

from __future__ import annotations

import dataclasses
import functools
import itertools
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from whsklearn.effects import Effect, Scales
from whsklearn.gap.least_squares import least_squares
from whsklearn.gap.plant import FittedTerm, WithTerms, with_vectors
from whsklearn.gap.plants.simulator_look import gone, sized_by_drive, smallest
from whsklearn.gap.plants.variant import EffectVariant
from whsklearn.gap.record import Array
from whsklearn.gap.search import HALF
from whsklearn.gap.tangent import Look

STEP = 1e-3  # of a logarithm, of a size relative to itself, of another number relative to a tenth at least
PARTS = 6  # of the record that are excluded in turn: one more than the usual number of parameters of a rigid axis


@dataclass(frozen=True)
class EffectTerm(FittedTerm):
    """One effect in a model."""

    kind: EffectVariant
    still: tuple[str, ...] = ()  # numbers of its shape that no fit moves

    @classmethod
    def of(cls, effect: Effect, still: tuple[str, ...] = ()) -> EffectTerm:
        """The term of an effect; besides ``still``, the numbers stay that do so by their nature."""
        kind = EffectVariant(type(effect), tuple((k, str(v)) for k, v in effect.options.items()))
        return cls(kind, tuple(map(float, effect.row)), (*still, *effect.held, *STILL))

    @property
    def free(self) -> tuple[int, ...]:
        """The size, or cosine and sine weight, and the free numbers of the shape."""
        return tuple(i for i, f in enumerate(self.kind.fields) if i < self.kind.linear or f not in self.still)

    def bounds(self, scales: Scales) -> tuple[list[float], list[float]]:
        """(low, high) of the vector: shapes within what the record can show, and where the term is."""
        ranges = [(-np.inf, np.inf)] * self.kind.linear + self.kind.cls.bounds(scales)
        wide = [sorted((*ranges[i], self.q[i])) for i in self.free]
        logs = [self.kind.ratios(i) for i in self.free]
        low, high = ([float(np.log(max(w[k], 1e-300))) if log else w[k] for w, log in zip(wide, logs, strict=True)]
                     for k in (0, -1))  # fmt: skip
        return low, high

    def steps(self) -> list[float]:
        """Differences for derivatives."""
        size = abs(self.effect.magnitude) or 1.0
        typical = (
            size if i < self.kind.linear else 1.0 if self.kind.ratios(i) else max(abs(self.q[i]), 0.1)
            for i in self.free
        )  # fmt: skip
        return [STEP * x for x in typical]


# Counts, and what only a transmission has.
STILL = ("elements", "load_share", "damping_ratio")


@dataclass(frozen=True)
class SimulatorModel(WithTerms):
    """The simulator with effects, refitted, and its error on the record."""

    simulator: Any  # None until it is built
    terms: tuple[EffectTerm, ...] = ()
    # (n,): measured minus simulated position
    error: Array = dataclasses.field(default_factory=lambda: np.zeros(0), compare=False, repr=False)
    n_base: int = 0  # always zero, because the simulator itself is the base model

    def with_terms(self, terms: Iterable[EffectTerm]) -> SimulatorModel:
        """The model with other terms, not built yet (`SimulatorFit.built`): a simulator keeps the effects it has."""
        return SimulatorModel(None, tuple(terms))

    def moved(self, x: Array, numbers: Array) -> SimulatorModel:
        """The model with other numbers of its effects and of the simulator (unchanged if empty), not simulated."""
        terms = with_vectors(self.terms, x)
        return SimulatorModel(self.simulator.with_numbers(numbers) if numbers.size else self.simulator, terms)


@dataclass
class SimulatorFit:
    """Refits and simulates a simulator on one record."""

    core: Any  # the simulator without effects, refitted
    record: Any
    train: NDArray[np.bool_]  # (n,)
    given: Any = None  # the simulator as it was given, not refitted
    scales: Scales = dataclasses.field(default_factory=Scales)  # of the record
    _known: dict[tuple[str, tuple[EffectTerm, ...]], Any] = dataclasses.field(default_factory=dict, repr=False)

    def _once(self, what: str, terms: tuple[EffectTerm, ...], computed: Callable[[], Any]) -> Any:
        if (what, terms) not in self._known:
            self._known[what, terms] = computed()
        return self._known[what, terms]

    def _of(self, simulator: Any, terms: tuple[EffectTerm, ...]) -> SimulatorModel:
        """The model of a simulator that holds these terms."""
        return SimulatorModel(simulator, terms, self.error(simulator))

    def error(self, simulator: Any) -> Array:
        """Measured minus simulated position, shape (n,).

        Raises ValueError if the simulator returns an array of another length.
        """
        y = np.asarray(simulator.simulate(self.record), dtype=float)
        if y.shape != self.record.position.shape:
            raise ValueError(
                f"simulate gave shape {y.shape}, expected {self.record.position.shape}: one value per sample."
            )
        reach = 1e3 * float(np.ptp(self.record.position)) + 1e-300
        return self.record.position - np.clip(np.nan_to_num(y, nan=reach, posinf=reach, neginf=-reach), -reach, reach)

    def built(self, model: SimulatorModel) -> SimulatorModel:
        """The model with its simulator."""
        if model.simulator is not None:
            return model
        built: SimulatorModel = self._once("built", model.terms, lambda: self.build(model.terms))
        return built

    def build(self, terms: tuple[EffectTerm, ...], *, refit: bool = True) -> SimulatorModel:
        """The core with these effects, refitted, and its error."""
        simulator = holding(self.core, terms)
        return self._of(simulator.refit(self.record, self.train) if refit else simulator, terms)

    def tangent(self, model: SimulatorModel) -> Array:
        """Directions in which the simulator's own numbers move its error, shape (n, k).

        They come from its ``numbers`` if it has them.  Otherwise they come from refits to parts of the training
        samples, whose differences span the same space, because every part is fitted slightly differently.
        """

        def by_numbers() -> Array:
            x = np.asarray(model.simulator.numbers, dtype=float)
            moved = (model.simulator.with_numbers(x + STEP * one) for one in np.eye(x.size))
            columns = [(self.error(m) - model.error) / STEP for m in moved]
            return np.column_stack(columns) if columns else np.zeros((self.train.size, 0))

        def by_parts() -> Array:
            columns = []
            for a, b in itertools.pairwise(np.linspace(0, self.train.size, PARTS + 1).astype(int)):
                part = self.train.copy()
                part[a:b] = False
                columns.append(self.error(model.simulator.refit(self.record, part)) - model.error)
            u, values, _ = np.linalg.svd(np.column_stack(columns), full_matrices=False)
            return np.asarray(u[:, values > 1e-6 * max(values[0], 1e-300)])  # the others are rounding errors

        numbered = hasattr(model.simulator, "with_numbers")
        return np.asarray(self._once("tangent", model.terms, by_numbers if numbered else by_parts))

    def by_terms(self, model: SimulatorModel) -> Array:
        """Derivatives of the error by the numbers of the effects, shape (n, k).

        The simulator's own numbers are held if they can be set; otherwise it is refitted for each derivative.
        """
        columns = []
        for i, t in enumerate(model.terms):
            x = np.array(t.vector())
            for j, h in enumerate(t.steps()):
                moved = x.copy()
                moved[j] += h
                terms = (*model.terms[:i], t.with_vector(moved), *model.terms[i + 1 :])
                columns.append((self._at_numbers_of(model, terms).error - model.error) / h)
        return np.column_stack(columns) if columns else np.zeros((self.train.size, 0))

    def _at_numbers_of(self, model: SimulatorModel, terms: tuple[EffectTerm, ...]) -> SimulatorModel:
        """The model with other terms; the simulator's own numbers are kept if possible, otherwise it is refitted."""
        if not hasattr(model.simulator, "with_numbers"):
            return self.build(terms)
        return self._of(holding(self.core, terms).with_numbers(model.simulator.numbers), terms)

    def homes(self, model: SimulatorModel) -> list[SimulatorModel]:
        """The model, and the same model with the numbers that the simulator had when it was given.

        If these cannot be set, the second is the simulator as it was given with the model's effects.  A refit of a
        model that lacks something large may end so far away that a refit with the effect does not return.
        """
        numbered = hasattr(model.simulator, "with_numbers")

        def given() -> SimulatorModel:
            simulator = (
                model.simulator.with_numbers(np.asarray(self.given.numbers, dtype=float))
                if numbered
                else holding(self.given, model.terms)
            )
            return self._of(simulator, model.terms)

        return [model, self._once("given", model.terms, given)]

    def begun(self, model: SimulatorModel, term: EffectTerm) -> SimulatorModel:
        """The model with one more term; the simulator's own numbers are kept if possible, otherwise it is refitted."""
        return self._placed(model, term, self._vector(model, term))

    def grow(self, model: SimulatorModel, begin: SimulatorModel, weigh: Any, *, again: bool = False) -> SimulatorModel:
        """Fit ``begin``, which is ``model`` with one more term, together with the simulator's numbers.

        If these can be set, all are fitted jointly.  Otherwise the simulator refits itself at every step, and the
        derivatives are those without a refit, with the influence of the simulator's own numbers projected out: of
        ``model``, or with ``again`` those of ``begin``, whose refits take longer.
        """
        term, joint = begin.terms[-1], hasattr(model.simulator, "with_numbers")
        least, best = _square(weigh(begin.error)), begin

        def residual(z: Array) -> Array:
            nonlocal least, best
            try:
                with np.errstate(over="raise", invalid="raise"):  # a run that diverges is no step
                    found = self._placed(model, term, z)
            except (ValueError, FloatingPointError):
                return np.full(int(self.train.sum()), np.inf)
            r = np.asarray(weigh(found.error))
            if _square(r) < least:
                least, best = _square(r), found
            return r

        def slopes(z: Array) -> Array:
            return self._slopes(begin if again else model, model, term.with_vector(z), weigh, again=again)

        x = self._vector(begin, term)
        wide = np.full(x.size - len(term.vector()), np.inf)
        low, high = term.bounds(self.scales)
        steps, ends = np.append(term.steps(), np.full(wide.size, STEP)), (np.append(low, -wide), np.append(high, wide))
        least_squares(residual, x, steps, ends, slopes=None if joint else slopes, workers=1)
        return best if joint else min((best, self.refitted(best)), key=lambda m: _square(weigh(m.error)))

    def refitted(self, model: SimulatorModel) -> SimulatorModel:
        """The model after one more refit: many ``refit`` methods stop after a few evaluations, far from the minimum."""
        return self._of(model.simulator.refit(self.record, self.train), model.terms)

    def _slopes(
        self, own: SimulatorModel, model: SimulatorModel, term: EffectTerm, weigh: Any, *, again: bool
    ) -> Array:
        """Derivatives of the weighted error by the numbers of a term, without the influence of the simulator's own."""
        before = self._freed(own) if again else model.simulator
        at = self.error(before.with_effect(term.effect))
        x, columns = np.array(term.vector()), []
        for j, h in enumerate(term.steps()):
            moved = term.with_vector(x + h * np.eye(1, x.size, j)[0])
            columns.append((self.error(before.with_effect(moved.effect)) - at) / h)
        q, _ = np.linalg.qr(weigh(self.tangent(own)))
        slopes = weigh(np.column_stack(columns))
        return np.asarray(slopes - q @ (q.T @ slopes))

    @staticmethod
    def _freed(model: SimulatorModel) -> Any:
        """The simulator with its last effect cancelled by the opposite torque; an effect that is not a torque stays."""
        effect = model.terms[-1].effect
        if effect.column_kind != "exact":
            return model.simulator
        return model.simulator.with_effect(effect.resized(-effect.magnitude))

    def _vector(self, model: SimulatorModel, term: EffectTerm) -> Array:
        """The numbers of a term, and those of the simulator if it has any."""
        own = np.asarray(getattr(model.simulator, "numbers", ()), dtype=float)
        return np.concatenate([term.vector(), own if hasattr(model.simulator, "with_numbers") else []])

    def _placed(self, model: SimulatorModel, term: EffectTerm, z: Array) -> SimulatorModel:
        """The model with the term at the numbers ``z``; the simulator takes its numbers from there or is refitted."""
        n = len(term.vector())
        term = term.with_vector(z[:n])
        own = model.simulator.with_effect(term.effect)
        joint = hasattr(own, "with_numbers")
        own = own.with_numbers(z[n:]) if joint else own.refit(self.record, self.train)
        return self._of(own, (*model.terms, term))


def _square(r: Array) -> float:
    return float(r @ r)


def holding(simulator: Any, terms: tuple[EffectTerm, ...]) -> Any:
    """A simulator with these effects."""
    return functools.reduce(lambda held, t: held.with_effect(t.effect), terms, simulator)


# --- the fit of one effect: its size first, then all its numbers together --------------------------
def refine(plant: Any, model: SimulatorModel, look: Look) -> SimulatorModel:
    """The model with the effect at its best numbers and the simulator refitted; unchanged if it cannot be added."""
    model = plant.fits.built(model)
    plant.tune(model.error)
    best: SimulatorModel | None = None
    scanned = {"order", "frequency"} & set(look.start[0].shape_fields())  # waves have many minima
    for start in look.start if scanned else look.start[:1]:
        try:
            found = grown(plant, model, start)
        except (ValueError, NotImplementedError, FloatingPointError) as error:
            plant.refused[look.name] = str(error)
            continue
        if best is None or plant.left(found) < plant.left(best):
            best = found
    if best is None:
        refused = (*model.terms, EffectTerm.of(look.start[0].resized(0.0)))
        return SimulatorModel(model.simulator, refused, model.error)
    whole = plant.scale * gone(plant.motion, model.error, np.zeros_like(model.error), plant.record)
    if look.size**2 > HALF * whole**2 and plant.left(best) > HALF * plant.left(model):
        best = min((best, anew(plant, model, look.start[0])), key=plant.left)
    left = plant.left(model)
    while plant.left(best) < HALF * left:
        plant.tune(best.error)  # weighted by the residual; the previous weights hid the effect's own spectrum
        again = plant.fits.grow(model, best, plant.weighed, again=True)
        left, best = plant.left(best), min((best, again), key=plant.left)
    return best


def grown(plant: Any, model: SimulatorModel, start: Any) -> SimulatorModel:
    """A start whose size is fitted first, then all its numbers together.

    The fit begins from the simulator's refitted numbers or from those that it had when given, whichever is better with
    the effect: a refit without it may have changed them greatly to compensate.
    """
    pairs = begins(plant, model, start)
    home, begin = min(pairs, key=lambda pair: plant.rms(plant.weighed(pair[1].error)))
    return plant.fits.grow(home, begin, plant.weighed)


def anew(plant: Any, model: SimulatorModel, start: Any) -> SimulatorModel:
    """The same, with the simulator refitted beside the effect before all numbers are fitted together.

    Bristles in place of dry friction move inertia, damping and friction far from both starts.  Steps along the
    derivatives there gain nothing, although the look has promised to explain most of the gap.
    """
    refitted = (plant.fits.refitted(begin) for _, begin in begins(plant, model, start))
    return plant.fits.grow(model, min(refitted, key=plant.left), plant.weighed, again=True)


def begins(plant: Any, model: SimulatorModel, start: Any) -> list[tuple[SimulatorModel, SimulatorModel]]:
    """(home, home with the effect at its estimated size) for every home of the model."""
    fits = plant.fits
    return [
        (home, fits.begun(home, EffectTerm.of(effect, plant.whole_fields)))
        for home in fits.homes(model)
        for effect in sizes(plant, home, start)
    ]


def sizes(plant: Any, home: SimulatorModel, start: Any) -> list[Any]:
    """The effect at the sizes given by the simulation's slope and by the drive along the measured motion.

    The slope is that of a run from numbers that the effect's lack has moved.  From there the fit of the spring of a
    joint that sticks half of the time did not arrive, and 7 % of the motion had no name.  A simulator that refits
    itself has no numbers that could be fitted beside the other size.
    """
    if start.column_kind != "exact":
        return [start]
    effects = [sized(plant, home, start)]
    if hasattr(home.simulator, "with_numbers") or isinstance(start, plant.further_shapes):
        effects.append(sized_by_drive(plant.motion, start, plant.train))
    positive = start.quantities[start.size].low >= 0.0 and not start.phased
    return list(dict.fromkeys(start if positive and e.magnitude <= 0.0 else e for e in effects))


def sized(plant: Any, model: SimulatorModel, start: Any) -> Any:
    """The size (and phase) from the sensitivity of the simulated position to it."""
    slopes, shape = smallest(plant, model, start)
    own = plant.weighed(plant.fits.tangent(model))
    columns = np.column_stack([plant.weighed(slopes), own])
    size = -np.linalg.lstsq(columns, plant.weighed(model.error), rcond=1e-9)[0][: slopes.shape[1]]
    return type(start).from_coefficients(size, **shape)
