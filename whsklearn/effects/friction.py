"""Friction: torque that resists motion, as a function of velocity.

Signs and symbols follow the torque balance J a = tau - friction, so a positive size opposes the motion.  On a
Wiener-Hammerstein system velocity is dx = x(t) - x(t-1) of (4).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from whsklearn.effects import codes
from whsklearn.effects.base import Effect
from whsklearn.effects.quantity import Quantity


@dataclass(frozen=True)
class StaticEffect(Effect):
    """An effect that is a memoryless term f(x, dx), so a law can hold it.

    `whsklearn.effects.terms.term` takes its ``code``, and ``term_shape`` gives its shape numbers.

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

    code: ClassVar[int] = -1

    @property
    def term_shape(self) -> tuple[float, ...]:
        """Shape numbers of the compiled term, in its order."""
        return tuple(self.shape.values())


@dataclass(frozen=True)
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

    coefficient: float = 1.0

    name: ClassVar[str] = "viscous"
    place: ClassVar[str] = "friction"
    equation: ClassVar[str] = "c v"
    size: ClassVar[str] = "coefficient"
    quantities: ClassVar[dict[str, Quantity]] = {"coefficient": Quantity("Nm s/rad", 1e-4, 1e3, log=True)}
    signature: ClassVar[str] = "a straight line against velocity"
    needs: ClassVar[str] = "at least two speeds"
    reference: ClassVar[str] = "Armstrong-Helouvry, Dupont, Canudas de Wit 1994, Automatica 30(7), 1083-1138"
    elementary: ClassVar[bool] = True
    code: ClassVar[int] = codes.VISCOUS


@dataclass(frozen=True)
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

    torque: float = 1.0

    name: ClassVar[str] = "coulomb"
    place: ClassVar[str] = "friction"
    equation: ClassVar[str] = "Fc sign(v)"
    size: ClassVar[str] = "torque"
    quantities: ClassVar[dict[str, Quantity]] = {"torque": Quantity("Nm", 1e-4, 1e3, log=True)}
    signature: ClassVar[str] = "a step at zero velocity"
    needs: ClassVar[str] = "reversals"
    reference: ClassVar[str] = "Armstrong-Helouvry, Dupont, Canudas de Wit 1994, Automatica 30(7), 1083-1138"
    elementary: ClassVar[bool] = True
    code: ClassVar[int] = codes.COULOMB


@dataclass(frozen=True)
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

    torque: float = 1.0

    name: ClassVar[str] = "asymmetric_coulomb"
    place: ClassVar[str] = "friction"
    equation: ClassVar[str] = "c |sign(v)|"
    size: ClassVar[str] = "torque"
    quantities: ClassVar[dict[str, Quantity]] = {"torque": Quantity("Nm", -1e3, 1e3)}
    signature: ClassVar[str] = "a constant while the axis moves, zero at rest"
    needs: ClassVar[str] = "rest and both directions"
    aliases: ClassVar[tuple[str, ...]] = ("input_offset",)
    reference: ClassVar[str] = "Armstrong-Helouvry, Dupont, Canudas de Wit 1994, Automatica 30(7), 1083-1138"
    commoner: ClassVar[tuple[str, ...]] = ("input_offset",)
    code: ClassVar[int] = codes.ASYMMETRIC_COULOMB


@dataclass(frozen=True)
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

    coefficient: float = 1.0

    name: ClassVar[str] = "asymmetric_viscous"
    place: ClassVar[str] = "friction"
    equation: ClassVar[str] = "c |v|"
    size: ClassVar[str] = "coefficient"
    quantities: ClassVar[dict[str, Quantity]] = {"coefficient": Quantity("Nm s/rad", -1e3, 1e3)}
    signature: ClassVar[str] = "a V against velocity"
    needs: ClassVar[str] = "both directions at several speeds"
    parent: ClassVar[str] = "viscous"
    commoner: ClassVar[tuple[str, ...]] = ("input_offset",)
    reference: ClassVar[str] = "Armstrong-Helouvry, Dupont, Canudas de Wit 1994, Automatica 30(7), 1083-1138"
    code: ClassVar[int] = codes.ASYMMETRIC_VISCOUS


@dataclass(frozen=True)
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

    torque: float = 1.0
    velocity: float = 0.1
    exponent: float = 2.0

    name: ClassVar[str] = "stribeck"
    place: ClassVar[str] = "friction"
    equation: ClassVar[str] = "c exp(-|v/v_s|^delta) sign(v)"
    size: ClassVar[str] = "torque"
    quantities: ClassVar[dict[str, Quantity]] = {
        "torque": Quantity("Nm", 1e-4, 1e3, log=True),
        # wider than half the rms speed, it is curvature at speed, which drag explains equally well
        "velocity": Quantity("rad/s", 1e-3, 2.0, log=True, span=(0.004, 0.5), starts=(0.01, 0.03, 0.08, 0.2, 0.4)),
        "exponent": Quantity("1", 0.5, 2.6, starts=(1.0, 2.0)),
    }
    signature: ClassVar[str] = "an odd bump below twice the Stribeck velocity"
    needs: ClassVar[str] = "time spent below the Stribeck velocity"
    parent: ClassVar[str] = "coulomb"
    reference: ClassVar[str] = (
        "Canudas de Wit, Olsson, Astrom, Lischinsky 1995, IEEE Trans. Autom. Control 40(3), 419-425"
    )
    code: ClassVar[int] = codes.STRIBECK_EXP


@dataclass(frozen=True)
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

    torque: float = 1.0
    velocity: float = 1.0

    name: ClassVar[str] = "stribeck"
    place: ClassVar[str] = "static"  # in the catalogue, ``stribeck`` is the exponential term
    equation: ClassVar[str] = "-beta_2 tanh(dx / v_s)"
    size: ClassVar[str] = "torque"
    quantities: ClassVar[dict[str, Quantity]] = {
        "torque": Quantity("Nm", 1e-4, 1e3, log=True),
        "velocity": Quantity("rad/s", 1e-3, 1e3, log=True),
    }
    signature: ClassVar[str] = "friction that falls with speed, within some v_s of rest"
    needs: ClassVar[str] = "speeds on both sides of v_s, in both directions"
    reference: ClassVar[str] = "paper, (4)"
    code: ClassVar[int] = codes.STRIBECK_TANH


@dataclass(frozen=True)
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

    coefficient: float = 1.0

    name: ClassVar[str] = "quadratic_drag"
    place: ClassVar[str] = "friction"
    equation: ClassVar[str] = "c v |v|"
    size: ClassVar[str] = "coefficient"
    quantities: ClassVar[dict[str, Quantity]] = {"coefficient": Quantity("Nm s2/rad2", 1e-6, 1e3, log=True)}
    signature: ClassVar[str] = "an odd parabola against velocity"
    needs: ClassVar[str] = "top speed"
    parent: ClassVar[str] = "viscous"
    reference: ClassVar[str] = "Batchelor 1967, An Introduction to Fluid Dynamics, Cambridge University Press"
    code: ClassVar[int] = codes.QUADRATIC_DRAG


# --- friction that varies with more than velocity: with the load, with position, with time --------------------------
@dataclass(frozen=True)
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

    coefficient: float = 0.1

    name: ClassVar[str] = "load_friction"
    place: ClassVar[str] = "friction"
    equation: ClassVar[str] = "c |u| sign(v)"
    size: ClassVar[str] = "coefficient"
    quantities: ClassVar[dict[str, Quantity]] = {"coefficient": Quantity("1", 1e-3, 0.5, log=True)}
    signature: ClassVar[str] = "a step at zero velocity whose height follows the drive"
    needs: ClassVar[str] = "several loads or accelerations at equal speed"
    commoner: ClassVar[tuple[str, ...]] = ("coulomb",)
    reference: ClassVar[str] = "Bittencourt, Gunnarsson 2012, ASME J. Dyn. Syst. Meas. Control 134(5), 051013"
    code: ClassVar[int] = codes.LOAD_FRICTION


@dataclass(frozen=True)
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

    torque: float = 0.1
    order: float = 1.0
    phase: float = 0.0

    name: ClassVar[str] = "position_friction"
    place: ClassVar[str] = "friction"
    equation: ClassVar[str] = "A cos(k q + phi) sign(v)"
    size: ClassVar[str] = "torque"
    quantities: ClassVar[dict[str, Quantity]] = {
        "torque": Quantity("Nm", 1e-4, 1e3, log=True),
        "order": Quantity("1", 0.8, 256.0, scan="position"),
        "phase": Quantity("rad", -math.pi, math.pi),
    }
    signature: ClassVar[str] = "a wave over position that changes sign with the direction of travel"
    needs: ClassVar[str] = "the same positions passed in both directions"
    parent: ClassVar[str] = "coulomb"
    repeats: ClassVar[bool] = True
    commoner: ClassVar[tuple[str, ...]] = ("cogging",)  # in one direction they are the same
    reference: ClassVar[str] = "Armstrong-Helouvry 1991, Control of Machines with Friction, Kluwer"
    phased: ClassVar[bool] = True
    code: ClassVar[int] = codes.POSITION_FRICTION


@dataclass(frozen=True)
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

    torque: float = -0.1
    time_constant: float = 20.0

    name: ClassVar[str] = "friction_drift"
    place: ClassVar[str] = "friction"
    equation: ClassVar[str] = "c (1 - exp(-t/T)) sign(v)"
    size: ClassVar[str] = "torque"
    quantities: ClassVar[dict[str, Quantity]] = {
        "torque": Quantity("Nm", -1e3, 1e3),
        "time_constant": Quantity("s", 1.0, 1e4, log=True, span=(0.03, 30.0), starts=(0.1, 0.27, 0.71, 1.9, 5.0)),
    }
    signature: ClassVar[str] = "the step at zero velocity has different heights early and late in the record"
    needs: ClassVar[str] = "a long run with all speeds throughout"
    parent: ClassVar[str] = "coulomb"
    reference: ClassVar[str] = "Simoni, Beschi, Legnani, Visioli 2017, Robotica, doi 10.1017/S0263574717000509"
    code: ClassVar[int] = codes.FRICTION_DRIFT
