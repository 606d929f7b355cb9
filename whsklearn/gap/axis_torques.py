"""The effects of an axis as compiled torques: which there are by number, and what each does at an instant.

A term is a code and up to `N_SLOTS` numbers; where an effect has two linear numbers, they are the
amplitudes of a cosine and a sine.
"""

from __future__ import annotations

import math

from numba import njit

N_SLOTS = 4  # numbers an effect

(
    VISCOUS, COULOMB, ASYMMETRIC_COULOMB, ASYMMETRIC_VISCOUS, STRIBECK, QUADRATIC_DRAG, LOAD_FRICTION,
    POSITION_FRICTION, PRESLIDING, FRICTION_DRIFT, INPUT_OFFSET, DEAD_ZONE, SATURATION, INPUT_DELAY, ACTUATOR_LAG,
    TORQUE_RIPPLE, BACKLASH, FLEXIBLE, COGGING, GRAVITY, SPRING, HARDENING, END_STOP, OUTPUT_DRIFT, RECTIFICATION,
    ECCENTRICITY, TONE, CHANGE_INERTIA, CHANGE_VISCOUS, CHANGE_COULOMB, CHANGE_GAIN, BACKLASH_LOAD, FLEXIBLE_LOAD,
    OUTPUT_OFFSET,
) = range(34)  # fmt: skip


@njit(cache=True, nogil=True)
def push(codes, q, th, v, u, t, z):
    """Torque on the first mass but for dry friction, and the factor on the drive is inside."""
    f = u
    for i in range(codes.size):
        c = codes[i]
        if c == VISCOUS:
            f -= q[i, 0] * v
        elif c == COGGING:
            f -= q[i, 0] * math.cos(q[i, 2] * th) + q[i, 1] * math.sin(q[i, 2] * th)
        elif c == GRAVITY:
            f -= q[i, 0] * math.cos(th) + q[i, 1] * math.sin(th)
        elif c == INPUT_OFFSET:
            f -= q[i, 0]
        elif c == ASYMMETRIC_VISCOUS:
            f -= q[i, 0] * abs(v)
        elif c == QUADRATIC_DRAG:
            f -= q[i, 0] * v * abs(v)
        elif c == TORQUE_RIPPLE:
            f -= u * (q[i, 0] * math.cos(q[i, 2] * th) + q[i, 1] * math.sin(q[i, 2] * th))
        elif c == SPRING:
            f -= q[i, 0] * (th - q[i, 1])
        elif c == HARDENING:
            f -= q[i, 0] * (th - q[i, 1]) ** 3
        elif c == END_STOP:
            if abs(th) > q[i, 1]:
                f -= q[i, 0] * (th - math.copysign(q[i, 1], th))
        elif c == TONE:
            f -= q[i, 0] * math.cos(2 * math.pi * q[i, 2] * t) + q[i, 1] * math.sin(2 * math.pi * q[i, 2] * t)
        elif c == PRESLIDING:
            f -= q[i, 0] * z
        elif c == CHANGE_VISCOUS:
            if t >= q[i, 1]:
                f -= q[i, 0] * v
        elif c == CHANGE_GAIN:
            if t >= q[i, 1]:
                f += q[i, 0] * u
    return f


@njit(cache=True, nogil=True)
def dry(codes, q, th, v, u, t, s):
    """Braking torque in the direction s = +-1, the part that jumps at rest."""
    f = 0.0
    for i in range(codes.size):
        c = codes[i]
        if c == COULOMB:
            f += q[i, 0]
        elif c == ASYMMETRIC_COULOMB:
            f += s * q[i, 0]
        elif c == STRIBECK:
            f += q[i, 0] * math.exp(-((abs(v) / q[i, 1]) ** q[i, 2]))
        elif c == LOAD_FRICTION:
            f += q[i, 0] * abs(u)
        elif c == POSITION_FRICTION:
            f += q[i, 0] * math.cos(q[i, 2] * th) + q[i, 1] * math.sin(q[i, 2] * th)
        elif c == FRICTION_DRIFT:
            f += q[i, 0] * (1.0 - math.exp(-t / q[i, 1]))
        elif c == CHANGE_COULOMB:
            if t >= q[i, 1]:
                f += q[i, 0]
    return f


@njit(cache=True, nogil=True)
def sensor(codes, q, th, t):
    """What the encoder shows at the angle th."""
    y = th
    for i in range(codes.size):
        c = codes[i]
        if c == ECCENTRICITY:
            y += q[i, 0] * math.cos(q[i, 2] * th) + q[i, 1] * math.sin(q[i, 2] * th)
        elif c == OUTPUT_DRIFT:
            y += q[i, 0] * t
        elif c == OUTPUT_OFFSET:
            y += q[i, 0]
        elif c == RECTIFICATION:
            y = (1.0 - q[i, 0]) * y + q[i, 0] * abs(y)
    return y


@njit(cache=True, nogil=True)
def contact(twist, slip, gap, stiffness, damping):
    """Torque through a coupling with play: none within ``gap``, never pulling beyond it."""
    over = abs(twist) - 0.5 * gap
    if over <= 0.0 and gap > 0.0:
        return 0.0
    if gap <= 0.0:
        return stiffness * twist + damping * slip
    f = math.copysign(stiffness * over, twist) + damping * slip
    return f if f * twist > 0.0 else 0.0
