"""Torques that depend on the position of the axis."""

from __future__ import annotations

import math

import numpy as np

from whsklearn.effects import codes
from whsklearn.effects.base import Effect
from whsklearn.effects.quantity import choice, number
from whsklearn.effects.surroundings import Surroundings

TOUCHED = 0.5  # share of the record, and part of the free travel, from which on what is touched is no end of the travel


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

    amplitude: float = number(0.05, "Nm", 1e-4, 1e3, log=True)
    order: float = number(12.0, "1", 1.4, 256.0, scan="position")
    phase: float = number(0.0, "rad", -math.pi, math.pi)

    name = "cogging"
    place = "position"
    equation = "A cos(k q + phi)"
    signature = "a wave over position that does not depend on speed, direction or drive"
    needs = "half a period of travel, at two speeds"
    reference = "Jahns, Soong 1996, IEEE Trans. Ind. Electron. 43(2), 321-330"
    phased = True
    repeats = True
    commoner = ("gravity_imbalance",)
    code = codes.COGGING


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

    amplitude: float = number(0.1, "Nm", 1e-4, 1e4, log=True)
    phase: float = number(0.0, "rad", -math.pi, math.pi)

    name = "gravity_imbalance"
    place = "position"
    equation = "A cos(q + phi)"
    signature = "one wave per turn at any speed"
    needs = "half a turn of travel"
    reference = "Swevers, Verdonck, De Schutter 2007, IEEE Control Systems Magazine 27(5), 58-71"
    phased = True
    rotary = True
    code = codes.GRAVITY_IMBALANCE


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

    stiffness: float = number(0.1, "Nm/rad", 1e-5, 1e4, log=True)
    # a spring may be at rest anywhere in the travel: a search from the middle alone finds a fifth of one at the end
    centre: float = number(0.0, "rad", -10.0, 10.0, span=(-3.0, 3.0), starts=(-1.0, -0.5, 0.0, 0.5, 1.0))

    name = "cable_spring"
    place = "position"
    equation = "c (q - q_0)"
    signature = "a straight line against position"
    needs = "travel, at more than one frequency (one sine hides it in the inertia)"
    reference = "Hilkert 2008, Inertially Stabilized Platform Technology, IEEE Control Systems Magazine 28(1), 26-46"
    commoner = ("gravity_imbalance",)
    covers = ("input_offset", "asymmetric_coulomb")
    code = codes.CABLE_SPRING


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

    stiffness: float = number(0.05, "Nm/rad3", 1e-6, 1e5, log=True)
    centre: float = number(0.0, "rad", -10.0, 10.0, span=(-1.0, 1.0), starts=(0.0, -0.6, 0.6))

    name = "hardening_spring"
    place = "position"
    equation = "c (q - q_0)^3"
    signature = "a cubic against position"
    needs = "large travel"
    reference = "Kovacic, Brennan 2011, The Duffing Equation: Nonlinear Oscillators and their Behaviour, Wiley"
    commoner = ("gravity_imbalance", "cable_spring")
    later = ("centre",)  # about another centre than that of the travel a cubic adds a line and a parabola
    code = codes.HARDENING_SPRING


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

    stiffness: float = number(10.0, "Nm/rad", 1e-2, 1e7, log=True)
    angle: float = number(
        1.0, "rad", 1e-3, 1e2, log=True, scale="extent", span=(0.2, 1.0), starts=(0.5, 0.65, 0.75, 0.83, 0.9, 0.95)
    )

    name = "end_stop"
    place = "position"
    equation = "k max(|q| - q_s, 0) sign(q)"
    signature = "a gap in one range of position only"
    needs = "travel into the stop"
    commoner = ("gravity_imbalance", "cable_spring", "hardening_spring")
    reference = "Brogliato 1999, Nonsmooth Mechanics, 2nd ed., Springer"
    code = codes.END_STOP

    @property
    def ends(self) -> tuple[float, float]:
        """Lower and upper end of the free travel (rad)."""
        return -self.angle, self.angle

    def implausible(self, seen: Surroundings) -> str:
        """The objection that the axis touches a stop for most of the record, or of its travel: a spring.

        A torque with a bend at about half of the travel is gravity or a spring that something else modulates, such as
        the neighbouring joints of an arm.  What touches a stop says nothing about the rest of a model, so that a weight
        taken up halfway was a stop, with certainty, and explained all.  ``seen``: see `Effect.implausible`.
        """
        low, high = self.ends
        lowest, highest = float(np.min(seen.position)), float(np.max(seen.position))
        touched = max(low - lowest, 0.0) + max(highest - high, 0.0)
        if touched > TOUCHED * (highest - lowest - touched):
            return f"it would give way over {100 * touched / (highest - lowest):.0f} % of the travel: a spring"
        at_it = np.mean((seen.position <= low) | (seen.position >= high))
        return "" if at_it < TOUCHED else f"the axis would touch it for {100 * at_it:.0f} % of the time: a spring"


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

    angle: float = number(1.0, "rad", -1e2, 1e2, scale="extent", span=(-1.5, 1.5), starts=(0.8,))
    relaxation: float = number(0.01, "s", 0.0, 1.0, span=(0.0, 0.05), starts=(0.0,))
    centre: float = number(0.0, "rad", -10.0, 10.0, span=(-3.0, 3.0), starts=(0.0,))
    side: str = choice("upper", {"both": codes.END_STOP, "upper": codes.END_STOP_UPPER, "lower": codes.END_STOP_LOWER})

    equation = "k max(d + tau dd/dt, 0) where d > 0, d the depth beyond the end at q_0 + q_s"
    held = ("centre",)
    reference = "Brogliato 1999, Nonsmooth Mechanics, 2nd ed., Springer, on Kelvin and Voigt's contact"

    @property
    def ends(self) -> tuple[float, float]:
        """Lower and upper end of the free travel (rad); infinite where there is no stop."""
        if self.side == "both":
            return self.centre - abs(self.angle), self.centre + abs(self.angle)
        end = self.centre + self.angle
        return (-math.inf, end) if self.side == "upper" else (end, math.inf)
