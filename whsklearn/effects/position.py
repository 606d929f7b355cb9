"""Torques that depend on the position of the axis."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from whsklearn.effects import codes
from whsklearn.effects.base import Effect
from whsklearn.effects.quantity import Quantity

_SIDES = {"both": codes.END_STOP, "upper": codes.END_STOP_UPPER, "lower": codes.END_STOP_LOWER}
_PHASE = Quantity("rad", -math.pi, math.pi)
# a spring may be at rest anywhere in the travel: a search from the middle alone finds a fifth of one at the end
_REST = Quantity("rad", -10.0, 10.0, span=(-3.0, 3.0), starts=(-1.0, -0.5, 0.0, 0.5, 1.0))
_CENTRE = Quantity("rad", -10.0, 10.0, span=(-3.0, 3.0), starts=(0.0,))


@dataclass(frozen=True)
class Cogging(Effect):
    """The rotor's magnets prefer certain angles, A cos(k q + phi) (Nm); a gear in between makes the order fractional.

    See Also
    --------
    TorqueRipple : the wave grows with the drive.
    PositionFriction : the wave changes sign with the direction.
    GravityImbalance : order one.
    EncoderEccentricity : its torque grows with the square of the speed.
    DisturbanceTone : fixed in time; at one speed the two look the same.

    Examples
    --------
    >>> Cogging(0.05, order=12.0).value(position=[0.0, 0.2618]).round(3).tolist()
    [0.05, -0.05]
    """

    amplitude: float = 0.05
    order: float = 12.0
    phase: float = 0.0

    name: ClassVar[str] = "cogging"
    place: ClassVar[str] = "position"
    equation: ClassVar[str] = "A cos(k q + phi)"
    size: ClassVar[str] = "amplitude"
    quantities: ClassVar[dict[str, Quantity]] = {
        "amplitude": Quantity("Nm", 1e-4, 1e3, log=True),
        "order": Quantity("1", 1.4, 256.0, scan="position"),
        "phase": _PHASE,
    }
    signature: ClassVar[str] = "a wave over position that does not depend on speed, direction or drive"
    needs: ClassVar[str] = "a period of travel at two speeds"
    reference: ClassVar[str] = "Jahns, Soong 1996, IEEE Trans. Ind. Electron. 43(2), 321-330"
    phased: ClassVar[bool] = True
    repeats: ClassVar[bool] = True
    commoner: ClassVar[tuple[str, ...]] = ("gravity_imbalance",)
    code: ClassVar[int] = codes.COGGING


@dataclass(frozen=True)
class GravityImbalance(Effect):
    """A centre of mass that is off the axis of rotation, A cos(q + phi) with A = m g l (Nm).

    See Also
    --------
    CableSpring : a line against position; alike over a short travel.
    EncoderEccentricity : order one too, in the reading instead of the torque.
    InputOffset : alike where the axis hardly moves.

    Examples
    --------
    >>> GravityImbalance(2.0, phase=0.5).value(position=-0.5)
    2.0
    """

    amplitude: float = 0.1
    phase: float = 0.0

    name: ClassVar[str] = "gravity_imbalance"
    place: ClassVar[str] = "position"
    equation: ClassVar[str] = "A cos(q + phi)"
    size: ClassVar[str] = "amplitude"
    quantities: ClassVar[dict[str, Quantity]] = {"amplitude": Quantity("Nm", 1e-4, 1e4, log=True), "phase": _PHASE}
    signature: ClassVar[str] = "one wave per turn at any speed"
    needs: ClassVar[str] = "half a turn of travel"
    reference: ClassVar[str] = "Swevers, Verdonck, De Schutter 2007, IEEE Control Systems Magazine 27(5), 58-71"
    phased: ClassVar[bool] = True
    code: ClassVar[int] = codes.GRAVITY_IMBALANCE


@dataclass(frozen=True)
class CableSpring(Effect):
    """Cables that act as a spring, c (q - q_0) (Nm).

    See Also
    --------
    HardeningSpring : cubic; the two differ at large travel.
    GravityImbalance : alike over a short travel.
    OutputOffset : shifts the centre of this spring.

    Examples
    --------
    >>> CableSpring(0.1, centre=1.0).value(position=[1.0, 3.0]).tolist()
    [0.0, 0.2]
    """

    stiffness: float = 0.1
    centre: float = 0.0

    name: ClassVar[str] = "cable_spring"
    place: ClassVar[str] = "position"
    equation: ClassVar[str] = "c (q - q_0)"
    size: ClassVar[str] = "stiffness"
    quantities: ClassVar[dict[str, Quantity]] = {
        "stiffness": Quantity("Nm/rad", 1e-5, 1e4, log=True),
        "centre": _REST,
    }
    signature: ClassVar[str] = "a straight line against position"
    needs: ClassVar[str] = "travel, at more than one frequency (one sine hides it in the inertia)"
    reference: ClassVar[str] = (
        "Hilkert 2008, Inertially Stabilized Platform Technology, IEEE Control Systems Magazine 28(1), 26-46"
    )
    commoner: ClassVar[tuple[str, ...]] = ("gravity_imbalance",)
    covers: ClassVar[tuple[str, ...]] = ("input_offset", "asymmetric_coulomb")
    code: ClassVar[int] = codes.CABLE_SPRING


@dataclass(frozen=True)
class HardeningSpring(Effect):
    """A spring that grows stiffer, Duffing's cubic c (q - q_0)^3 (Nm).

    See Also
    --------
    CableSpring : linear.
    EndStop : zero before the stop.

    Examples
    --------
    >>> HardeningSpring(0.05).value(position=2.0)
    0.4
    """

    stiffness: float = 0.05
    centre: float = 0.0

    name: ClassVar[str] = "hardening_spring"
    place: ClassVar[str] = "position"
    equation: ClassVar[str] = "c (q - q_0)^3"
    size: ClassVar[str] = "stiffness"
    quantities: ClassVar[dict[str, Quantity]] = {
        "stiffness": Quantity("Nm/rad3", 1e-6, 1e5, log=True),
        "centre": Quantity("rad", -10.0, 10.0, scale="extent", span=(-1.0, 1.0), starts=(0.0,)),
    }
    signature: ClassVar[str] = "a cubic against position"
    needs: ClassVar[str] = "large travel"
    reference: ClassVar[str] = (
        "Kovacic, Brennan 2011, The Duffing Equation: Nonlinear Oscillators and their Behaviour, Wiley"
    )
    commoner: ClassVar[tuple[str, ...]] = ("gravity_imbalance", "cable_spring")
    held: ClassVar[tuple[str, ...]] = ("centre",)  # a cubic about another centre adds a line and a parabola
    code: ClassVar[int] = codes.HARDENING_SPRING


@dataclass(frozen=True)
class EndStop(Effect):
    """An elastic stop at either end of the travel, k max(|q| - q_s, 0) sign(q) (Nm).

    See Also
    --------
    ContactStop : the same with a damper, at one end, or about another centre.
    HardeningSpring : grows from the centre.
    Saturation : limits the drive; both show where the motion is largest.

    Examples
    --------
    >>> EndStop(10.0, angle=1.0).value(position=[-1.5, 0.5, 1.25]).tolist()
    [-5.0, 0.0, 2.5]
    """

    stiffness: float = 10.0
    angle: float = 1.0

    name: ClassVar[str] = "end_stop"
    place: ClassVar[str] = "position"
    equation: ClassVar[str] = "k max(|q| - q_s, 0) sign(q)"
    size: ClassVar[str] = "stiffness"
    quantities: ClassVar[dict[str, Quantity]] = {
        "stiffness": Quantity("Nm/rad", 1e-2, 1e7, log=True),
        "angle": Quantity(
            "rad", 1e-3, 1e2, log=True, scale="extent", span=(0.2, 1.0), starts=(0.5, 0.65, 0.75, 0.83, 0.9, 0.95)
        ),
    }
    signature: ClassVar[str] = "a gap in one range of position only"
    needs: ClassVar[str] = "travel into the stop"
    commoner: ClassVar[tuple[str, ...]] = ("gravity_imbalance", "cable_spring", "hardening_spring")
    reference: ClassVar[str] = "Brogliato 1999, Nonsmooth Mechanics, 2nd ed., Springer"
    code: ClassVar[int] = codes.END_STOP

    @property
    def ends(self) -> tuple[float, float]:
        """Lower and upper end of the free travel (rad)."""
        return -self.angle, self.angle


@dataclass(frozen=True)
class ContactStop(EndStop):
    """A stop that is a spring with a damper and only pushes, k max(d + tau dd/dt, 0) at the depth d > 0 (Nm).

    ``side`` says which end of the travel has it: ``upper`` (d = q - q_0 - q_s), ``lower`` (d = q_0 + q_s - q) or
    ``both``, at q_0 - q_s and q_0 + q_s.

    See Also
    --------
    EndStop : elastic, about zero.

    Examples
    --------
    >>> ContactStop(10.0, -0.5, relaxation=0.1, side="lower").value(position=[-1.0, -1.0], velocity=[0.0, 9.0]).tolist()
    [-5.0, 0.0]
    >>> ContactStop(10.0, 0.5, centre=2.0, side="both").ends
    (1.5, 2.5)
    """

    stiffness: float = 10.0
    angle: float = 1.0
    relaxation: float = 0.01
    centre: float = 0.0
    side: str = "upper"

    equation: ClassVar[str] = "k max(d + tau dd/dt, 0) where d > 0, d the depth beyond the end at q_0 + q_s"
    quantities: ClassVar[dict[str, Quantity]] = {
        "stiffness": Quantity("Nm/rad", 1e-2, 1e7, log=True),
        "angle": Quantity("rad", -1e2, 1e2, span=(-1.5, 1.5), starts=(0.8,)),
        "relaxation": Quantity("s", 0.0, 1.0, span=(0.0, 0.05), starts=(0.0,)),
        "centre": _CENTRE,
    }
    choices: ClassVar[dict[str, tuple[str, ...]]] = {"side": tuple(_SIDES)}
    held: ClassVar[tuple[str, ...]] = ("centre",)
    reference: ClassVar[str] = "Brogliato 1999, Nonsmooth Mechanics, 2nd ed., Springer, on Kelvin and Voigt's contact"

    @property
    def code(self) -> int:  # type: ignore[override]
        """The code of the side."""
        return _SIDES[self.side]

    @property
    def ends(self) -> tuple[float, float]:
        """Lower and upper end of the free travel (rad); infinite where there is no stop."""
        if self.side == "both":
            return self.centre - abs(self.angle), self.centre + abs(self.angle)
        end = self.centre + self.angle
        return (-math.inf, end) if self.side == "upper" else (end, math.inf)
