"""Torques that depend on where the axis is."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from whsklearn.effects import codes
from whsklearn.effects.base import Effect
from whsklearn.effects.quantity import Quantity
from whsklearn.effects.waves import as_column, waves

if TYPE_CHECKING:
    from numpy.typing import NDArray

_PHASE = Quantity("rad", -math.pi, math.pi)
_CENTRE = Quantity("rad", -10.0, 10.0)


@dataclass(frozen=True)
class Cogging(Effect):
    """The rotor's magnets prefer some angles; a gear in between makes the order fractional."""

    amplitude: float = 0.05
    order: float = 12.0
    phase: float = 0.0

    name: ClassVar[str] = "cogging"
    place: ClassVar[str] = "position"
    equation: ClassVar[str] = "A cos(k q + phi)"
    size: ClassVar[str] = "amplitude"
    quantities: ClassVar[dict[str, Quantity]] = {
        "amplitude": Quantity("Nm", 1e-4, 1e3, log=True),
        "order": Quantity("1", 1.5, 256.0),
        "phase": _PHASE,
    }
    signature: ClassVar[str] = "a wave over position, whatever the speed, the direction and the drive"
    needs: ClassVar[str] = "a period of travel at two speeds"
    reference: ClassVar[str] = "Jahns, Soong 1996, IEEE Trans. Ind. Electron. 43(2), 321-330"
    phased: ClassVar[bool] = True
    code: ClassVar[int] = codes.COGGING

    def columns(self, signals: Any) -> NDArray[np.float64]:
        """cos(k q), sin(k q)."""
        return waves(self.order * np.asarray(signals.position))


@dataclass(frozen=True)
class GravityImbalance(Effect):
    """A centre of mass off the axis, A = m g l."""

    amplitude: float = 0.1
    phase: float = 0.0

    name: ClassVar[str] = "gravity_imbalance"
    place: ClassVar[str] = "position"
    equation: ClassVar[str] = "A cos(q + phi)"
    size: ClassVar[str] = "amplitude"
    quantities: ClassVar[dict[str, Quantity]] = {"amplitude": Quantity("Nm", 1e-4, 1e4, log=True), "phase": _PHASE}
    signature: ClassVar[str] = "one wave a turn, whatever the speed"
    needs: ClassVar[str] = "half a turn of travel"
    reference: ClassVar[str] = "Swevers, Verdonck, De Schutter 2007, IEEE Control Systems Magazine 27(5), 58-71"
    phased: ClassVar[bool] = True
    code: ClassVar[int] = codes.GRAVITY_IMBALANCE

    def columns(self, signals: Any) -> NDArray[np.float64]:
        """cos q, sin q."""
        return waves(np.asarray(signals.position, dtype=float))


@dataclass(frozen=True)
class CableSpring(Effect):
    """Cables that pull back."""

    stiffness: float = 0.1
    centre: float = 0.0

    name: ClassVar[str] = "cable_spring"
    place: ClassVar[str] = "position"
    equation: ClassVar[str] = "c (q - q_0)"
    size: ClassVar[str] = "stiffness"
    quantities: ClassVar[dict[str, Quantity]] = {
        "stiffness": Quantity("Nm/rad", 1e-5, 1e4, log=True),
        "centre": _CENTRE,
    }
    signature: ClassVar[str] = "a straight line against position"
    needs: ClassVar[str] = "travel, at more than one frequency (one sine hides it in the inertia)"
    reference: ClassVar[str] = (
        "Hilkert 2008, Inertially Stabilized Platform Technology, IEEE Control Systems Magazine 28(1), 26-46"
    )
    code: ClassVar[int] = codes.CABLE_SPRING

    def columns(self, signals: Any) -> NDArray[np.float64]:
        """q - q_0."""
        return as_column(np.asarray(signals.position) - self.centre)


@dataclass(frozen=True)
class HardeningSpring(Effect):
    """A spring that grows stiffer, Duffing's cubic."""

    stiffness: float = 0.05
    centre: float = 0.0

    name: ClassVar[str] = "hardening_spring"
    place: ClassVar[str] = "position"
    equation: ClassVar[str] = "c (q - q_0)^3"
    size: ClassVar[str] = "stiffness"
    quantities: ClassVar[dict[str, Quantity]] = {
        "stiffness": Quantity("Nm/rad3", 1e-6, 1e5, log=True),
        "centre": _CENTRE,
    }
    signature: ClassVar[str] = "a cubic against position"
    needs: ClassVar[str] = "large travel"
    reference: ClassVar[str] = (
        "Kovacic, Brennan 2011, The Duffing Equation: Nonlinear Oscillators and their Behaviour, Wiley"
    )
    code: ClassVar[int] = codes.HARDENING_SPRING

    def columns(self, signals: Any) -> NDArray[np.float64]:
        """(q - q_0)^3."""
        return as_column((np.asarray(signals.position) - self.centre) ** 3)


@dataclass(frozen=True)
class EndStop(Effect):
    """An elastic stop at either end of the travel."""

    stiffness: float = 10.0
    angle: float = 1.0

    name: ClassVar[str] = "end_stop"
    place: ClassVar[str] = "position"
    equation: ClassVar[str] = "k max(|q| - q_s, 0) sign(q)"
    size: ClassVar[str] = "stiffness"
    quantities: ClassVar[dict[str, Quantity]] = {
        "stiffness": Quantity("Nm/rad", 1e-2, 1e7, log=True),
        "angle": Quantity("rad", 1e-3, 1e2, log=True),
    }
    signature: ClassVar[str] = "a gap in one range of position only"
    needs: ClassVar[str] = "travel into the stop"
    reference: ClassVar[str] = "Brogliato 1999, Nonsmooth Mechanics, 2nd ed., Springer"
    code: ClassVar[int] = codes.END_STOP

    def columns(self, signals: Any) -> NDArray[np.float64]:
        """max(|q| - q_s, 0) sign(q)."""
        position = np.asarray(signals.position, dtype=float)
        return as_column(np.maximum(np.abs(position) - self.angle, 0.0) * np.sign(position))
