"""F(q, v) of `whsklearn.systems._servo_kernel`, along a motion that is given."""

from __future__ import annotations

import numpy as np

from whsklearn._numba import njit
from whsklearn.effects.equations import N_STATES, smooth_sign
from whsklearn.systems._servo_kernel import KAPPA, Ends, arranged, load_sum, motor_sum


@njit(nogil=True, error_model="numpy")
def torque_along(plant, time, position, velocity, drive):
    """Drive torque for all memoryless effects along a motion (Nm), shape (n,): F(q, v) of the module's formula.

    Effects with a memory of the path are omitted because noise on the path would excite them, and effects of the sensor
    because they are not torques.
    """
    effects, p, all_ends = arranged(plant.codes, plant.p)
    ends = Ends(all_ends.plain, all_ends.own, all_ends.own, all_ends.load, all_ends.sensor, all_ends.inertia)
    z = np.zeros((1, N_STATES))
    out = np.empty(position.size)
    for k in range(position.size):
        t, q, v = time[k], position[k], velocity[k]
        s, ds = smooth_sign(v, plant.parts[KAPPA])
        out[k] = motor_sum(effects, p, plant.own, ends, z, t, q, v, s, ds, drive[k])[0]
        out[k] += load_sum(effects, p, all_ends, t, q, v)
    return out
