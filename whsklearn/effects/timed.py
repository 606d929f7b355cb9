"""Effects that depend on time: a tone from outside, a parameter that changes."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from whsklearn.effects import codes
from whsklearn.effects.base import Effect
from whsklearn.effects.quantity import Quantity
from whsklearn.effects.waves import as_column, direction, waves

if TYPE_CHECKING:
    from numpy.typing import NDArray


@dataclass(frozen=True)
class DisturbanceTone(Effect):
    """A torque of one frequency from outside: mains, a fan, a pump."""

    amplitude: float = 0.05
    frequency: float = 25.0
    phase: float = 0.0

    name: ClassVar[str] = "disturbance_tone"
    place: ClassVar[str] = "time"
    equation: ClassVar[str] = "A cos(2 pi f t + phi)"
    size: ClassVar[str] = "amplitude"
    quantities: ClassVar[dict[str, Quantity]] = {
        "amplitude": Quantity("Nm", 1e-4, 1e3, log=True),
        "frequency": Quantity("Hz", 0.05, 500.0, log=True),
        "phase": Quantity("rad", -math.pi, math.pi),
    }
    signature: ClassVar[str] = "a line at a fixed frequency, with no relation to the reference"
    needs: ClassVar[str] = "two speeds (at one speed cogging looks the same)"
    reference: ClassVar[str] = "Bodson, Douglas 1997, Automatica 33(12), 2213-2221"
    phased: ClassVar[bool] = True
    code: ClassVar[int] = codes.DISTURBANCE_TONE

    def columns(self, signals: Any) -> NDArray[np.float64]:
        """cos(2 pi f t), sin(2 pi f t)."""
        return waves(2.0 * math.pi * self.frequency * np.asarray(signals.time))


_CHANGES = {
    "inertia": codes.CHANGE_INERTIA,
    "viscous": codes.CHANGE_VISCOUS,
    "coulomb": codes.CHANGE_COULOMB,
    "gain": codes.CHANGE_GAIN,
}


@dataclass(frozen=True)
class ParameterChange(Effect):
    """One parameter of the axis takes another value at a time; ``change`` is in the parameter's unit."""

    change: float = 0.01
    time: float = 1.0
    parameter: str = "inertia"

    name: ClassVar[str] = "parameter_change"
    place: ClassVar[str] = "time"
    equation: ClassVar[str] = "c r(t) for t > t_0, r = a, v, sign(v) or -u"
    size: ClassVar[str] = "change"
    quantities: ClassVar[dict[str, Quantity]] = {
        "change": Quantity("1", -1e3, 1e3),
        "time": Quantity("s", 0.0, 1e5),
    }
    signature: ClassVar[str] = "a constant that is not the same before and after"
    needs: ClassVar[str] = "the same motion before and after the change"
    reference: ClassVar[str] = (
        "Basseville, Nikiforov 1993, Detection of Abrupt Changes: Theory and Application, Prentice Hall"
    )
    choices: ClassVar[dict[str, tuple[str, ...]]] = {"parameter": tuple(_CHANGES)}

    @property
    def code(self) -> int:  # type: ignore[override]
        """The compiled code of the parameter that changes."""
        return _CHANGES[self.parameter]

    def columns(self, signals: Any) -> NDArray[np.float64]:
        """The parameter's own regressor after t_0, zero before."""
        regressors = {
            "inertia": signals.acceleration,
            "viscous": signals.velocity,
            "coulomb": direction(signals),
            "gain": -np.asarray(signals.drive),
        }
        after = np.asarray(signals.time) > self.time
        return as_column(np.where(after, np.asarray(regressors[self.parameter], dtype=float), 0.0))
