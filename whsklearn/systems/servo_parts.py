"""The parts of a servo axis that are not effects: drive, transmission, sensor, controller."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields


@dataclass(frozen=True)
class Part:
    """A part of the axis; its numbers are checked to be finite where required and not below their bounds.

    >>> try:
    ...     Sensor(noise=-1e-5)
    ... except ValueError as error:
    ...     print(error)
    Sensor: noise is -1e-05, expected a number not below zero; use SI units.
    """

    def __post_init__(self) -> None:
        for f in fields(self):
            value = getattr(self, f.name)
            if isinstance(value, str):
                continue
            if not isinstance(value, (int, float)) or math.isnan(value) or value < 0:
                raise ValueError(
                    f"{type(self).__name__}: {f.name} is {value!r}, expected a number not below zero; use SI units."
                )


@dataclass(frozen=True)
class Drive(Part):
    """From the controller's output to the torque at the shaft.

    Parameters
    ----------
    gain : float
        Torque per unit of the controller's output (Nm); the log shows gain times output.
    limit : float
        Torque that the drive cannot exceed (Nm); the log shows the commanded torque.
    delay, lag : float
        Dead time and time constant of the torque (s).

    References
    ----------
    Astrom and Hagglund 2006, Advanced PID Control, ISA, first-order lag with dead time.

    Examples
    --------
    >>> from whsklearn import ServoAxis
    >>> from whsklearn.systems import Drive
    >>> axis = ServoAxis(inertia=1.0, law="viscous", drive=Drive(gain=2.0, limit=0.5))
    >>> run = axis.simulate_drive([5.0] * 100, noise=False)
    >>> run.drive[0].item(), run.torque.max().item()  # what was asked for, and what was given
    (5.0, 0.5)
    """

    gain: float = 1.0
    limit: float = math.inf
    delay: float = 0.0
    lag: float = 0.0


@dataclass(frozen=True)
class Transmission(Part):
    """A spring between motor and load, with optional play; the inertia of the axis is that of both.

    Parameters
    ----------
    load_share : float
        Share of the inertia behind the spring, above 0 and below 1.
    stiffness : float
        Stiffness (Nm/rad).
    damping_ratio : float
        Damping of the free resonance, as a ratio.
    gap : float
        Full play (rad).

    References
    ----------
    Spong 1987, ASME J. Dyn. Syst. Meas. Control 109(4), 310-319; Nordin and Gutman 2002, Automatica 38(10),
    1633-1649.

    Examples
    --------
    >>> from whsklearn import ServoAxis
    >>> from whsklearn.systems import Transmission
    >>> axis = ServoAxis(inertia=0.1, law="viscous", transmission=Transmission(load_share=0.5, stiffness=100.0))
    >>> run = axis.simulate_drive([1.0] * 1000, noise=False)
    >>> bool((run.true_position - run.load_position).max() > 0)  # the motor leads
    True
    """

    load_share: float = 0.5
    stiffness: float = 1000.0
    damping_ratio: float = 0.05
    gap: float = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0.0 < self.load_share < 1.0:
            raise ValueError(f"Transmission: load_share is {self.load_share}, expected a share between 0 and 1.")
        if not 0.0 < self.stiffness < math.inf:
            raise ValueError(f"Transmission: stiffness is {self.stiffness}, expected a finite number above zero.")


@dataclass(frozen=True)
class Sensor(Part):
    """The encoder.

    Parameters
    ----------
    resolution : float
        Step of the reading (rad); 0 for none.
    noise : float
        Standard deviation of white noise on the reading (rad).
    side : str
        ``motor`` or ``load``: the side that the controller and the log see.

    References
    ----------
    Widrow, Kollar and Liu 1996, IEEE Trans. Instrum. Meas. 45(2), 353-361, on rounding.

    Examples
    --------
    >>> from whsklearn import ServoAxis
    >>> from whsklearn.systems import Sensor
    >>> axis = ServoAxis(inertia=1.0, law="viscous", sensor=Sensor(resolution=0.01))
    >>> sorted({round(q, 3) for q in axis.simulate_drive([1.0] * 170).position.tolist()})
    [0.0, 0.01]
    """

    resolution: float = 0.0
    noise: float = 0.0
    side: str = "motor"

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.side not in ("motor", "load"):
            raise ValueError(f"Sensor: side is {self.side!r}, expected 'motor' or 'load'.")


@dataclass(frozen=True)
class PIDController(Part):
    """u = sat(kp e + ki sum(e) T + kd de/dt + kv r' + ka r''), with conditional integration.

    Parameters
    ----------
    kp, ki, kd : float
        Continuous-time gains, in units of output per rad, per rad s and per rad/s.
    velocity_feedforward, acceleration_feedforward : float
        kv and ka, the gains on the reference's derivatives.
    limit : float
        Bound of the output; the integral is frozen while the output exceeds it.
    derivative_on : str
        ``error``, or ``measurement`` to keep steps of the reference out of the drive.
    derivative_filter : float
        Time constant of the derivative (s).

    References
    ----------
    Astrom and Hagglund 2006, Advanced PID Control, ISA, on filtering, feed-forward and integrator windup; paper,
    sec. 5.2.

    Examples
    --------
    >>> import numpy as np
    >>> from whsklearn import ServoAxis
    >>> from whsklearn.systems import PIDController
    >>> axis = ServoAxis(inertia=0.05, law="viscous", controller=PIDController(kp=60.0, ki=60.0, kd=2.0))
    >>> run = axis.simulate(np.full(2000, 0.1), noise=False)
    >>> round(float(run.position[-1]), 2)
    0.1
    """

    kp: float = 60.0
    ki: float = 60.0
    kd: float = 2.0
    velocity_feedforward: float = 0.0
    acceleration_feedforward: float = 0.0
    limit: float = math.inf
    derivative_on: str = "error"
    derivative_filter: float = 0.002

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.derivative_on not in ("error", "measurement"):
            raise ValueError(
                f"PIDController: derivative_on is {self.derivative_on!r}, expected 'error' or 'measurement'."
            )

    @property
    def row(self) -> tuple[float, ...]:
        """The controller as compiled passes take it, eight numbers: gains, feed-forward, limit, derivative."""
        gains = (self.kp, self.ki, self.kd, self.velocity_feedforward, self.acceleration_feedforward, self.limit)
        return tuple(float(g) for g in (*gains, self.derivative_on == "measurement", self.derivative_filter))
