"""Effects between the axis and its measured position; they add to y, not to the torque."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from whsklearn.effects import codes
from whsklearn.effects.base import Effect
from whsklearn.effects.quantity import Quantity


@dataclass(frozen=True)
class OutputOffset(Effect):
    """The sensor has a zero offset, y = q + c (rad).

    See Also
    --------
    InputOffset : a constant in the torque.
    CableSpring : turns an offset of the reading into a constant torque.

    Examples
    --------
    >>> OutputOffset(0.01).value(position=2.0)
    0.01
    """

    offset: float = 1e-3

    name: ClassVar[str] = "output_offset"
    place: ClassVar[str] = "sensor"
    equation: ClassVar[str] = "y = q + c"
    size: ClassVar[str] = "offset"
    quantities: ClassVar[dict[str, Quantity]] = {"offset": Quantity("rad", -10.0, 10.0)}
    signature: ClassVar[str] = "a constant in the position but not in the torque"
    needs: ClassVar[str] = "a torque that depends on position, or a known start"
    reference: ClassVar[str] = "Ljung 1999, System Identification, 2nd ed., sec. 14.1"
    port: ClassVar[str] = "output"
    code: ClassVar[int] = codes.OUTPUT_OFFSET


@dataclass(frozen=True)
class OutputDrift(Effect):
    """The sensor's zero drifts at a constant rate, y = q + c t (rad).

    See Also
    --------
    OutputOffset : constant.
    FrictionDrift : also slow, but in the torque.

    Examples
    --------
    >>> OutputDrift(0.001).value(time=20.0)
    0.02
    """

    rate: float = 1e-3

    name: ClassVar[str] = "output_drift"
    place: ClassVar[str] = "sensor"
    equation: ClassVar[str] = "y = q + c t"
    size: ClassVar[str] = "rate"
    quantities: ClassVar[dict[str, Quantity]] = {"rate": Quantity("rad/s", -0.1, 0.1)}
    signature: ClassVar[str] = "a trend in the position but not in the torque"
    needs: ClassVar[str] = "a long run"
    reference: ClassVar[str] = "Ljung 1999, System Identification, 2nd ed., sec. 14.1"
    port: ClassVar[str] = "output"
    code: ClassVar[int] = codes.OUTPUT_DRIFT


@dataclass(frozen=True)
class SensorRectification(Effect):
    """The sensor loses the sign, wholly (fraction 1) or in part: y = (1 - f) q + f |q| (rad).

    See Also
    --------
    OutputOffset : shifts the reading but keeps its sign.

    Examples
    --------
    >>> SensorRectification(1.0).value(position=[-0.5, 0.5]).tolist()
    [1.0, 0.0]
    """

    fraction: float = 1.0

    name: ClassVar[str] = "sensor_rectification"
    place: ClassVar[str] = "sensor"
    equation: ClassVar[str] = "y = (1 - f) q + f |q|"
    size: ClassVar[str] = "fraction"
    quantities: ClassVar[dict[str, Quantity]] = {"fraction": Quantity("1", 0.0, 1.0, starts=(1.0,))}
    signature: ClassVar[str] = "a gap where the position should be negative, and nowhere else"
    needs: ClassVar[str] = "both signs of position"
    reference: ClassVar[str] = (
        "Wigren, Schoukens 2017, Coupled Electric Drives Data Set and Reference Models, Uppsala University 2017-024"
    )
    port: ClassVar[str] = "output"
    code: ClassVar[int] = codes.SENSOR_RECTIFICATION


@dataclass(frozen=True)
class EncoderEccentricity(Effect):
    """The disc of the encoder is off centre (order 1) or bent (order 2): y = q + A cos(k q + phi) (rad).

    See Also
    --------
    Cogging : a wave in the torque, at any speed.
    GravityImbalance : one wave per turn in the torque.

    Examples
    --------
    >>> EncoderEccentricity(0.001, order=2.0).value(position=[0.0, 1.5708]).round(6).tolist()
    [0.001, -0.001]
    """

    amplitude: float = 1e-3
    order: float = 1.0
    phase: float = 0.0

    name: ClassVar[str] = "encoder_eccentricity"
    place: ClassVar[str] = "sensor"
    equation: ClassVar[str] = "y = q + A cos(k q + phi), A = eccentricity / radius"
    size: ClassVar[str] = "amplitude"
    quantities: ClassVar[dict[str, Quantity]] = {
        "amplitude": Quantity("rad", 1e-6, 0.1, log=True),
        "order": Quantity("1", 0.8, 64.0, starts=(1.0, 2.0, 3.0, 4.0)),
        "phase": Quantity("rad", -math.pi, math.pi),
    }
    signature: ClassVar[str] = "a wave over position whose torque grows with the square of speed"
    needs: ClassVar[str] = "a turn at two speeds"
    reference: ClassVar[str] = (
        "makers' notes: Celera Motion, scale eccentricity (order 1, e/R); Synapticon Circulo, ovality (order 2)"
    )
    port: ClassVar[str] = "output"
    phased: ClassVar[bool] = True
    code: ClassVar[int] = codes.ENCODER_ECCENTRICITY


@dataclass(frozen=True)
class Quantization(Effect):
    """The sensor counts in steps, y = s round(q / s) (rad); it has no column.

    See Also
    --------
    OutputOffset : rounding down adds an offset of half a step.
    DisturbanceTone : periodic in time, which rounding is not.

    Examples
    --------
    >>> Quantization(0.001).labelled()
    {'step_rad': 0.001}
    """

    step: float = 1e-3

    name: ClassVar[str] = "quantization"
    place: ClassVar[str] = "sensor"
    equation: ClassVar[str] = "y = s round(q / s)"
    size: ClassVar[str] = "step"
    quantities: ClassVar[dict[str, Quantity]] = {"step": Quantity("rad", 1e-8, 0.1, log=True)}
    signature: ClassVar[str] = "positions that are multiples of a step"
    needs: ClassVar[str] = "slow motion and less noise than a step"
    reference: ClassVar[str] = "Widrow, Kollar, Liu 1996, IEEE Trans. Instrum. Meas. 45(2), 353-361"
    port: ClassVar[str] = "output"
    column_kind: ClassVar[str] = "none"
    code: ClassVar[int] = codes.QUANTIZATION
