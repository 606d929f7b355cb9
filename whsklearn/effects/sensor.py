"""Effects between the axis and its measured position; they add to y, not to the torque."""

from __future__ import annotations

import math

import numpy as np

from whsklearn.effects import codes
from whsklearn.effects.base import Effect
from whsklearn.effects.quantity import A_QUARTER, ONE_PERIOD, number
from whsklearn.effects.surroundings import Surroundings


class _SensorEffect(Effect):
    """An effect on the reading; its columns are what it adds to the measured position (rad)."""

    place = "sensor"
    port = "output"


class OutputOffset(_SensorEffect):
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

    offset: float = number(1e-3, "rad", -10.0, 10.0)

    name = "output_offset"
    equation = "y = q + c"
    signature = "a constant in the position but not in the torque"
    needs = "a torque that depends on position, or a known start"
    reference = "Ljung 1999, System Identification, 2nd ed., sec. 14.1"
    code = codes.OUTPUT_OFFSET


class OutputDrift(_SensorEffect):
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

    rate: float = number(1e-3, "rad/s", -0.1, 0.1)

    name = "output_drift"
    equation = "y = q + c t"
    signature = "a trend in the position but not in the torque"
    needs = "a long run"
    reference = "Ljung 1999, System Identification, 2nd ed., sec. 14.1"
    code = codes.OUTPUT_DRIFT


class SensorRectification(_SensorEffect):
    """The sensor loses the sign, wholly (fraction 1) or in part: y = (1 - f) q + f |q| (rad).

    See Also
    --------
    OutputOffset : shifts the reading but keeps its sign.

    Examples
    --------
    >>> SensorRectification(1.0).value(position=[-0.5, 0.5]).tolist()
    [1.0, 0.0]
    """

    fraction: float = number(1.0, "1", 0.0, 1.0, starts=(1.0,))

    name = "sensor_rectification"
    equation = "y = (1 - f) q + f |q|"
    signature = "a gap where the position should be negative, and nowhere else"
    needs = "both signs of position"
    reference = (
        "Wigren, Schoukens 2017, Coupled Electric Drives Data Set and Reference Models, Uppsala University 2017-024"
    )
    code = codes.SENSOR_RECTIFICATION


class EncoderEccentricity(_SensorEffect):
    """The disc of the encoder is off centre (order 1), bent (order 2), or a resolver of several pole pairs errs with
    each of them: y = q + A cos(k q + phi) (rad).

    See Also
    --------
    Cogging : a wave in the torque, at any speed.
    GravityImbalance : one wave per turn in the torque.

    Examples
    --------
    >>> EncoderEccentricity(0.001, order=2.0).value(position=[0.0, 1.5708]).round(6).tolist()
    [0.001, -0.001]
    """

    amplitude: float = number(1e-3, "rad", 1e-6, 0.1, log=True)
    order: float = number(1.0, "1", 0.8, 256.0, scan="position")
    phase: float = number(0.0, "rad", -math.pi, math.pi)

    name = "encoder_eccentricity"
    equation = "y = q + A cos(k q + phi), A = eccentricity / radius"
    signature = "a wave over position whose torque grows with the square of speed"
    needs = "a turn at two speeds"
    reference = "makers' notes: Celera Motion, scale eccentricity (order 1, e/R); Synapticon Circulo, ovality (order 2)"
    phased = True
    repeats = True
    code = codes.ENCODER_ECCENTRICITY

    def implausible(self, seen: Surroundings) -> str:
        """The objection that the reading would stand still somewhere in the turn, or that the wave is not seen as one.

        The error of a disc repeats with the turn.  On a slide, which has no turn, the travel itself must show a period:
        one of 18 mm in a travel of 246 mm, a quarter of a period long, stood beside the spring of a lift.

        ``seen``: see `Effect.implausible`.
        """
        if self.amplitude * self.order > 1.0:
            return "with such a steep encoder error the reading would not change while the axis turns"
        least = A_QUARTER if seen.turns else ONE_PERIOD
        short = 0.5 * float(np.ptp(seen.position)) * self.order < least
        return "the travel is too short to show such a wave" if short else ""


class Quantization(_SensorEffect):
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

    step: float = number(1e-3, "rad", 1e-8, 0.1, log=True)

    name = "quantization"
    equation = "y = s round(q / s)"
    signature = "positions that are multiples of a step"
    needs = "slow motion and less noise than a step"
    reference = "Widrow, Kollar, Liu 1996, IEEE Trans. Instrum. Meas. 45(2), 353-361"
    column_kind = "none"
    code = codes.QUANTIZATION
