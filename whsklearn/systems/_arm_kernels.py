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
