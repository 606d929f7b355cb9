"""Effects that depend on time: an external tone, and a parameter that changes."""

from __future__ import annotations

import math

import numpy as np

from whsklearn.effects import codes
from whsklearn.effects.base import Effect
from whsklearn.effects.quantity import choice, number
from whsklearn.effects.surroundings import Surroundings

# Multiple of the median power around it from which a peak is a line of the reference, where no tone is accepted; and
# the widths, in bins (1 / duration), of the line and of its surroundings: a Hann window spreads a line over 1.5 bins
# (`python -m benchmarks.real_axes --only so101`).
STANDS_OUT = 10.0
LINE, AROUND = 1.5, 12.0
# Smallest gain after a change of gain, relative to before: with 0.4 %, inertia and missing torque also fall to 0.4 %,
# which "explained" KR300 A with Coulomb friction hidden.  Simulated changes keep 70 % and more.
LEAST_GAIN_LEFT = 0.1


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

    def implausible(self, seen: Surroundings) -> str:
        """The objection that a tone is at a line of the command where the following error takes the drive's place.

        Loop dynamics that are not modelled leave a residual at every line of the command's spectrum, which a tone would
        explain.  With a measured drive, a tone at such a line is accepted as a tone.

        ``seen``: see `Effect.implausible`.
        """
        if seen.command is None:
            return ""
        x = seen.command - seen.command.mean()
        power = np.abs(np.fft.rfft(np.hanning(x.size) * x)) ** 2
        distance = np.abs(np.arange(power.size) - self.frequency * seen.dt * x.size)
        line, around = power[distance <= LINE], power[(distance > 2 * LINE) & (distance <= AROUND)]
        if line.size == 0 or around.size == 0 or line.max() <= STANDS_OUT * np.median(around):
            return ""
        return "its frequency is a line of the reference, where wrong dynamics would cause a tone as well"


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

    def implausible(self, seen: Surroundings) -> str:
        """The objection that next to no drive is left, or an inertia or friction farther below zero than it was above.

        A loop that diverges looks like friction that begins to drive the axis.  ``seen``: see `Effect.implausible`.
        """
        if self.parameter == "gain":
            left = 1.0 + self.change
            hides = f"it would leave {100 * left:.1f} % of the drive's effect and hide whatever is missing"
            return hides if left < LEAST_GAIN_LEFT else ""
        before = seen.inertia if self.parameter == "inertia" else seen.size(self.parameter)
        if before + self.change >= -abs(before):
            return ""
        return f"it would leave a negative {self.parameter}, which would drive the axis"
