"""The scales of one record, from which a search takes where a number can lie and where to begin."""

from __future__ import annotations

import math
from dataclasses import dataclass

_OF_UNIT = {
    "rad": "reach",
    "rad/s": "speed",
    "Nm": "torque",
    "s": "duration",
    "Hz": "slowest",
    "rad/Nm": "compliance",
}
_REACHED = 3.0  # periods of a tone that a record must hold to show its frequency


@dataclass(frozen=True)
class Scales:
    """How large everything is in one record.

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
        Highest frequency that the simulation's steps carry (Hz).

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
        """Scale and origin of a quantity by its unit, or by the scale's own name; None where there is none.

        Parameters
        ----------
        unit : str
            Such as ``rad/s``.
        name : str, optional
            A scale's own name.
        """
        name = name or _OF_UNIT.get(unit, "")
        if not name:
            return None, 0.0
        return float(getattr(self, name)), self.centre if unit == "rad" and name == "reach" else 0.0
