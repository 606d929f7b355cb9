"""Rigid-body dynamics of a tree of joints as compiled loops: regressor, inverse dynamics, mass matrix.

Frame k turns (or slides) with joint k.  In it the link behind the joint moves with angular velocity o, angular
acceleration b and, at the frame's origin, acceleration c, from which gravity is taken off.  Joint j, which carries
link k, moves that origin by l and turns it by w per unit of its rate: column j of the link's Jacobian. The link
contributes to the drive of joint j (Atkeson, An and Hollerbach 1986; Siciliano et al. 2009, sec. 7.3)

    l . (m c + b x h + o x (o x h)) + w . (h x c + I b + o x I o),      h = m r, I about the origin,

which is linear in the ten numbers m, h_x, h_y, h_z, I_xx, I_xy, I_yy, I_xz, I_yz, I_zz.  `link_row` holds its ten
factors; everything else here only evaluates them along another motion.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from whsklearn._numba import borrowed, njit, part
from whsklearn.effects.equations import AHEAD, N_STATES, quantized, smooth_sign
from whsklearn.systems._servo_kernel import (
    AxisNumbers,
    DriveStage,
    Ends,
    added_inertia,
    advance_memories,
    arranged,
    body_of,
    chain_of,
    control,
    effective,
    held,
    hold_weights,
    lattice_of,
    load_sum,
    motor_sum,
    read,
)

N_BODY = 10  # numbers of a link
N_MOTION = 9  # of a frame: angular velocity, angular acceleration, acceleration


class Links(NamedTuple):
    """The geometry of an arm with n joints.

    ``parent`` (n,): the joint before, -1 for the base; ``slides`` (n,): whether it is prismatic; ``turn`` (n, 3, 3, 3):
    rotation from frame k to the frame before as turn[0] + sin(q) turn[1] + cos(q) turn[2]; ``place`` (n, 3): its
    origin there at q = 0, which moves by ``travel`` (n, 3) q; ``axis`` (n, 3); ``gravity`` (3,) of the base.
    """

    parent: Any
    slides: Any
    turn: Any
    place: Any
    travel: Any
    axis: Any
    gravity: Any


class Scratch(NamedTuple):
    """Room for one instant: rotation (3, 3), `motion` (n, 9), `jacobian` (n, n, 6) and ten factors (10,)."""

    rotation: Any
    motion: Any
    jacobian: Any
    row: Any


@part
def room(n):
    """Room for an arm of n joints."""
    return Scratch(np.zeros((3, 3)), np.zeros((n, N_MOTION)), np.zeros((n, n, 6)), np.zeros(N_BODY))


@part
def back(r, x, y, z):
    """Express a vector of the previous frame in this one, by the transposed rotation."""
    return (
        r[0, 0] * x + r[1, 0] * y + r[2, 0] * z,
        r[0, 1] * x + r[1, 1] * y + r[2, 1] * z,
        r[0, 2] * x + r[1, 2] * y + r[2, 2] * z,
    )


@part
def cross(ax, ay, az, bx, by, bz):
    """A x b."""
    return ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx


@part
def move(links, q, v, a, work):
    """Fill ``work`` with the motion of every link and its Jacobian ([k, j] holds w and l) at one instant, (n,) each."""
    r, motion, jacobian = work.rotation, work.motion, work.jacobian
    for k in range(links.parent.size):
        parent, slides = links.parent[k], links.slides[k]
        s, c = (0.0, 1.0) if slides else (math.sin(q[k]), math.cos(q[k]))
        for i in range(3):
            for j in range(3):
                r[i, j] = links.turn[k, 0, i, j] + s * links.turn[k, 1, i, j] + c * links.turn[k, 2, i, j]
        px = links.place[k, 0] + links.travel[k, 0] * q[k]
        py = links.place[k, 1] + links.travel[k, 1] * q[k]
        pz = links.place[k, 2] + links.travel[k, 2] * q[k]
        ex, ey, ez = links.axis[k, 0], links.axis[k, 1], links.axis[k, 2]
        if parent < 0:
            ox = oy = oz = bx = by = bz = 0.0
            cx, cy, cz = back(r, -links.gravity[0], -links.gravity[1], -links.gravity[2])
        else:
            m = motion[parent]
            tx, ty, tz = cross(m[0], m[1], m[2], px, py, pz)
            ux, uy, uz = cross(m[0], m[1], m[2], tx, ty, tz)
            tx, ty, tz = cross(m[3], m[4], m[5], px, py, pz)
            cx, cy, cz = back(r, m[6] + tx + ux, m[7] + ty + uy, m[8] + tz + uz)
            ox, oy, oz = back(r, m[0], m[1], m[2])
            bx, by, bz = back(r, m[3], m[4], m[5])
            j = parent
            while j >= 0:
                w, to = jacobian[parent, j], jacobian[k, j]
                tx, ty, tz = cross(w[0], w[1], w[2], px, py, pz)
                to[3], to[4], to[5] = back(r, w[3] + tx, w[4] + ty, w[5] + tz)
                to[0], to[1], to[2] = back(r, w[0], w[1], w[2])
                j = links.parent[j]
        tx, ty, tz = cross(ox, oy, oz, ex, ey, ez)
        to, own = jacobian[k, k], motion[k]
        if slides:
            to[3], to[4], to[5] = ex, ey, ez
            cx += 2.0 * v[k] * tx + a[k] * ex
            cy += 2.0 * v[k] * ty + a[k] * ey
            cz += 2.0 * v[k] * tz + a[k] * ez
        else:
            to[0], to[1], to[2] = ex, ey, ez
            bx += v[k] * tx + a[k] * ex
            by += v[k] * ty + a[k] * ey
            bz += v[k] * tz + a[k] * ez
            ox += v[k] * ex
            oy += v[k] * ey
            oz += v[k] * ez
        own[0], own[1], own[2], own[3], own[4], own[5] = ox, oy, oz, bx, by, bz
        own[6], own[7], own[8] = cx, cy, cz


@part
def link_row(row, w, m):
    """The ten coefficients of a link's parameters in the drive of a joint: w (6,) is its Jacobian column, m (9,) the
    motion.
    """
    wx, wy, wz, lx, ly, lz = w[0], w[1], w[2], w[3], w[4], w[5]
    ox, oy, oz, bx, by, bz, cx, cy, cz = m[0], m[1], m[2], m[3], m[4], m[5], m[6], m[7], m[8]
    along, square = lx * ox + ly * oy + lz * oz, ox * ox + oy * oy + oz * oz
    tx, ty, tz = cross(lx, ly, lz, bx, by, bz)
    ux, uy, uz = cross(cx, cy, cz, wx, wy, wz)
    row[0] = lx * cx + ly * cy + lz * cz
    row[1] = tx + ux + along * ox - square * lx
    row[2] = ty + uy + along * oy - square * ly
    row[3] = tz + uz + along * oz - square * lz
    ux, uy, uz = cross(wx, wy, wz, ox, oy, oz)
    row[4] = wx * bx + ux * ox
    row[5] = wx * by + wy * bx + ux * oy + uy * ox
    row[6] = wy * by + uy * oy
    row[7] = wx * bz + wz * bx + ux * oz + uz * ox
    row[8] = wy * bz + wz * by + uy * oz + uz * oy
    row[9] = wz * bz + uz * oz


@njit(nogil=True, error_model="numpy")
def fill_regressor(out, links, q, v, a):
    """Fill ``out`` (n_samples, n, 10 n), initially zero, with the coefficients of all link parameters along q, v, a."""
    _regressor(out, links, q, v, a, room(links.parent.size))


@part
def _regressor(out, links, q, v, a, work):
    out, links, q, v, a, work = borrowed((out, links, q, v, a, work))
    for t in range(q.shape[0]):
        move(links, q[t], v[t], a[t], work)
        for k in range(links.parent.size):
            j = k
            while j >= 0:
                link_row(out[t, j, N_BODY * k : N_BODY * k + N_BODY], work.jacobian[k, j], work.motion[k])
                j = links.parent[j]


@part
def pay(links, inertial, work, total):
    """Add the drives needed for the motion in ``work`` to ``total`` (n,); ``inertial`` is (n, 10)."""
    for k in range(links.parent.size):
        j = k
        while j >= 0:
            link_row(work.row, work.jacobian[k, j], work.motion[k])
            for i in range(N_BODY):
                total[j] += work.row[i] * inertial[k, i]
            j = links.parent[j]


@part
def weigh(links, inertial, work, mass):
    """Fill ``mass`` (n, n) from the Jacobians in ``work``: the drive of i per unit acceleration of j."""
    mass[:] = 0.0
    only = np.zeros(N_MOTION)
    for k in range(links.parent.size):
        j = k
        while j >= 0:
            only[3:] = work.jacobian[k, j]
            i = j
            while i >= 0:
                link_row(work.row, work.jacobian[k, i], only)
                for c in range(N_BODY):
                    mass[i, j] += work.row[c] * inertial[k, c]
                mass[j, i] = mass[i, j]
                i = links.parent[i]
            j = links.parent[j]


@njit(nogil=True, error_model="numpy")
def fill_torque(out, links, inertial, q, v, a):
    """Fill ``out`` (n_samples, n), initially zero, with the drives that the links need along q, v, a (n_samples, n)."""
    _torque(out, links, inertial, q, v, a, room(links.parent.size))


@part
def _torque(out, links, inertial, q, v, a, work):
    out, links, inertial, q, v, a, work = borrowed((out, links, inertial, q, v, a, work))
    for t in range(q.shape[0]):
        move(links, q[t], v[t], a[t], work)
        pay(links, inertial, work, out[t])


@njit(nogil=True, error_model="numpy")
def fill_mass(out, links, inertial, q):
    """Fill ``out`` (n_samples, n, n) with the mass matrices at q (n_samples, n)."""
    n = links.parent.size
    _mass(out, links, inertial, q, np.zeros(n), room(n))


@part
def _mass(out, links, inertial, q, rest, work):
    out, links, inertial, q, rest, work = borrowed((out, links, inertial, q, rest, work))
    for t in range(q.shape[0]):
        move(links, q[t], rest, rest, work)
        weigh(links, inertial, work, out[t])


# --- the one pass along a record of an arm ---------------------------------------------------------------------------
# Half a drift, a kick, half a drift, as for an axis (`whsklearn.systems._servo_kernel`); the kick solves for all joints
# at once, linearly implicit in each joint's friction.  sign(v) is tanh(v / smoothing), and the torque that it
# multiplies is divided by v rather than differentiated: a step can bring a joint to rest but not throw it backwards.
# Where a joint has a play or a spring, its motor moves apart from its link.  The push between them depends on the
# accelerations of both at the end of the step: that of the motor is eliminated, that of the link goes into the mass
# matrix, so that a stiff contact is stable beside all other joints.
N_SIGNALS = 6
DRIVE, MEASURED, POSITION, VELOCITY, LINK, LINK_VELOCITY = range(N_SIGNALS)  # rows of a simulated record
MOTOR, STIFFNESS, DAMPING, GAP, DRY, FIRM, PUSH, SIDE = range(8)  # of a joint whose motor moves apart; PUSH, see `push`


class Axes(NamedTuple):
    """The effects along the axes, which are the n joints and sums of joints: rows of axis k from ``first[k]`` on.

    Up to ``first[k + 1]``, as in a servo's `AxisNumbers`.
    """

    codes: Any
    p: Any
    own: Any
    first: Any
    # of a servo axis (m, 12): limit, resolution, sharpness of sign(v), and the inertia that a play or a spring divides
    parts: Any
    armature: Any  # (m,): of motors that move with their links
    direction: Any  # (m, n)


class PassInput(NamedTuple):
    """The input of a pass: sample time, fine steps per sample, whether the controllers write the drive, samples between
    returns to ``measured`` (2 or 4, n, n_samples; 0: none), whose last two rows are links that are known; ``reference``
    (3, n, n_samples), ``feed`` (n, n_samples) added to the output of the controllers, ``noise`` (n, n_samples) of the
    encoders, ``controllers`` (n, 8).
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
def implicit(slope, inertia, h):
    """What a linearly implicit step adds to an inertia: the midpoint rule if it resolves the slope, otherwise Euler."""
    give = h * max(slope, 0.0)
    return 0.5 * give if give < 0.5 * inertia else give


@part
def push(own, ahead, slip, free, h):
    """What pushes a link that its motor would meet ``ahead`` at mid-step: PUSH - FIRM times the link's acceleration.

    ``free`` is the acceleration of the motor alone, MOTOR its inertia with implicit friction.  The push is that of
    `whsklearn.effects.transmission.coupling_torque`, without the link's own acceleration.
    """
    own[FIRM] = own[PUSH] = own[SIDE] = 0.0
    if own[GAP] > 0.0:
        if abs(ahead) <= 0.5 * own[GAP]:
            return
        own[SIDE] = 1.0 if ahead > 0.0 else -1.0
    spring = 0.5 * h * (0.5 * h * own[STIFFNESS] + own[DAMPING])
    share = 1.0 / (1.0 + spring / own[MOTOR])
    own[FIRM] = share * spring
    own[PUSH] = share * (own[STIFFNESS] * (ahead - 0.5 * own[SIDE] * own[GAP]) + own[DAMPING] * slip + spring * free)


@part
def fine_step(links, inertial, axes, ends, z, state, apart, u, t, h, space):
    """Move ``state`` (4, n), links and then motors, by h under the drives u (n,).

    ``apart`` (n, 8) are the joints whose motor moves apart from its link (MOTOR 0: with it); ``space`` holds a `Work`,
    rest, right, mass and copies of both.
    """
    work, rest, right, mass, right_too, mass_too = space
    q, v, x, w = state
    n, split = rest.size, False
    for j in range(n):
        q[j] += 0.5 * h * v[j]
        split |= apart[j, MOTOR] > 0.0
    move(links, q, v, rest, work)
    right[:] = 0.0
    pay(links, inertial, work, right)
    weigh(links, inertial, work, mass)
    middle = t + 0.5 * h
    for j in range(n):
        right[j] = (0.0 if apart[j, MOTOR] > 0.0 else u[j]) - right[j]
    for k in range(axes.armature.size):
        d = axes.direction[k]
        two = k < n and apart[k, MOTOR] > 0.0
        drive, sharp = along(d, u), axes.parts[k, 1]
        if two:
            x[k] += 0.5 * h * w[k]
            place, speed = x[k], w[k]
        else:
            place, speed = along(d, q), along(d, v)
        part_of = slice(axes.first[k], axes.first[k + 1])
        codes, p, zk, e = axes.codes[part_of], axes.p[part_of], z[part_of], ends_of(ends, k)
        if e.memory > e.own:
            advance_memories(codes, p, e, zk, 0.5 * h * speed, speed)
        s, ds = smooth_sign(speed, sharp)
        smooth, at_rest = torque_at(codes, p, axes.own, e, zk, middle, place, speed, 0.0, 0.0, drive)
        whole, slope = torque_at(codes, p, axes.own, e, zk, middle, place, speed, s, ds, drive)
        if abs(speed) * sharp > 1e-6:
            slope = at_rest + max((whole - smooth) / speed, 0.0)
        if two:
            own, motor = apart[k], axes.armature[k]
            own[MOTOR] = motor + implicit(slope, motor, h)
            s, ds = smooth_sign(v[k], sharp)
            mass[k, k] += added_inertia(p, e, middle)
            dry = own[DRY] * (s / v[k] if abs(v[k]) * sharp > 1e-6 else ds)
            mass[k, k] += implicit(dry, mass[k, k], h)
            right[k] -= load_sum(codes, p, e, middle, q[k], v[k]) + own[DRY] * s
            push(own, x[k] - q[k], w[k] - v[k], (drive - whole) / own[MOTOR], h)
            mass[k, k] += own[FIRM]
            right[k] += own[PUSH]
            w[k] += h * (drive - whole) / own[MOTOR]
            continue
        paid = whole + load_sum(codes, p, e, middle, place, speed)
        total = 0.0
        for i in range(n):
            right[i] -= d[i] * paid
            total += d[i] * d[i] * mass[i, i]
        added = axes.armature[k] + added_inertia(p, e, middle)
        added += implicit(slope, total + added, h)
        for i in range(n):
            for j in range(n):
                mass[i, j] += added * d[i] * d[j]
    if split:
        settle(apart, right, mass, right_too, mass_too)
    else:
        solve(mass, right)
    for j in range(n):
        v[j] += h * right[j]
        q[j] += 0.5 * h * v[j]
        if apart[j, MOTOR] > 0.0:
            w[j] -= h * (apart[j, PUSH] - apart[j, FIRM] * right[j]) / apart[j, MOTOR]
            x[j] += 0.5 * h * w[j]
        else:
            x[j], w[j] = q[j], v[j]
    for k in range(axes.armature.size):
        if axes.first[k + 1] > axes.first[k] and ends[k, 2] > ends[k, 1]:
            speed = w[k] if k < n else along(axes.direction[k], v)
            z[axes.first[k] + ends[k, 1], AHEAD] = 0.5 * h * speed


@part
def settle(apart, right, mass, right_too, mass_too):
    """Solve for the accelerations; a contact that would pull does not act, and they are solved for again."""
    right_too[:], mass_too[:] = right, mass
    solve(mass, right)
    for _ in range(right.size):
        again = False
        for j in range(right.size):
            own = apart[j]
            if own[SIDE] * (own[PUSH] - own[FIRM] * right[j]) < 0.0:
                mass_too[j, j] -= own[FIRM]
                right_too[j] -= own[PUSH]
                own[FIRM] = own[PUSH] = own[SIDE] = 0.0
                again = True
        if not again:
            return
        right[:], mass[:] = right_too, mass_too
        solve(mass, right)


@njit(nogil=True, error_model="numpy")
def run(out, links, inertial, axes, course, state):
    """Fill ``out`` (6, n, n_samples) with drive, measured and true position, velocity, and those of the links.

    ``state`` (4, n): position and velocity of links and then of motors, at which encoders and controllers are.
    In open loop row 0 of ``out`` is the drive as logged.
    """
    n, dt, substeps = links.parent.size, course.sample_time, course.substeps
    space = room(n), np.zeros(n), np.zeros(n), np.zeros((n, n)), np.zeros(n), np.zeros((n, n))
    m = axes.armature.size
    ends = np.zeros((m, 6), dtype=np.int64)
    chain, lag, memory = np.zeros((n, 5)), np.zeros((n, 2)), np.zeros((n, 3))
    lattice, u, apart = np.zeros(n), np.zeros(n), np.zeros((n, 8))
    first = np.zeros((n, substeps), dtype=np.int64)
    weight = np.zeros((n, substeps))
    z = np.zeros((axes.codes.size + 1, N_STATES + 1))
    for j in range(m):
        rows = slice(axes.first[j], axes.first[j + 1])
        if j < n:  # the drive acts at joints alone
            plant = AxisNumbers(axes.codes[rows], axes.p[rows], axes.parts[j], axes.own)
            c = chain_of(plant)
            lattice[j] = lattice_of(plant)[0]
            body = body_of(plant)
            if body.share > 0.0:
                apart[j, MOTOR] = axes.armature[j]
                apart[j, STIFFNESS], apart[j, DAMPING], apart[j, GAP] = body.stiffness, body.damping, body.gap
                apart[j, DRY] = body.dry
            chain[j, 0], chain[j, 1], chain[j, 2], chain[j, 3], chain[j, 4] = c
            first[j], weight[j] = hold_weights(c.delay / dt, substeps, False)
            lag[j] = 0.0 if course.closed else out[DRIVE, j, 0]
        codes, p, e = arranged(axes.codes[rows], axes.p[rows])
        ends[j, 0], ends[j, 1], ends[j, 2], ends[j, 3], ends[j, 4], ends[j, 5] = e
        axes.codes[axes.first[j] : axes.first[j] + codes.size] = codes
        axes.p[axes.first[j] : axes.first[j] + codes.size] = p
    prepared = ends, chain, lag, memory, lattice, u, first, weight, z, apart
    _pass(out, links, inertial, axes, course, state, space, prepared)


@part
def _pass(out, links, inertial, axes, course, state, space, prepared):
    """The pass itself, on borrowed arrays whose owners live in `run`."""
    out, links, inertial, axes, course, state, space = borrowed((out, links, inertial, axes, course, state, space))
    ends, chain, lag, memory, lattice, u, first, weight, z, apart = borrowed(prepared)
    n, dt, substeps = links.parent.size, course.sample_time, course.substeps
    h = dt / substeps
    for k in range(out.shape[2]):
        t = k * dt
        if course.every > 0 and k % course.every == 0:
            for i in range(2):  # a link keeps its place behind its motor, unless it is known
                state[i] += course.measured[i, :, k] - state[2 + i]
                state[2 + i] = course.measured[i, :, k]
                if course.measured.shape[0] > 2:
                    state[i] = course.measured[2 + i, :, k]
        for j in range(n):
            rows = slice(axes.first[j], axes.first[j + 1])
            y = read(axes.codes[rows], axes.p[rows], axes.own, ends_of(ends, j), t, state[2, j])
            if course.noise.size > 0:
                y += course.noise[j, k]
            if lattice[j] > 0.0:
                y = quantized(lattice[j], y)
            if course.closed:
                asked = control(course.controllers[j], memory[j], course.reference[:, j], k, y, dt)
                out[DRIVE, j, k] = asked + course.feed[j, k]
            out[MEASURED, j, k], out[POSITION, j, k], out[VELOCITY, j, k] = y, state[2, j], state[3, j]
            out[LINK, j, k], out[LINK_VELOCITY, j, k] = state[0, j], state[1, j]
        for i in range(substeps):
            for j in range(n):
                before = 0.0 if course.closed else out[DRIVE, j, 0]
                asked = held(out[DRIVE, j], k + first[j, i], weight[j, i], before)
                c = DriveStage(chain[j, 0], chain[j, 1], chain[j, 2], chain[j, 3], chain[j, 4])
                u[j], lag[j, 0], lag[j, 1] = effective(c, asked, lag[j, 0], lag[j, 1], h)
            fine_step(links, inertial, axes, ends, z, state, apart, u, t + i * h, h, space)
