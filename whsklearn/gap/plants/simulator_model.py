"""A user's own simulator with effects: the model that the engine extends, and how its numbers are fitted.

The simulator refits itself; the numbers of an effect are fitted here.  They are found by Gauss-Newton on the error
after a refit.  Its derivatives are those without a refit, with the influence of the simulator's own numbers projected
out (variable projection with a black box inside; Golub, Pereyra 2003, Inverse Problems 19(2), R1-R26).
"""

from __future__ import annotations

import dataclasses
import itertools
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from whsklearn.effects import Effect
from whsklearn.gap.plants.simulator_look import gone, sized_by_drive, smallest
from whsklearn.gap.search import HALF
from whsklearn.gap.tangent import Look

Array = NDArray[Any]

STEP = 1e-3  # of a logarithm
PARTS = 6  # of the record that are excluded in turn: one more than the usual number of parameters of a rigid axis
ITERATIONS = 10  # of Gauss-Newton; half of the effects need only two
LEAST_GAIN = 1e-3  # of the sum of squares: a step that gains less is the last one with these derivatives
WORTH_SLOPES = 0.25  # of the sum of squares without the effect: with a larger residual, no new derivatives are computed
FARTHEST = 3.0  # factor on a shape number in one step; a contact's relaxation of 20 ms would otherwise become 0.5 s
SHORTER = (1.0, 0.3, 0.1)  # shares of a step that are tried


@dataclass(frozen=True)
class EffectTerm:
    """One effect in a model; ``searched`` are the shape fields that a fit may move."""

    effect: Effect
    searched: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """Canonical name."""
        return self.effect.name

    @property
    def phased(self) -> bool:
        """Whether a cosine and a sine weight represent size and phase."""
        return self.effect.phased

    def vector(self) -> list[float]:
        """Size, or cosine and sine weight, and then the searched shape numbers."""
        size = list(self.effect.coefficients) if self.phased else [self.effect.magnitude]
        return [*map(float, size), *(float(getattr(self.effect, f)) for f in self.searched)]

    def with_vector(self, x: Array) -> EffectTerm:
        """The term with other numbers.

        Raises
        ------
        ValueError
            If the effect does not accept them.
        """
        shape = {**self.effect.shape, **self.effect.options}
        shape |= dict(zip(self.searched, map(float, x[2 if self.phased else 1 :]), strict=True))
        if self.phased:
            shape.pop("phase", None)
            effect: Effect = type(self.effect).from_coefficients(x[:2], **shape)
        else:
            effect = dataclasses.replace(self.effect.resized(float(x[0])), **shape)
        return dataclasses.replace(self, effect=effect)

    def held_in(self, step: Array) -> Array:
        """The step, limited so that no non-negative shape number changes by more than a factor of three."""
        out, first = step.copy(), step.size - len(self.searched)
        for i, f in enumerate(self.searched, first):
            x = float(getattr(self.effect, f))
            if self.effect.quantities[f].low >= 0.0 and x > 0.0:
                out[i] = np.clip(step[i], x / FARTHEST - x, FARTHEST * x - x)
        return out

    def steps(self) -> list[float]:
        """Differences for derivatives."""
        size = abs(self.effect.magnitude) or 1.0
        sizes = [1e-3 * size] * (2 if self.phased else 1)
        return [*sizes, *(1e-3 * max(abs(float(getattr(self.effect, f))), 0.1) for f in self.searched)]


@dataclass(frozen=True)
class SimulatorModel:
    """The simulator with effects, refitted, and its error on the record.

    Attributes
    ----------
    simulator : object or None
        None until it is built.
    terms : tuple of EffectTerm
    error : ndarray of shape (n,)
        Measured minus simulated position.
    n_base : int
        Always zero, because the simulator itself is the base model.
    """

    simulator: Any
    terms: tuple[EffectTerm, ...] = ()
    error: Array = dataclasses.field(default_factory=lambda: np.zeros(0), compare=False, repr=False)
    n_base: int = 0

    def without(self, index: int) -> SimulatorModel:
        """The model without one term, not built yet; see `SimulatorFit.built`."""
        return self.with_terms((*self.terms[:index], *self.terms[index + 1 :]))

    def with_terms(self, terms: tuple[EffectTerm, ...]) -> SimulatorModel:
        """The model with other terms, not built yet, because an effect cannot be removed from a simulator."""
        return SimulatorModel(None, tuple(terms))

    def moved(self, x: Array, numbers: Array) -> SimulatorModel:
        """The model with other numbers of its effects and of the simulator (unchanged if empty), not simulated."""
        ends = np.cumsum([0, *(len(t.vector()) for t in self.terms)])
        terms = (t.with_vector(x[a:b]) for t, a, b in zip(self.terms, ends[:-1], ends[1:], strict=True))
        return SimulatorModel(self.simulator.with_numbers(numbers) if numbers.size else self.simulator, tuple(terms))


@dataclass
class SimulatorFit:
    """Refits and simulates a simulator on one record.

    Parameters
    ----------
    core : object
        The simulator without effects, refitted.
    record : ServoRecord
    train : ndarray of bool, shape (n,)
    given : object
        The simulator as it was given, not refitted.
    """

    core: Any
    record: Any
    train: NDArray[np.bool_]
    given: Any = None
    _given: dict[tuple[EffectTerm, ...], SimulatorModel] = dataclasses.field(default_factory=dict, repr=False)
    _cache: dict[tuple[EffectTerm, ...], SimulatorModel] = dataclasses.field(default_factory=dict, repr=False)
    _tangents: dict[tuple[EffectTerm, ...], Array] = dataclasses.field(default_factory=dict, repr=False)

    def error(self, simulator: Any) -> Array:
        """Measured minus simulated position, shape (n,).

        Raises
        ------
        ValueError
            If the simulator returns an array of another length.
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
        if model.terms not in self._cache:
            self._cache[model.terms] = self.build(model.terms)
        return self._cache[model.terms]

    def build(self, terms: tuple[EffectTerm, ...], *, refit: bool = True) -> SimulatorModel:
        """The core with these effects, refitted, and its error."""
        simulator = self.core
        for t in terms:
            simulator = simulator.with_effect(t.effect)
        if refit:
            simulator = simulator.refit(self.record, self.train)
        return SimulatorModel(simulator, terms, self.error(simulator))

    def tangent(self, model: SimulatorModel) -> Array:
        """Directions in which the simulator's own numbers move its error, shape (n, k).

        They come from its ``numbers`` if it has them.  Otherwise they come from refits to parts of the training
        samples, whose differences span the same space, because every part is fitted slightly differently.
        """
        if model.terms in self._tangents:
            return self._tangents[model.terms]
        columns = []
        if hasattr(model.simulator, "with_numbers"):
            x = np.asarray(model.simulator.numbers, dtype=float)
            for j in range(x.size):
                moved = x.copy()
                moved[j] += STEP
                columns.append((self.error(model.simulator.with_numbers(moved)) - model.error) / STEP)
            self._tangents[model.terms] = np.column_stack(columns) if columns else np.zeros((self.train.size, 0))
        else:
            edges = np.linspace(0, self.train.size, PARTS + 1).astype(int)
            for a, b in itertools.pairwise(edges):
                part = self.train.copy()
                part[a:b] = False
                columns.append(self.error(model.simulator.refit(self.record, part)) - model.error)
            self._tangents[model.terms] = _spanned(columns, self.train.size)
        return self._tangents[model.terms]

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
        simulator = self.core
        for t in terms:
            simulator = simulator.with_effect(t.effect)
        simulator = simulator.with_numbers(model.simulator.numbers)
        return SimulatorModel(simulator, terms, self.error(simulator))

    def homes(self, model: SimulatorModel) -> list[SimulatorModel]:
        """The model, and the same model with the numbers that the simulator had when it was given.

        If these cannot be set, the second is the simulator as it was given with the model's effects.  A refit of a
        model that lacks something large may end so far away that a refit with the effect does not return.
        """
        if model.terms not in self._given:
            if hasattr(model.simulator, "with_numbers"):
                simulator = model.simulator.with_numbers(np.asarray(self.given.numbers, dtype=float))
            else:
                simulator = self.given
                for t in model.terms:
                    simulator = simulator.with_effect(t.effect)
            self._given[model.terms] = SimulatorModel(simulator, model.terms, self.error(simulator))
        return [model, self._given[model.terms]]

    def begun(self, model: SimulatorModel, term: EffectTerm) -> SimulatorModel:
        """The model with one more term; the simulator's own numbers are kept if possible, otherwise it is refitted."""
        return self._placed(model, term, self._vector(model, term))

    def grow(self, model: SimulatorModel, begin: SimulatorModel, weigh: Any, *, again: bool = False) -> SimulatorModel:
        """Fit ``begin``, which is ``model`` with one more term, by Gauss-Newton together with the simulator's numbers.

        Derivatives are computed by differences once and then updated from the steps (Broyden 1965, Math. Comp.
        19(92), 577-593), so a step costs one simulation.  They are computed again if the result is a model worth
        it.  ``weigh`` turns an error, shape (n,) or (n, k), into the weighted training residual.  With ``again`` the
        derivatives by the simulator's own numbers are those of ``begin`` from the first step on, and not the known
        ones of ``model``.
        """
        joint = hasattr(model.simulator, "with_numbers")  # then both are changed in one step without a refit in between
        best, first = begin, _square(weigh(model.error))
        slopes, fresh = self._slopes(model, best, weigh, again=again), again or not joint
        r = weigh(best.error)
        for _ in range(ITERATIONS):
            step = -np.linalg.lstsq(slopes, r, rcond=1e-9)[0]
            found, step = self._stepped(model, best, step, weigh)
            change = weigh(found.error) - r if found is not None else np.zeros_like(r)
            gain = 1.0 - _square(r + change) / max(_square(r), 1e-300)
            if found is not None:
                scale = 1.0 / np.maximum(np.linalg.norm(slopes, axis=0), 1e-300)
                moved = step / scale
                slopes = slopes + np.outer(change - slopes @ step, moved / scale) / max(_square(moved), 1e-300)
                best, r = found, r + change
            if gain < LEAST_GAIN:
                settled = best if joint else self.refitted(best)
                if _square(weigh(settled.error)) < (1.0 - LEAST_GAIN) * _square(r):
                    best, r = settled, weigh(settled.error)
                    slopes = self._slopes(model, best, weigh, again=True)
                    continue
                if fresh or _square(r) > WORTH_SLOPES * first:
                    break
                slopes, fresh = self._slopes(model, best, weigh, again=True), True
            elif joint:
                fresh = False
        return best

    def refitted(self, model: SimulatorModel) -> SimulatorModel:
        """The model after one more refit: many ``refit`` methods stop after a few evaluations, far from the minimum."""
        simulator = model.simulator.refit(self.record, self.train)
        return SimulatorModel(simulator, model.terms, self.error(simulator))

    def _stepped(
        self, model: SimulatorModel, best: SimulatorModel, step: Array, weigh: Any
    ) -> tuple[SimulatorModel | None, Array]:
        """The first better model along a step, shortened if necessary, and the step taken."""
        n, cost = len(best.terms[-1].vector()), _square(weigh(best.error))
        at = self._vector(best, best.terms[-1])
        step = np.concatenate([best.terms[-1].held_in(step[:n]), np.clip(step[n:], -1.0, 1.0)])
        for share in SHORTER:
            try:
                found = self._placed(model, best.terms[-1], at + share * step)
            except (ValueError, FloatingPointError):
                continue
            if _square(weigh(found.error)) < cost:
                return found, share * step
        return None, step

    def _slopes(self, model: SimulatorModel, best: SimulatorModel, weigh: Any, *, again: bool) -> Array:
        """Derivatives of the weighted error by the numbers of the last term, and by the simulator's own if known.

        The latter are the known ones of ``model`` unless ``again``.  If the simulator refits itself, its influence is
        projected out of the derivatives by the term's numbers.
        """
        term, x = best.terms[-1], np.array(best.terms[-1].vector())
        joint = hasattr(model.simulator, "with_numbers")
        before = self._freed(best) if again and not joint else model.simulator
        at = best.error if joint else self.error(before.with_effect(term.effect))
        columns = []
        for j, h in enumerate(term.steps()):
            moved = x.copy()
            moved[j] += h
            grown = before.with_effect(term.with_vector(moved).effect)
            grown = grown.with_numbers(best.simulator.numbers) if joint else grown
            columns.append((self.error(grown) - at) / h)
        own = self.tangent(best if again else model)
        if joint:
            return np.asarray(weigh(np.column_stack([*columns, own])))
        q, _ = np.linalg.qr(weigh(own))
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
        return SimulatorModel(own, (*model.terms, term), self.error(own))


def _square(r: Array) -> float:
    return float(r @ r)


def _spanned(columns: list[Array], n: int) -> Array:
    """An orthonormal basis of the columns, without those that are rounding errors."""
    if not columns:
        return np.zeros((n, 0))
    u, values, _ = np.linalg.svd(np.column_stack(columns), full_matrices=False)
    return u[:, values > 1e-6 * max(values[0], 1e-300)]


# --- the fit of one effect: its size first, then all its numbers together --------------------------
# Number of such fits at most, and the share of the error that the last one may leave: a stop takes three.
AGAIN, SETTLED = 4, 0.8


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
        refused = (*model.terms, EffectTerm(look.start[0].resized(0.0)))
        return SimulatorModel(model.simulator, refused, model.error)
    whole = plant.scale * gone(plant.motion, model.error, np.zeros_like(model.error), plant.record)
    if look.size**2 > HALF * whole**2 and plant.left(best) > HALF * plant.left(model):
        best = min((best, anew(plant, model, look.start[0])), key=plant.left)
    left = plant.left(model)
    if plant.left(best) < HALF * left:
        for _ in range(AGAIN):
            plant.tune(best.error)  # weighted by the residual; the previous weights hid the effect's own spectrum
            left, best = plant.left(best), plant.fits.grow(model, best, plant.weighed, again=True)
            if plant.left(best) > SETTLED * left:
                break
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
    fixed = (*start.later, *plant.whole_fields)
    searched = tuple(f for f in start.shape_fields() if movable(f) and f not in fixed)
    out = []
    for home in plant.fits.homes(model):
        for effect in sizes(plant, home, start):
            out.append((home, plant.fits.begun(home, EffectTerm(effect, searched))))
    return out


def sizes(plant: Any, home: SimulatorModel, start: Any) -> list[Any]:
    """The effect at the size given by the simulation's slope and, if it acts only for instants, by the drive too."""
    if start.column_kind != "exact":
        return [start]
    effects = [sized(plant, home, start)]
    if isinstance(start, plant.further_shapes):
        effects.append(sized_by_drive(plant.motion, start, plant.train))
    positive = start.quantities[start.size].low >= 0.0 and not start.phased
    return [start if positive and e.magnitude <= 0.0 else e for e in effects]


def sized(plant: Any, model: SimulatorModel, start: Any) -> Any:
    """The size (and phase) from the sensitivity of the simulated position to it."""
    slopes, shape = smallest(plant, model, start)
    own = plant.weighed(plant.fits.tangent(model))
    columns = np.column_stack([plant.weighed(slopes), own])
    size = -np.linalg.lstsq(columns, plant.weighed(model.error), rcond=1e-9)[0][: slopes.shape[1]]
    return type(start).from_coefficients(size, **shape)


def movable(field: str) -> bool:
    """Whether a fit may move a shape number: exponents and counts stay fixed."""
    return field not in ("exponent", "elements", "load_share", "damping_ratio")
