"""The outcome of a diagnosis, as data."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from whsklearn import __version__
from whsklearn.logs.current import DRIVEN_BY
from whsklearn.logs.units import factor_of, inertia_unit, respelled

VERDICTS = ("no_gap", "named", "ambiguous", "partial", "unknown", "coloured_noise", "not_testable", "data_problem")
CURVE_UNITS = {"velocity": "{1}/s", "speed": "{1}/s", "drive": "{0}"}  # of a signal by drive and motion; else a motion
ALPHA = 0.01  # probability of naming an effect in a record in which nothing is missing, unless the user gives one
MAP_POINTS = 1440  # of a map over one turn: four to a degree


def spoken(label: str) -> str:
    """The name of an effect in words; that of its joint stays as the robot's file spells it.

    >>> from whsklearn.gap.diagnosis import spoken
    >>> spoken("cable_spring at wrist_1_joint")
    'cable spring at wrist_1_joint'
    """
    effect, at, joint = label.partition(" at ")
    return effect.replace("_", " ") + at + joint


@dataclass
class NamedEffect:
    """An effect with its parameters, its evidence, and the effects it cannot be distinguished from.

    Attributes
    ----------
    effect : Effect
        The effect with its parameters.
    standard_errors : dict of str to float
        Standard errors by the names that `Effect.labelled` gives.
    delta_bic : float
        Evidence, after the penalty for its free parameters and for the places searched.
    closure : float
        Share of the gap that it closes.
    aliases : list of str
        Effects that no log can distinguish from it.
    units : tuple of two str
        Units of drive and position in which its parameters are given; the effect itself is in SI.
    orders : list of NamedEffect
        Further waves of the same family.
    p_value : float
        Probability that a record in which nothing is missing shows as much, all families taken into account.
    joint : str
        For an arm, the joint at which it acts; a sum of two joints if it acts along both.

    References
    ----------
    Kass and Raftery 1995, Bayes Factors, J. Am. Stat. Assoc. 90(430), 773-795, on differences of BIC.

    Examples
    --------
    >>> from whsklearn.effects import Cogging
    >>> from whsklearn.gap import NamedEffect
    >>> found = NamedEffect(Cogging(0.1, 12.0), {"amplitude_nm": 0.01}, delta_bic=812.0, closure=0.97)
    >>> found.name, found.parameters["amplitude_nm"], found.errors["amplitude_nm"]
    ('cogging', 0.1, 0.01)
    """

    effect: Any
    standard_errors: dict[str, float]
    delta_bic: float
    closure: float
    aliases: list[str] = field(default_factory=list)
    units: tuple[str, str] = ("Nm", "rad")  # of drive and position
    orders: list[NamedEffect] = field(default_factory=list)  # further ones of a family of waves
    p_value: float = 0.0
    joint: str = ""

    @property
    def name(self) -> str:
        """Canonical name."""
        return str(self.effect.name)

    @property
    def label(self) -> str:
        """The name, of an arm's effect with its joint: ``coulomb at elbow``."""
        return f"{self.name} at {self.joint}" if self.joint else self.name

    @property
    def parameters(self) -> dict[str, float | str]:
        """The parameters in the units of the log, which their names state: ``torque_nm``, or ``torque_n`` on a line."""
        return self._told(self.effect.labelled())

    @property
    def errors(self) -> dict[str, float]:
        """Standard errors under the same names."""
        return self._told(self.standard_errors)

    @property
    def told(self) -> list[tuple[str, Any, float | None, str]]:
        """(name, value, standard error, unit) of every number, as a person reads it.

        A wave along a line has a period, and what is a torque on a rotary axis is a force there, or a current.

        Examples
        --------
        >>> from whsklearn.effects import Coulomb
        >>> NamedEffect(Coulomb(0.2), {"torque_nm": 0.01}, 80.0, 0.9, units=("A", "rad")).told
        [('current', 0.2, 0.01, 'A')]
        >>> from whsklearn.effects import Cogging
        >>> wave = Cogging(0.1, order=2 * np.pi / 0.024)
        >>> NamedEffect(wave, {"amplitude_nm": 0.01}, 80.0, 0.9, units=("N", "mm")).told[:2]
        [('amplitude', 0.1, 0.01, 'N'), ('period', 24.0, None, 'mm')]
        """
        known = {}
        (_, driven), (factor, si) = map(factor_of, self.units)
        for name, q in getattr(self.effect, "quantities", {}).items():
            label = in_units(q.labelled(name), self.units) if any(self.units) else name
            unit = q.unit if name.startswith("phase") else respelled(q.unit, self._spelled)[1]
            if q.unit == "kg m2":
                unit = inertia_unit(driven, si)
            if name == "torque":
                name = DRIVEN_BY.get(driven, name)
            if name == "angle" and si == "m":  # the place of a stop along a line
                name = "position"
            known[label] = name.replace("_", " "), "" if unit == "1" or not any(self.units) else unit
        out = []
        for label, value in self.parameters.items():
            (name, unit), error = known.get(label, (label.replace("_", " "), "")), self.errors.get(label)
            if name == "order" and si == "m":
                period = 2 * np.pi / float(value) / factor
                name, value, error, unit = "period", period, error and period * error / float(value), self.units[1]
            out.append((name, value, error, unit))
        return out

    @property
    def _spelled(self) -> dict[str, str]:
        """SI symbol -> unit of the log."""
        return dict(zip(("Nm", "rad"), self.units, strict=True))

    def _told(self, numbers: Mapping[str, Any]) -> dict[str, Any]:
        """Numbers in SI under labels of a rotary axis, converted to the log's units; unchanged if it has none."""
        factors = {}
        if not any(self.units):  # a chain, whose signals between the blocks have no unit
            bare = {q.labelled(name): name for name, q in getattr(self.effect, "quantities", {}).items()}
            return {bare.get(k, k): v for k, v in numbers.items()}
        for name, q in getattr(self.effect, "quantities", {}).items():
            if not name.startswith("phase"):
                factors[q.labelled(name)] = respelled(q.unit, self._spelled)[0]
        return {
            in_units(k, self.units): v if isinstance(v, str) else v / factors.get(k, 1.0) for k, v in numbers.items()
        }

    @property
    def amplitude_unit(self) -> str:
        """Unit of the size; empty if it is a share or the log has no units."""
        quantity = getattr(self.effect, "quantities", {}).get(getattr(self.effect, "size", ""))
        if quantity is None or quantity.unit == "1" or not all(self.units):
            return ""
        return respelled(quantity.unit, self._spelled)[1]

    def as_dict(self) -> dict[str, Any]:
        """The entry for the report's file; a family of waves also has its orders and its map over one turn."""
        return (
            {
                "name": self.name,
                "place": self.effect.place,
                "equation": self.effect.equation,
                "parameters": {k: _plain(v) for k, v in self.parameters.items()},
                "standard_errors": self.errors,
                "delta_bic": self.delta_bic,
                "p_value": self.p_value,
                "confidence": 1.0 - self.p_value,  # for programs that read it from older reports
                "aliases": self.aliases,
            }
            | ({"joint": self.joint} if self.joint else {})
            | ({"orders": self.family, "map": self.map_over_turn()} if self.of_orders else {})
        )

    @property
    def of_orders(self) -> bool:
        """Whether it is a family of waves over the angle."""
        return bool(self.orders) and hasattr(self.effect, "order")

    @property
    def family(self) -> list[dict[str, float]]:
        """Order, amplitude, phase (rad) and the amplitude's standard error of every member, the largest first."""
        rows = []
        for e in (self, *self.orders):
            label, amplitude = next(iter(e.parameters.items()))
            order, phase = e.effect.order, e.effect.phase
            rows.append(
                {"order": order, "amplitude": amplitude, "phase_rad": phase, "standard_error": e.errors.get(label, 0.0)}
            )
        return sorted(rows, key=lambda r: -abs(r["amplitude"]))

    def map_over_turn(self) -> dict[str, list[float]]:
        """The sum of the family over one turn, at `MAP_POINTS` angles in rad.

        Examples
        --------
        >>> from whsklearn.effects import Cogging
        >>> more = NamedEffect(Cogging(0.1, order=8.0), {}, 0.0, 1.0)
        >>> one = NamedEffect(Cogging(0.3, order=4.0), {}, 0.0, 1.0)
        >>> two = NamedEffect(Cogging(0.3, order=4.0), {}, 0.0, 1.0, orders=[more])
        >>> max(one.map_over_turn()["value"]), max(two.map_over_turn()["value"])
        (0.3, 0.4)
        """
        angle = np.arange(MAP_POINTS) * 2 * np.pi / MAP_POINTS
        waves = [(next(iter(e.parameters.values())), e.effect) for e in (self, *self.orders)]
        value = sum(amplitude * np.cos(wave.order * angle + wave.phase) for amplitude, wave in waves)
        return {"angle_rad": angle.tolist(), "value": np.asarray(value).tolist()}


def in_units(label: str, units: tuple[str, str]) -> str:
    """A label of a rotary axis in the units of the log.

    A phase and an order count radians of a wave on any axis.

    >>> in_units("velocity_rad_per_s", ("N", "m")), in_units("coefficient_nm_s_per_rad", ("N", "m"))
    ('velocity_m_per_s', 'coefficient_n_s_per_m')
    >>> in_units("inertia_kg_m2", ("N", "m"))
    'inertia_kg'
    """
    if label.startswith("phase"):
        return label
    drive, position = (u.lower() for u in units)
    if drive == "n":
        label = re.sub("_kg_m2$", "_kg", label)
    return re.sub(r"_rad(?=[0-9]*(_|$))", f"_{position}", re.sub(r"_nm(?=_|$)", f"_{drive}", label))


@dataclass(frozen=True)
class Place:
    """The range of one signal in which the gap is densest.

    Attributes
    ----------
    signal : str
    low, high : float
        The range, in ``unit``.
    share : float
        Share of the power of the gap inside it.
    width : float
        Share of the samples inside it.
    p_value : float
        Adjusted p-value; small if the gap follows the signal.
    centres, means, errors : ndarray
        Mean of the gap and its standard error by bin.

    References
    ----------
    Politis and Romano 1992, A circular block-resampling procedure for stationary data, in LePage and Billard (eds.),
    Exploring the Limits of Bootstrap, Wiley, 263-270; Benjamini and Hochberg 1995, Controlling the False Discovery
    Rate, J. R. Stat. Soc. B 57(1), 289-300.

    Examples
    --------
    >>> import numpy as np
    >>> from whsklearn.gap import Place
    >>> empty = np.zeros(0)
    >>> knock = Place("position", 1.2, 1.3, 0.71, 0.05, 0.01, "rad", empty, empty, empty)
    >>> f"{100 * knock.share:.0f} % of the gap in {100 * knock.width:.0f} % of the samples"
    '71 % of the gap in 5 % of the samples'
    """

    signal: str
    low: float
    high: float
    share: float
    width: float
    p_value: float
    unit: str
    centres: NDArray[Any]
    means: NDArray[Any]
    errors: NDArray[Any]

    def as_dict(self) -> dict[str, Any]:
        """For the report's file."""
        return {
            "signal": self.signal,
            "from": self.low,
            "to": self.high,
            "unit": self.unit,
            "share_of_gap": self.share,
            "p_value": self.p_value,
        }


class Curve(NamedTuple):
    """A learned torque as a function of one signal (times the sign or the value of a second one).

    Attributes
    ----------
    signals : tuple of str
        The signals it depends on; that of the picture's axis comes first.
    x, y, band : ndarray of shape (n,)
        Signal, torque (in the unit of the drive), and two standard deviations of the torque.

    References
    ----------
    Hastie and Tibshirani 1990, Generalized Additive Models, Chapman and Hall.

    Examples
    --------
    >>> import numpy as np
    >>> from whsklearn.gap import Curve
    >>> speed = np.array([0.0, 0.5, 1.0])
    >>> curve = Curve(("velocity",), speed, 0.2 * speed**2, np.full(3, 0.01))
    >>> bool((abs(curve.y) > curve.band).any())  # it is more than its own uncertainty somewhere
    True
    """

    signals: tuple[str, ...]
    x: NDArray[Any]
    y: NDArray[Any]
    band: NDArray[Any]


@dataclass
class LearnedTorques:
    """A torque without a name that was learned from the record.

    Attributes
    ----------
    curves : tuple of Curve
        A curve for each signal that the remainder depends on.
    closure : float
        Share of the gap that the curves close in free run on held-out samples.

    References
    ----------
    Hastie and Tibshirani 1990, Generalized Additive Models, Chapman and Hall.

    Examples
    --------
    >>> import numpy as np
    >>> from whsklearn.gap import Curve, LearnedTorques
    >>> angle = np.linspace(0, 6.28, 5)
    >>> learned = LearnedTorques((Curve(("angle",), angle, 0.1 * np.sin(angle), np.full(5, 0.01)),), closure=0.8)
    >>> learned.signals, learned.closure
    (['angle'], 0.8)
    """

    curves: tuple[Curve, ...]
    closure: float

    @property
    def signals(self) -> list[str]:
        """What the curves depend on, each once."""
        return list(dict.fromkeys(s for c in self.curves for s in c.signals))

    def as_dict(self) -> dict[str, Any]:
        """For the report's file."""
        return {"signals": self.signals, "closure": self.closure}


@dataclass
class CandidateLine:
    """One line of the table of candidates: an effect that was considered, and the outcome.

    Attributes
    ----------
    name : str
        Name of the effect.
    delta_bic : float
        Its evidence.
    closure : float
        Share of the gap that it closes.
    status, reason : str
        The decision and its reason.
    p_value : float
        Probability that a record in which nothing is missing shows as much, all families taken into account.

    References
    ----------
    Kass and Raftery 1995, Bayes Factors, J. Am. Stat. Assoc. 90(430), 773-795.

    Examples
    --------
    >>> from whsklearn.gap import CandidateLine
    >>> CandidateLine("backlash", 3.1, 0.02, "not needed", "its evidence is below the bar of 18").as_dict()["status"]
    'not needed'
    """

    name: str
    delta_bic: float
    closure: float
    status: str
    reason: str
    p_value: float = 1.0

    def as_dict(self) -> dict[str, Any]:
        """For the report's file."""
        return dict(self.__dict__)


@dataclass
class Diagnosis:
    """All that a report needs; ``as_dict`` is the file that other programs read.

    Attributes
    ----------
    verdict, sentence : str
        One of `VERDICTS`, and what was found in words.
    effects : list of NamedEffect
        What was missing.
    learned : LearnedTorques or None
        The torque without a name that was learned.
    candidates : list of CandidateLine
        Every effect that was considered.
    where : list of Place
        Where the gap is densest; ``where_sentence`` says so in words.
    before, after : dict of str to float
        ``nmse``, ``mu_e`` and ``rmse`` (unit of the position) of the free run on held-out samples.
    floor : float
        The rmse due to noise alone, in the same unit.
    closure : float
        1 - (after - floor) / (before - floor) of the rmse.
    figures : tuple of three floats
        Missing share of the rms drive (or output): before, after, and of noise alone.
    next_experiment, shortfall : str
        The experiment that would settle what is still open; what the base model lacks.
    horizons, test : list of dict
        Free runs by horizon, and on a second record.
    base_parameters, drifting : list of dict
        Numbers of the base model before and after; those that drift along the record.
    rounds, residual_tests : list of dict
        The effects that the search added; tests of the final residual.
    problems, notes : list
        What is wrong with the log; further remarks.
    pictures : dict of str to Any
        Arrays for the page's pictures, by name.
    units : dict of str to str
        Units of all numbers in the diagnosis, by role.
    logged : tuple of two str
        Units of the columns of drive and position, which the repaired model takes and gives.
    joints : list of dict
        For an arm, by ``name`` of the joint: what is ``missing`` on held-out blocks before and after and the floor, as
        shares of its drive, and the ``names``.
    rows : dict of str to int
        Rows of the log: ``used``, ``given``, and in how many ``segments`` they are.
    alpha : float
        Significance level at which effects were named.
    horizon : float
        Horizon of the free runs above, in ``horizon_unit``.
    seconds : float
        Processor time (s).
    interrupted : bool
        Whether the search was ended early.
    file, origin : str
        Name of the log; file, columns, span, rate, date and version in a sentence.

    References
    ----------
    Schwarz 1978, Estimating the Dimension of a Model, Annals of Statistics 6(2), 461-464; Ljung 1999, System
    Identification, 2nd ed., ch. 16, Model structure selection and model validation.

    Examples
    --------
    >>> from whsklearn.gap import Diagnosis
    >>> diagnosis = Diagnosis("no_gap", "Nothing is missing: the gap is 0.4 % of the drive, noise gives as much.")
    >>> diagnosis.verdict, diagnosis.effects
    ('no_gap', [])
    >>> sorted(diagnosis.as_dict())[:3]
    ['after', 'alpha', 'base']
    """

    verdict: str
    sentence: str
    effects: list[NamedEffect] = field(default_factory=list)
    learned: LearnedTorques | None = None
    candidates: list[CandidateLine] = field(default_factory=list)
    where: list[Place] = field(default_factory=list)
    where_sentence: str = ""
    before: dict[str, float] = field(default_factory=lambda: dict.fromkeys(("nmse", "mu_e", "rmse"), 0.0))
    after: dict[str, float] = field(default_factory=lambda: dict.fromkeys(("nmse", "mu_e", "rmse"), 0.0))
    floor: float = 0.0
    closure: float = 0.0
    next_experiment: str = ""
    seconds: float = 0.0
    problems: list[Any] = field(default_factory=list)
    horizons: list[dict[str, float]] = field(default_factory=list)
    horizon: float = 0.0  # of the free runs of the first line
    horizon_unit: str = "s"
    shortfall: str = ""
    rounds: list[dict[str, Any]] = field(default_factory=list)
    residual_tests: list[dict[str, Any]] = field(default_factory=list)
    base_parameters: list[dict[str, Any]] = field(default_factory=list)
    drifting: list[dict[str, Any]] = field(default_factory=list)
    alpha: float = ALPHA
    interrupted: bool = False
    notes: list[str] = field(default_factory=list)
    pictures: dict[str, Any] = field(default_factory=dict)
    file: str = ""  # name of the log
    origin: str = ""  # file, columns, span, rate, date and version in a sentence
    units: dict[str, str] = field(default_factory=dict)  # by role, of all numbers in the diagnosis
    logged: tuple[str, str] = ("", "")  # units of the columns of drive and position
    test: list[dict[str, float]] = field(default_factory=list)  # free run on a second record, a row a horizon
    rows: dict[str, int] = field(default_factory=dict)  # used, given, segments; empty where no file was read
    joints: list[dict[str, Any]] = field(default_factory=list)
    figures: tuple[float, float, float] = (0.0, 0.0, 0.0)  # missing share of drive or output: before, after, floor

    @property
    def repaired(self) -> bool:
        """Whether the repaired model differs from the base model."""
        return bool(self.effects) or self.learned is not None

    def as_dict(self) -> dict[str, Any]:
        """The contract of ``gap.json``.

        ``seconds`` is always 0, for programs that expect a number: the duration is in ``run.json`` and on
        the page, so that the same log and seed give the same bytes here.
        """
        raw = {
            "verdict": self.verdict,
            "effects": [e.as_dict() for e in self.effects],
            "candidates": [c.as_dict() for c in self.candidates],
            "where": [p.as_dict() for p in self.where],
            "before": self.before,
            "after": self.after,
            "noise_floor_rmse": self.floor,
            "closure": self.closure,
            "next_experiment": self.next_experiment,
            "seconds": 0.0,
            "learned": self.learned.as_dict() if self.learned else {"signals": [], "closure": 0.0},
            "file": self.file,
            "units": self.units,
            "test": self.test,
            "version": __version__,
            "missing": dict(zip(("before", "after", "floor"), self.figures, strict=True)),
            "base": self.base_parameters,
            "horizon": self.horizon,
            "alpha": self.alpha,
        } | {name: part for name in ("rows", "joints") if (part := getattr(self, name))}
        return _plain(raw)

    def run(self) -> dict[str, Any]:
        """What differs between runs of the same log, for ``run.json``."""
        now = datetime.now(UTC).isoformat(timespec="seconds")
        return {"file": self.file, "seconds": self.seconds, "finished": now, "version": __version__}


def _plain(value: Any) -> Any:
    """Numbers as JSON can represent them: no NumPy scalars, no NaN or infinity."""
    if isinstance(value, dict):
        return {str(k): _plain(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(v) for v in value]
    if isinstance(value, bool | np.bool_):
        return bool(value)
    if isinstance(value, int | np.integer):
        return int(value)
    if isinstance(value, float | np.floating):
        return float(value) if np.isfinite(value) else 0.0
    return value


def families(effects: list[NamedEffect]) -> list[NamedEffect]:
    """One entry for each name and joint: further orders of a wave are listed with the first one."""
    out: dict[str, NamedEffect] = {}
    for e in effects:
        if e.label in out:
            out[e.label].orders.append(e)
        else:
            out[e.label] = e
    return list(out.values())


def place_in(place: Place, gap: str, own: Mapping[str, str]) -> Place:
    """A range of a signal and the means of the gap (in the SI unit ``gap``) over it, in the units of the log."""
    by, unit = respelled(place.unit, own)
    size = respelled(gap, own)[0]
    return dataclasses.replace(
        place, low=place.low / by, high=place.high / by, unit=unit, centres=place.centres / by,
        means=place.means / size, errors=place.errors / size,
    )  # fmt: skip


def curve_in(curve: Curve, units: tuple[str, str], own: Mapping[str, str]) -> Curve:
    """A learned torque and its signal in the units of the log; ``units`` are the SI symbols of drive and motion."""
    by = respelled(CURVE_UNITS.get(curve.signals[0], "{1}").format(*units), own)[0]
    size = respelled(units[0], own)[0]
    return curve._replace(x=curve.x / by, y=curve.y / size, band=curve.band / size)


def rows_in(rows: list[dict[str, Any]], unit: str, own: Mapping[str, str], *names: str) -> list[dict[str, Any]]:
    """Rows of a table with the named numbers converted from one SI unit to that of the log."""
    by = respelled(unit, own)[0]
    return [r | {k: r[k] / by for k in names if r.get(k) is not None} for r in rows]
