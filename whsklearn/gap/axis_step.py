"""One fine step of an axis: dry friction is exact in it, both masses go by the midpoint rule.

A velocity that would change sign stops, and starts again only if the push exceeds breakaway.
"""

from __future__ import annotations

import math

from numba import njit

from whsklearn.gap.axis_torques import (
    BACKLASH,
    BACKLASH_LOAD,
    CHANGE_INERTIA,
    FLEXIBLE,
    FLEXIBLE_LOAD,
    contact,
    dry,
    push,
)


@njit(cache=True, nogil=True)
def coupling_of(codes, q, inertia):
    """Whether there is a coupling; its load's share of the inertia, gap, stiffness, damping; encoder on the load."""
    two, load_side, share, gap, stiffness, damping = False, False, 0.0, 0.0, 0.0, 0.0
    for i in range(codes.size):
        c = codes[i]
        if c == BACKLASH or c == BACKLASH_LOAD:
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
    return two, share, gap, stiffness, damping, load_side


@njit(cache=True, nogil=True, forceinline=True)
def step(codes, q, inertia, coupling, reach, h, t, u, th, v, thl, vl, z):
    """Angle and velocity of both masses and deflection of the bristles after the time ``h`` at the drive ``u``."""
    two, share, gap, stiffness, damping, _ = coupling
    mass = _mass(codes, q, inertia * (1.0 - share), t)
    brake = contact(th - thl, v - vl, gap, stiffness, damping) if two else 0.0
    if reach > 0.0:
        z += h * (v - abs(v) * z) / reach if abs(v) * h < reach else math.copysign(1.0, v) - z
        z = min(max(z, -1.0), 1.0)
    s = 1.0 if v > 0.0 else (-1.0 if v < 0.0 else 0.0)
    if s == 0.0:
        s = _breakaway(codes, q, push(codes, q, th, 0.0, u, t, z) - brake, th, u, t)
        if s == 0.0:
            if two:
                thl, vl, brake = _move_load(coupling, inertia, h, brake, th, 0.0, thl, vl)
            return th, v, thl, vl, z
    a = (push(codes, q, th, v, u, t, z) - brake - s * dry(codes, q, th, v, u, t, s)) / mass
    vm = v + 0.5 * h * a
    thm = th + 0.5 * h * v
    if two:
        thl, vl, brake = _move_load(coupling, inertia, h, brake, thm, vm, thl, vl)
    a = (push(codes, q, thm, vm, u, t + 0.5 * h, z) - brake - s * dry(codes, q, thm, vm, u, t, s)) / mass
    new = v + h * a
    if new * s >= 0.0:
        th += 0.5 * h * (v + new)
        return th, new, thl, vl, z
    past = h * v / (v - new) if v != 0.0 else 0.0
    th += 0.5 * past * v
    th, v = _start_again(codes, q, mass, brake, h - past, th, u, t, z)
    return th, v, thl, vl, z


@njit(cache=True, nogil=True, forceinline=True)
def _mass(codes, q, mass, t):
    """Inertia of the first mass at the time t."""
    for i in range(codes.size):
        if codes[i] == CHANGE_INERTIA and t >= q[i, 1]:
            mass += q[i, 0]
    return mass


@njit(cache=True, nogil=True)
def _breakaway(codes, q, f, th, u, t):
    """Direction in which the push f sets a resting axis going; 0 where friction holds it."""
    if f > dry(codes, q, th, 0.0, u, t, 1.0):
        return 1.0
    if -f > dry(codes, q, th, 0.0, u, t, -1.0):
        return -1.0
    return 0.0


@njit(cache=True, nogil=True, forceinline=True)
def _move_load(coupling, inertia, h, brake, th_mid, v_mid, thl, vl):
    """Take the second mass a step on; also the contact's torque at the middle, so that it keeps its energy."""
    _, share, gap, stiffness, damping, _ = coupling
    vlm = vl + 0.5 * h * brake / (inertia * share)
    thlm = thl + 0.5 * h * vl
    brake = contact(th_mid - thlm, v_mid - vlm, gap, stiffness, damping)
    return thl + h * vlm, vl + h * brake / (inertia * share), brake


@njit(cache=True, nogil=True)
def _start_again(codes, q, mass, brake, rest, th, u, t, z):
    """What follows a stop within a step, for the ``rest`` of its time."""
    f = push(codes, q, th, 0.0, u, t, z) - brake
    s = _breakaway(codes, q, f, th, u, t)
    v = rest * (f - s * dry(codes, q, th, 0.0, u, t, s)) / mass if s != 0.0 else 0.0
    return th + 0.5 * rest * v, v
