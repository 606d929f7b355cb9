"""The protocol between the engine and a plant.

A `Plant` is one record under one kind of model.  It owns all physics: how a model is fitted, what it leaves
unexplained (the *gap*), which effects may be missing and how each is tried.  The engine (`search`, `conclude`,
`proof`, `finder`) owns all decisions: it names no effect and depends on no kind of model.

How to write a plant
--------------------
1. A frozen dataclass that is a model `WithTerms`; each term has ``name`` and ``effect`` (the library's own
   `whsklearn.effects.Effect`).
2. ``base``, ``errors`` and ``settled``: the model, its residual, and the model with all numbers fitted.
3. ``looks``: every candidate to first order, in the record and in records that the model simulates
   (`whsklearn.gap.tangent.Tangent` does both at once); ``refine`` fits one of them, ``objection`` gives a physical
   objection to it.  ``n_effective`` is the number of independent samples on which the last looks are based.
4. ``made`` and ``simulate``: a record that the model simulates, and the free run for the proof.
5. ``numbers``, ``gap``, ``figures`` and ``told``: the content of the report.  Everything else has a default.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple, Protocol, Self

import numpy as np
from numpy.typing import NDArray

from whsklearn.effects.base import rms
from whsklearn.gap.calibration import gain, least_lead, rival_leads
from whsklearn.gap.diagnosis import ALPHA, Curve
from whsklearn.gap.record import Array

# Share of the rms drive or output below which no effect is worth naming. In the inverse view, the residual of
# surrogates of records with nothing missing is 0.0037 to 0.0047 of the drive. The default of every entry point.
DEFAULT_TOLERANCE = 0.004
# Multiple of the residual that encoder noise causes in own records, below which nothing is missing: five records
# determine that residual to a tenth.
QUIET = 1.35
# Share of a gap that is worth a sentence of the report where nothing is named: of a place or a drift, beyond its share
# of the samples; of learned curves, in cross-validated power when they are fitted and in simulation to be kept
# (`benchmarks.learned`).
WORTH_A_WORD = 0.1
# Gain per number above which numbers that a first look holds are freed, and a learned curve is better than a simpler
# one: the lead that parts two explanations at the level alpha.
PAYS = least_lead(ALPHA)


def quiet(left: Any, floor: Any, least: Any) -> Any:
    """Whether a residual is no more than noise, of the rms ``floor``, and what is not worth naming, ``least``.

    >>> quiet(1.2, 1.0, 0.0), quiet(1.5, 1.0, 0.0), quiet(1.5, 1.0, 0.5)
    (True, False, True)
    """
    return left**2 <= (QUIET * floor) ** 2 + 2.0 * least**2  # twice: after one empty record of a test


@dataclass(frozen=True)
class FittedTerm:
    """A candidate with its numbers.

    >>> from whsklearn.gap.plants.servo_candidates import candidate
    >>> t = FittedTerm(candidate("cable_spring"), (2.0, 0.1))
    >>> t.name, t.effect, t.with_vector([3.0, 0.2]).q
    ('cable_spring', CableSpring(stiffness=2.0, centre=0.1), (3.0, 0.2))
    """

    kind: Any  # an object with ``name``, ``effect(q)``, ``ratios(i)`` and ``free``, the numbers that a fit moves
    q: tuple[float, ...]

    @property
    def name(self) -> str:
        """Canonical name."""
        return str(self.kind.name)

    @property
    def effect(self) -> Any:
        """The effect with these numbers."""
        return self.kind.effect(np.array(self.q))

    @property
    def free(self) -> tuple[int, ...]:
        """Numbers that a fit moves, by their index in ``q``."""
        return tuple(self.kind.free)

    def with_slot(self, i: int, value: float) -> Self:
        """The same term with one number changed."""
        return replace(self, q=(*self.q[:i], float(value), *self.q[i + 1 :]))

    def vector(self) -> list[float]:
        """The free numbers, as logarithms if they are varied by ratios."""
        return [float(np.log(max(self.q[i], 1e-300))) if self.kind.ratios(i) else self.q[i] for i in self.free]

    def with_vector(self, x: Sequence[float] | Array) -> Self:
        """The term with other free numbers."""
        q = list(self.q)
        for i, value in zip(self.free, x, strict=True):
            q[i] = float(np.exp(value) if self.kind.ratios(i) else value)
        return replace(self, q=tuple(q))


class WithTerms:
    """A model whose effects are its ``terms``; the first ``n_base`` are the base model's.

    >>> @dataclass(frozen=True)
    ... class Names(WithTerms):
    ...     terms: tuple[str, ...] = ("coulomb",)
    ...     n_base: int = 1
    >>> model = Names().with_term("cogging")
    >>> model.added, model.without(0).terms
    (('cogging',), ('cogging',))
    """

    terms: tuple[Any, ...]
    n_base: int

    @property
    def added(self) -> tuple[Any, ...]:
        """Effects beyond the base model."""
        return self.terms[self.n_base :]

    def with_terms(self, terms: Iterable[Any]) -> Self:
        """The model with other terms."""
        return replace(self, terms=tuple(terms))  # type: ignore[type-var]  # those that have it are dataclasses

    def replaced(self, index: int, term: Any) -> Self:
        """The model with another term in the place of the term ``index``."""
        return self.with_terms((*self.terms[:index], term, *self.terms[index + 1 :]))

    def with_term(self, term: Any) -> Self:
        """The model with one more effect."""
        return self.with_terms((*self.terms, term))

    def without(self, index: int) -> Self:
        """The model without its term ``index``."""
        return self.with_terms(self.terms[:index] + self.terms[index + 1 :])


def with_vectors(terms: tuple[Any, ...], x: Array) -> tuple[Any, ...]:
    """The terms with other free numbers, those of the first one first."""
    ends = np.cumsum([0, *(len(t.free) for t in terms)])
    return tuple(t.with_vector(x[a:b]) for t, a, b in zip(terms, ends[:-1], ends[1:], strict=True))


class Linearised(NamedTuple):
    """A fitted vector with its residual and derivatives.

    >>> one = np.ones(1)
    >>> fit = Linearised(one, 0.0 * one, 2.0 * one, np.zeros(3), np.ones((3, 1)), rebuild=lambda x: {"gain": x[0]})
    >>> float(fit.rebuild(fit.x)["gain"])
    1.0
    """

    x: Array  # x, low, high (p,)
    low: Array
    high: Array
    residual: Array  # (n,)
    jacobian: Array  # (n, p)
    rebuild: Any  # x -> model
    covariance: Any = None  # (p, p): given if more is known about the errors than that the residual is white


class Gap(NamedTuple):
    """The residual of a model along the record, and the signals that it may follow.

    >>> speed = np.array([0.0, 1.0, 2.0])
    >>> gap = Gap(0.1 * speed, 0.01, {"velocity": (speed, "rad/s")}, {"viscous": (0.5, speed)})
    >>> float(gap.left @ gap.columns["viscous"][1] / (speed @ speed))  # by how much viscous friction is off
    0.1
    """

    left: Array  # (n,)
    step: float  # seconds between its samples
    signals: dict[str, tuple[Array, str]]  # name -> (signal of shape (n,), unit)
    # name of a constant of the base model that may drift -> (its value, its column of shape (n,))
    columns: dict[str, tuple[float, Array]]


class Figures(NamedTuple):
    """Rms of the gap before and after, of noise alone, and of what still follows the motion without a name.

    >>> before, after, floor, *_ = Figures(before=0.2, after=0.03, floor=0.01)
    >>> round((before - after) / (before - floor), 3)  # share of the gap that is closed
    0.895
    """

    before: float
    after: float
    floor: float
    nameless: float = 0.0
    by_run: bool = False  # whether the free run alone tells what the effects explain


@dataclass(frozen=True)
class Reading:
    """What a record shows before any model is fitted.

    >>> from whsklearn.effects import Quantization
    >>> Reading([Quantization(0.01)]).effects, Reading().shortfall
    ([Quantization(step=0.01)], '')
    """

    # read from the record itself, besides those of a model: a coarse grid, a lost sign
    effects: list[Any] = field(default_factory=list)
    # sentence on what the base model itself lacks (order, shape of a law), if that causes the gap and no effect does
    shortfall: str = ""
    # the record as it was given and its base model, if the plant has repaired a reading
    given: tuple[Any, Any] | None = None


@dataclass(frozen=True)
class Told:
    """What a plant adds to the report.

    >>> Told(tests=[], notes=["The drive is logged 2 ms late."], pictures={}).notes
    ['The drive is logged 2 ms late.']
    """

    tests: list[dict[str, Any]]  # rows of the table of residual tests
    notes: list[str]  # remarks on how the record was used
    pictures: dict[str, Any]  # series that the page draws (`whsklearn.gap.pictures`)
    # for an arm, what is missing from each drive, before and after
    joints: list[dict[str, Any]] = field(default_factory=list)
    experiment: str = ""  # that this record calls for, where the verdict leaves something open


class Plant(Protocol):
    """One record under one kind of model.

    Attributes
    ----------
    units : tuple of str
        Of drive (or input) and position (or output), used inside the plant; empty if the log has none.
    logged : tuple of str
        The same, as in the log.
    own_units : dict of str to str
        Symbol of ``units`` -> the unit that a report uses for it.
    gap_unit, gap_word, whole : str
        Unit of the gap, what it is called ("missing torque") and what it is a share of ("drive").
    subject : str
        Whose drive it is, if there are several (" of elbow").
    tolerance : float
        Smallest effect worth naming, rms as a share of ``scale``.
    scale : float
        Rms of the drive (servo) or of the output (chain).
    horizons : tuple of float
        Of the free runs of the proof, in ``horizon_unit`` (``s`` or ``samples``); ``headline`` is the one in the first
        line of the report.
    n_effective : float
        Independent samples on which the last looks are based.
    exact : bool
        Whether its own records are exact: simulated from the input alone, with no loop and no filter.

    Examples
    --------
    What the engine asks of a plant in its first round, here of an axis:

    >>> import numpy as np
    >>> from whsklearn.datasets import make_servo_log
    >>> from whsklearn.effects import Cogging
    >>> from whsklearn.gap.plants import Base, make_plant
    >>> log = make_servo_log([Cogging(0.2, 12.0)], duration=6.0, sample_rate=250.0, random_state=0)
    >>> plant, rng = make_plant("servo", log, None, Base(), tolerance=0.004, columns={}), np.random.default_rng(0)
    >>> plant.check()  # nothing is wrong with the data
    []
    >>> base = plant.base(rng)
    >>> first, *others = plant.looks(base, rng)  # the best first
    >>> first.name
    'cogging'
    >>> grown = plant.refine(base, first)
    >>> plant.objection(base, grown)
    ''
    >>> bool(plant.rms(plant.errors(grown)) < 0.1 * plant.rms(plant.errors(base)))
    True
    """

    units: tuple[str, str]
    logged: tuple[str, str]
    own_units: dict[str, str]
    gap_word: str
    whole: str
    subject: str = ""
    tolerance: float
    scale: float
    horizons: tuple[float, ...]
    headline: float
    n_effective: float
    horizon_unit: str = "s"
    exact: bool = False

    def check(self) -> list[Any]:
        """Problems of the data (`whsklearn.gap.data_check.DataProblem`), called before anything else."""

    def base(self, rng: np.random.Generator) -> Any:
        """The base model, fitted."""

    def errors(self, model: Any) -> Array:
        """Residual of the model at the judged samples, shape (n,)."""

    def settled(self, model: Any) -> Any:
        """The model with all numbers fitted jointly."""

    def looks(self, model: Any, rng: np.random.Generator, beside: Any | None = None) -> list[Any]:
        """Looks at every candidate beside the model (`whsklearn.gap.tangent.Look`), nameless families included.

        ``beside`` is the model with the effect that is being tested again, for looks that need it.
        """

    def refine(self, model: Any, look: Any) -> Any:
        """The model with one candidate fitted."""

    def objection(self, model: Any, grown: Any) -> str:
        """Objection to the last term of ``grown``, which the model lacks; empty if there is none.

        It concerns the term's numbers, a free run that the term makes worse, or too small a share beside other terms.
        """

    def aliases(self, name: str) -> tuple[str, ...]:
        """Effects that no record of this kind can distinguish from ``name``."""

    def made(self, model: Any, rng: np.random.Generator) -> Any:
        """A plant with a record simulated by the model in the same experiment: nothing is missing in it."""

    def simulate(self, model: Any, horizon: float) -> Array:
        """Free run from the drive alone, restarted every ``horizon`` seconds; shape (n,)."""

    def measured(self, *models: Any) -> tuple[Array, NDArray[np.bool_]]:
        """(measured output of shape (n,), mask of the held-out samples on which these models can be compared)."""

    def figures(self, base: Any, model: Any, nameless: float = 0.0) -> Figures:
        """The gap in figures, in the unit of drive or output; ``nameless`` is the rms that looks saw without a name."""

    def linearised(self, model: Any) -> Linearised:
        """The fit's vector, residual and derivatives at the model, for standard errors."""

    def numbers(self, model: Any) -> dict[str, tuple[float, str]]:
        """Name of a number of the base model -> (value, unit); the unit is empty if it has none."""

    def gap(self, model: Any) -> Gap:
        """The residual of the model, with the signals and constants that it may follow."""

    def told(self, base: Any, model: Any) -> Told:
        """The rest of the report's content."""

    def system(self, model: Any) -> Any:
        """The model as the library's own object."""

    # --- with a default ---------------------------------------------------------------------------
    def units_at(self, joint: str) -> tuple[str, str]:
        """Units of drive and motion in which the numbers of an effect at a joint are stated: those of the log."""
        drive, motion = self.units
        return self.own_units.get(drive, drive), self.own_units.get(motion, motion)

    @property
    def gap_unit(self) -> str:
        """That of the drive, or of the output."""
        return str(self.units[0] if self.whole == "drive" else self.units[1])

    def shown_by(self, model: Any) -> float:
        """Factor from the unit of `errors` to the one in which the report of this final model states them."""
        return 1.0

    def retold(self, model: Any) -> Any:
        """The model with another effect in the place of one of which `errors` shows the first order only.

        A simulation must tell so; otherwise it is the model itself.
        """
        return model

    def rms(self, errors: Array) -> float:
        """Root mean square of errors, in the unit of `Plant.scale`."""
        return rms(errors)

    def size(self, before: Array, after: Array) -> float:
        """Rms of the difference between the errors of two models, in the unit of `Plant.scale`."""
        return float(np.sqrt(max(0.0, float(before @ before) - float(after @ after)) / before.size))

    def explained(self, model: Any, grown: Any, look: Any) -> tuple[float, float]:
        """(gain g, rms in the unit of `Plant.scale`) of what a fitted effect explains, found by this look."""
        before, after = self.errors(model), self.errors(grown)
        return gain(float(before @ before), float(after @ after), self.n_effective), self.size(before, after)

    def gap_share(self, look: Any, step: Any) -> float:
        """Share of the power of a round's gap that a look explains."""
        return float(min((look.size / max(step.gap, 1e-300)) ** 2, 1.0))

    def complete(self, before: Array, model: Any) -> bool:
        """Whether a model leaves nothing worth naming of these errors where its effects act.

        By default this is not known, because the level of the noise is not.
        """
        return False

    def silent(self, model: Any) -> bool:
        """Whether nothing that a model leaves, wherever it is, is worth naming: by default this is not known either."""
        return False

    def too_little(self, model: Any) -> str:
        """Why the last effect of a settled model is no name beside all that is still missing: by default for no reason.

        ``model``: fitted, the effect its last term.
        """
        return ""

    def half_shown(self, model: Any) -> str:
        """Why the record shows too little of the last effect of a model to tell it: by default for no reason."""
        return ""

    def p_of_all(self, model: Any, rng: np.random.Generator) -> float:
        """p-value of the hypothesis that a model, settled, is all there is: zero where own records may hide the rest.

        They do where they take the colour of their noise from a residual that contains it.
        """
        return 0.0

    def enough(self, model: Any) -> bool:
        """Whether the record has samples enough for a certain name beside the model's other numbers: always."""
        return True

    def leads(self, taken: Any, other: Any, before: Array, rng: np.random.Generator) -> Array:
        """Lead of the one taken in records simulated with the other: to first order, from what each explains."""
        return rival_leads(before, taken.errors, other.errors, self.n_effective, rng)

    def family(self, model: Any) -> Iterable[Any]:
        """Empty: further orders are candidates like any other."""
        return ()

    def contributes(self, base: Any, model: Any) -> bool:
        """Whether effects improve the runs in a way that the closure hides: never."""
        return False

    def told_by_run(self, model: Any, rivals: list[str]) -> tuple[Any, list[str]]:
        """The model with another effect in the place of one that is the same to first order, if a simulation says so.

        Also the rivals of that effect, ``rivals`` before, of which a simulation decides some: by default none.
        """
        return model, rivals

    def along_the_run(self, model: Any) -> Any:
        """The model at another minimum that fits along its own run have found; by default itself."""
        return model

    def sharpened(self, model: Any) -> bool:
        """Whether the record shows more at higher frequencies, as it does from here on: never."""
        return False

    def snapshot(self) -> dict[str, Any]:
        """What `restore` takes, once, to go back to the present state; what is changed in place is copied."""
        return dict(vars(self))

    def restore(self, kept: dict[str, Any]) -> None:
        """Go back to a state: what a test of other models has changed of the record and of its views is undone."""
        vars(self).update(kept)

    def to_simulate(self, model: Any) -> Any:
        """The model with the numbers that give the best free run: those that were fitted."""
        return model

    def learn(self, model: Any) -> tuple[Any, tuple[Curve, ...]] | None:
        """(model with what it still lacks as nameless functions of the motion, their curves): by default none."""
        return None

    def reading(self, base: Any, model: Any) -> Reading:
        """No effect read from the record, which is used as it is."""
        return Reading()
