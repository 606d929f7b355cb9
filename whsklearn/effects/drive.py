"""Effects between the command and the torque at the shaft."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from whsklearn.effects import codes
from whsklearn.effects.base import Effect
from whsklearn.effects.quantity import Quantity


@dataclass(frozen=True)
class InputOffset(Effect):
    """A constant torque that the drive must supply, c (Nm): amplifier offset, a constant load.

    See Also
    --------
    AsymmetricCoulomb : vanishes at rest; without rest in the record the two columns are equal.
    GravityImbalance : nearly constant over a short travel.

    Examples
    --------
    >>> InputOffset(0.1).value(velocity=-3.0)
    0.1
    """

    torque: float = 0.1

    name: ClassVar[str] = "input_offset"
    place: ClassVar[str] = "drive"
    equation: ClassVar[str] = "c"
    size: ClassVar[str] = "torque"
    quantities: ClassVar[dict[str, Quantity]] = {"torque": Quantity("Nm", -1e3, 1e3)}
    signature: ClassVar[str] = "a constant, at rest and in motion"
    needs: ClassVar[str] = "both directions; rest distinguishes it from asymmetric_coulomb"
    aliases: ClassVar[tuple[str, ...]] = ("asymmetric_coulomb",)
    reference: ClassVar[str] = (
        "Janot, Gautier, Brunot 2019, Data Set and Reference Models of EMPS, Nonlinear System Identification Benchmarks"
    )
    port: ClassVar[str] = "input"
    elementary: ClassVar[bool] = True
    code: ClassVar[int] = codes.INPUT_OFFSET


@dataclass(frozen=True)
class DeadZone(Effect):
    """The amplifier delivers nothing below a threshold d, and d less above it: u_eff = u - clip(u, -d, d) (Nm).

    See Also
    --------
    Coulomb : the step is in the sign of velocity.
    Backlash : drive is also lost around zero, but over a distance.

    Examples
    --------
    >>> DeadZone(0.05).value(drive=[-1.0, 0.02]).tolist()
    [-0.05, 0.02]
    """

    width: float = 0.05

    name: ClassVar[str] = "dead_zone"
    place: ClassVar[str] = "drive"
    equation: ClassVar[str] = "u_eff = u - clip(u, -d, d)"
    size: ClassVar[str] = "width"
    quantities: ClassVar[dict[str, Quantity]] = {
        "width": Quantity("Nm", 1e-4, 1e2, log=True, span=(1e-4, 2.0), starts=(0.01, 0.028, 0.077, 0.22, 0.6))
    }
    signature: ClassVar[str] = "a step in the sign of the drive, not of velocity"
    needs: ClassVar[str] = "a small drive during motion"
    reference: ClassVar[str] = (
        "Tao, Kokotovic 1996, Adaptive Control of Systems with Actuator and Sensor Nonlinearities, Wiley"
    )
    port: ClassVar[str] = "input"
    column_kind: ClassVar[str] = "at_size"
    code: ClassVar[int] = codes.DEAD_ZONE


@dataclass(frozen=True)
class Saturation(Effect):
    """The amplifier delivers no more than its limit, u_eff = clip(u, -U, U) (Nm).

    See Also
    --------
    DeadZone : takes from the drive near zero.
    ActuatorLag : also loses peaks, but only the fast ones.

    Examples
    --------
    >>> Saturation(1.5).value(drive=[2.0, -1.0]).tolist()
    [0.5, 0.0]
    """

    limit: float = 1.0

    name: ClassVar[str] = "saturation"
    place: ClassVar[str] = "drive"
    equation: ClassVar[str] = "u_eff = clip(u, -U, U)"
    size: ClassVar[str] = "limit"
    quantities: ClassVar[dict[str, Quantity]] = {
        "limit": Quantity(
            "Nm", 1e-3, 1e4, log=True, scale="peak", span=(0.01, 1.1), starts=(0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9)
        )
    }
    signature: ClassVar[str] = "a gap at high drive only, with wind-up after it"
    needs: ClassVar[str] = "drive above the limit"
    reference: ClassVar[str] = "Astrom, Hagglund 2006, Advanced PID Control, ISA, on integrator windup"
    port: ClassVar[str] = "input"
    column_kind: ClassVar[str] = "at_size"
    neutral: ClassVar[float] = math.inf
    code: ClassVar[int] = codes.SATURATION

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.limit <= 0:
            raise ValueError(f"Saturation: limit is {self.limit}, expected a torque above zero; give it in Nm.")


@dataclass(frozen=True)
class InputDelay(Effect):
    """The drive acts later than it is logged, u_eff(t) = u(t - tau), tau in s.

    Its column is the first order of it, du/dt.

    See Also
    --------
    ActuatorLag : the same to first order; only frequencies near 1 / tau distinguish them.
    FlexibleCoupling : adds phase below its resonance too.

    Examples
    --------
    >>> InputDelay(0.01).value(time=[0.0, 0.1, 0.2], drive=[0.0, 1.0, 2.0]).round(3).tolist()
    [0.1, 0.1, 0.1]
    """

    delay: float = 1e-3

    name: ClassVar[str] = "input_delay"
    place: ClassVar[str] = "drive"
    equation: ClassVar[str] = "u_eff(t) = u(t - tau)"
    size: ClassVar[str] = "delay"
    quantities: ClassVar[dict[str, Quantity]] = {
        "delay": Quantity("s", 1e-5, 0.5, log=True, scale="dt", span=(0.01, 300.0), starts=(1.5, 4.0, 20.0, 50.0))
    }
    signature: ClassVar[str] = "a gap that follows du/dt, with linear phase"
    needs: ClassVar[str] = "frequencies of 0.2 / (2 pi tau) and above"
    aliases: ClassVar[tuple[str, ...]] = ("actuator_lag",)
    reference: ClassVar[str] = "Astrom, Hagglund 2006, Advanced PID Control, ISA, first-order lag with dead time"
    port: ClassVar[str] = "input"
    column_kind: ClassVar[str] = "first_order"
    code: ClassVar[int] = codes.INPUT_DELAY


@dataclass(frozen=True)
class ActuatorLag(Effect):
    """The torque follows the command as a first-order lag, T du_eff/dt = u - u_eff, T in s: a current loop, a valve.

    Its column is its first-order approximation, du/dt, the same as that of a delay.

    See Also
    --------
    InputDelay : the same to first order; its gain does not roll off.
    FlexibleCoupling : rolls off after a peak.

    Examples
    --------
    >>> ActuatorLag(0.01).value(time=[0.0, 0.1, 0.2], drive=[0.0, 1.0, 2.0]).round(3).tolist()
    [0.1, 0.1, 0.1]
    """

    time_constant: float = 1e-3

    name: ClassVar[str] = "actuator_lag"
    place: ClassVar[str] = "drive"
    equation: ClassVar[str] = "T du_eff/dt = u - u_eff"
    size: ClassVar[str] = "time_constant"
    quantities: ClassVar[dict[str, Quantity]] = {
        "time_constant": Quantity(
            "s", 1e-5, 0.5, log=True, scale="dt", span=(0.01, 300.0), starts=(1.5, 4.0, 20.0, 50.0)
        )
    }
    signature: ClassVar[str] = "a gap that follows du/dt and rolls off"
    needs: ClassVar[str] = "frequencies of 0.5 / (2 pi T) and above"
    aliases: ClassVar[tuple[str, ...]] = ("input_delay",)
    reference: ClassVar[str] = "Astrom, Hagglund 2006, Advanced PID Control, ISA, first-order lag with dead time"
    port: ClassVar[str] = "input"
    column_kind: ClassVar[str] = "first_order"
    code: ClassVar[int] = codes.ACTUATOR_LAG


@dataclass(frozen=True)
class TorqueRipple(Effect):
    """The torque constant varies with the rotor's angle, u_eff = u (1 - A cos(k q + phi)).

    See Also
    --------
    Cogging : the same wave over position, whatever the drive.
    LoadFriction : proportional to the drive, with the sign of velocity.

    Examples
    --------
    >>> TorqueRipple(0.1, order=6.0).value(position=0.0, drive=-2.0)
    -0.2
    """

    amplitude: float = 0.03
    order: float = 6.0
    phase: float = 0.0

    name: ClassVar[str] = "torque_ripple"
    place: ClassVar[str] = "drive"
    equation: ClassVar[str] = "u_eff = u (1 - A cos(k q + phi))"
    size: ClassVar[str] = "amplitude"
    quantities: ClassVar[dict[str, Quantity]] = {
        "amplitude": Quantity("1", 1e-4, 0.3, log=True),
        "order": Quantity("1", 0.8, 256.0, scan="position"),
        "phase": Quantity("rad", -math.pi, math.pi),
    }
    signature: ClassVar[str] = "a wave over position, proportional to the drive"
    needs: ClassVar[str] = "both signs of torque over a period of travel"
    reference: ClassVar[str] = "Jahns, Soong 1996, IEEE Trans. Ind. Electron. 43(2), 321-330"
    port: ClassVar[str] = "input"
    phased: ClassVar[bool] = True
    repeats: ClassVar[bool] = True
    code: ClassVar[int] = codes.TORQUE_RIPPLE
