"""The axis driven by its own log and held near the measurement: one compiled pass.

The equation of motion J a = u_eff - sum of torques is stepped with the drive as logged (held
over a sample) and corrected, after every sample, by the innovation e = y - y_hat: position by
``gain_1 e``, velocity by ``gain_2 e`` (a Luenberger observer, Luenberger 1971, IEEE TAC 16(6)).
So no controller need be known, the trajectory stays the measured one, and what the model lacks
stands in e: to first order e = [p^2 + l1 p + l2]^-1 (missing torque / J), l1 = gain_1/dt, l2 = gain_2/dt.
With ``reset_every`` > 0 the same pass is a free simulation restarted at that many samples.

Dry friction is exact in the step: a velocity that would change sign stops, and starts again
only if the push exceeds breakaway.
"""

from __future__ import annotations

import math

import numpy as np
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


@njit(cache=True, nogil=True)
def follow(inertia, timing, codes, q, u, y, dt, substeps, gain_1, gain_2, reset_every, th0, v0, twist0):
    """Predicted position y_hat, axis angle, velocity (n,) and twist of the coupling with its rate (n, 2).

    ``timing`` is the age of the drive in samples (0: the logged value acts from its sample on).  A restart takes
    angle and velocity on the encoder's side from ``th0``, ``v0`` and, where it has rows, twist and rate from
    ``twist0``.
    """
    n = u.size
    twists = np.zeros((n, 2))
    y_hat = np.empty(n)
    angle = np.empty(n)
    speed = np.empty(n)
    delay = timing
    lag = 0.0
    limit = math.inf
    width = 0.0
    gap = 0.0
    share = 0.0
    stiffness = 0.0
    damping = 0.0
    load_side = False
    two = False
    reach = 0.0
    folded = False
    for i in range(codes.size):
        c = codes[i]
        if c == INPUT_DELAY:
            delay += q[i, 0] / dt
        elif c == ACTUATOR_LAG:
            lag = q[i, 0]
        elif c == SATURATION:
            limit = q[i, 0]
        elif c == DEAD_ZONE:
            width = q[i, 0]
        elif c == PRESLIDING:
            reach = q[i, 1]
        elif c == RECTIFICATION:
            folded = q[i, 0] > 0.5
        elif c == BACKLASH or c == BACKLASH_LOAD:
            two = True
            gap = q[i, 0]
            share = q[i, 1]
            w = 2 * math.pi * q[i, 2]
            stiffness = inertia * share * (1 - share) * w * w
            damping = 2 * q[i, 3] * inertia * share * (1 - share) * w
            load_side = c == BACKLASH_LOAD
        elif c == FLEXIBLE or c == FLEXIBLE_LOAD:
            two = True
            stiffness = 1.0 / q[i, 0]
            share = q[i, 1]
            damping = 2 * q[i, 2] * math.sqrt(stiffness * inertia * share * (1 - share))
            load_side = c == FLEXIBLE_LOAD
    h = dt / substeps
    th = th0[0]
    v = v0[0]
    thl = th
    vl = v
    z = 0.0
    lagged = u[0]
    whole = math.floor(delay)
    part = delay - whole
    fade = math.exp(-h / lag) if lag > 0.0 else 0.0
    for k in range(n):
        t = k * dt
        if reset_every > 0 and k % reset_every == 0:
            side = -1.0 if folded and th < 0.0 else 1.0
            twist, slip = th - thl, v - vl
            if twist0.shape[0] > 0:
                twist, slip = twist0[k, 0], twist0[k, 1]
            th = side * th0[k] + (twist if load_side else 0.0)
            v = side * v0[k] + (slip if load_side else 0.0)
            thl = th - twist
            vl = v - slip
        y_hat[k] = sensor(codes, q, thl if load_side else th, t)
        angle[k] = th
        speed[k] = v
        twists[k, 0] = th - thl
        twists[k, 1] = v - vl
        if gain_1 > 0.0:
            e = y[k] - y_hat[k]
            if folded and th < 0.0:
                e = -e
            th += gain_1 * e
            v += gain_2 * e
            thl += gain_1 * e
            vl += gain_2 * e
        i0 = min(max(k - whole, 0), n - 1)
        i1 = min(max(k - whole - 1, 0), n - 1)
        held = (1.0 - part) * u[i0] + part * u[i1]
        if limit < math.inf:
            held = min(max(held, -limit), limit)
        if width > 0.0:
            held -= min(max(held, -width), width)
        for j in range(substeps):
            ue = held
            tj = t + j * h
            mass = inertia * (1.0 - share)
            for i in range(codes.size):
                if codes[i] == CHANGE_INERTIA and tj >= q[i, 1]:
                    mass += q[i, 0]
            if lag > 0.0:
                mean = ue + (lagged - ue) * (1.0 - fade) * lag / h
                lagged = ue + (lagged - ue) * fade
                ue = mean
            brake = 0.0
            if two:
                brake = contact(th - thl, v - vl, gap, stiffness, damping)
            if reach > 0.0:
                z += h * (v - abs(v) * z) / reach if abs(v) * h < reach else math.copysign(1.0, v) - z
                z = min(max(z, -1.0), 1.0)
            s = 1.0 if v > 0.0 else (-1.0 if v < 0.0 else 0.0)
            if s == 0.0:
                f = push(codes, q, th, 0.0, ue, tj, z) - brake
                if f > dry(codes, q, th, 0.0, ue, tj, 1.0):
                    s = 1.0
                elif -f > dry(codes, q, th, 0.0, ue, tj, -1.0):
                    s = -1.0
                else:
                    if two:
                        vlm = vl + 0.5 * h * brake / (inertia * share)
                        thlm = thl + 0.5 * h * vl
                        brake = contact(th - thlm, -vlm, gap, stiffness, damping)
                        thl += h * vlm
                        vl += h * brake / (inertia * share)
                    continue
            a = (push(codes, q, th, v, ue, tj, z) - brake - s * dry(codes, q, th, v, ue, tj, s)) / mass
            vm = v + 0.5 * h * a
            thm = th + 0.5 * h * v
            if two:  # both masses by the midpoint rule, so that a contact keeps its energy to second order
                vlm = vl + 0.5 * h * brake / (inertia * share)
                thlm = thl + 0.5 * h * vl
                brake = contact(thm - thlm, vm - vlm, gap, stiffness, damping)
                thl += h * vlm
                vl += h * brake / (inertia * share)
            a = (push(codes, q, thm, vm, ue, tj + 0.5 * h, z) - brake - s * dry(codes, q, thm, vm, ue, tj, s)) / mass
            new = v + h * a
            if new * s >= 0.0:
                th += 0.5 * h * (v + new)
                v = new
                continue
            past = h * v / (v - new) if v != 0.0 else 0.0
            th += 0.5 * past * v
            v = 0.0
            rest = h - past
            f = push(codes, q, th, 0.0, ue, tj, z) - brake
            if f > dry(codes, q, th, 0.0, ue, tj, 1.0):
                v = rest * (f - dry(codes, q, th, 0.0, ue, tj, 1.0)) / mass
            elif -f > dry(codes, q, th, 0.0, ue, tj, -1.0):
                v = rest * (f + dry(codes, q, th, 0.0, ue, tj, -1.0)) / mass
            th += 0.5 * rest * v
    return y_hat, angle, speed, twists
