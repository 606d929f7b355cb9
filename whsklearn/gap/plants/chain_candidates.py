"""Effects that may be missing between u and y: those of the catalogue, in the form that the compiled chain takes.

Ranges, starts and scanned parameters come from each effect's `Quantity`.  A chain adds the ports that only it has
(`whsklearn.effects.chain`) and its own scales: x is its position, x(t) - x(t-1) its velocity, v its torque.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from whsklearn.effects import Effect, FrictionLaw, Scales, codes, effect_names, get_effect
from whsklearn.effects.chain import CHAIN_FORMS
from whsklearn.effects.static import Power
from whsklearn.gap.plant import FittedTerm

Array = NDArray[np.float64]

READ_OFF = ("quantization",)  # a grid of the readings is visible directly, so it is not a term
# Fields that keep their start: another position of rest is the same as one more offset, and no record of a few thousand
# samples can distinguish exponents of a Stribeck curve.
HELD = ("centre", "exponent")
# Waves over a signal of a chain, which has no revolution to count them by: two thirds of a period within three rms to
LEAST_ORDER, MOST_ORDER = 0.7, 20.0
N_SHAPES = 12  # of one number without a grid of its own: neighbours explain 0.95 of each other


@dataclass(frozen=True)
class Sizes:
    """Sizes of the signals of a fitted model, from which ranges and starts follow."""

    u: float  # rms
    u_peak: float
    x: float
    x_peak: float
    dx: float
    v: float
    y: float
    seconds: float
    dt: float

    def seen_from(self, kind: Candidate) -> Scales:
        """The scales of the signals where a candidate acts, in the form of the scales of an axis."""
        place, at = kind.cls.place, kind.at
        torque, peak, reach = self.v, 3.0 * self.v, self.x_peak
        if at == "middle":
            torque, peak = self.x, self.x_peak
        elif at == "input" or place == "drive":
            torque, peak, reach = self.u, self.u_peak, self.u_peak
        elif place == "friction":
            reach = 6.0 * self.dx  # the distance of a friction is covered within a few samples
        elif kind.at_sensor:
            reach = 3.0 * self.y
        return Scales(
            torque=torque, peak=peak, speed=2.0 * self.dx, reach=reach, centre=0.0, duration=self.seconds, dt=self.dt,
            resonance=0.25 / self.dt,
        )  # fmt: skip


@dataclass(frozen=True)
class Candidate:
    """One effect, at one port or in one variant of its text fields.

    Attributes
    ----------
    cls : type
        The library's effect.
    choice : tuple of (str, str)
        Its text fields.
    """

    cls: type[Effect]
    choice: tuple[tuple[str, str], ...] = ()

    @property
    def name(self) -> str:
        """Canonical name."""
        return self.cls.name

    @cached_property
    def options(self) -> dict[str, str]:
        """The text fields."""
        return dict(self.choice)

    @cached_property
    def code(self) -> int:
        """Its code in the compiled chain."""
        return int(self.cls(**self.options).code)

    @cached_property
    def linear(self) -> int:
        """Number of leading parameters in which it is linear: 1, 2 (cosine and sine), or 0 if its size is a shape."""
        return self.cls.linear()

    @cached_property
    def fields(self) -> tuple[str, ...]:
        """Names of the parameters, linear ones first."""
        first = {0: (), 1: (self.cls.size,), 2: ("cosine", "sine")}[self.linear]
        return (*first, *self.cls.searched())

    @cached_property
    def free(self) -> tuple[int, ...]:
        """Numbers that a fit moves; an instant has no slope, so it is found by a walk."""
        walked = (self.cls.scanned(),) if self.scan == "step" else ()
        still = (*walked, *self.cls.held, *(HELD if self.cls.evaluate is None else ()))
        return tuple(i for i, f in enumerate(self.fields) if f not in still)

    @property
    def n_numbers(self) -> int:
        """Number of parameters that a record must determine."""
        return len(self.free) + (self.scan == "step")

    @cached_property
    def scan(self) -> str:
        """Which fine grid finds its one number: ``position``, ``time``, ``step``, or empty for none."""
        if "order" in self.fields:
            return "position"
        field = self.cls.scanned()
        return self.cls.quantities[field].scan if field else ""

    @property
    def positive(self) -> bool:
        """Whether its one size must be positive."""
        return self.linear == 1 and self.cls.quantities[self.cls.size].positive

    @property
    def at(self) -> str:
        """The port, if there is a choice."""
        return self.options.get("at", "")

    @property
    def at_sensor(self) -> bool:
        """Whether it acts on the reading."""
        return self.cls.place == "sensor" or self.cls.port == "output" or self.at == "output"

    @property
    def delays(self) -> bool:
        """Whether its shape is a time of a few samples."""
        return self.linear == 0 and self.cls.quantities[self.fields[0]].scale == "dt"

    @property
    def folds(self) -> bool:
        """Whether its one size is a share between 0 and 1; a share of one is not a small change."""
        q = self.cls.quantities[self.cls.size]
        return self.linear == 1 and self.at_sensor and (q.low, q.high) == (0.0, 1.0)

    def ratios(self, i: int) -> bool:
        """Whether number i is varied by ratios."""
        if i < self.linear:
            return False
        q = self.cls.quantities[self.fields[i]]
        return q.log or q.low > 0.0 or (self.scan == "position" and self.fields[i] == "order")

    def range_of(self, i: int, z: Sizes) -> tuple[float, float]:
        """(low, high) of number i in one record."""
        field = self.fields[i]
        if i < self.linear:
            q = None if self.linear == 2 else self.cls.quantities[field]
            bounded = q is not None and q.unit == "1" and q.low == 0.0
            return (0.0, q.high) if bounded and q is not None else (-np.inf, np.inf)
        if field == "order":
            size = z.y if self.at_sensor else z.x
            return LEAST_ORDER / size, MOST_ORDER / size
        if self.scan == "time":
            return 0.7 / z.seconds, 0.5 / z.dt
        low, high = self.cls.quantities[field].bounds(z.seen_from(self))
        return (low, min(high, 0.49 / z.dt)) if field == "frequency" else (low, high)

    def shapes(self, z: Sizes) -> list[tuple[float, ...]]:
        """Values of the numbers after the linear ones at which a look tries it."""
        grids = []
        for i in range(self.linear, len(self.fields)):
            low, high = self.range_of(i, z)
            q = self.cls.quantities[self.fields[i]]
            if self.scan == "position":
                grids.append(np.arange(LEAST_ORDER, 12.0, 0.3) * low / LEAST_ORDER)
            elif self.scan == "step":
                grids.append(np.linspace(low, high, 43))
            elif self.delays:  # a delay between samples has a valley of its own
                grids.append(z.dt * np.concatenate([np.arange(0.3, 6.0, 0.4), np.geomspace(6.3, 60.0, 6)]))
            elif i in self.free and self.ratios(i) and len(self.free) - self.linear == 1:
                known = q.grid(z.seen_from(self))
                around = max(low, known[0] / 4.0), min(0.97 * high, 1.3 * known[-1])
                grids.append(np.geomspace(*around, N_SHAPES))
            else:
                grids.append(np.array(q.grid(z.seen_from(self))))
        if self.fields[-1] == "centre" and len(self.fields) - 1 not in self.free:
            grids[-1] = np.zeros(1)
        return list(itertools.product(*(map(float, g) for g in grids)))

    def effect(self, q: Any) -> Effect:
        """The library's effect with these numbers."""
        return self.cls.from_row(q, **self.options)


@dataclass(frozen=True)
class Term(FittedTerm):
    """A candidate with its numbers."""

    def row(self) -> Array:
        """The numbers in the form that the compiled chain takes."""
        out = np.zeros(codes.N_NUMBERS)
        out[: len(self.q)] = self.q
        return out


def is_line(law: FrictionLaw) -> bool:
    """Whether a law is a straight line in x, with or without an offset."""
    return all(isinstance(t, Power) and t.degree <= 1 for t in law.terms)


def catalogue(law: FrictionLaw) -> list[Candidate]:
    """Every candidate besides a law: all defined effects at every port, except those that the law contains.

    A limit or a dead zone of x is the same as one of v if the law is a line; otherwise a look cannot see it.
    """
    held = {t.code for t in law.terms}
    dry = {t.name for t in law.terms}
    out = []
    for name in effect_names():
        cls = CHAIN_FORMS.get(name, get_effect(name))
        if name in READ_OFF or cls.code in held:
            continue
        for options in cls.variants():
            if cls.port == "input" and options.get("at") == "middle" and not is_line(law):
                continue
            parent = cls.parent_of(**options)
            if parent and parent in ("coulomb", "viscous") and parent not in dry:
                continue
            out.append(Candidate(cls, tuple(options.items())))
    return out
