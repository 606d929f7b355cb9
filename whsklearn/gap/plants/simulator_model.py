"""A simulator of the user's own with effects: what the engine extends, and how its numbers are fitted.

The simulator refits itself; the numbers of an effect are ours.  They are found by Gauss-Newton on the error after a
refit, whose derivatives are those without a refit, freed of what the simulator's own numbers can do (variable
projection with a black box inside; Golub, Pereyra 2003, Inverse Problems 19(2), R1-R26).
"""

from __future__ import annotations

import dataclasses
import itertools
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from whsklearn.effects import Effect

Array = NDArray[Any]
STEP = 1e-3  # of a logarithm
PARTS = 6  # of the record that are left out in turn: one more than the numbers that a rigid axis usually has
ITERATIONS = 10  # of Gauss-Newton; half of the effects stop after two
LEAST_GAIN = 1e-3  # of the sum of squares, below which a step is the last one on these derivatives
WORTH_SLOPES = 0.25  # of the sum of squares without the effect: one that leaves more is not worth new derivatives
FARTHEST = 3.0  # times a shape number in one step: a contact's relaxation of 20 ms would else be half a second
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
        """Whether a cosine and a sine weight stand for size and phase."""
        return self.effect.phased

    def vector(self) -> list[float]:
        """Size, or cosine and sine weight, and then the searched shape numbers."""
        size = list(self.effect.coefficients) if self.phased else [self.effect.magnitude]
        return [*map(float, size), *(float(getattr(self.effect, f)) for f in self.searched)]

    def with_vector(self, x: Array) -> EffectTerm:
        """The term at other numbers.

        Raises
        ------
        ValueError
            If the effect cannot have them.
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
        """A step in which no shape number that is never negative changes by more than a factor of three."""
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
        No term is the base model's: the simulator holds that itself.
    """

    simulator: Any
    terms: tuple[EffectTerm, ...] = ()
    error: Array = dataclasses.field(default_factory=lambda: np.zeros(0), compare=False, repr=False)
    n_base: int = 0

    @property
    def has_play(self) -> bool:
        """Nothing is known of what the simulator holds."""
        return False

    def without(self, index: int) -> SimulatorModel:
        """The model without one term, not built yet; see `SimulatorFit.built`."""
        return self.with_terms((*self.terms[:index], *self.terms[index + 1 :]))

    def with_terms(self, terms: tuple[EffectTerm, ...]) -> SimulatorModel:
        """The model with other terms, not built yet: an effect cannot be taken out of a simulator."""
        return SimulatorModel(None, tuple(terms))

    def moved(self, x: Array, numbers: Array) -> SimulatorModel:
        """The model at other numbers of its effects and of the simulator (none: as they are), not simulated."""
        ends = np.cumsum([0, *(len(t.vector()) for t in self.terms)])
        terms = (t.with_vector(x[a:b]) for t, a, b in zip(self.terms, ends[:-1], ends[1:], strict=True))
        return SimulatorModel(self.simulator.with_numbers(numbers) if numbers.size else self.simulator, tuple(terms))


@dataclass
class SimulatorFit:
    """How a simulator is refitted and simulated on one record.

    Parameters
    ----------
    core : object
        The simulator without effects, refitted.
    record : ServoRecord
    train : ndarray of bool, shape (n,)
    given : object
        The simulator as it came, not refitted.
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
            If the simulator gives another length.
        """
        y = np.asarray(simulator.simulate(self.record), dtype=float)
        if y.shape != self.record.position.shape:
            raise ValueError(
                f"simulate gave shape {y.shape}, expected {self.record.position.shape}: one value a sample."
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

        From its ``numbers`` where it has them; else from refits to parts of the training samples, whose differences
        span the same space: every part is fitted a little differently.
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

        At the simulator's own numbers where they can be set; else after a refit at every one of them.
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
        """The model with other terms, its simulator's own numbers kept, or else refitted."""
        if not hasattr(model.simulator, "with_numbers"):
            return self.build(terms)
        simulator = self.core
        for t in terms:
            simulator = simulator.with_effect(t.effect)
        simulator = simulator.with_numbers(model.simulator.numbers)
        return SimulatorModel(simulator, terms, self.error(simulator))

    def homes(self, model: SimulatorModel) -> list[SimulatorModel]:
        """The model, and the same with the numbers that the simulator was given with.

        Where they cannot be set it is the simulator as it was given, with the model's effects: a refit of a model that
        lacks something large may end so far away that a refit with it does not find back.
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
        """The model with one term more, the simulator's own numbers kept where they can be, or else refitted."""
        return self._placed(model, term, self._vector(model, term))

    def grow(self, model: SimulatorModel, begin: SimulatorModel, weigh: Any, *, again: bool = False) -> SimulatorModel:
        """The model ``begin``, which has one term more, at numbers found by Gauss-Newton beside the simulator's own.

        Derivatives are differences once, then follow the steps taken (Broyden 1965, Math. Comp. 19(92), 577-593): a
        step costs one simulation.  They are taken anew where that ends at a model worth it.  ``weigh`` takes an error
        (n,) or (n, k) to the weighted training residual; ``again`` if the derivatives by the simulator's own numbers
        are to be those of ``begin`` from the first step on, not those of ``model``, which are known.
        """
        joint = hasattr(model.simulator, "with_numbers")  # then both move in one step, nothing is refitted in between
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
        """The model after one refit more: many a ``refit`` stops after a few evaluations, long before its minimum."""
        simulator = model.simulator.refit(self.record, self.train)
        return SimulatorModel(simulator, model.terms, self.error(simulator))

    def _stepped(
        self, model: SimulatorModel, best: SimulatorModel, step: Array, weigh: Any
    ) -> tuple[SimulatorModel | None, Array]:
        """The first model along a step, shortened where need be, that is better, and the step taken."""
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
        """Derivatives of the weighted error by the numbers of the last term, and by the simulator's own if it has them.

        Those by its own are the model's, which are known, unless ``again``.  Where the simulator refits itself those
        of the term are freed of what it can do.
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
        """The simulator as it stands, freed of its last effect by the opposite torque; what is no torque stays."""
        effect = model.terms[-1].effect
        if effect.column_kind != "exact":
            return model.simulator
        return model.simulator.with_effect(effect.resized(-effect.magnitude))

    def _vector(self, model: SimulatorModel, term: EffectTerm) -> Array:
        """Numbers of a term, and those of the simulator if it has any."""
        own = np.asarray(getattr(model.simulator, "numbers", ()), dtype=float)
        return np.concatenate([term.vector(), own if hasattr(model.simulator, "with_numbers") else []])

    def _placed(self, model: SimulatorModel, term: EffectTerm, z: Array) -> SimulatorModel:
        """The model and the term at the numbers ``z``, the simulator at its own numbers there, or else refitted."""
        n = len(term.vector())
        term = term.with_vector(z[:n])
        own = model.simulator.with_effect(term.effect)
        joint = hasattr(own, "with_numbers")
        own = own.with_numbers(z[n:]) if joint else own.refit(self.record, self.train)
        return SimulatorModel(own, (*model.terms, term), self.error(own))


def _square(r: Array) -> float:
    return float(r @ r)


def _spanned(columns: list[Array], n: int) -> Array:
    """An orthonormal basis of the columns, without those that are rounding."""
    if not columns:
        return np.zeros((n, 0))
    u, values, _ = np.linalg.svd(np.column_stack(columns), full_matrices=False)
    return u[:, values > 1e-6 * max(values[0], 1e-300)]
