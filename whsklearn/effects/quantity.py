"""A parameter of an effect: its unit, its plausible range, and the starting points of a search."""

from __future__ import annotations

import dataclasses
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

# --- the scales of one record, from which a search takes where a number can lie and where to begin ------------------
_OF_UNIT = {"rad": "reach", "rad/s": "speed", "Nm": "torque", "s": "duration", "Hz": "slowest", "rad/Nm": "compliance"}
_REACHED = 3.0  # periods of a tone that a record must hold to show its frequency


@dataclass(frozen=True)
class Scales:
    """Typical magnitudes in one record.

    Parameters
    ----------
    torque, peak : float
        Rms and largest absolute drive (Nm).
    speed : float
        Rms velocity (rad/s).
    reach, centre : float
        Half the travel and its middle (rad).
    duration, dt : float
        Length of the record and time between samples (s).
    inertia : float
        Of the axis (kg m2).
    resonance : float
        Highest frequency that the steps of the simulation resolve (Hz).

    References
    ----------
    Gill, Murray and Wright 1981, Practical Optimization, Academic Press, on the scaling of variables.

    Examples
    --------
    >>> Scales(reach=2.0, centre=0.5).extent
    2.5
    """

    torque: float = 1.0
    peak: float = 1.5
    speed: float = 1.0
    reach: float = 1.0
    centre: float = 0.0
    duration: float = 10.0
    dt: float = 1e-3
    inertia: float = 1.0
    resonance: float = 60.0

    @property
    def extent(self) -> float:
        """Largest absolute position (rad)."""
        return abs(self.centre) + self.reach

    @property
    def stroke(self) -> float:
        """Time in which the axis crosses half its travel at its rms speed (s)."""
        return self.reach / self.speed

    @property
    def slowest(self) -> float:
        """Lowest frequency of which the record holds enough periods (Hz)."""
        return _REACHED / self.duration

    @property
    def compliance(self) -> float:
        """Compliance between two equal halves of the inertia that ring at `resonance` (rad/Nm)."""
        return 4.0 / (self.inertia * (2.0 * math.pi * self.resonance) ** 2)

    def of(self, unit: str, name: str = "") -> tuple[float | None, float]:
        """Scale and origin of a quantity by its ``unit`` or by the ``name`` of the scale; None if there is none."""
        name = name or _OF_UNIT.get(unit, "")
        if not name:
            return None, 0.0
        return float(getattr(self, name)), self.centre if unit == "rad" and name == "reach" else 0.0


ONE_PERIOD = math.pi  # rad of a wave over half the travel; a shorter piece is a line and a parabola
A_QUARTER = 0.25 * ONE_PERIOD  # a slower wave is a line over position: its order and its size are one number
N_STARTS = 5  # of a number without a setting of its own; a decade of a logarithmic range is about two of them


@dataclass(frozen=True)
class Quantity:
    """A parameter of an effect: its unit on a rotary axis, its plausible range, and where to search for it.

    Parameters
    ----------
    unit : str
        Unit on a rotary axis (``"Nm"``, ``"rad/s"``, ``"1"``).  A linear axis reads
        N for Nm and m for rad; a Wiener-Hammerstein system, the units of its log.
    low, high : float
        Plausible range on real axes, inclusive; used to reject a fit, to draw tests.
    log : bool
        Whether the range is logarithmic rather than linear.
    span : tuple of two floats, optional
        Range in which a record can show it, as multiples of the record's scale (see `whsklearn.effects.Scales`); if
        given, only this range is used, whatever the unit of the log. Without it the plausible range is cut to 1e-3 to 3
        for a logarithmic quantity, and to -3 to 3 otherwise.
    starts : tuple of float, optional
        Starting points of a search, as multiples of the record's scale; evenly spaced over the range by default.
    scale : str, optional
        Which of the record's scales; that of the unit by default (``rad``: reach of the motion, ``rad/s``: speed,
        ``Nm``: torque, ``s``: duration, ``Hz``: one over the duration, ``rad/Nm``: compliance).
    scan : str
        How a fine grid finds it if starting points are too coarse: ``position`` (the order of a wave over position),
        ``time`` (a frequency), ``step`` (an instant); empty if the starting points suffice.
    open_below, open_above : bool
        Whether the effect is still itself below or above its range, where a record shows that it is there but not how
        large this number is. Otherwise it has become another effect there, as a slow wave becomes an offset.

    References
    ----------
    Gill, Murray and Wright 1981, Practical Optimization, Academic Press, on the scaling of variables.

    Examples
    --------
    >>> from whsklearn.effects import Quantity, Scales
    >>> width = Quantity("rad", 0.01, 1.0, log=True)
    >>> width.labelled("width"), width.positive
    ('width_rad', True)
    >>> tuple(round(x, 2) for x in width.bounds(Scales(reach=0.1)))
    (0.01, 0.3)
    """

    unit: str
    low: float
    high: float
    log: bool = False
    span: tuple[float, float] | None = None
    starts: tuple[float, ...] = ()
    scale: str = ""
    scan: str = ""
    open_below: bool = False
    open_above: bool = False

    def labelled(self, name: str) -> str:
        """The ``name`` with the unit appended, as in a column name: ``torque_nm``.

        Examples
        --------
        >>> Quantity("rad/s", 0, 1).labelled("velocity")
        'velocity_rad_per_s'
        """
        unit = re.sub(r"[^a-z0-9]+", "_", self.unit.lower().replace("/", " per ")).strip("_")
        return name if self.unit == "1" else f"{name}_{unit}"

    def bounds(self, scales: Scales) -> tuple[float, float]:
        """Search range in a record of these ``scales``: the plausible range, cut to what the record can show.

        If the two do not overlap, as in a log in degrees or millimetres, the record's own range is used.

        Examples
        --------
        >>> from whsklearn.effects import Scales
        >>> low, high = Quantity("rad", 0.01, 1.0, log=True).bounds(Scales(reach=0.2))
        >>> round(low, 3), round(high, 3)
        (0.01, 0.6)
        """
        if self.scan == "position":  # orders grow as the travel shrinks
            # a wave that is itself below its range needs less than a period to be told from the rest of the law
            least = max(self.low, (A_QUARTER if self.open_below else ONE_PERIOD) / scales.reach)
            return least, max(self.high, self.high / scales.reach, 10.0 * least)
        unit, origin = scales.of(self.unit, self.scale)
        if unit is None:
            return self.low, self.high
        span = self.span if self.span is not None else ((1e-3, 3.0) if self.log else (-3.0, 3.0))
        origin = 0.0 if self.log else origin
        seen = origin + span[0] * unit, origin + span[1] * unit
        if self.span is not None:
            return seen
        both = max(self.low, seen[0]), min(self.high, seen[1])
        wide = both[1] > 2.0 * both[0] if self.log else both[1] > both[0]
        return both if wide else seen

    def grid(self, scales: Scales, n: int = N_STARTS) -> tuple[float, ...]:
        """Starting values of a search in one record, in increasing order.

        ``scales``: those of the record. ``n``: number of values if the quantity has no starts of its own.

        Examples
        --------
        >>> from whsklearn.effects import Scales
        >>> Quantity("rad", 0.01, 1.0, log=True).grid(Scales(reach=1.0), n=3)
        (0.0215..., 0.1, 0.464...)
        """
        low, high = self.bounds(scales)
        if self.starts:
            unit, origin = scales.of(self.unit, self.scale)
            scaled = [s if unit is None else (0.0 if self.log else origin) + s * unit for s in self.starts]
            return tuple(sorted({min(max(float(s), low), high) for s in scaled}))
        inside = (np.arange(n) + 0.5) / n
        if self.log:
            return tuple(float(x) for x in low * (high / low) ** inside)
        return tuple(float(x) for x in low + (high - low) * inside)

    @property
    def positive(self) -> bool:
        """Whether plausible values are never below zero."""
        return self.low >= 0.0 and not math.isinf(self.low)


def number(default: float, unit: str, low: float, high: float, **search: Any) -> Any:
    """A numeric field of an effect: its default and its `Quantity`.

    Parameters
    ----------
    default : float
        In ``unit``.
    unit : str
        As in ``"Nm"``; ``"1"`` for none.
    low, high : float
        Plausible range.
    **search
        The other fields of `Quantity`.

    Examples
    --------
    >>> from whsklearn.effects import Effect, number
    >>> class Pull(Effect):
    ...     torque: float = number(0.1, "Nm", -1.0, 1.0)
    >>> Pull(0.2), Pull.size, Pull.quantities["torque"].unit
    (Pull(torque=0.2), 'torque', 'Nm')
    """
    return dataclasses.field(default=default, metadata={"quantity": Quantity(unit, low, high, **search)})


def choice(default: str, by_text: Mapping[str, int]) -> Any:
    """A text field of an effect, which selects its equation.

    ``default``: one of the texts. ``by_text``: the code of each allowed text.

    Examples
    --------
    >>> from whsklearn.effects import Effect, choice, codes, number
    >>> class Limit(Effect):
    ...     width: float = number(0.1, "Nm", 1e-3, 1.0)
    ...     kind: str = choice("dead", {"dead": codes.DEAD_ZONE, "top": codes.SATURATION})
    >>> Limit(kind="top").code == codes.SATURATION, Limit.choices
    (True, {'kind': ('dead', 'top')})
    """
    return dataclasses.field(default=default, metadata={"codes": by_text})
