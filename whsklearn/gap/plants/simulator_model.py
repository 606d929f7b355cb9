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
ITERATIONS = 5
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


@dataclass
class SimulatorFit:
    """How a simulator is refitted and simulated on one record.

    Parameters
    ----------
    core : object
        The simulator without effects, refitted.
    record : ServoRecord
    train : ndarray of bool, shape (n,)
    """

    core: Any
    record: Any
    train: NDArray[np.bool_]
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

    def grow(self, model: SimulatorModel, term: EffectTerm, weigh: Any) -> SimulatorModel:
        """The model with one term more, its numbers found by Gauss-Newton beside the simulator's own.

        ``weigh`` takes an error (n,) or (n, k) to the weighted training residual.
        """
        own = weigh(self.tangent(model))
        before = model.simulator

        def error(x: Array) -> Array:
            return self.error(before.with_effect(term.with_vector(x).effect))

        x = np.array(term.vector())
        joint = hasattr(before, "with_numbers")  # then both move in one step, and nothing is refitted in between
        numbers = np.asarray(before.numbers, dtype=float) if joint else None
        best = self._placed(model, term, x, numbers)
        cost = _square(weigh(best.error))
        for _ in range(ITERATIONS):
            at = error(x) if not joint or numbers is None else best.error
            columns = []
            for j, h in enumerate(best.terms[-1].steps()):
                moved = x.copy()
                moved[j] += h
                change = self._placed(model, term, moved, numbers).error if joint else error(moved)
                columns.append(weigh(change - at) / h)
            r = weigh(best.error)
            step = -np.linalg.lstsq(np.column_stack([*columns, own]), r, rcond=1e-9)[0]
            found, share = None, 1.0
            for share in SHORTER:
                shifted = None if numbers is None else numbers + share * np.clip(step[x.size :], -1.0, 1.0)
                try:
                    found = self._placed(model, term, x + share * step[: x.size], shifted)
                except (ValueError, FloatingPointError):
                    found = None
                    continue
                if _square(weigh(found.error)) < cost:
                    break
                found = None
            if found is None:
                break
            numbers = None if numbers is None else numbers + share * np.clip(step[x.size :], -1.0, 1.0)
            gain = 1.0 - _square(weigh(found.error)) / cost
            best, x = found, np.array(found.terms[-1].vector())
            cost = _square(weigh(found.error))
            if gain < 1e-3:
                break
        return best

    def _placed(self, model: SimulatorModel, term: EffectTerm, x: Array, numbers: Array | None) -> SimulatorModel:
        """The model and the term at the numbers ``x``, the simulator at its own ``numbers``, or else refitted."""
        term = term.with_vector(x)
        simulator = model.simulator.with_effect(term.effect)
        own = simulator.refit(self.record, self.train) if numbers is None else simulator.with_numbers(numbers)
        return SimulatorModel(own, (*model.terms, term), self.error(own))


def _square(r: Array) -> float:
    return float(r @ r)


def _spanned(columns: list[Array], n: int) -> Array:
    """An orthonormal basis of the columns, without those that are rounding."""
    if not columns:
        return np.zeros((n, 0))
    u, values, _ = np.linalg.svd(np.column_stack(columns), full_matrices=False)
    return u[:, values > 1e-6 * max(values[0], 1e-300)]
