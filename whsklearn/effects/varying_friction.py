"""Friction that varies with more than velocity: with the load, with position, with time."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from whsklearn.effects import codes
from whsklearn.effects.base import Effect
from whsklearn.effects.friction import StaticEffect
from whsklearn.effects.quantity import Quantity


@dataclass(frozen=True)
class LoadFriction(Effect):
    """Dry friction that grows with the torque that the gears carry, c |u| sign(v) (Nm).

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
    Coulomb : the mean of it over a turn.

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
    commoner: ClassVar[tuple[str, ...]] = ("cogging",)  # over one direction they are one
    reference: ClassVar[str] = "Armstrong-Helouvry 1991, Control of Machines with Friction, Kluwer"
    phased: ClassVar[bool] = True
    code: ClassVar[int] = codes.POSITION_FRICTION


@dataclass(frozen=True)
class FrictionDrift(Effect):
    """Dry friction that settles while the axis warms up, c (1 - exp(-t/T)) sign(v) (Nm); negative: falls.

    See Also
    --------
    ParameterChange : friction changes at one instant instead of settling.
    Coulomb : what it looks like in a short record.

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
    signature: ClassVar[str] = "the step at zero velocity has another height early than late"
    needs: ClassVar[str] = "a long run with all speeds throughout"
    parent: ClassVar[str] = "coulomb"
    reference: ClassVar[str] = "Simoni, Beschi, Legnani, Visioli 2017, Robotica, doi 10.1017/S0263574717000509"
    code: ClassVar[int] = codes.FRICTION_DRIFT
