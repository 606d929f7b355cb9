"""One fine step of the axis.

Half a drift, a kick, half a drift (second order).  The kick is a linearly implicit
midpoint step, so that a steep friction curve stays stable, and dry friction is resolved
as the set-valued law it is: when the velocity would change sign within the step, the instant is located, the resisting
torque just off rest in either direction is compared with the driving torque, and the remainder of the step is either
standstill or motion.  No threshold velocity is needed, standstill is exactly zero velocity, and the step cannot
chatter.  It evaluates the torques once per step, where an explicit midpoint rule takes two.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from whsklearn._numba import njit, part
from whsklearn.effects import codes
from whsklearn.effects.equations import AHEAD, smooth_sign
from whsklearn.effects.transmission import contact_damping, contact_stiffness, coupling_torque
from whsklearn.systems._servo_torques import (
    GAP,
    INERTIA,
    KAPPA,
    RATIO,
    SHARE,
    STIFFNESS,
    added_inertia,
    advance_memories,
    load_sum,
    motor_sum,
)


class Body(NamedTuple):
    """Inertia (kg m2), the load's share of it (0: rigid), stiffness, damping and play of the coupling, kappa."""

    inertia: Any
    share: Any
    stiffness: Any
    damping: Any
    gap: Any
    kappa: Any


@part
def body_of(plant):
    """The inertias and the coupling between them, from the parts and the effects of the transmission."""
    parts = plant.parts
    inertia, share, ratio, gap = parts[INERTIA], parts[SHARE], parts[RATIO], parts[GAP]
    compliance = 1.0 / parts[STIFFNESS] if parts[STIFFNESS] > 0.0 else 0.0
    contact_ratio, frequency = 0.0, 0.0
    for i in range(plant.codes.size):
        code = plant.codes[i]
        if code == codes.BACKLASH or code == codes.FLEXIBLE_COUPLING:
            if share == 0.0:
                share = plant.p[i, 1]
            if code == codes.BACKLASH:
                gap += plant.p[i, 0]
                if frequency == 0.0:
                    frequency, contact_ratio = plant.p[i, 2], plant.p[i, 3]
            else:
                compliance += plant.p[i, 0]
                ratio = plant.p[i, 2]
    if share == 0.0:
        return Body(inertia, 0.0, 0.0, 0.0, 0.0, parts[KAPPA])
    reduced = inertia * share * (1.0 - share)
    if compliance > 0.0:
        stiffness = 1.0 / compliance
    else:
        stiffness, ratio = contact_stiffness(frequency, reduced), contact_ratio
    return Body(inertia, share, stiffness, contact_damping(ratio, stiffness, reduced), gap, parts[KAPPA])


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
def off_rest(effects, p, own, ends, z, t, q, u):
    """Torque on the motor's side just off rest, forwards and backwards, and its slope."""
    forwards, slope = motor_sum(effects, p, own, ends, z, t, q, 0.0, 1.0, 0.0, u)
    backwards, _ = motor_sum(effects, p, own, ends, z, t, q, 0.0, -1.0, 0.0, u)
    return forwards, backwards, slope


@njit(cache=False, forceinline=True, error_model="numpy")
def fine_step(effects, p, own, ends, z, body, state, u, t, h):
    """Positions and velocities (motor, motor, load, load) after h under the torque u."""
    x, v, q, w = state
    half = 0.5 * h
    middle = t + half
    two = body.share > 0.0
    sharp = body.kappa == math.inf
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
        q += half * (w + w_new)
        w = w_new
        pull -= coupling
        inertia = motor
    else:
        pull -= load
        inertia += added
    v_new = 0.0 if at_rest else v + h * (pull - f) / inertia / implicit_gain(slope, inertia, h)
    path = half * (v + v_new)
    if at_rest or (sharp and v_new * s <= 0.0):
        forwards, backwards, slope = off_rest(effects, p, own, ends, z, middle, x_mid, u)
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
