"""The one pass along a record of an arm: encoders, controllers or logged drives, and fine steps of all joints.

Half a drift, a kick, half a drift, as for an axis (`whsklearn.systems._servo_step`); the kick solves for all joints at
once, linearly implicit in each joint's friction.  sign(v) is tanh(v / smoothing), and the torque that it multiplies is
divided by v rather than differentiated: a step can then bring a joint to rest but not throw it backwards.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from whsklearn._numba import borrowed, njit, part
from whsklearn.effects.equations import AHEAD, N_STATES, quantized, smooth_sign
from whsklearn.systems._arm_kernels import move, pay, room, weigh
from whsklearn.systems._servo_drive import DriveStage, chain_of, effective, held, hold_weights
from whsklearn.systems._servo_kernel import control, lattice_of
from whsklearn.systems._servo_torques import (
    AxisNumbers,
    Ends,
    added_inertia,
    advance_memories,
    arranged,
    load_sum,
    motor_sum,
    read,
)

N_SIGNALS = 4
DRIVE, MEASURED, POSITION, VELOCITY = range(N_SIGNALS)  # rows of a simulated record


class Axes(NamedTuple):
    """The effects along the axes, which are the n joints and sums of joints: rows of axis k from ``first[k]`` on.

    Up to ``first[k + 1]``, as in a servo's `AxisNumbers`.
    """

    codes: Any
    p: Any
    own: Any
    first: Any
    parts: Any  # of a servo axis (m, 12): limit, resolution, sharpness of sign(v)
    armature: Any
    direction: Any  # (m, n)


class PassInput(NamedTuple):
    """The input of a pass: sample time, fine steps per sample, whether the controllers write the drive, samples between
    returns to ``measured`` (2, n, n_samples; 0: none); ``reference`` (3, n, n_samples), ``feed`` (n, n_samples) added
    to the output of the controllers, ``noise`` (n, n_samples) of the encoders, ``controllers`` (n, 8).
    """

    sample_time: float
    substeps: int
    closed: bool
    every: int
    measured: Any
    reference: Any
    feed: Any
    noise: Any
    controllers: Any


@part
def solve(mass, right):
    """Solve the symmetric positive definite system in place by Cholesky factorisation; ``right`` (n,) becomes the
    solution.
    """
    n = right.size
    for i in range(n):
        for j in range(i + 1):
            total = mass[i, j]
            for k in range(j):
                total -= mass[i, k] * mass[j, k]
            mass[i, j] = math.sqrt(max(total, 1e-300)) if i == j else total / mass[j, j]
        for k in range(i):
            right[i] -= mass[i, k] * right[k]
        right[i] /= mass[i, i]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            right[i] -= mass[k, i] * right[k]
        right[i] /= mass[i, i]


@part
def torque_at(codes, p, own, e, z, t, q, v, s, ds, u):
    """Torque of a joint's effects for this sign of its velocity, and its slope; one function, so it is compiled
    once.
    """
    return motor_sum(codes, p, own, e, z, t, q, v, s, ds, u)


@part
def ends_of(ends, j):
    """Row j of ``ends`` in the form that the sums over effects take."""
    return Ends(ends[j, 0], ends[j, 1], ends[j, 2], ends[j, 3], ends[j, 4], ends[j, 5])


@part
def along(direction, x):
    """The component of x (n,) along an axis."""
    total = 0.0
    for j in range(x.size):
        total += direction[j] * x[j]
    return total


@part
def fine_step(links, inertial, axes, ends, z, state, u, t, h, space):
    """Move ``state`` (2, n) by h under the drives u (n,); ``space`` holds a `Work`, rest, right and mass."""
    work, rest, right, mass = space
    q, v = state
    for j in range(rest.size):
        q[j] += 0.5 * h * v[j]
    move(links, q, v, rest, work)
    right[:] = 0.0
    pay(links, inertial, work, right)
    weigh(links, inertial, work, mass)
    middle = t + 0.5 * h
    for j in range(rest.size):
        right[j] = u[j] - right[j]
    for k in range(axes.armature.size):
        d = axes.direction[k]
        x, speed, drive = along(d, q), along(d, v), along(d, u)
        part_of = slice(axes.first[k], axes.first[k + 1])
        codes, p, zk, e = axes.codes[part_of], axes.p[part_of], z[part_of], ends_of(ends, k)
        if e.memory > e.own:
            advance_memories(codes, p, e, zk, 0.5 * h * speed, speed)
        sharp = axes.parts[k, 1]
        s, ds = smooth_sign(speed, sharp)
        smooth, at_rest = torque_at(codes, p, axes.own, e, zk, middle, x, speed, 0.0, 0.0, drive)
        whole, slope = torque_at(codes, p, axes.own, e, zk, middle, x, speed, s, ds, drive)
        if abs(speed) * sharp > 1e-6:
            slope = at_rest + max((whole - smooth) / speed, 0.0)
        paid = whole + load_sum(codes, p, e, middle, x, speed)
        own = 0.0
        for i in range(rest.size):
            right[i] -= d[i] * paid
            own += d[i] * d[i] * mass[i, i]
        added = axes.armature[k] + added_inertia(p, e, middle)
        give = h * max(slope, 0.0)
        added += 0.5 * give if give < 0.5 * (own + added) else give
        for i in range(rest.size):
            for j in range(rest.size):
                mass[i, j] += added * d[i] * d[j]
    solve(mass, right)
    for j in range(rest.size):
        v[j] += h * right[j]
        q[j] += 0.5 * h * v[j]
    for k in range(axes.armature.size):
        if axes.first[k + 1] > axes.first[k] and ends[k, 2] > ends[k, 1]:
            z[axes.first[k] + ends[k, 1], AHEAD] = 0.5 * h * along(axes.direction[k], v)


@njit(nogil=True, error_model="numpy")
def run(out, links, inertial, axes, course, state):
    """Fill ``out`` (4, n, n_samples) with drive, measured and true position, velocity, from ``state`` (2, n).

    In open loop row 0 of ``out`` is the drive as logged.
    """
    n, dt, substeps = links.parent.size, course.sample_time, course.substeps
    space = room(n), np.zeros(n), np.zeros(n), np.zeros((n, n))
    m = axes.armature.size
    ends = np.zeros((m, 6), dtype=np.int64)
    chain, lag, memory = np.zeros((n, 5)), np.zeros((n, 2)), np.zeros((n, 3))
    lattice, u = np.zeros(n), np.zeros(n)
    first = np.zeros((n, substeps), dtype=np.int64)
    weight = np.zeros((n, substeps))
    z = np.zeros((axes.codes.size + 1, N_STATES + 1))
    for j in range(m):
        rows = slice(axes.first[j], axes.first[j + 1])
        if j < n:  # the drive acts at joints alone
            plant = AxisNumbers(axes.codes[rows], axes.p[rows], axes.parts[j], axes.own)
            c = chain_of(plant)
            lattice[j] = lattice_of(plant)[0]
            chain[j, 0], chain[j, 1], chain[j, 2], chain[j, 3], chain[j, 4] = c
            first[j], weight[j] = hold_weights(c.delay / dt, substeps, False)
            lag[j] = 0.0 if course.closed else out[DRIVE, j, 0]
        codes, p, e = arranged(axes.codes[rows], axes.p[rows])
        ends[j, 0], ends[j, 1], ends[j, 2], ends[j, 3], ends[j, 4], ends[j, 5] = e
        axes.codes[axes.first[j] : axes.first[j] + codes.size] = codes
        axes.p[axes.first[j] : axes.first[j] + codes.size] = p
    prepared = ends, chain, lag, memory, lattice, u, first, weight, z
    _pass(out, links, inertial, axes, course, state, space, prepared)


@part
def _pass(out, links, inertial, axes, course, state, space, prepared):
    """The pass itself, on borrowed arrays whose owners live in `run`."""
    out, links, inertial, axes, course, state, space = borrowed((out, links, inertial, axes, course, state, space))
    ends, chain, lag, memory, lattice, u, first, weight, z = borrowed(prepared)
    n, dt, substeps = links.parent.size, course.sample_time, course.substeps
    h = dt / substeps
    for k in range(out.shape[2]):
        t = k * dt
        if course.every > 0 and k % course.every == 0:
            state[0], state[1] = course.measured[0, :, k], course.measured[1, :, k]
        for j in range(n):
            rows = slice(axes.first[j], axes.first[j + 1])
            y = read(axes.codes[rows], axes.p[rows], axes.own, ends_of(ends, j), t, state[0, j])
            if course.noise.size > 0:
                y += course.noise[j, k]
            if lattice[j] > 0.0:
                y = quantized(lattice[j], y)
            if course.closed:
                asked = control(course.controllers[j], memory[j], course.reference[:, j], k, y, dt)
                out[DRIVE, j, k] = asked + course.feed[j, k]
            out[MEASURED, j, k], out[POSITION, j, k], out[VELOCITY, j, k] = y, state[0, j], state[1, j]
        for i in range(substeps):
            for j in range(n):
                before = 0.0 if course.closed else out[DRIVE, j, 0]
                asked = held(out[DRIVE, j], k + first[j, i], weight[j, i], before)
                c = DriveStage(chain[j, 0], chain[j, 1], chain[j, 2], chain[j, 3], chain[j, 4])
                u[j], lag[j, 0], lag[j, 1] = effective(c, asked, lag[j, 0], lag[j, 1], h)
            fine_step(links, inertial, axes, ends, z, state, u, t + i * h, h, space)
