"""Friction: what resists motion, a function of velocity and sometimes of position.

Signs and symbols follow the torque balance J a = tau - friction, so a positive size
brakes.  On a Wiener-Hammerstein system velocity is dx = x(t) - x(t-1) of (4).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from whsklearn.effects import codes, terms
from whsklearn.effects.base import Effect
from whsklearn.effects.quantity import Quantity
from whsklearn.effects.waves import as_column, direction, waves

if TYPE_CHECKING:
    from numpy.typing import NDArray


@dataclass(frozen=True)
class StaticEffect(Effect):
    """An effect that is a memoryless term f(x, dx), so a law can hold it.

    ``code`` names the compiled function in `whsklearn.effects.terms`,
    ``term_shape`` gives its shape numbers.
    """

    code: ClassVar[int] = -1

    @property
    def term_shape(self) -> tuple[float, ...]:
        """Shape numbers of the compiled term, in its order."""
        return tuple(self.shape.values())

    def columns(self, signals: Any) -> NDArray[np.float64]:
        """The term at weight one."""
        s0, s1, s2 = (*self.term_shape, 0.0, 0.0, 0.0)[:3]
        kappa = getattr(signals, "kappa", None)
        position, velocity = (np.ascontiguousarray(s, dtype=float) for s in (signals.position, signals.velocity))
        return as_column(
            terms.term_values(self.code, s0, s1, s2, position, velocity, math.inf if kappa is None else kappa)
        )


@dataclass(frozen=True)
class Viscous(StaticEffect):
    """Friction proportional to velocity; gamma_6 of (3) and (4)."""

    coefficient: float = 1.0

    name: ClassVar[str] = "viscous"
    place: ClassVar[str] = "friction"
    equation: ClassVar[str] = "c v"
    size: ClassVar[str] = "coefficient"
    quantities: ClassVar[dict[str, Quantity]] = {"coefficient": Quantity("Nm s/rad", 1e-4, 1e3, log=True)}
    signature: ClassVar[str] = "a straight line against velocity"
    needs: ClassVar[str] = "at least two speeds"
    reference: ClassVar[str] = "Armstrong-Helouvry, Dupont, Canudas de Wit 1994, Automatica 30(7), 1083-1138"
    code: ClassVar[int] = terms.VISCOUS


@dataclass(frozen=True)
class Coulomb(StaticEffect):
    """Dry friction, constant against the motion; beta_1 of (4)."""

    torque: float = 1.0

    name: ClassVar[str] = "coulomb"
    place: ClassVar[str] = "friction"
    equation: ClassVar[str] = "Fc sign(v)"
    size: ClassVar[str] = "torque"
    quantities: ClassVar[dict[str, Quantity]] = {"torque": Quantity("Nm", 1e-4, 1e3, log=True)}
    signature: ClassVar[str] = "a step at zero velocity"
    needs: ClassVar[str] = "reversals"
    reference: ClassVar[str] = "Armstrong-Helouvry, Dupont, Canudas de Wit 1994, Automatica 30(7), 1083-1138"
    code: ClassVar[int] = terms.COULOMB


@dataclass(frozen=True)
class AsymmetricCoulomb(StaticEffect):
    """The half difference of dry friction between the two directions."""

    torque: float = 1.0

    name: ClassVar[str] = "asymmetric_coulomb"
    place: ClassVar[str] = "friction"
    equation: ClassVar[str] = "c |sign(v)|"
    size: ClassVar[str] = "torque"
    quantities: ClassVar[dict[str, Quantity]] = {"torque": Quantity("Nm", -1e3, 1e3)}
    signature: ClassVar[str] = "a constant while the axis moves, nothing while it rests"
    needs: ClassVar[str] = "rest and both directions"
    aliases: ClassVar[tuple[str, ...]] = ("input_offset",)
    reference: ClassVar[str] = "Armstrong-Helouvry, Dupont, Canudas de Wit 1994, Automatica 30(7), 1083-1138"
    code: ClassVar[int] = terms.ASYMMETRIC_COULOMB


@dataclass(frozen=True)
class AsymmetricViscous(StaticEffect):
    """The half difference of viscous friction between the two directions."""

    coefficient: float = 1.0

    name: ClassVar[str] = "asymmetric_viscous"
    place: ClassVar[str] = "friction"
    equation: ClassVar[str] = "c |v|"
    size: ClassVar[str] = "coefficient"
    quantities: ClassVar[dict[str, Quantity]] = {"coefficient": Quantity("Nm s/rad", -1e3, 1e3)}
    signature: ClassVar[str] = "a V against velocity"
    needs: ClassVar[str] = "both directions at several speeds"
    reference: ClassVar[str] = "Armstrong-Helouvry, Dupont, Canudas de Wit 1994, Automatica 30(7), 1083-1138"
    code: ClassVar[int] = terms.ASYMMETRIC_VISCOUS


@dataclass(frozen=True)
class Stribeck(StaticEffect):
    """The excess of friction near standstill that fades with speed."""

    torque: float = 1.0
    velocity: float = 0.1
    exponent: float = 2.0

    name: ClassVar[str] = "stribeck"
    place: ClassVar[str] = "friction"
    equation: ClassVar[str] = "c exp(-|v/v_s|^delta) sign(v)"
    size: ClassVar[str] = "torque"
    quantities: ClassVar[dict[str, Quantity]] = {
        "torque": Quantity("Nm", 1e-4, 1e3, log=True),
        "velocity": Quantity("rad/s", 1e-3, 2.0, log=True),
        "exponent": Quantity("1", 0.5, 2.0),
    }
    signature: ClassVar[str] = "an odd bump below twice the Stribeck velocity"
    needs: ClassVar[str] = "time spent below the Stribeck velocity"
    reference: ClassVar[str] = (
        "Canudas de Wit, Olsson, Astrom, Lischinsky 1995, IEEE Trans. Autom. Control 40(3), 419-425"
    )
    code: ClassVar[int] = terms.STRIBECK_EXP


@dataclass(frozen=True)
class ReducedStribeck(StaticEffect):
    """The Stribeck term of (4), -beta_2 tanh(dx / v_s) with v_s = 1.

    With a Coulomb term beta_1 beside it, friction falls from beta_1 just off
    standstill to beta_1 - beta_2 at speed.
    """

    torque: float = 1.0
    velocity: float = 1.0

    name: ClassVar[str] = "stribeck"
    place: ClassVar[str] = "static"  # the catalogue's stribeck is the exponential one
    equation: ClassVar[str] = "-beta_2 tanh(dx / v_s)"
    size: ClassVar[str] = "torque"
    quantities: ClassVar[dict[str, Quantity]] = {
        "torque": Quantity("Nm", 1e-4, 1e3, log=True),
        "velocity": Quantity("rad/s", 1e-3, 1e3, log=True),
    }
    reference: ClassVar[str] = "paper, (4)"
    code: ClassVar[int] = terms.STRIBECK_TANH


@dataclass(frozen=True)
class QuadraticDrag(StaticEffect):
    """Drag of air or oil at high speed."""

    coefficient: float = 1.0

    name: ClassVar[str] = "quadratic_drag"
    place: ClassVar[str] = "friction"
    equation: ClassVar[str] = "c v |v|"
    size: ClassVar[str] = "coefficient"
    quantities: ClassVar[dict[str, Quantity]] = {"coefficient": Quantity("Nm s2/rad2", 1e-6, 1e3, log=True)}
    signature: ClassVar[str] = "an odd parabola against velocity"
    needs: ClassVar[str] = "top speed"
    reference: ClassVar[str] = "Batchelor 1967, An Introduction to Fluid Dynamics, Cambridge University Press"
    code: ClassVar[int] = terms.QUADRATIC_DRAG


@dataclass(frozen=True)
class LoadFriction(Effect):
    """Dry friction that grows with the torque that the gears carry."""

    coefficient: float = 0.1

    name: ClassVar[str] = "load_friction"
    place: ClassVar[str] = "friction"
    equation: ClassVar[str] = "c |u| sign(v)"
    size: ClassVar[str] = "coefficient"
    quantities: ClassVar[dict[str, Quantity]] = {"coefficient": Quantity("1", 1e-3, 0.5, log=True)}
    signature: ClassVar[str] = "a step at zero velocity whose height follows the drive"
    needs: ClassVar[str] = "several loads or accelerations at equal speed"
    reference: ClassVar[str] = "Bittencourt, Gunnarsson 2012, ASME J. Dyn. Syst. Meas. Control 134(5), 051013"
    code: ClassVar[int] = codes.LOAD_FRICTION

    def columns(self, signals: Any) -> NDArray[np.float64]:
        """|u| sign(v)."""
        return as_column(np.abs(signals.drive) * direction(signals))


@dataclass(frozen=True)
class PositionFriction(StaticEffect):
    """Dry friction that varies over a turn: a bent shaft, an uneven bearing."""

    torque: float = 0.1
    order: float = 1.0
    phase: float = 0.0

    name: ClassVar[str] = "position_friction"
    place: ClassVar[str] = "friction"
    equation: ClassVar[str] = "A cos(k q + phi) sign(v)"
    size: ClassVar[str] = "torque"
    quantities: ClassVar[dict[str, Quantity]] = {
        "torque": Quantity("Nm", 1e-4, 1e3, log=True),
        "order": Quantity("1", 0.5, 64.0),
        "phase": Quantity("rad", -math.pi, math.pi),
    }
    signature: ClassVar[str] = "a wave over position that changes sign with the direction of travel"
    needs: ClassVar[str] = "the same positions passed in both directions"
    reference: ClassVar[str] = "Armstrong-Helouvry 1991, Control of Machines with Friction, Kluwer"
    phased: ClassVar[bool] = True
    code: ClassVar[int] = terms.POSITION_FRICTION

    def columns(self, signals: Any) -> NDArray[np.float64]:
        """sign(v) cos(k q), sign(v) sin(k q)."""
        return direction(signals)[:, None] * waves(self.order * np.asarray(signals.position))


@dataclass(frozen=True)
class FrictionDrift(Effect):
    """Dry friction that settles while the axis warms up (negative: falls)."""

    torque: float = -0.1
    time_constant: float = 20.0

    name: ClassVar[str] = "friction_drift"
    place: ClassVar[str] = "friction"
    equation: ClassVar[str] = "c (1 - exp(-t/T)) sign(v)"
    size: ClassVar[str] = "torque"
    quantities: ClassVar[dict[str, Quantity]] = {
        "torque": Quantity("Nm", -1e3, 1e3),
        "time_constant": Quantity("s", 1.0, 1e4, log=True),
    }
    signature: ClassVar[str] = "the step at zero velocity has another height early than late"
    needs: ClassVar[str] = "a long run with all speeds throughout"
    reference: ClassVar[str] = "Simoni, Beschi, Legnani, Visioli, Robotica, doi 10.1017/S0263574717000509"
    code: ClassVar[int] = codes.FRICTION_DRIFT

    def columns(self, signals: Any) -> NDArray[np.float64]:
        """(1 - exp(-t/T)) sign(v), t from the start of the record."""
        return as_column(-np.expm1(-np.asarray(signals.time) / self.time_constant) * direction(signals))
