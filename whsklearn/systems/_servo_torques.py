"""What acts on the axis at one instant, as compiled scalar functions.

Dry friction is kept apart from the rest, because at standstill it is no function but a
range: friction lies between -(dry - asymmetric) and dry + asymmetric.
"""

from __future__ import annotations

import math

from numba import njit, types

from whsklearn.effects import codes, terms
from whsklearn.effects.hysteresis import hysteresis_torque
from whsklearn.effects.terms import term

BARELY = 1e-9  # the speed at which "just off standstill" is read off a dry term

USER_SIGNATURE = types.float64(
    types.int64, types.float64[::1], types.float64, types.float64, types.float64, types.float64
)


@njit(USER_SIGNATURE, cache=True)
def no_user_effect(index, p, time, position, velocity, drive):
    """The slot for effects of one's own when there is none."""
    return 0.0


@njit
def static_torque(code, p, i, x, v):
    """A static term's share of: smooth torque, its slope, dry level, its slope, asymmetric level."""
    w = p[i, 0]
    if code == terms.COULOMB:
        return 0.0, 0.0, w, 0.0, 0.0
    if code == terms.ASYMMETRIC_COULOMB:
        return 0.0, 0.0, 0.0, 0.0, w
    if code == terms.STRIBECK_EXP or code == terms.POSITION_FRICTION:
        f, _, slope = term(code, p[i, 1], p[i, 2], p[i, 3], x, abs(v) + BARELY, math.inf)
        return 0.0, 0.0, w * f, w * slope, 0.0
    f, _, slope = term(code, p[i, 1], p[i, 2], p[i, 3], x, v, math.inf)
    return w * f, w * slope, 0.0, 0.0, 0.0


@njit
def motor_torque(code, p, z, i, x, v, u, t, user):
    """The same five shares of an effect on the motor's side that is no static term."""
    w = p[i, 0]
    if code == codes.COGGING:
        return w * math.cos(p[i, 1] * x + p[i, 2]), 0.0, 0.0, 0.0, 0.0
    if code == codes.INPUT_OFFSET:
        return w, 0.0, 0.0, 0.0, 0.0
    if code == codes.TORQUE_RIPPLE:
        return u * w * math.cos(p[i, 1] * x + p[i, 2]), 0.0, 0.0, 0.0, 0.0
    if code == codes.LOAD_FRICTION:
        return 0.0, 0.0, w * abs(u), 0.0, 0.0
    if code == codes.FRICTION_DRIFT:
        return 0.0, 0.0, w * (1.0 - math.exp(-t / p[i, 1])), 0.0, 0.0
    if codes.DAHL <= code <= codes.BOUC_WEN:
        f, slope = hysteresis_torque(code, p, z, i, v)
        return w * f, w * slope, 0.0, 0.0, 0.0
    if code == codes.USER_TORQUE:
        f = user(int(p[i, 7]), p[i], t, x, v, u)
        step = 1e-6 * (1.0 + abs(v))
        return f, (user(int(p[i, 7]), p[i], t, x, v + step, u) - f) / step, 0.0, 0.0, 0.0
    if codes.CHANGE_VISCOUS <= code <= codes.CHANGE_GAIN and t > p[i, 1]:
        if code == codes.CHANGE_VISCOUS:
            return w * v, w, 0.0, 0.0, 0.0
        if code == codes.CHANGE_COULOMB:
            return 0.0, 0.0, w, 0.0, 0.0
        return -w * u, 0.0, 0.0, 0.0, 0.0
    return 0.0, 0.0, 0.0, 0.0, 0.0


@njit
def load_torque(code, p, i, q, t):
    """An effect on the load's side: a function of the load's position and of time."""
    w = p[i, 0]
    if code == codes.GRAVITY_IMBALANCE:
        return w * math.cos(q + p[i, 1])
    if code == codes.CABLE_SPRING:
        return w * (q - p[i, 1])
    if code == codes.HARDENING_SPRING:
        return w * (q - p[i, 1]) ** 3
    if code == codes.END_STOP:
        if q > p[i, 1]:
            return w * (q - p[i, 1])
        return w * (q + p[i, 1]) if q < -p[i, 1] else 0.0
    if code == codes.DISTURBANCE_TONE:
        return w * math.cos(2.0 * math.pi * p[i, 1] * t + p[i, 2])
    return 0.0


@njit
def all_torques(effects, p, z, x, q, v, u, t, user):
    """Sums over all effects: smooth, slope, dry, dry slope, asymmetric, load, added inertia."""
    smooth = slope = dry = dry_slope = asymmetric = load = inertia = 0.0
    for i in range(effects.size):
        code = effects[i]
        if code == codes.CHANGE_INERTIA:
            inertia += p[i, 0] if t > p[i, 1] else 0.0
        elif codes.GRAVITY_IMBALANCE <= code <= codes.END_STOP or code == codes.DISTURBANCE_TONE:
            load += load_torque(code, p, i, q, t)
        else:
            if code < 100:
                a, b, c, d, e = static_torque(code, p, i, x, v)
            else:
                a, b, c, d, e = motor_torque(code, p, z, i, x, v, u, t, user)
            smooth += a
            slope += b
            dry += c
            dry_slope += d
            asymmetric += e
    return smooth, slope, dry, dry_slope, asymmetric, load, inertia


@njit
def measured_position(effects, p, x, t, user):
    """The sensor's reading before noise and lattice, and the coarsest lattice step."""
    y = x
    step = 0.0
    for i in range(effects.size):
        code = effects[i]
        w = p[i, 0]
        if code == codes.OUTPUT_OFFSET:
            y += w
        elif code == codes.OUTPUT_DRIFT:
            y += w * t
        elif code == codes.SENSOR_RECTIFICATION:
            y += w * (abs(x) - x)
        elif code == codes.ENCODER_ECCENTRICITY:
            y += w * math.cos(p[i, 1] * x + p[i, 2])
        elif code == codes.USER_OUTPUT:
            y += user(int(p[i, 7]), p[i], t, x, 0.0, 0.0)
        elif code == codes.QUANTIZATION:
            step = max(step, w)
    return y, step
