"""The axis along a record: sensor, controller, drive and mechanics, sample by sample.

One compiled function serves the closed loop (the controller writes the drive) and the
open loop (the drive is given).  All its inputs are flat arrays, so a batch costs no more
than a loop, and it lets go of the interpreter, so threads help.
"""

from __future__ import annotations

import math
import sys
from pathlib import Path
from typing import Any

import numpy as np
from numba import njit, types
from numba.core.types import FunctionType

from whsklearn.effects import codes, hysteresis, terms
from whsklearn.effects.hysteresis import N_STATES
from whsklearn.systems import _servo_step, _servo_torques
from whsklearn.systems._servo_step import fine_step
from whsklearn.systems._servo_torques import USER_SIGNATURE, measured_position

_BELOW = (hysteresis, terms, codes)

# columns of the output
DRIVE, MEASURED, POSITION, VELOCITY, TORQUE, LOAD, LOAD_VELOCITY = range(7)

_V = types.float64[::1]
_SIGNATURE = types.void(
    types.float64[:, ::1],  # out (n, 7)
    types.float64[:, ::1],  # reference, its velocity, its acceleration (3, n)
    _V,  # noise on the position
    _V,  # disturbance torque
    _V,  # axis
    _V,  # drive
    _V,  # controller
    types.int64[::1],  # mechanical effects
    types.float64[:, ::1],
    types.int64[::1],  # sensor effects
    types.float64[:, ::1],
    types.float64[:, ::1],  # measured position and velocity to return to (2, n)
    types.int64[::1],  # closed loop, sub-steps, samples between returns, sensor on the load, linear hold
    types.float64,  # sample time
    _V,  # initial state
    FunctionType(USER_SIGNATURE),
)


@njit
def held_drive(u, start, width, before, linear):
    """The drive's mean over a fine step that starts at ``start`` (in samples): held or interpolated."""
    last = u.shape[0] - 1
    if linear:
        s = start + 0.5 * width
        i = math.floor(s)
        if i < 0:
            return before
        return u[last, 0] if i >= last else u[i, 0] + (s - i) * (u[i + 1, 0] - u[i, 0])
    i = math.floor(start + 1e-9)
    j = math.floor(start + width - 1e-9)
    first = before if i < 0 else u[min(i, last), 0]
    if i == j:
        return first
    share = (j - start) / width
    return share * first + (1.0 - share) * (before if j < 0 else u[min(j, last), 0])


@njit
def lagged(u, state, constant, h):
    """Mean output and new state of a first-order lag under a constant input; exact."""
    if constant <= 0.0:
        return u, u
    decay = math.exp(-h / constant)
    return u + (state - u) * (1.0 - decay) * constant / h, u + (state - u) * decay


@njit
def control(c, memory, reference, k, y, sample_time):
    """PID with feed-forward, saturation and conditional integration; memory = [integral, derivative, last input]."""
    kp, ki, kd, kv, ka, limit, on_measurement, filter_time = c
    error = reference[0, k] - y
    source = -y if on_measurement > 0.0 else error
    if k > 0:
        blend = filter_time / (filter_time + sample_time)
        memory[1] = blend * memory[1] + (1.0 - blend) * (source - memory[2]) / sample_time
    memory[2] = source
    step = ki * error * sample_time
    rest = kp * error + kd * memory[1] + kv * reference[1, k] + ka * reference[2, k]
    out = rest + memory[0] + step
    if -limit <= out <= limit or (out > limit and step < 0.0) or (out < -limit and step > 0.0):
        memory[0] += step
    return min(limit, max(-limit, rest + memory[0]))


@njit
def return_to(state, position, velocity):
    """Set motor position and velocity, and carry the load along."""
    state[2] += position - state[0]
    state[3] += velocity - state[1]
    state[0] = position
    state[1] = velocity


def _compiled(function: Any) -> Any:
    """Compile for the one signature, and cache under the age of all files that are compiled in, not of this one only.

    Numba looks at the caller's own file; an edit below it would leave yesterday's physics in the cache.
    """
    dispatcher = njit(cache=True, nogil=True)(function)
    if not hasattr(dispatcher, "compile"):  # uncompiled on request
        return dispatcher
    index: Any = getattr(getattr(dispatcher, "_cache", None), "_cache_file", None)
    if hasattr(index, "_source_stamp"):
        stats = [Path(str(m.__file__)).stat() for m in (sys.modules[__name__], _servo_step, _servo_torques, *_BELOW)]
        index._source_stamp = (max(s.st_mtime for s in stats), sum(s.st_size for s in stats))
    dispatcher.compile(_SIGNATURE)
    dispatcher.disable_compile()
    return dispatcher


@_compiled
def run(
    out, reference, noise, disturbance, axis, drive, controller, effects, p, sensors, sp, measured, how, sample_time,
    initial, user,
):  # fmt: skip
    """Fill ``out`` with drive, measured and true position, velocity, torque at the axis, load position and velocity."""
    closed, substeps, every, on_load, linear = how[0], how[1], how[2], how[3], how[4]
    gain, limit, delay, lag, extra_lag, width, resolution = drive
    axis_numbers = (axis[0], axis[1], axis[2], axis[3], axis[4], axis[5])
    controller_numbers = (
        controller[0], controller[1], controller[2], controller[3],
        controller[4], controller[5], controller[6], controller[7],
    )  # fmt: skip
    state = initial.copy()
    z = np.zeros((effects.size, N_STATES))
    memory = np.zeros(3)
    h = sample_time / substeps
    before = 0.0 if closed else out[0, DRIVE]
    first = second = before
    for k in range(out.shape[0]):
        t = k * sample_time
        if every > 0 and k % every == 0:
            return_to(state, measured[0, k], measured[1, k])
        y, step = measured_position(sensors, sp, state[2] if on_load else state[0], t, user)
        y += noise[k]
        step = max(step, resolution)
        if step > 0.0:
            y = step * math.floor(y / step + 0.5)
        if closed:
            out[k, DRIVE] = gain * control(controller_numbers, memory, reference, k, y, sample_time)
        out[k, MEASURED] = y
        out[k, POSITION] = state[0]
        out[k, VELOCITY] = state[1]
        out[k, LOAD] = state[2]
        out[k, LOAD_VELOCITY] = state[3]
        for j in range(substeps):
            u = held_drive(out, k + (j - delay / h) / substeps, 1.0 / substeps, before, linear)
            u -= min(width, max(-width, u))
            u = min(limit, max(-limit, u))
            u, first = lagged(u, first, lag, h)
            u, second = lagged(u, second, extra_lag, h)
            if j == 0:
                out[k, TORQUE] = u + disturbance[k]
            fine_step(effects, p, z, state, axis_numbers, u + disturbance[k], t + j * h, h, user)
