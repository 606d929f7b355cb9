"""Friction: torque that resists motion, as a function of velocity.

Signs and symbols follow the torque balance J a = tau - friction, so a positive size opposes the motion.  On a
Wiener-Hammerstein system velocity is dx = x(t) - x(t-1) of (4).
"""

from __future__ import annotations

import math

import numpy as np

from whsklearn.effects import codes
from whsklearn.effects.base import Effect
from whsklearn.effects.quantity import number
from whsklearn.effects.surroundings import Surroundings

BOTH_WAYS = 0.25  # smallest share of a record in either direction, with which it shows the dry friction


class StaticEffect(Effect):
    """An effect that is a memoryless term f(x, dx), so a law can hold it.

    `whsklearn.effects.rows.term` takes its ``code``, and ``term_shape`` gives its shape numbers.

    References
    ----------
    Paper, (3) and (4).

    Examples
    --------
    >>> from whsklearn.effects import Coulomb, StaticEffect, Stribeck
    >>> isinstance(Coulomb(), StaticEffect)
    True
    >>> Stribeck(0.3, velocity=0.1, exponent=2.0).term_shape
    (0.1, 2.0)
    """

    code = -1

    @property
    def term_shape(self) -> tuple[float, ...]:
        """Shape numbers of the compiled term, in its order."""
        return tuple(self.shape.values())


class Viscous(StaticEffect):
    """Friction proportional to velocity, c v (Nm); gamma_6 of (3) and (4).

    See Also
    --------
    QuadraticDrag : grows with the square; the two differ at top speed only.
    AsymmetricViscous : the part of the slope that differs between the two directions.
    Coulomb : absorbs part of the slope if only one speed was driven.

    Examples
    --------
    >>> Viscous(0.5).value(velocity=-2.0)
    -1.0
    """

    coefficient: float = number(1.0, "Nm s/rad", 1e-4, 1e3, log=True)

    name = "viscous"
    place = "friction"
    equation = "c v"
    signature = "a straight line against velocity"
    needs = "at least two speeds"
    reference = "Armstrong-Helouvry, Dupont, Canudas de Wit 1994, Automatica 30(7), 1083-1138"
    elementary = True
    code = codes.VISCOUS


class Coulomb(StaticEffect):
    """Dry friction of constant size against the motion, Fc sign(v) (Nm); beta_1 of (4).

    See Also
    --------
    PreslidingHysteresis : builds up over a short distance instead of at once.
    LoadFriction : the height of the step follows the drive.
    DeadZone : the step is in the sign of the drive; alike where drive and velocity reverse together.

    Examples
    --------
    >>> Coulomb(0.7).value(velocity=[-2.0, 0.0, 0.1]).tolist()
    [-0.7, 0.0, 0.7]
    """

    torque: float = number(1.0, "Nm", 1e-4, 1e3, log=True)

    name = "coulomb"
    place = "friction"
    equation = "Fc sign(v)"
    signature = "a step at zero velocity"
    needs = "reversals"
    reference = "Armstrong-Helouvry, Dupont, Canudas de Wit 1994, Automatica 30(7), 1083-1138"
    elementary = True
    code = codes.COULOMB


class AsymmetricCoulomb(StaticEffect):
    """The half difference of dry friction between the two directions, c |sign(v)| (Nm).

    See Also
    --------
    InputOffset : acts at rest too; without rest in the record the two columns are equal.
    GravityImbalance : nearly constant over a short travel.

    Examples
    --------
    >>> AsymmetricCoulomb(0.2).value(velocity=[-2.0, 0.0, 0.1]).tolist()
    [0.2, 0.0, 0.2]
    """

    torque: float = number(1.0, "Nm", -1e3, 1e3)

    name = "asymmetric_coulomb"
    place = "friction"
    equation = "c |sign(v)|"
    signature = "a constant while the axis moves, zero at rest"
    needs = "rest and both directions"
    aliases = ("input_offset",)
    reference = "Armstrong-Helouvry, Dupont, Canudas de Wit 1994, Automatica 30(7), 1083-1138"
    commoner = ("input_offset",)
    code = codes.ASYMMETRIC_COULOMB


class AsymmetricViscous(StaticEffect):
    """The half difference of viscous friction between the two directions, c |v| (Nm).

    See Also
    --------
    AsymmetricCoulomb : a constant in motion; can be distinguished only with two speeds in each direction.
    Viscous : its odd counterpart.

    Examples
    --------
    >>> AsymmetricViscous(0.1).value(velocity=[-2.0, 3.0]).round(3).tolist()
    [0.2, 0.3]
    """

    coefficient: float = number(1.0, "Nm s/rad", -1e3, 1e3)

    name = "asymmetric_viscous"
    place = "friction"
    equation = "c |v|"
    signature = "a V against velocity"
    needs = "both directions at several speeds"
    parent = "viscous"
    commoner = ("input_offset",)
    reference = "Armstrong-Helouvry, Dupont, Canudas de Wit 1994, Automatica 30(7), 1083-1138"
    code = codes.ASYMMETRIC_VISCOUS

    def implausible(self, seen: Surroundings) -> str:
        """The objection that the friction drives the axis in one direction (``seen``: see `Effect.implausible`).

        An asymmetry larger than the viscous friction is friction as long as dry friction is larger than the difference
        at all speeds.  In a record of one direction, which shows no dry friction, under a speed controller u = k (r -
        v), -k looks like such an asymmetry.
        """
        excess = abs(self.coefficient) - max(seen.size("viscous"), 0.0)
        driven = -np.sign(self.coefficient) * seen.velocity  # positive where friction is the smaller
        both_ways = min(np.mean(driven > 0.0), np.mean(driven < 0.0)) >= BOTH_WAYS
        if excess <= 0.0 or (both_ways and excess * float(driven.max()) < seen.size("coulomb")):
            return ""
        return "the axis would be driven by its own friction in one direction"


class Stribeck(StaticEffect):
    """The excess of friction near standstill that fades with speed, c exp(-|v/v_s|^delta) sign(v) (Nm).

    See Also
    --------
    QuadraticDrag : a wide Stribeck term bends the curve at speed as drag does.
    PreslidingHysteresis : also acts near standstill, but depends on distance and not on speed.
    ReducedStribeck : the term in (4) of the paper, which saturates at speed.

    Examples
    --------
    >>> Stribeck(0.3, velocity=0.1, exponent=2.0).value(velocity=[1e-9, 0.1, 1.0]).round(3).tolist()
    [0.3, 0.11, 0.0]
    """

    torque: float = number(1.0, "Nm", 1e-4, 1e3, log=True)
    # wider than half the rms speed, it is curvature at speed, which drag explains equally well
    velocity: float = number(0.1, "rad/s", 1e-3, 2.0, log=True, span=(0.004, 0.5), starts=(0.01, 0.03, 0.08, 0.2, 0.4))
    exponent: float = number(2.0, "1", 0.5, 2.6, starts=(1.0, 2.0))

    name = "stribeck"
    place = "friction"
    equation = "c exp(-|v/v_s|^delta) sign(v)"
    signature = "an odd bump below twice the Stribeck velocity"
    needs = "time spent below the Stribeck velocity"
    parent = "coulomb"
    reference = "Canudas de Wit, Olsson, Astrom, Lischinsky 1995, IEEE Trans. Autom. Control 40(3), 419-425"
    code = codes.STRIBECK_EXP

    def implausible(self, seen: Surroundings) -> str:
        """The objection that the drive could not have moved the axis. ``seen``: see `Effect.implausible`."""
        return seen.never_moved

    def falls_beside(self, viscous: float) -> bool:
        """Whether friction still falls with speed somewhere beside ``viscous`` friction (Nm s/rad), as Stribeck saw.

        Where it grows at all speeds, a drag that begins at some speed bends it in the same way.  The back-EMF of a
        motor whose drive is a voltage is such a viscous friction, however.

        Examples
        --------
        >>> [Stribeck(0.3, velocity=0.1).falls_beside(viscous) for viscous in (0.5, 10.0)]
        [True, False]
        """
        speed = self.velocity * np.linspace(0.05, 3.0, 60)
        return bool((np.diff(self.value(velocity=speed) + viscous * speed) < 0.0).any())


class ReducedStribeck(StaticEffect):
    """The Stribeck term of (4), -beta_2 tanh(dx / v_s) with v_s = 1.

    With a Coulomb term beta_1 beside it, friction falls from beta_1 just off
    standstill to beta_1 - beta_2 at speed.

    See Also
    --------
    Stribeck : the exponential term, which is the catalogue's.
    Tanh : the same function with the sign of a Coulomb term.

    Examples
    --------
    >>> round(ReducedStribeck(0.2).value(velocity=1.0), 3)
    -0.152
    """

    torque: float = number(1.0, "Nm", 1e-4, 1e3, log=True)
    velocity: float = number(1.0, "rad/s", 1e-3, 1e3, log=True)

    name = "stribeck"
    place = "static"  # in the catalogue, ``stribeck`` is the exponential term
    equation = "-beta_2 tanh(dx / v_s)"
    signature = "friction that falls with speed, within some v_s of rest"
    needs = "speeds on both sides of v_s, in both directions"
    reference = "paper, (4)"
    code = codes.STRIBECK_TANH


class QuadraticDrag(StaticEffect):
    """Drag of air or oil at high speed, c v |v| (Nm).

    See Also
    --------
    Viscous : alike where the speed varies little.
    Stribeck : a wide one also bends the curve, in the other direction.

    Examples
    --------
    >>> QuadraticDrag(0.1).value(velocity=[-2.0, 2.0]).round(3).tolist()
    [-0.4, 0.4]
    """

    coefficient: float = number(1.0, "Nm s2/rad2", 1e-6, 1e3, log=True)

    name = "quadratic_drag"
    place = "friction"
    equation = "c v |v|"
    signature = "an odd parabola against velocity"
    needs = "top speed"
    parent = "viscous"
    reference = "Batchelor 1967, An Introduction to Fluid Dynamics, Cambridge University Press"
    code = codes.QUADRATIC_DRAG


# --- friction that varies with more than velocity: with the load, with position, with time --------------------------
class LoadFriction(Effect):
    """Dry friction that grows with the torque transmitted by the gears, c |u| sign(v) (Nm).

    See Also
    --------
    Coulomb : the same where the size of the drive is nearly constant.
    TorqueRipple : also proportional to the drive, but it follows the angle.
    ParameterChange : a change of gain is proportional to the drive in both directions.

    Examples
    --------
    >>> LoadFriction(0.1).value(velocity=0.3, drive=-4.0)
    0.4
    """

    # self-locking worm and screw drives lose more than half of the torque, none loses all of it
    coefficient: float = number(0.1, "1", 1e-3, 0.8, log=True)

    name = "load_friction"
    place = "friction"
    equation = "c |u| sign(v)"
    signature = "a step at zero velocity whose height follows the drive"
    needs = "several loads or accelerations at equal speed"
    commoner = ("coulomb",)
    reference = "Bittencourt, Gunnarsson 2012, ASME J. Dyn. Syst. Meas. Control 134(5), 051013"
    code = codes.LOAD_FRICTION


class PositionFriction(StaticEffect):
    """Dry friction that varies over a turn, A cos(k q + phi) sign(v) (Nm): a bent shaft, an uneven bearing.

    See Also
    --------
    Cogging : the same wave, but its sign does not change with the direction.
    Coulomb : its mean over a turn.

    Examples
    --------
    >>> PositionFriction(0.1, order=2.0).value(position=[0.0, 1.5708], velocity=-1.0).round(3).tolist()
    [-0.1, 0.1]
    """

    torque: float = number(0.1, "Nm", 1e-4, 1e3, log=True)
    order: float = number(1.0, "1", 0.8, 256.0, scan="position", open_below=True)
    phase: float = number(0.0, "rad", -math.pi, math.pi)

    name = "position_friction"
    place = "friction"
    equation = "A cos(k q + phi) sign(v)"
    signature = "a wave over position that changes sign with the direction of travel"
    needs = "the same positions passed in both directions"
    parent = "coulomb"
    repeats = True
    commoner = ("cogging",)  # in one direction they are the same
    reference = "Armstrong-Helouvry 1991, Control of Machines with Friction, Kluwer"
    phased = True
    code = codes.POSITION_FRICTION


class EarlyReversal(Effect):
    """Dry friction of a solver of contacts: it brings the axis to rest within about the time T (s), not at once.

    Of the torque tau + J v / T that would do so against the torque tau of drive and load, it takes the share d as long
    as this is within its range.  It therefore reverses ahead of the velocity, by T, and creeps at rest; T = 0 and d = 1
    is dry friction as a set-valued law.  It has no torque of its own.  MuJoCo's ``frictionloss`` has T = d_max t / 2
    with the time constant t of ``solreffriction``, 9.5 ms by default, and d = d_min of ``solimpfriction``.

    See Also
    --------
    Coulomb : the friction that reverses.
    PreslidingHysteresis : friction of real contacts lags behind instead.

    Examples
    --------
    >>> from whsklearn.effects import Coulomb, EarlyReversal
    >>> from whsklearn.models import AxisModel
    >>> axis = AxisModel(1.0, [Coulomb(100.0)], [EarlyReversal(0.01, impedance=1.0)], dt=1e-3, logged="velocity")
    >>> round(float(axis.simulate([0.0] * 11, speed=0.1)[-1]), 3)  # after T, 0.1 / e
    0.037
    """

    lead: float = number(9.5e-3, "s", 1e-4, 0.1, log=True)
    impedance: float = number(0.9, "1", 0.5, 1.0)

    name = "early_reversal"
    place = "friction"
    equation = "friction = clip(d (tau + J v / T), -Fc, Fc)"
    signature = "the step of dry friction comes before the velocity is zero"
    needs = "reversals"
    parent = "coulomb"
    column_kind = "none"
    reference = "Todorov 2014, Proc. IEEE ICRA, 6054-6061, on MuJoCo's constraints"
    code = codes.EARLY_REVERSAL


class FrictionDrift(Effect):
    """Dry friction that settles while the axis warms up, c (1 - exp(-t/T)) sign(v) (Nm); a negative c means that it
    falls.

    See Also
    --------
    ParameterChange : friction changes at one instant instead of settling.
    Coulomb : the same in a short record.

    Examples
    --------
    >>> round(FrictionDrift(-0.1, time_constant=20.0).value(time=20.0, velocity=1.0), 3)
    -0.063
    """

    torque: float = number(-0.1, "Nm", -1e3, 1e3)
    time_constant: float = number(
        20.0, "s", 1.0, 1e4, log=True, span=(0.03, 30.0), starts=(0.1, 0.27, 0.71, 1.9, 5.0), open_above=True
    )

    name = "friction_drift"
    place = "friction"
    equation = "c (1 - exp(-t/T)) sign(v)"
    signature = "the step at zero velocity has different heights early and late in the record"
    needs = "a long run with all speeds throughout"
    parent = "coulomb"
    reference = "Simoni, Beschi, Legnani, Visioli 2017, Robotica, doi 10.1017/S0263574717000509"
    code = codes.FRICTION_DRIFT
