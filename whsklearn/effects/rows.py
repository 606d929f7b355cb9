"""Effects by their code: the drive that a row of numbers takes, or what it adds to the reading, at one instant.

This is the only place that maps a code to an equation; integrators, the chain, regressor columns and screenings call
it.  A row is `Effect.row`: the size and then the shape,
or for a phased effect its cosine and sine weight and then the shape.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from whsklearn._numba import borrowed, njit, part
from whsklearn.effects import codes, equations


# --- the static terms of a law: value and derivatives ----------------------------------------------------------------
# Auxiliary models and sensitivity filters call `term`, the simulators `directed_term`.
@part
def directed_term(code, s0, s1, s2, x, dx, s, ds):
    """Value of a term and its derivatives by x and by dx, with s and ds for sign(dx) and its slope."""
    if code == codes.VISCOUS:
        return equations.viscous(dx)
    if code == codes.COULOMB:
        return equations.coulomb(s, ds)
    if code == codes.ASYMMETRIC_COULOMB:
        return equations.asymmetric_coulomb(s, ds)
    if code == codes.ASYMMETRIC_VISCOUS:
        return equations.asymmetric_viscous(dx, s, ds)
    if code == codes.STRIBECK_EXP:
        return equations.stribeck(s0, s1, dx, s, ds)
    if code == codes.POSITION_FRICTION:
        return equations.position_friction(math.cos(s1), -math.sin(s1), s0, x, s, ds)
    if code == codes.TANH:
        return equations.smooth_coulomb(s0, dx)
    if code == codes.TANH_DIFFERENCE:
        return equations.smooth_stribeck(s0, s1, dx)
    if code == codes.STRIBECK_TANH:
        return equations.reduced_stribeck(s0, dx)
    if code == codes.QUADRATIC_DRAG:
        return equations.quadratic_drag(dx)
    if code == codes.POWER:
        return equations.power(s0, x)
    if code == codes.HINGE:
        return equations.hinge(s0, x)
    if code == codes.NATURAL_SPLINE:
        return equations.natural_spline(s0, s1, s2, x)
    if code == codes.SPEED_HINGE:
        return equations.speed_hinge(s0, dx)
    return 1.0, 0.0, 0.0


@njit(cache=False, error_model="numpy", forceinline=True)
def term(code, s0, s1, s2, x, dx, kappa):
    """Value of a term and its derivatives by x and by dx, where sign(dx) has the sharpness kappa."""
    if codes.COULOMB <= code <= codes.POSITION_FRICTION:
        s, ds = equations.smooth_sign(dx, kappa)
    else:
        s, ds = 0.0, 0.0
    return directed_term(code, s0, s1, s2, x, dx, s, ds)


def law_values(
    law: NDArray[np.int64], shapes: NDArray[np.float64], x: NDArray[np.float64], dx: NDArray[np.float64], kappa: float
) -> NDArray[np.float64]:
    """The values of each term of a ``law``, given by its codes, along a record, at weight one; shape (K, n)."""
    out = np.empty((law.size, x.size))
    _law_values(out, law, shapes, x, dx, kappa)
    return out


@njit(error_model="numpy", counted=False, short=True)
def _law_values(out, law, shapes, x, dx, kappa):
    for k in range(law.size):
        for i in range(x.size):
            out[k, i] = term(law[k], shapes[k, 0], shapes[k, 1], shapes[k, 2], x[i], dx[i], kappa)[0]


# --- all effects: torque or reading of a row -------------------------------------------------------------------------
@njit(cache=False, forceinline=True, error_model="numpy")
def motor_torque(code, p, i, t, q, v, s, ds, u):
    """Torque of row i that acts on the motor's side (Nm), and its slope by velocity.

    ``s`` is sign(v) and ``ds`` its slope: +1 or -1 in motion, either of them just off rest.
    Effects on the drive before the motor (dead zone, saturation, timing) are not torques here.
    """
    w = p[i, 0]
    if code == codes.VISCOUS:  # the two that every axis has come first and need no call
        value, _, slope = equations.viscous(v)
        return w * value, w * slope
    if code == codes.COULOMB:
        value, _, slope = equations.coulomb(s, ds)
        return w * value, w * slope
    if code == codes.POSITION_FRICTION:
        value, _, slope = equations.position_friction(w, p[i, 1], p[i, 2], q, s, ds)
        return value, slope
    if code <= codes.SPEED_HINGE:
        value, _, slope = directed_term(code, p[i, 1], p[i, 2], p[i, 3], q, v, s, ds)
        return w * value, w * slope
    if code == codes.COGGING:
        return equations.wave(w, p[i, 1], p[i, 2] * q), 0.0
    if code == codes.INPUT_OFFSET:
        return w, 0.0
    if code == codes.LOAD_FRICTION:
        value, slope = equations.load_friction(u, s, ds)
        return w * value, w * slope
    if code == codes.FRICTION_DRIFT:
        value, slope = equations.friction_drift(p[i, 1], t, s, ds)
        return w * value, w * slope
    if code == codes.TORQUE_RIPPLE:
        return equations.torque_ripple(w, p[i, 1], p[i, 2], q, u), 0.0
    if code == codes.CHANGE_VISCOUS:
        return equations.parameter_change(w, p[i, 1], t, v), equations.parameter_change(w, p[i, 1], t, 1.0)
    if code == codes.CHANGE_COULOMB:
        return equations.parameter_change(w, p[i, 1], t, s), equations.parameter_change(w, p[i, 1], t, ds)
    if code == codes.CHANGE_GAIN:
        return equations.parameter_change(w, p[i, 1], t, -u), 0.0
    if codes.LEARNED_POSITION <= code <= codes.LEARNED_DRIVE:
        value, slope = equations.learned_torque(code, p[i, 1], p[i, 2], p[i, 3], q, v, s, ds, u)
        return w * value, w * slope
    return 0.0, 0.0


@part
def load_torque(code, p, i, t, q, v):
    """Torque of row i that acts on the load's side (Nm), a function of the load's motion and of time."""
    w = p[i, 0]
    if code == codes.GRAVITY_IMBALANCE:
        return equations.wave(w, p[i, 1], q)
    if code == codes.CABLE_SPRING:
        return equations.cable_spring(w, p[i, 1], q)
    if code == codes.HARDENING_SPRING:
        return equations.hardening_spring(w, p[i, 1], q)
    if code == codes.END_STOP:
        return equations.end_stop(w, abs(p[i, 1]), p[i, 2], 1.0 if q > p[i, 3] else -1.0, q - p[i, 3], v)
    if code == codes.END_STOP_UPPER:
        return equations.end_stop(w, p[i, 1], p[i, 2], 1.0, q - p[i, 3], v)
    if code == codes.END_STOP_LOWER:
        return equations.end_stop(w, -p[i, 1], p[i, 2], -1.0, q - p[i, 3], v)
    if code == codes.DISTURBANCE_TONE:
        return equations.disturbance_tone(w, p[i, 1], p[i, 2], t)
    if code == codes.LOAD_VISCOUS:
        return w * v
    return 0.0


@part
def reading(code, p, i, t, q):
    """The contribution of row i to the reading of the position q (rad); of quantization, the rounding error."""
    w = p[i, 0]
    if code == codes.OUTPUT_OFFSET:
        return w
    if code == codes.OUTPUT_DRIFT:
        return equations.output_drift(w, t)
    if code == codes.SENSOR_RECTIFICATION:
        return equations.sensor_rectification(w, q)
    if code == codes.ENCODER_ECCENTRICITY:
        return equations.wave(w, p[i, 1], p[i, 2] * q)
    if code == codes.QUANTIZATION:
        return equations.quantized(w, q) - q
    return 0.0


@part
def on_load(code):
    """Whether a code is a torque on the load's side."""
    return codes.GRAVITY_IMBALANCE <= code <= codes.LOAD_VISCOUS


@part
def has_memory(code):
    """Whether a code is a torque with a memory of the path."""
    return codes.DAHL <= code <= codes.BOUC_WEN


@njit(nogil=True, error_model="numpy")
def values_along(code, p, time, position, velocity, acceleration, drive, kappa):
    """Any built-in effect along a record: the drive that it takes (Nm), or its contribution to the reading (rad).

    ``p`` has shape (1, 8); every signal has shape (n,).  sign(v) has the sharpness ``kappa``.
    """
    out = np.empty(position.size)
    _fill(out, np.zeros((1, equations.N_STATES)), code, p, time, position, velocity, acceleration, drive, kappa)
    return out


@part
def _fill(out, z, code, p, time, position, velocity, acceleration, drive, kappa):
    """``values_along``, on borrowed arrays whose owners live there."""
    out, z, p, time, position, velocity = borrowed((out, z, p, time, position, velocity))
    acceleration, drive = borrowed((acceleration, drive))
    for k in range(position.size):
        t, q, v, u = time[k], position[k], velocity[k], drive[k]
        if has_memory(code):
            if k > 0:
                equations.advance_hysteresis(code, p, z, 0, q - position[k - 1], v)
            out[k] = p[0, 0] * equations.hysteresis_torque(code, p, z, 0, v)[0]
        elif on_load(code):
            out[k] = load_torque(code, p, 0, t, q, v)
        elif code == codes.DEAD_ZONE:
            out[k] = equations.dead_zone(p[0, 0], u)
        elif code == codes.SATURATION:
            out[k] = equations.saturation(p[0, 0], u)
        elif code == codes.CHANGE_INERTIA:
            out[k] = equations.parameter_change(p[0, 0], p[0, 1], t, acceleration[k])
        elif codes.OUTPUT_OFFSET <= code <= codes.QUANTIZATION:
            out[k] = reading(code, p, 0, t, q)
        else:
            s, ds = equations.smooth_sign(v, kappa)
            out[k] = motor_torque(code, p, 0, t, q, v, s, ds, u)[0]
