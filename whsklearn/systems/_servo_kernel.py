"""The one pass along a record of a servo axis: sensor, controller or logged drive, mechanics, observer.

``run`` serves the closed loop (the controller writes the drive), the replay of a logged drive, and the observer:
a replay that is corrected after every sample by the innovation e = y - y_hat, position by ``gains[0]`` e and
velocity by ``gains[1]`` e (Luenberger 1971, IEEE Trans. Autom. Control 16(6), 596-602).  The replay stays near the
measurement, so the controller need not be known, and what the model lacks appears in e.  With l1 = gains[0] / dt and l2
= gains[1] / dt,

    missing torque = J (p^2 + l1 p + l2) e + F(q, v) - F(q^, v^),

F being the torque of the effects on the measured motion and on the observer's, see `torque_along`.  All arguments
are flat arrays in named tuples: a batch costs no more than a loop, and the kernel releases the GIL, so threads help.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from whsklearn._numba import borrowed, njit, part
from whsklearn.effects import codes
from whsklearn.effects.equations import N_STATES, quantized, smooth_sign
from whsklearn.systems._servo_drive import chain_of, effective, held, hold_weights
from whsklearn.systems._servo_step import body_of, fine_step
from whsklearn.systems._servo_torques import GAIN, KAPPA, ON_LOAD, RESOLUTION, Ends, arranged, load_sum, motor_sum, read

N_SIGNALS = 7
DRIVE, MEASURED, POSITION, VELOCITY, TORQUE, LOAD, LOAD_VELOCITY = range(N_SIGNALS)  # rows of the output
_FOLDED = 0.5  # share of the sign lost above which the encoder falls where the position rises from below zero


class PassInputs(NamedTuple):
    """The input of a pass: arrays of n samples.

    ``reference`` (3, n): commanded position and its two derivatives; ``noise`` on the encoder and ``disturbance``
    torque, (n,) or (0,); ``measured`` (2, n) or (4, n): position and velocity on the encoder's side and, if there,
    the twist of the coupling and its rate, which the pass returns to or observes.
    """

    reference: Any
    noise: Any
    disturbance: Any
    measured: Any


class How(NamedTuple):
    """The settings of a pass: sample time (s), fine steps per sample, closed loop, samples between returns to the
    measurement (0: none), the observer's two gains (0: none), whether the drive is interpolated between samples, time
    of the first sample (s).
    """

    sample_time: float
    substeps: int
    closed: bool = False
    every: int = 0
    gains: tuple[float, float] = (0.0, 0.0)
    linear: bool = False
    start: float = 0.0


@part
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


@part
def returned(state, measured, k, on_load, side):
    """The state with the encoder side set to the measurement; the twist is set if it is given, and kept otherwise."""
    x, v, q, w = state
    twist, slip = x - q, v - w
    if measured.shape[0] > 2:
        twist, slip = measured[2, k], measured[3, k]
    x = side * measured[0, k] + (twist if on_load else 0.0)
    v = side * measured[1, k] + (slip if on_load else 0.0)
    return x, v, x - twist, v - slip


@part
def lattice_of(plant):
    """Step of the encoder (the coarsest applies), and whether the encoder loses the sign."""
    step, folded = plant.parts[RESOLUTION], False
    for i in range(plant.codes.size):
        if plant.codes[i] == codes.QUANTIZATION:
            step = max(step, plant.p[i, 0])
        elif plant.codes[i] == codes.SENSOR_RECTIFICATION:
            folded = plant.p[i, 0] > _FOLDED
    return step, folded


@njit(nogil=True, error_model="numpy")
def run(out, plant, controller, signals, how, initial):
    """Fill ``out`` (7, n) with drive, measured and true position, velocity, torque, load position and velocity.

    ``controller`` holds the eight numbers of a `PIDController`; ``initial`` is the state (4,): position and velocity
    of motor and load.  In open loop row 0 of ``out`` is the drive as logged.
    """
    effects, p, ends = arranged(plant.codes, plant.p)
    chain = chain_of(plant)
    weights = hold_weights(chain.delay / how.sample_time, how.substeps, how.linear)
    z = np.zeros((max(effects.size, 1), N_STATES + 1))
    _pass(out, plant, effects, p, ends, z, chain, weights, controller, signals, how, initial)


@part
def _pass(out, plant, effects, p, ends, z, chain, weights, controller, signals, how, initial):
    """The pass itself, on borrowed arrays whose owners live in `run`."""
    out, effects, p, z = borrowed((out, effects, p, z))
    reference, noise, disturbance, measured = borrowed(signals)
    first, weight = borrowed(weights)
    u = out[DRIVE]
    own = plant.own
    body = body_of(plant)
    lattice, folded = lattice_of(plant)
    on_load = plant.parts[ON_LOAD] > 0.0
    n, dt, substeps = out.shape[1], how.sample_time, how.substeps
    h = dt / substeps
    closed, every, gain = how.closed, how.every, plant.parts[GAIN]
    gain_1, gain_2 = how.gains
    observed = gain_1 > 0.0 or gain_2 > 0.0
    memory = np.zeros(3)
    before = 0.0 if how.closed else u[0]
    lag = second = before
    state = (initial[0], initial[1], initial[2], initial[3])
    for k in range(n):
        t = how.start + k * dt
        if every > 0 and k % every == 0:
            state = returned(state, measured, k, on_load, -1.0 if folded and state[0] < 0.0 else 1.0)
        y = read(effects, p, own, ends, t, state[2] if on_load else state[0])
        if noise.size > 0:
            y += noise[k]
        if lattice > 0.0:
            y = quantized(lattice, y)
        if closed:
            u[k] = gain * control(controller, memory, reference, k, y, dt)
        out[MEASURED, k] = y
        out[POSITION, k], out[VELOCITY, k] = state[0], state[1]
        out[LOAD, k], out[LOAD_VELOCITY, k] = state[2], state[3]
        if observed:
            e = measured[0, k] - y
            if folded and state[0] < 0.0:
                e = -e
            a, b = gain_1 * e, gain_2 * e
            state = (state[0] + a, state[1] + b, state[2] + a, state[3] + b)
        for j in range(substeps):
            torque, lag, second = effective(chain, held(u, k + first[j], weight[j], before), lag, second, h)
            if disturbance.size > 0:
                torque += disturbance[k]
            if j == 0:
                out[TORQUE, k] = torque
            state = fine_step(effects, p, own, ends, z, body, state, torque, t + j * h, h)


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
