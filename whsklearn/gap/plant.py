"""The protocol between the engine and a plant.

A `Plant` is one record under one kind of model.  It owns all physics: how a model is fitted, what it leaves
unexplained (the *gap*), which effects may be missing and how each is tried.  The engine (`search`, `conclude`,
`proof`, `finder`) owns all decisions: it names no effect and asks for no kind of model.

How to write a plant
--------------------
1. A frozen model class with ``terms`` (base model's first), ``n_base``, ``without(index)`` and ``with_terms``; each
   term has ``name`` and ``effect`` (the library's own `whsklearn.effects.Effect`).
2. ``base``, ``errors``, ``fit`` and ``settled``: the model, what it leaves, sizes solved, shapes polished.
3. ``looks``: every candidate to first order, in the record and in records that the model makes itself
   (`whsklearn.gap.tangent.Tangent` does both at once); ``refine`` fits one of them.  ``n_effective`` is the number of
   independent samples that the last looks counted by.
4. ``simulate``: the free run that proves.  Everything else has a default in `PlantDefaults`, or tells the report
   something.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from whsklearn.effects import effect_names, get_effect
from whsklearn.gap.calibration import gain, rival_leads
from whsklearn.gap.record import rms
from whsklearn.gap.values import Learned, Linearised

Array = NDArray[Any]


class Term(Protocol):
    """One effect in a model, with its numbers."""

    @property
    def name(self) -> str:
        """Canonical name of the effect."""

    @property
    def effect(self) -> Any:
        """The library's `Effect` with these numbers."""


class Model(Protocol):
    """A value: what a plant fits, simulates and extends."""

    @property
    def terms(self) -> tuple[Any, ...]:
        """Effects, those of the base model first."""

    @property
    def n_base(self) -> int:
        """How many leading terms are the base model's."""

    def without(self, index: int) -> Any:
        """The model without its term ``index`` (not refitted)."""

    def with_terms(self, terms: tuple[Any, ...]) -> Any:
        """The model with these terms in place of its own."""


class Plant(Protocol):
    """One record under one kind of model.

    Attributes
    ----------
    units : tuple of str
        Of drive (or input) and position (or output), in which the plant reckons; empty where the log has none.
    logged : tuple of str
        The same as the log has them.
    own_units : dict of str to str
        Symbol of ``units`` -> the unit in which a report tells it.
    gap_word, whole : str
        What the gap is called ("missing torque") and what it is a share of ("drive").
    tolerance : float
        Smallest effect worth a name, rms as a share of ``scale``.
    scale : float
        Rms of the drive (servo) or of the output (chain).
    horizons : tuple of float
        Of the free runs that prove, in ``horizon_unit`` (``s`` or ``samples``); ``headline`` is the one of the first
        line.
    """

    units: tuple[str, str]
    logged: tuple[str, str]
    own_units: dict[str, str]
    gap_word: str
    whole: str
    tolerance: float
    scale: float
    horizons: tuple[float, ...]
    headline: float
    horizon_unit: str

    def check(self) -> list[Any]:
        """Problems of the data (`whsklearn.gap.data_check.DataProblem`), called before anything else."""

    def base(self, rng: np.random.Generator) -> Any:
        """The base model, fitted."""

    def looks(self, model: Any, rng: np.random.Generator, beside: Any | None = None) -> list[Any]:
        """Every candidate on top of the model (`whsklearn.gap.tangent.Look`), nameless families too.

        ``beside`` is the model with the effect that is asked anew, for what can be looked at beside it only.
        """

    def refine(self, model: Any, look: Any) -> Any:
        """The model with one candidate fitted."""

    def errors(self, model: Any) -> Array:
        """What the model leaves at the judged samples, shape (n,)."""

    def fit(self, model: Any) -> Any:
        """The model with its sizes solved."""

    def settled(self, model: Any) -> Any:
        """The model with all numbers fitted jointly."""

    def objection(self, model: Any, index: int) -> str:
        """What physics has against the numbers of a term; empty if nothing."""

    def demand(self, model: Any) -> float:
        """Least share of the rms left that a further effect must explain."""

    def surrogate(self, model: Any, rng: np.random.Generator) -> Any:
        """A plant whose record the model itself made in the same experiment: nothing is missing in it."""

    def simulate(self, model: Any, horizon: float) -> Array:
        """Free run from the drive alone, restarted every ``horizon`` seconds; shape (n,)."""

    def measured(self, *models: Any) -> tuple[Array, NDArray[np.bool_]]:
        """(measured output of shape (n,), mask of the held-out samples on which these models can be compared)."""

    def falls_short(self, base: Any, model: Any) -> str:
        """Sentence on what the base model itself lacks (order, shape of a law), where that and no effect is the gap."""

    def settle(self, model: Any) -> Any:
        """The repaired model's numbers for simulation: a joint refit from several starts, the better kept."""

    def follows(self, model: Any) -> float:
        """Cross-validated share of the gap that nameless functions of the motion explain."""

    def learn(self, model: Any) -> Learned | None:
        """What a model still lacks as nameless functions of the motion that it then simulates; None: none is earned."""

    def read_off(self, model: Any) -> list[Any]:
        """Effects read off the record itself (`NamedEffect`) beside those of a model: a coarse grid, a folded sign."""

    def as_given(self, base: Any) -> tuple[Any, Any]:
        """(plant, base model) of the record as it was given; ``(self, base)`` unless the plant repaired a reading."""

    def aliases(self, name: str) -> tuple[str, ...]:
        """Names that no record of this kind can tell from ``name``."""

    def commoner(self, name: str) -> tuple[str, ...]:
        """Names preferred to ``name`` where both explain the record about as well."""

    def linearised(self, model: Any) -> Linearised:
        """The fit's vector, residual and derivatives at the model, for standard errors."""

    def parameters(self, model: Any) -> dict[str, float]:
        """The base model's numbers by name."""

    def parameter_units(self, model: Any) -> dict[str, str]:
        """Units of the base model's numbers, where they have one."""

    def figures(self, base: Any, model: Any) -> tuple[float, float, float]:
        """(gap before, gap after, floor) of the first line, in the unit of drive or output."""

    def gap_to_locate(self, model: Any) -> Array:
        """The gap at the samples of `signals`, for localisation."""

    def signals(self, model: Any) -> dict[str, tuple[Array, str]]:
        """Name -> (signal at the judged samples, unit): what the gap may follow."""

    def regressors(self, model: Any) -> tuple[dict[str, tuple[float, Array]], Array, float]:
        """(name -> (number, its column at the judged samples), gap, seconds a sample), for parameter drift."""

    def residual_tests(self, base: Any, model: Any) -> list[dict[str, Any]]:
        """Rows of the table of residual tests."""

    def notes(self, base: Any, model: Any) -> list[str]:
        """Remarks on how the record was used."""

    def pictures(self, base: Any, model: Any) -> dict[str, Any]:
        """Series that the page draws (`whsklearn.gap.pictures`)."""

    def system(self, model: Any) -> Any:
        """The model as the library's own object."""


class PlantDefaults:
    """What a plant does unless it knows better."""

    horizon_unit = "s"
    exact = False  # whether its own records are exact: simulated from the input alone, with no loop and no filter

    @property
    def effect_units(self: Any) -> tuple[str, str]:
        """Units of drive and motion in which the numbers of effects are told; empty where they have none."""
        drive, motion = self.units
        return self.own_units.get(drive, drive), self.own_units.get(motion, motion)

    @property
    def gap_unit(self: Any) -> str:
        """In which the gap is told: that of the drive, or of the output."""
        return str(self.units[0] if self.whole == "drive" else self.units[1])

    def size(self, before: Array, after: Array) -> float:
        """Rms of what is gone between the errors of two models, in the unit of `Plant.scale`."""
        return float(np.sqrt(max(0.0, float(before @ before) - float(after @ after)) / before.size))

    def fitted_gain(self: Any, model: Any, grown: Any, look: Any) -> tuple[float, float]:
        """(gain g of a fitted effect, rms of what it explains in the unit of `Plant.scale`)."""
        before, after = self.errors(model), self.errors(grown)
        return gain(float(before @ before), float(after @ after), self.n_effective), self.size(before, after)

    def leads(self: Any, taken: Any, other: Any, rng: np.random.Generator) -> Array:
        """Lead of the one taken in records that the other makes: to first order, from what each explains."""
        before = self.errors(self.fit(taken.model.without(len(taken.model.terms) - 1)))
        return rival_leads(before, taken.errors, other.errors, self.n_effective, rng)

    def preferred(self, sound: list[Any]) -> Any:
        """Which of several sound fits (`whsklearn.gap.search.Named`) is taken, the best score first: that."""
        return sound[0]

    def joints(self, base: Any, model: Any) -> list[dict[str, Any]]:
        """None: an axis is its only joint."""
        return []

    def runs_worse(self, before: Any, after: Any) -> bool:
        """Never: a fit by simulation error cannot."""
        return False

    def commoner(self, name: str) -> tuple[str, ...]:
        """What the effect says of itself."""
        return get_effect(name).commoner if name in effect_names() else ()

    def rms(self, errors: Array) -> float:
        """Root mean square."""
        return rms(errors)

    def family(self, model: Any) -> Iterable[Any]:
        """None: further orders are candidates like any other."""
        return ()

    def remains(self, model: Any, nameless: float) -> float:
        """Rms of what still follows the signals without a name: all that is seen of it."""
        return nameless

    def falls_short(self, base: Any, model: Any) -> str:
        """Nothing: the base model has no order that could be too low."""
        return ""

    def learn(self, model: Any) -> Learned | None:
        """Nothing: this plant learns no torque."""
        return None

    def settle(self, model: Any) -> Any:
        """The numbers as fitted."""
        return model

    def read_off(self, model: Any) -> list[Any]:
        """Nothing."""
        return []

    def as_given(self, base: Any) -> tuple[Any, Any]:
        """The record is used as it is."""
        return self, base

    def parameter_units(self, model: Any) -> dict[str, str]:
        """None."""
        return {}
