"""Effects between the command and the torque at the shaft."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from whsklearn.effects import codes
from whsklearn.effects.base import Effect
from whsklearn.effects.quantity import Quantity
from whsklearn.effects.waves import as_column, rate, waves

if TYPE_CHECKING:
    from numpy.typing import NDArray


@dataclass(frozen=True)
class InputOffset(Effect):
    """A constant torque that the drive has to add: amplifier offset, a constant load."""

    torque: float = 0.1

    name: ClassVar[str] = "input_offset"
    place: ClassVar[str] = "drive"
    equation: ClassVar[str] = "c"
    size: ClassVar[str] = "torque"
    quantities: ClassVar[dict[str, Quantity]] = {"torque": Quantity("Nm", -1e3, 1e3)}
    signature: ClassVar[str] = "a constant, at rest and in motion"
    needs: ClassVar[str] = "both directions; rest tells it from asymmetric_coulomb"
    aliases: ClassVar[tuple[str, ...]] = ("asymmetric_coulomb",)
    reference: ClassVar[str] = (
        "Janot, Gautier, Brunot 2019, Data Set and Reference Models of EMPS, Nonlinear System Identification Benchmarks"
    )
    port: ClassVar[str] = "input"
    code: ClassVar[int] = codes.INPUT_OFFSET

    def columns(self, signals: Any) -> NDArray[np.float64]:
        """Ones."""
        return np.ones((np.asarray(signals.position).size, 1))


@dataclass(frozen=True)
class DeadZone(Effect):
    """The amplifier gives nothing below a threshold, and the rest is short of it by as much."""

    width: float = 0.05

    name: ClassVar[str] = "dead_zone"
    place: ClassVar[str] = "drive"
    equation: ClassVar[str] = "u_eff = u - clip(u, -d, d)"
    size: ClassVar[str] = "width"
    quantities: ClassVar[dict[str, Quantity]] = {"width": Quantity("Nm", 1e-4, 1e2, log=True)}
    signature: ClassVar[str] = "a step in the sign of the drive, not of velocity"
    needs: ClassVar[str] = "a small drive during motion"
    reference: ClassVar[str] = (
        "Tao, Kokotovic 1996, Adaptive Control of Systems with Actuator and Sensor Nonlinearities, Wiley"
    )
    port: ClassVar[str] = "input"
    column_kind: ClassVar[str] = "at_size"
    code: ClassVar[int] = codes.DEAD_ZONE

    def columns(self, signals: Any) -> NDArray[np.float64]:
        """clip(u, -d, d) / d; sign(u) at width zero."""
        if self.width == 0.0:
            return as_column(np.sign(signals.drive))
        return as_column(np.clip(np.asarray(signals.drive) / self.width, -1.0, 1.0))


@dataclass(frozen=True)
class Saturation(Effect):
    """The amplifier gives no more than its limit."""

    limit: float = 1.0

    name: ClassVar[str] = "saturation"
    place: ClassVar[str] = "drive"
    equation: ClassVar[str] = "u_eff = clip(u, -U, U)"
    size: ClassVar[str] = "limit"
    quantities: ClassVar[dict[str, Quantity]] = {"limit": Quantity("Nm", 1e-3, 1e4, log=True)}
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

    def columns(self, signals: Any) -> NDArray[np.float64]:
        """(u - clip(u, -U, U)) / U; zeros without a limit."""
        drive = np.asarray(signals.drive, dtype=float)
        return as_column((drive - np.clip(drive, -self.limit, self.limit)) / self.limit)

    def contribution(self, signals: Any) -> NDArray[np.float64]:
        """What is cut off."""
        drive = np.asarray(signals.drive, dtype=float)
        return drive - np.clip(drive, -self.limit, self.limit)


@dataclass(frozen=True)
class InputDelay(Effect):
    """The drive acts later than it is logged."""

    delay: float = 1e-3

    name: ClassVar[str] = "input_delay"
    place: ClassVar[str] = "drive"
    equation: ClassVar[str] = "u_eff(t) = u(t - tau)"
    size: ClassVar[str] = "delay"
    quantities: ClassVar[dict[str, Quantity]] = {"delay": Quantity("s", 1e-5, 0.1, log=True)}
    signature: ClassVar[str] = "a gap that follows du/dt, with linear phase"
    needs: ClassVar[str] = "frequencies of 0.2 / (2 pi tau) and above"
    aliases: ClassVar[tuple[str, ...]] = ("actuator_lag",)
    reference: ClassVar[str] = "Astrom, Hagglund 2006, Advanced PID Control, ISA, first-order lag with dead time"
    port: ClassVar[str] = "input"
    column_kind: ClassVar[str] = "first_order"
    code: ClassVar[int] = codes.INPUT_DELAY

    def columns(self, signals: Any) -> NDArray[np.float64]:
        """du/dt."""
        return as_column(rate(signals.drive, signals.time))


@dataclass(frozen=True)
class ActuatorLag(Effect):
    """The torque follows the command as a first-order lag: a current loop, a valve."""

    time_constant: float = 1e-3

    name: ClassVar[str] = "actuator_lag"
    place: ClassVar[str] = "drive"
    equation: ClassVar[str] = "T du_eff/dt = u - u_eff"
    size: ClassVar[str] = "time_constant"
    quantities: ClassVar[dict[str, Quantity]] = {"time_constant": Quantity("s", 1e-5, 0.1, log=True)}
    signature: ClassVar[str] = "a gap that follows du/dt and rolls off"
    needs: ClassVar[str] = "frequencies of 0.5 / (2 pi T) and above"
    aliases: ClassVar[tuple[str, ...]] = ("input_delay",)
    reference: ClassVar[str] = "Astrom, Hagglund 2006, Advanced PID Control, ISA, first-order lag with dead time"
    port: ClassVar[str] = "input"
    column_kind: ClassVar[str] = "first_order"
    code: ClassVar[int] = codes.ACTUATOR_LAG

    def columns(self, signals: Any) -> NDArray[np.float64]:
        """du/dt, the same as a delay's for a small time constant."""
        return as_column(rate(signals.drive, signals.time))


@dataclass(frozen=True)
class TorqueRipple(Effect):
    """The torque constant varies with the rotor's angle."""

    amplitude: float = 0.03
    order: float = 6.0
    phase: float = 0.0

    name: ClassVar[str] = "torque_ripple"
    place: ClassVar[str] = "drive"
    equation: ClassVar[str] = "u_eff = u (1 - A cos(k q + phi))"
    size: ClassVar[str] = "amplitude"
    quantities: ClassVar[dict[str, Quantity]] = {
        "amplitude": Quantity("1", 1e-4, 0.3, log=True),
        "order": Quantity("1", 0.5, 256.0),
        "phase": Quantity("rad", -math.pi, math.pi),
    }
    signature: ClassVar[str] = "a wave over position in proportion to the drive"
    needs: ClassVar[str] = "both signs of torque over a period of travel"
    reference: ClassVar[str] = "Jahns, Soong 1996, IEEE Trans. Ind. Electron. 43(2), 321-330"
    port: ClassVar[str] = "input"
    phased: ClassVar[bool] = True
    code: ClassVar[int] = codes.TORQUE_RIPPLE

    def columns(self, signals: Any) -> NDArray[np.float64]:
        """u cos(k q), u sin(k q)."""
        return np.asarray(signals.drive)[:, None] * waves(self.order * np.asarray(signals.position))
