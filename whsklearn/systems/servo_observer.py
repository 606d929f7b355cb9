"""A servo axis that follows its own log: the compiled pass for fits, on flat arrays instead of objects.

J a = u_eff - F is stepped with the drive as logged and corrected after every sample by the innovation
e = y - y_hat (Luenberger 1971, IEEE Trans. Autom. Control 16(6), 596-602), or restarted at the measurement at fixed
intervals. The torque that the model lacks is J (p^2 + l1 p + l2) e + F(q, v) - F(q^, v^), with l1 = gains[0] / dt and
l2 = gains[1] / dt; `effect_torque` gives F on either motion.
"""

from __future__ import annotations

import math

import numpy as np

from whsklearn.effects.base import Array
from whsklearn.systems._servo_kernel import (
    DRIVE,
    LOAD,
    LOAD_VELOCITY,
    MEASURED,
    N_SIGNALS,
    POSITION,
    TORQUE,
    VELOCITY,
    AxisNumbers,
    How,
    PassInputs,
    plant_of,
    run,
    torque_along,
)

__all__ = [
    "DRIVE",
    "LOAD",
    "LOAD_VELOCITY",
    "MEASURED",
    "POSITION",
    "TORQUE",
    "VELOCITY",
    "AxisNumbers",
    "How",
    "bare_parts",
    "effect_torque",
    "follow",
    "plant_of",
]

_NO_CONTROLLER = (0.0, 0.0, 0.0, 0.0, 0.0, math.inf, 0.0, 0.0)
_NOTHING = np.zeros(0)


def bare_parts(inertia: float, delay: float = 0.0, *, on_load: bool = False) -> Array:
    """`AxisNumbers.parts` of an axis with these values; everything else is in its effects.

    ``inertia``: inertia (kg m2). ``delay``: delay between the logged drive and its action (s); below zero it acts
    early. ``on_load``: whether the encoder sits behind the transmission.
    """
    return np.array([inertia, math.inf, 1.0, math.inf, delay, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, float(on_load)])


def follow(
    plant: AxisNumbers, drive: Array, measured: Array, how: How, *, start: tuple[float, float] | None = None
) -> Array:
    """One pass along a log.

    ``plant``: the axis: `plant_of` a sequence of effects and `bare_parts`, `whsklearn.systems.servo.pack`, or arrays of
        a fit of its own.
    ``drive`` (n,): the drive as logged (Nm).
    ``measured`` (2, n) or (4, n): position and velocity on the encoder's side (rad, rad/s), and, if a restart needs
        them, the twist of the coupling and its rate.
    ``how``: sample time, fine steps, samples between restarts, the observer's gains.
    ``start``: position and velocity at the first sample; those measured by default.
    Returns (7, n): rows ``DRIVE MEASURED POSITION VELOCITY TORQUE LOAD LOAD_VELOCITY``; ``MEASURED`` is y_hat.
    """
    position, velocity = (measured[0, 0], measured[1, 0]) if start is None else start
    out = np.empty((N_SIGNALS, drive.size))
    out[DRIVE] = drive
    signals = PassInputs(np.zeros((3, 1)), _NOTHING, _NOTHING, measured)
    run(out, plant, _NO_CONTROLLER, signals, how, np.array([position, velocity, position, velocity], dtype=float))
    return out


def effect_torque(plant: AxisNumbers, time: Array, position: Array, velocity: Array, drive: Array) -> Array:
    """F(q, v): drive torque for all memoryless effects of an axis along a motion (Nm), shape (n,).

    Hysteresis is omitted because noise on the path would excite it, and the sensor's effects because they are not
    torques. The difference between this torque on the measured motion and on the observer's is what the innovation does
    not show.
    """
    return torque_along(plant, *(np.ascontiguousarray(s, dtype=float) for s in (time, position, velocity, drive)))
