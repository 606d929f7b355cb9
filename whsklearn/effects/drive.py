"""Effects between the command and the torque at the shaft."""

from __future__ import annotations

import math

import numpy as np

from whsklearn.effects import codes
from whsklearn.effects.base import Effect
from whsklearn.effects.quantity import number
from whsklearn.effects.surroundings import Surroundings


class _DriveEffect(Effect):
    """An effect on the drive; its columns are the torques that the drive loses to it (Nm)."""

    place = "drive"
    port = "input"


class InputOffset(_DriveEffect):
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

    torque: float = number(0.1, "Nm", -1e3, 1e3)

    name = "input_offset"
    equation = "c"
    signature = "a constant, at rest and in motion"
    needs = "both directions; rest distinguishes it from asymmetric_coulomb"
    aliases = ("asymmetric_coulomb",)
    reference = (
        "Janot, Gautier, Brunot 2019, Data Set and Reference Models of EMPS, Nonlinear System Identification Benchmarks"
    )
    elementary = True
    code = codes.INPUT_OFFSET


class DeadZone(_DriveEffect):
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

    width: float = number(0.05, "Nm", 1e-4, 1e2, log=True, span=(1e-4, 2.0), starts=(0.01, 0.028, 0.077, 0.22, 0.6))

    name = "dead_zone"
    equation = "u_eff = u - clip(u, -d, d)"
    signature = "a step in the sign of the drive, not of velocity"
    needs = "a small drive during motion"
    reference = "Tao, Kokotovic 1996, Adaptive Control of Systems with Actuator and Sensor Nonlinearities, Wiley"
    column_kind = "at_size"
    code = codes.DEAD_ZONE

    def implausible(self, seen: Surroundings) -> str:
        """The objection that the drive chatters across the zone. ``seen``: see `Effect.implausible`."""
        return seen.unknown_between(np.clip(seen.drive, -self.width, self.width))


class Saturation(_DriveEffect):
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

    limit: float = number(
        1.0, "Nm", 1e-3, 1e4, log=True, scale="peak", span=(1e-4, 1.1), starts=(0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9)
    )

    name = "saturation"
    equation = "u_eff = clip(u, -U, U)"
    signature = "a gap at high drive only, with wind-up after it"
    needs = "drive above the limit"
    reference = "Astrom, Hagglund 2006, Advanced PID Control, ISA, on integrator windup"
    column_kind = "at_size"
    neutral = math.inf
    code = codes.SATURATION

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.limit <= 0:
            raise ValueError(f"Saturation: limit is {self.limit}, expected a torque above zero; give it in Nm.")

    def implausible(self, seen: Surroundings) -> str:
        """The objection that the drive could not have moved the axis, or that it chatters beyond the limit.

        ``seen``: see `Effect.implausible`.
        """
        return seen.never_moved or seen.unknown_between(seen.drive - np.clip(seen.drive, -self.limit, self.limit))


class InputDelay(_DriveEffect):
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

    delay: float = number(1e-3, "s", 1e-5, 0.5, log=True, scale="dt", span=(0.01, 300.0), starts=(1.5, 4.0, 20.0, 50.0))

    name = "input_delay"
    equation = "u_eff(t) = u(t - tau)"
    signature = "a gap that follows du/dt, with linear phase"
    needs = "frequencies of 0.2 / (2 pi tau) and above"
    aliases = ("actuator_lag",)
    reference = "Astrom, Hagglund 2006, Advanced PID Control, ISA, first-order lag with dead time"
    column_kind = "first_order"
    code = codes.INPUT_DELAY


class ActuatorLag(_DriveEffect):
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

    time_constant: float = number(
        1e-3, "s", 1e-5, 0.5, log=True, scale="dt", span=(0.01, 300.0), starts=(1.5, 4.0, 20.0, 50.0)
    )

    name = "actuator_lag"
    equation = "T du_eff/dt = u - u_eff"
    signature = "a gap that follows du/dt and rolls off"
    needs = "frequencies of 0.5 / (2 pi T) and above"
    aliases = ("input_delay",)
    reference = "Astrom, Hagglund 2006, Advanced PID Control, ISA, first-order lag with dead time"
    column_kind = "first_order"
    code = codes.ACTUATOR_LAG


class TorqueRipple(_DriveEffect):
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

    amplitude: float = number(0.03, "1", 1e-4, 0.3, log=True)
    order: float = number(6.0, "1", 0.8, 256.0, scan="position", open_below=True)
    phase: float = number(0.0, "rad", -math.pi, math.pi)

    name = "torque_ripple"
    equation = "u_eff = u (1 - A cos(k q + phi))"
    signature = "a wave over position, proportional to the drive"
    needs = "both signs of torque over a period of travel"
    reference = "Jahns, Soong 1996, IEEE Trans. Ind. Electron. 43(2), 321-330"
    phased = True
    repeats = True
    code = codes.TORQUE_RIPPLE
