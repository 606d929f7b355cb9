"""Effects that depend on time: an external tone, and a parameter that changes."""

from __future__ import annotations

import math

from whsklearn.effects import codes
from whsklearn.effects.base import Effect
from whsklearn.effects.quantity import choice, number


class DisturbanceTone(Effect):
    """An external torque of one frequency, A cos(2 pi f t + phi) (Nm): mains, a fan, a pump.

    See Also
    --------
    Cogging : fixed over position; at one speed the two look the same.
    EncoderEccentricity : also periodic at a constant speed, with an amplitude that follows the speed.

    Examples
    --------
    >>> DisturbanceTone(0.05, frequency=25.0).value(time=[0.0, 0.02]).round(3).tolist()
    [0.05, -0.05]
    """

    amplitude: float = number(0.05, "Nm", 1e-4, 1e3, log=True)
    frequency: float = number(25.0, "Hz", 0.05, 500.0, log=True, span=(1.0, 1e5), scan="time")
    phase: float = number(0.0, "rad", -math.pi, math.pi)

    name = "disturbance_tone"
    place = "time"
    equation = "A cos(2 pi f t + phi)"
    signature = "a line at a fixed frequency, with no relation to the reference"
    needs = "two speeds (at one speed cogging looks the same)"
    reference = "Bodson, Douglas 1997, Automatica 33(12), 2213-2221"
    phased = True
    repeats = True
    code = codes.DISTURBANCE_TONE


class ParameterChange(Effect):
    """One parameter of the axis takes another value from a certain time on; ``change`` is in the parameter's unit.

    The drive torque (Nm) for it is c r(t) for t >= t_0, with r = a, v, sign(v) or -u.

    See Also
    --------
    FrictionDrift : friction settles over time instead of at one instant.
    LoadFriction : varies with the drive; a motion that changes half-way hides the difference.

    Examples
    --------
    >>> ParameterChange(0.1, time=1.0, parameter="viscous").value(time=[0.9, 1.0], velocity=[2.0, 2.0]).tolist()
    [0.0, 0.2]
    """

    change: float = number(0.01, "1", -1e3, 1e3)
    time: float = number(1.0, "s", 0.0, 1e5, span=(0.08, 0.92), scan="step")
    parameter: str = choice(
        "inertia",
        {
            "inertia": codes.CHANGE_INERTIA,
            "viscous": codes.CHANGE_VISCOUS,
            "coulomb": codes.CHANGE_COULOMB,
            "gain": codes.CHANGE_GAIN,
        },
    )

    name = "parameter_change"
    place = "time"
    equation = "c r(t) for t >= t_0, r = a, v, sign(v) or -u"
    signature = "a parameter that differs before and after"
    needs = "the same motion before and after the change"
    reference = "Basseville, Nikiforov 1993, Detection of Abrupt Changes: Theory and Application, Prentice Hall"

    @classmethod
    def parent_of(cls, **options: str) -> str:
        """The friction that a change of friction requires; ``options`` holds the parameter that changes."""
        return options["parameter"] if options["parameter"] in ("viscous", "coulomb") else ""
