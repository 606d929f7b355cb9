"""The one pass along a record of a servo axis: sensor, controller or logged drive, mechanics, observer.

``run`` serves the closed loop (the controller writes the drive), the replay of a logged drive, and the observer:
a replay that is corrected after every sample by the innovation e = y - y_hat, position by ``gains[0]`` e and
velocity by ``gains[1]`` e (Luenberger 1971, IEEE Trans. Autom. Control 16(6), 596-602).  The replay stays near the
measurement, so the controller need not be known, and what the model lacks appears in e.  With l1 = gains[0] / dt and l2
= gains[1] / dt,

    missing torque = J (p^2 + l1 p + l2) e + F(q, v) - F(q^, v^),

F being the torque of the effects on the measured motion and on the observer's.  All arguments are flat arrays in named
tuples: a batch costs no more than a loop, and the kernel releases the GIL, so threads help.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from whsklearn._numba import borrowed, njit, part
from whsklearn.effects import Effect, codes
from whsklearn.effects.base import Array
from whsklearn.effects.equations import (
    AHEAD,
    N_STATES,
    advance_hysteresis,
    dead_zone,
    early_friction,
    hysteresis_torque,
    lagged,
    parameter_change,
    quantized,
    saturation,
    smooth_sign,
)
from whsklearn.effects.own import WHICH, address_of
from whsklearn.effects.rows import has_memory, load_torque, motor_torque, on_load, reading
from whsklearn.effects.transmission import contact_damping, contact_stiffness, coupling_torque


# --- from the drive to the torque on the motor in a fine step --------------------------------------------------------
class DriveStage(NamedTuple):
    """The path from the drive to the motor: delay (s), two lags (s), width of the dead zone, limit."""

    delay: Any
    lag: Any
    second_lag: Any
    width: Any
    limit: Any


@part
def chain_of(plant):
    """The drive with its effects: delays, lags and dead zones add up, and the lowest limit applies."""
    delay, limit = plant.parts[DELAY], plant.parts[LIMIT]
    second, width = 0.0, 0.0
    for i in range(plant.codes.size):
        code = plant.codes[i]
        if code == codes.INPUT_DELAY:
            delay += plant.p[i, 0]
        elif code == codes.ACTUATOR_LAG:
            second += plant.p[i, 0]
        elif code == codes.DEAD_ZONE:
            width += plant.p[i, 0]
        elif code == codes.SATURATION:
            limit = min(limit, plant.p[i, 0])
    return DriveStage(delay, plant.parts[LAG], second, width, limit)


@part
def hold_weights(delay, substeps, linear):
    """For each fine step of a sample: the sample that acts, counted from the current one, and its weight against the
    next.

    Together they give the mean of the drive ``delay`` samples ago over the fine step, held or interpolated.
    """
    first = np.zeros(substeps, dtype=np.int64)
    weight = np.ones(substeps)
    width = 1.0 / substeps
    for j in range(substeps):
        start = j * width - delay
        if linear:
            s = start + 0.5 * width
            first[j] = math.floor(s)
            weight[j] = 1.0 - (s - first[j])
        else:
            first[j] = math.floor(start + 1e-9)
            if math.floor(start + width - 1e-9) > first[j]:
                weight[j] = (first[j] + 1.0 - start) / width
    return first, weight


@njit(cache=False, forceinline=True, error_model="numpy")
def held(u, i, weight, before):
    """The drive between samples i and i + 1; ``before`` is its value before the record, and the last value holds after
    it.
    """
    last = u.size - 1
    a = before if i < 0 else u[min(i, last)]
    if weight == 1.0:
        return a
    b = before if i + 1 < 0 else u[min(i + 1, last)]
    return weight * a + (1.0 - weight) * b


@njit(cache=False, forceinline=True, error_model="numpy")
def effective(chain, u, first, second, h):
    """Mean torque over a fine step behind dead zone, limit and lags, and the new states of the lags."""
    if chain.width > 0.0:
        u -= dead_zone(chain.width, u)
    if chain.limit < math.inf:
        u -= saturation(chain.limit, u)
    if chain.lag > 0.0:
        u, first = lagged(u, first, chain.lag, h)
    if chain.second_lag > 0.0:
        u, second = lagged(u, second, chain.second_lag, h)
    return u, first, second


# --- the torques on a servo axis at one instant: sums of the effects' equations over the rows of an axis -------------
# The equations are those of `whsklearn.effects`; this module contains none of them. An axis is an `AxisNumbers` of flat
# arrays, so a fit can change its numbers without creating objects.
# inlined into the pass; otherwise its arrays are reference-counted at every call
_inlined = njit(cache=False, forceinline=True, error_model="numpy")

N_PARTS = 12
(
    INERTIA, KAPPA, GAIN, LIMIT, DELAY, LAG, SHARE, STIFFNESS, RATIO, GAP, RESOLUTION, ON_LOAD,
) = range(N_PARTS)  # fmt: skip


class AxisNumbers(NamedTuple):
    """An axis as kernels take it.

    ``codes`` (n,) and ``p`` (n, 8) are the effects as `Effect.code` and `Effect.row`, the law's terms among them;
    ``parts`` (12,) holds inertia, kappa (inf: true stiction), drive gain, limit, delay and lag in s, the load's share
    of the inertia (0: rigid), stiffness (0: none given), damping ratio and gap of the transmission, the encoder's
    resolution, and 1 if the encoder is on the load.  ``own`` calls the user-defined effects (None: there are none).
    """

    codes: Any
    p: Any
    parts: Any
    own: Any


class Ends(NamedTuple):
    """Where each kind of row ends in an arranged axis: plain torques on the motor's side, user-defined ones, those with
    a memory, torques on the load's side, additions to the reading, changes of the inertia.

    Plain indices rather than arrays of indices: an array inside a tuple is reference-counted at every use in a fine
    step.
    """

    plain: Any
    own: Any
    memory: Any
    load: Any
    sensor: Any
    inertia: Any


@part
def kind_of(code):
    """The field of `Ends` that a code belongs to; 6 if it is neither a torque nor an effect on the reading."""
    if code == codes.CHANGE_INERTIA:
        return 5
    if code == codes.DEAD_ZONE or code == codes.SATURATION:
        return 6
    if code <= codes.CHANGE_GAIN:
        return 0
    if code == codes.USER_TORQUE:
        return 1
    if has_memory(code):
        return 2
    if on_load(code):
        return 3
    if code == codes.USER_OUTPUT or codes.OUTPUT_OFFSET <= code < codes.QUANTIZATION:
        return 4
    return 6


@part
def arranged(effects, p):
    """Copies of codes (n,) and numbers (n, 8) with the rows in the order of `Ends`, and where each kind ends."""
    n = effects.size
    rows = np.empty(n, dtype=np.int64)
    ends = np.zeros(6, dtype=np.int64)
    filled = 0
    for kind in range(6):
        for i in range(n):
            if kind_of(effects[i]) == kind:
                rows[filled] = i
                filled += 1
        ends[kind] = filled
    return effects[rows[:filled]], p[rows[:filled]], Ends(ends[0], ends[1], ends[2], ends[3], ends[4], ends[5])


@_inlined
def motor_sum(effects, p, own, ends, z, t, q, v, s, ds, u):
    """Torque of all effects on the motor's side (Nm), and its slope by velocity; s is sign(v)."""
    total, slope = 0.0, 0.0
    for i in range(ends.plain):
        f, df = motor_torque(effects[i], p, i, t, q, v, s, ds, u)
        total += f
        slope += df
    if own is not None:
        for i in range(ends.plain, ends.own):
            which = int(p[i, WHICH])
            f = own(which, p[i], t, q, v, u)
            step = 1e-6 * (1.0 + abs(v))
            slope += (own(which, p[i], t, q, v + step, u) - f) / step
            total += f
    for i in range(ends.own, ends.memory):
        f, df = hysteresis_torque(effects[i], p, z, i, v)
        total += p[i, 0] * f
        slope += p[i, 0] * df
    return total, slope


@_inlined
def load_sum(effects, p, ends, t, q, v):
    """Torque of all effects on the load's side (Nm)."""
    total = 0.0
    for i in range(ends.memory, ends.load):
        total += load_torque(effects[i], p, i, t, q, v)
    return total


@_inlined
def added_inertia(p, ends, t):
    """The sum of all changes of the inertia up to the time t."""
    total = 0.0
    for i in range(ends.sensor, ends.inertia):
        total += parameter_change(p[i, 0], p[i, 1], t, 1.0)
    return total


@_inlined
def advance_memories(effects, p, ends, z, dx, v):
    """Move every effect with a memory along what the last step left of its path, and along ``dx``.

    Their states refer to the middle of a step, where the torque is evaluated, so one advance per step is enough: from
    middle to middle, at the velocity ``v`` between them.
    """
    dx += z[ends.own, AHEAD]
    for i in range(ends.own, ends.memory):
        advance_hysteresis(effects[i], p, z, i, dx, v)


@_inlined
def read(effects, p, own, ends, t, x):
    """The encoder's reading of the position x, before noise and rounding."""
    y = x
    for i in range(ends.load, ends.sensor):
        if effects[i] == codes.USER_OUTPUT:
            if own is not None:
                y += own(int(p[i, WHICH]), p[i], t, x, 0.0, 0.0)
        else:
            y += reading(effects[i], p, i, t, x)
    return y


def plant_of(effects: Iterable[Effect], parts: NDArray[np.float64]) -> AxisNumbers:
    """Effects and parts as a `AxisNumbers`; the rows are in the order of the effects."""
    effects = tuple(effects)
    own = list(dict.fromkeys(type(e) for e in effects if e.evaluate is not None))
    p = np.zeros((len(effects), codes.N_NUMBERS))
    for row, e in zip(p, effects, strict=True):
        if e.code < 0:
            address_of((type(e),))  # which says what is missing
        if e.evaluate is not None:
            if len(e.row) > WHICH:
                raise ValueError(f"{type(e).__name__} has {len(e.row)} numbers, expected at most {WHICH}.")
            row[WHICH] = own.index(type(e))
        row[: len(e.row)] = e.row
    return AxisNumbers(np.array([e.code for e in effects], dtype=np.int64), p, parts, address_of(tuple(own)))


# --- one fine step of the axis ---------------------------------------------------------------------------------------
# Half a drift, a kick, half a drift (second order).  The kick is a linearly implicit midpoint step, so that a steep
# friction curve stays stable, and dry friction is resolved as the set-valued law it is: when the velocity would
# change sign within the step, the instant is located, the resisting torque just off rest in either direction is
# compared with the driving torque, and the remainder of the step is either standstill or motion.  No threshold
# velocity is needed, standstill is exactly zero velocity, and the step cannot chatter.  It evaluates the torques once
# per step, where an explicit midpoint rule takes two.
class Body(NamedTuple):
    """Inertia (kg m2), the load's share of it (0: rigid), stiffness, damping and play of the coupling, kappa, the dry
    friction of the load (Nm), and the time by which dry friction reverses early (s), with its impedance.
    """

    inertia: Any
    share: Any
    stiffness: Any
    damping: Any
    gap: Any
    kappa: Any
    dry: Any
    lead: Any
    grip: Any


@part
def body_of(plant):
    """The inertias and the coupling between them, from the parts and the effects of the transmission."""
    parts = plant.parts
    inertia, share, ratio, gap, dry = parts[INERTIA], parts[SHARE], parts[RATIO], parts[GAP], 0.0
    compliance = 1.0 / parts[STIFFNESS] if parts[STIFFNESS] > 0.0 else 0.0
    contact_ratio, frequency, lead, grip = 0.0, 0.0, 0.0, 1.0
    for i in range(plant.codes.size):
        code = plant.codes[i]
        if code == codes.EARLY_REVERSAL:
            lead, grip = plant.p[i, 0], plant.p[i, 1]
        if code == codes.BACKLASH or code == codes.FLEXIBLE_COUPLING:
            if share == 0.0:
                share = plant.p[i, 1]
            if code == codes.BACKLASH:
                gap += plant.p[i, 0]
                dry += plant.p[i, 4]
                if frequency == 0.0:
                    frequency, contact_ratio = plant.p[i, 2], plant.p[i, 3]
            else:
                compliance += plant.p[i, 0]
                ratio = plant.p[i, 2]
                dry += plant.p[i, 3]
    if share == 0.0:
        return Body(inertia, 0.0, 0.0, 0.0, 0.0, parts[KAPPA], 0.0, lead, grip)
    reduced = inertia * share * (1.0 - share)
    if compliance > 0.0:
        stiffness = 1.0 / compliance
    else:
        stiffness, ratio = contact_stiffness(frequency, reduced), contact_ratio
    return Body(
        inertia, share, stiffness, contact_damping(ratio, stiffness, reduced), gap, parts[KAPPA], dry, lead, grip
    )


@njit(cache=False, forceinline=True, error_model="numpy")
def implicit_gain(slope, inertia, h):
    """Divisor of the linearly implicit step: the midpoint rule if the step resolves the slope, otherwise Euler."""
    stiffness = h * slope / inertia
    if stiffness < 0.5:
        return max(1.0 + 0.5 * stiffness, 0.5)
    return 1.0 + stiffness


@njit(cache=False, forceinline=True, error_model="numpy")
def from_rest(up, down, slope, inertia, h):
    """Velocity and path after h from rest: zero while friction can hold.

    ``up`` and ``down`` are the net pull just off rest forwards and backwards; friction holds unless the first points
    forwards or the second backwards.
    """
    if up > 0.0 and up > -down:
        excess = up
    elif down < 0.0:
        excess = down
    else:
        return 0.0, 0.0
    v = h * excess / inertia / implicit_gain(slope, inertia, h)
    return v, 0.5 * h * v


@njit(cache=False, error_model="numpy")
def both_ways(effects, p, own, ends, z, t, q, v, u):
    """Torque on the motor's side with dry friction against motion forwards and backwards, and its slope."""
    forwards, slope = motor_sum(effects, p, own, ends, z, t, q, v, 1.0, 0.0, u)
    backwards, _ = motor_sum(effects, p, own, ends, z, t, q, v, -1.0, 0.0, u)
    return forwards, backwards, slope


@njit(cache=False, forceinline=True, error_model="numpy")
def fine_step(effects, p, own, ends, z, body, state, u, t, h):
    """Positions and velocities (motor, motor, load, load) after h under the torque u."""
    x, v, q, w = state
    half = 0.5 * h
    middle = t + half
    two = body.share > 0.0
    sharp = body.kappa == math.inf and body.lead == 0.0
    x_mid = x + half * v
    q_mid = q + half * w if two else x_mid
    if ends.memory > ends.own:
        advance_memories(effects, p, ends, z, half * v, v)
    inertia, pull, slope, f = body.inertia, u, 0.0, 0.0
    load = load_sum(effects, p, ends, middle, q_mid, w if two else v)
    added = added_inertia(p, ends, middle)
    s, ds = smooth_sign(v, body.kappa)
    at_rest = sharp and s == 0.0
    if not at_rest:
        f, slope = motor_sum(effects, p, own, ends, z, middle, x_mid, v, s, ds, u)
    if two:
        motor, behind = (1.0 - body.share) * inertia, body.share * inertia + added
        free = 0.0 if at_rest else (u - f) / motor
        give = (0.0 if at_rest else 1.0 / motor) + 1.0 / behind
        coupling = coupling_torque(x - q, v - w, free, -load / behind, body.stiffness, body.damping, body.gap, give, h)
        w_new = w + h * (coupling - load) / behind
        if body.dry > 0.0:
            hold = h * body.dry / behind
            w_new = w_new - hold if w_new > hold else (w_new + hold if w_new < -hold else 0.0)
        q += half * (w + w_new)
        w = w_new
        pull -= coupling
        inertia = motor
    else:
        pull -= load
        inertia += added
    if body.lead > 0.0:
        forwards, backwards, slope = both_ways(effects, p, own, ends, z, middle, x_mid, v, u)
        f = early_friction(body.lead, body.grip, inertia, pull, v, backwards, forwards, h)
    v_new = 0.0 if at_rest else v + h * (pull - f) / inertia / implicit_gain(slope, inertia, h)
    path = half * (v + v_new)
    if at_rest or (sharp and v_new * s <= 0.0):
        forwards, backwards, slope = both_ways(effects, p, own, ends, z, middle, x_mid, 0.0, u)
        if at_rest or forwards != backwards:
            before = 0.0 if at_rest else h * v / (v - v_new)
            v_new, path = from_rest(pull - forwards, pull - backwards, slope, inertia, h - before)
            path += 0.5 * before * v
    if ends.memory > ends.own:
        z[ends.own, AHEAD] = path - half * v
    x += path
    if not two:
        q, w = x, v_new
    return x, v_new, q, w


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


# --- an axis that follows its own log, for fits ----------------------------------------------------------------------
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
