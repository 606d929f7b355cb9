"""The outcome of a diagnosis, and how a verdict follows from what the search found."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from whsklearn.gap import judge
from whsklearn.gap.judge import Evidence
from whsklearn.gap.locate import Place

VERDICTS = ("no_gap", "named", "ambiguous", "partial", "unknown", "coloured_noise", "not_testable", "data_problem")


@dataclass
class NamedEffect:
    """An effect with its numbers, its evidence and what it cannot be told from."""

    effect: Any
    standard_errors: dict[str, float]
    delta_bic: float
    confidence: float
    closure: float
    aliases: list[str] = field(default_factory=list)
    units: tuple[str, str] = ("Nm", "rad")  # of drive and position

    @property
    def name(self) -> str:
        """Canonical name."""
        return str(self.effect.name)

    @property
    def parameters(self) -> dict[str, float | str]:
        """The numbers under names that carry the units of the log: ``torque_nm``, on a linear axis ``torque_n``."""
        return {in_units(k, self.units): v for k, v in self.effect.labelled().items()}

    @property
    def errors(self) -> dict[str, float]:
        """Standard errors under the same names."""
        return {in_units(k, self.units): v for k, v in self.standard_errors.items()}

    def as_dict(self) -> dict[str, Any]:
        """For the report's file."""
        return {
            "name": self.name,
            "place": self.effect.place,
            "equation": self.effect.equation,
            "parameters": {k: _plain(v) for k, v in self.parameters.items()},
            "standard_errors": self.errors,
            "delta_bic": self.delta_bic,
            "confidence": self.confidence,
            "aliases": self.aliases,
        }


def in_units(label: str, units: tuple[str, str]) -> str:
    """A label of a rotary axis in the units of the log.

    A phase and an order count radians of a wave on any axis.

    Examples
    --------
    >>> in_units("velocity_rad_per_s", ("N", "m")), in_units("coefficient_nm_s_per_rad", ("N", "m"))
    ('velocity_m_per_s', 'coefficient_n_s_per_m')
    """
    if label.startswith("phase"):
        return label
    drive, position = (u.lower() for u in units)
    return re.sub(r"_rad(?=[0-9]*(_|$))", f"_{position}", re.sub(r"_nm(?=_|$)", f"_{drive}", label))


@dataclass
class CandidateLine:
    """One line of the table of candidates."""

    name: str
    delta_bic: float
    closure: float
    status: str
    reason: str

    def as_dict(self) -> dict[str, Any]:
        """For the report's file."""
        return dict(self.__dict__)


@dataclass
class Diagnosis:
    """All that a report needs; ``as_dict`` is the file that other programs read."""

    verdict: str
    sentence: str
    effects: list[NamedEffect] = field(default_factory=list)
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
    horizon_unit: str = "s"
    rounds: list[dict[str, Any]] = field(default_factory=list)
    residual_tests: list[dict[str, Any]] = field(default_factory=list)
    base_parameters: list[dict[str, Any]] = field(default_factory=list)
    restless: list[dict[str, Any]] = field(default_factory=list)
    need: float = 0.0
    interrupted: bool = False
    notes: list[str] = field(default_factory=list)
    pictures: dict[str, Any] = field(default_factory=dict)

    def as_dict(self) -> dict[str, Any]:
        """The contract of ``gap.json``."""
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
            "seconds": self.seconds,
        }
        return _plain(raw)


def _plain(value: Any) -> Any:
    """Numbers as JSON has them: no NumPy scalars, no NaN or infinity."""
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


def verdict_of(
    taken: list[Evidence],
    total_closure: float,
    rivals: list[list[str]],
    gap_is_quiet: bool,
    follows: float,
    left: float = 0.0,
    still: float = 0.0,
) -> str:
    """The verdict, from what was taken and what is left.

    Parameters
    ----------
    taken : list of Evidence
    total_closure : float
        Of the missing torque on held-out samples, all effects together.
    rivals : list of list of str
        For each effect, the names that could stand in its place, aliases left out.
    gap_is_quiet : bool
        Whether the base model is at the floor already.
    follows : float
        Cross-validated share of the gap that follows the motion.
    left : float
        What is left, in units of the floor (of noise or tolerance): several effects together can imitate
        one that has no name, so they must leave next to nothing.
    still : float
        Cross-validated share of what is left that follows the motion: a neighbour of the true effect closes most
        of the gap and leaves its own shape.
    """
    if not taken:
        if gap_is_quiet:
            return "no_gap"
        return "unknown" if follows > judge.FOLLOWS else "coloured_noise"
    if total_closure < judge.PARTIAL:
        return "unknown"
    need = 1.0 - (1.0 - judge.NAMED) / len(taken)
    repeated = len({e.name for e in taken}) < len(taken)
    if total_closure < need or still > judge.FOLLOWS or (len(taken) > 1 and (left > judge.LEFT_BY_SEVERAL or repeated)):
        return "partial"
    return "ambiguous" if any(rivals) else "named"
