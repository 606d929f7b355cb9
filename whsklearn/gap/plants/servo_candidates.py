"""Effects that an axis may be missing: all defined ones, the library's and the user's, in the form of candidates.

An effect itself defines the ranges of its numbers, where a search begins, which of them only a fine grid finds, and
which other effect it requires (`whsklearn.effects.base`).  A `Candidate` is one effect in one variant of its text
fields, seen from one side of a transmission.  This module names no effect except those that no torque shows.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Any, NamedTuple

import numpy as np

from whsklearn.effects import Effect, Scales, codes, effect_names, get_effect
from whsklearn.effects.base import shapes_of
from whsklearn.effects.quantity import A_QUARTER, ONE_PERIOD
from whsklearn.gap.plants.variant import EffectVariant
from whsklearn.gap.record import Array

# Read directly from the record (a grid, a folded sign), equivalent to another zero or slope of the reference, or part
# of the base model like the age of the drive: no torque is missing because of these.
UNSEEN = ("quantization", "sensor_rectification", "output_offset", "output_drift", "early_reversal")
SEEN = 0.01  # of an effect's largest value over its starts: a start at which it shows less is outside the travel
N_POINTS = 2001  # of the motion on which an effect's largest value is found: a thousandth of the travel apart


class TypicalMotion:
    """A motion with the scales of one record on which every effect shows; shape (n,) each.

    It swings slightly more than seven times over the travel, so that no two swings pass the same positions.
    """

    def __init__(self, scales: Scales):
        phase = np.linspace(0.0, 14.6 * np.pi, N_POINTS)
        self.time = np.linspace(0.0, scales.duration, N_POINTS)
        self.position = scales.centre - scales.reach * np.cos(phase)
        self.velocity = np.sqrt(2.0) * scales.speed * np.sin(phase)
        self.acceleration = np.sqrt(2.0) * scales.torque / scales.inertia * np.cos(phase)
        self.drive = np.sqrt(2.0) * scales.torque * np.cos(phase)


@dataclass(frozen=True)
class Candidate(EffectVariant):
    """One effect in one variant, seen from one side of a transmission."""

    on_load: bool = False  # whether the encoder is behind the transmission
    whole: bool = False  # whether the numbers that are freed later (`Effect.later`) are free

    @property
    def positive(self) -> bool:
        """Whether a physical size is positive; the two weights of a wave are free."""
        return self.linear != 2 and self.cls.quantities[self.cls.size].positive

    @cached_property
    def parent(self) -> str:
        """The effect that must be present before it is tried."""
        return self.cls.parent_of(**self.options)

    @cached_property
    def held(self) -> tuple[int, ...]:
        """Shape numbers, counted after the linear ones, that keep their start values."""
        held = (*self.cls.held, *(() if self.whole else self.cls.later))
        return tuple(i for i, f in enumerate(self.fields[self.linear :]) if f in held)

    @cached_property
    def free(self) -> tuple[int, ...]:
        """Numbers that a fit moves."""
        return tuple(i for i in range(len(self.fields)) if i - self.linear not in self.held)

    @cached_property
    def later(self) -> tuple[int, ...]:
        """Shape numbers, counted after the linear ones, that are freed once the effect is chosen."""
        late = () if self.whole else self.cls.later
        return tuple(i for i, f in enumerate(self.fields[self.linear :]) if f in late)

    @cached_property
    def driven(self) -> bool:
        """Whether its columns contain the drive, which they could then explain by itself; tested on the equation."""
        if self.linear == 0:
            return self.cls.column_kind != "none"
        signals, scales = TypicalMotion(Scales()), Scales()
        shape = self.starts(scales)[0]
        with_drive = self.unit_columns(shape, signals)
        signals.drive = np.zeros(N_POINTS)
        return not np.array_equal(with_drive, self.unit_columns(shape, signals))

    @cached_property
    def signal(self) -> str:
        """``position`` or ``velocity`` if its torque is a function of the present value of one of them; else empty."""
        if self.cls.port != "torque" or self.linear == 0:
            return ""
        kept, shape = TypicalMotion(Scales()), self.starts(Scales())[0]
        backwards = self.unit_columns(shape, kept)[::-1]
        for name in ("position", "velocity"):
            other = TypicalMotion(Scales())
            for rest in ("time", "position", "velocity", "acceleration", "drive"):
                setattr(other, rest, 0.5 * getattr(kept, rest))
            setattr(other, name, getattr(kept, name)[::-1])
            if np.array_equal(backwards, self.unit_columns(shape, other)):
                return name
        return ""

    @property
    def of_place(self) -> bool:
        """Whether its torque depends on the present position alone, with a shape that no scan has to find."""
        return self.signal == "position" and not self.scanned

    @property
    def transforms(self) -> bool:
        """Whether it transforms the whole drive and has no size but its shape: a limit, a dead zone, a delay."""
        return self.cls.port == "input" and self.linear == 0

    @property
    def delays(self) -> bool:
        """Whether it only delays the drive, as an age of the drive would."""
        return self.transforms and self.cls.column_kind == "first_order"

    @property
    def label(self) -> str:
        """Name with the variant, for internal use."""
        extra = "".join(f"[{v}]" for v in self.options.values())
        shape = f"[{self.cls.__name__}{'+' if self.whole else ''}]" if self.cls.sought else ""
        return f"{self.name}{shape}{extra}{'L' if self.on_load else ''}"

    def ranged(self, scales: Scales) -> list[tuple[float, float]]:
        """(low, high) of every shape number in one record."""
        return _ranged(self, scales)

    def of_part(self, q: tuple[float, ...], scales: Scales) -> bool:
        """Whether it is less than a period over the travel of a wave that is something else if it is too slow."""
        if self.scanned != "position" or self.cls.quantities[self.cls.scanned()].open_below:
            return False
        return bool(q[self.linear] * scales.reach < ONE_PERIOD)

    def starts(self, scales: Scales) -> list[tuple[float, ...]]:
        """Shape numbers from which the search on one record begins."""
        return self.cls.starts(scales)

    def opened(self, q: tuple[float, ...], scales: Scales) -> list[tuple[Candidate, tuple[float, ...]]]:
        """The candidate with its later numbers freed, and its parameters with each of their starts."""
        kind, at = replace(self, whole=True), [self.linear + i for i in self.later]
        rows = []
        for start in self.cls.later_starts(scales) if at else []:
            row = list(q)
            for i, x in zip(at, start, strict=True):
                row[i] = x
            rows.append((kind, tuple(row)))
        return rows

    def spread(self, shape: int, scales: Scales) -> float:
        """A typical change of a shape number that is not varied by ratios."""
        q = self.cls.quantities[self.fields[self.linear + shape]]
        unit, _ = scales.of(q.unit, q.scale)
        return max(unit if unit is not None else (q.high - q.low) / 6.0, 1e-6)

    def size_unit(self, scales: Scales) -> float:
        """The size at which the effect's largest value equals the rms drive (or a hundredth of the travel)."""
        return _size_unit(self, scales)

    def unit_columns(self, shape: tuple[float, ...], signals: Any) -> Array:
        """Torque (or reading) per unit of each linear number, shape (n, linear), by the effect's own equation."""
        effect = self.cls(**self.options)
        return np.column_stack([effect.along((*unit, *shape), signals) for unit in np.eye(self.linear)])


@lru_cache(maxsize=1024)
def _ranged(candidate: Candidate, scales: Scales) -> list[tuple[float, float]]:
    rows = candidate.cls.bounds(scales)
    if candidate.scanned == "position":  # its order comes first
        least = candidate.cls.quantities[candidate.cls.scanned()].low
        rows = [(max(least, A_QUARTER / scales.reach), rows[0][1]), *rows[1:]]
    return rows


@lru_cache(maxsize=1024)
def _size_unit(candidate: Candidate, scales: Scales) -> float:
    whole = 0.01 * scales.reach if candidate.cls.port == "output" else scales.torque
    if candidate.linear == 0:
        return whole
    signals = TypicalMotion(scales)
    tops = np.array([np.abs(candidate.unit_columns(s, signals)).max() for s in candidate.starts(scales)])
    seen = tops[tops > SEEN * tops.max()]
    return float(whole / seen.min()) if seen.size else whole


def catalogue() -> tuple[Candidate, ...]:
    """Every defined effect that a missing torque can show, in all variants.

    >>> [c.label for c in catalogue() if c.name == "flexible_coupling"]
    ['flexible_coupling', 'flexible_couplingL']
    """
    names = (n for n in effect_names() if n not in UNSEEN)
    return tuple(c for name in names for cls in shapes_of(name) for c in variants(cls))


def variants(cls: type[Effect]) -> tuple[Candidate, ...]:
    """One candidate for every choice of the text fields, and for either side if it splits the inertia."""
    sides = (False, True) if cls.port == "block" else (False,)
    return tuple(Candidate(cls, tuple(v.items()), side) for side in sides for v in cls.variants())


def candidate(name: str) -> Candidate:
    """The first candidate of a canonical name.

    Raises ValueError if there is no such effect, or if no missing torque can show it.
    """
    if name not in effect_names() or name in UNSEEN:
        known = ", ".join(sorted(n for n in effect_names() if n not in UNSEEN))
        raise ValueError(f"{name!r} cannot be part of the law of an axis; expected one of {known}.")
    return variants(get_effect(name))[0]


def aliases(name: str) -> tuple[str, ...]:
    """Names that no record of drive and position can distinguish from ``name``.

    Effects that are the same only to first order (a delay and a lag) are distinguished by simulation.
    """
    cls = get_effect(name)
    return () if cls.column_kind == "first_order" else cls.aliases


TWO_MASS = frozenset((codes.BACKLASH, codes.FLEXIBLE_COUPLING))


def usable(present: list[Candidate]) -> tuple[Candidate, ...]:
    """Candidates that may be added to a model with those ``present``.

    At most one splits the inertia, a name occurs once unless it repeats, an effect that modifies another one requires
    it, and nothing is added that a present effect already describes.
    """
    names = {p.name for p in present}
    said = {name for p in present for name in p.cls.covers}
    split = any(p.cls.port == "block" for p in present)
    return tuple(
        c for c in catalogue()
        if (c.name not in names or c.cls.repeats)
        and c.name not in said
        and not (split and c.cls.port == "block")
        and (not c.parent or c.parent in names)
    )  # fmt: skip


class ColumnSignals(NamedTuple):
    """The signals from which an effect's columns are computed, shape (n,) each.

    If an effect acts on the drive, ``drive`` is the torque that the model predicts; with the measured one the effect
    could explain the drive by itself.  ``kappa`` (s/rad) softens sign(v) to tanh(kappa v); None keeps the sign.
    """

    time: Array
    position: Array
    velocity: Array
    acceleration: Array
    drive: Array
    kappa: float | None = None
