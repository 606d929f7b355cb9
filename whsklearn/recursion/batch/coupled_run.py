"""Free run of two masses, motor and load with a spring and a damper between them, with exact sensitivities.

J_m dv/dt = u - o - T - B v - C sign(v), J_l dw/dt = T - B_l w - C_l sign(w), T = k d + c dd/dt, d = q_m - q_l.

The steps are those of `whsklearn.systems._servo_kernel`: half a drift, a kick, half a drift, with the torque of the
coupling by the implicit midpoint rule.  Dry friction is a proximal step on either side, as in
`whsklearn.recursion.batch.axis_free_run`.  The loop differentiates by the inertias, stiffness and damping; `slopes_of`
takes that to resonance, share and damping ratio.
"""

from __future__ import annotations

import math

import numpy as np

from whsklearn._numba import njit, part
from whsklearn.effects.base import Array

NUMBERS, STATES = 9, 4
_J_M, _J_L, _B, _C, _OFFSET, _B_L, _C_L, _K, _D = range(NUMBERS)


def bodies_of(theta: Array) -> Array:
    """J_m, J_l, B, C, o, B_l, C_l, k and c (9,) of the theta of a coupled axis."""
    inertia, viscous, coulomb, offset, far_viscous, far_coulomb, frequency, share, ratio = theta.tolist()
    reduced, turn = inertia * share * (1.0 - share), 2.0 * math.pi * frequency
    stiffness, damping = reduced * turn**2, 2.0 * ratio * reduced * turn
    masses = (1.0 - share) * inertia, share * inertia
    return np.array([*masses, viscous, coulomb, offset, far_viscous, far_coulomb, stiffness, damping])


def slopes_of(theta: Array) -> Array:
    """Derivatives (9, 9) of `bodies_of`, a row for each entry of theta."""
    inertia, *_, frequency, share, ratio = theta.tolist()
    stiffness, damping = bodies_of(theta)[[_K, _D]].tolist()
    by_share = (1.0 - 2.0 * share) / (share * (1.0 - share))
    out = np.zeros((NUMBERS, NUMBERS))
    out[0, [_J_M, _J_L, _K, _D]] = 1.0 - share, share, stiffness / inertia, damping / inertia
    out[np.arange(1, 6), [_B, _C, _OFFSET, _B_L, _C_L]] = 1.0
    out[6, [_K, _D]] = 2.0 * stiffness / frequency, damping / frequency
    out[7, [_J_M, _J_L, _K, _D]] = -inertia, inertia, stiffness * by_share, damping * by_share
    out[8, _D] = damping / ratio
    return out


@part
def _kicked(v, pull, dry, viscous, inertia, h, slope):
    """Velocity after a kick against dry friction; write its slopes by v, pull, dry, viscous and inertia."""
    g = h / (inertia + 0.5 * h * viscous)
    z = v + g * pull
    hold = g * dry
    if abs(z) <= hold:
        slope[:] = 0.0
        return 0.0
    s = 1.0 if z > 0.0 else -1.0
    kick = g * (pull - s * dry)
    slope[0], slope[1], slope[2] = 1.0, g, -s * g
    slope[3], slope[4] = -0.5 * g * kick, -g * kick / h
    return v + kick


@part
def _begin(dv, dx, dw, dq, at_load):
    """Derivatives of both masses' motion at the start of a piece, by its velocity, position, twist and slip."""
    dv[:], dx[:], dw[:], dq[:] = 0.0, 0.0, 0.0, 0.0
    at = dv.size - STATES
    dv[at], dw[at], dx[at + 1], dq[at + 1] = 1.0, 1.0, 1.0, 1.0
    if at_load:
        dx[at + 2], dv[at + 3] = 1.0, 1.0
    else:
        dq[at + 2], dw[at + 3] = -1.0, -1.0


# A function of its own: of the same loop inside the pass the compiler took one number at a time, and a run with all
# derivatives took 1.7 times as long.
@part
def _carry(moving, direct, by, own, g_m, g_l, half):
    """Derivatives ``moving`` of both masses' motion through a step; ``direct``: of torque and velocities by numbers."""
    dv, dx, dw, dq = moving
    e_t, e_v, e_w = direct
    by_d, by_v, by_w = by
    for i in range(dv.size):
        pull = by_d * (dx[i] - dq[i]) + by_v * dv[i] + by_w * dw[i] + e_t[i]
        new = own[0] * dv[i] - g_m * pull + e_v[i]
        far = own[1] * dw[i] + g_l * pull + e_w[i]
        dx[i] += half * (dv[i] + new)
        dq[i] += half * (dw[i] + far)
        dv[i], dw[i] = new, far


@njit(cache=True, error_model="numpy")
def coupled_pass(b, at_load, u, bounds, start, dt, rows, ends):
    """Return velocity and position at the encoder, (2, n).

    Derivatives are written into rows (2, k, n) and the states behind the pieces into ends (pieces, 4), unless empty.
    The derivatives are by the last k of the nine numbers ``b`` and of velocity, position, twist and slip at the start
    of each piece: k is 13, or 4 for those of the state alone.
    """
    n_samples, steps = u.shape
    n_rows = rows.shape[1]
    motion = np.zeros((2, n_samples))
    h = dt / steps
    half = 0.5 * h
    dv, dx, dw, dq = np.zeros(n_rows), np.zeros(n_rows), np.zeros(n_rows), np.zeros(n_rows)
    e_t, e_v, e_w = np.zeros(n_rows), np.zeros(n_rows), np.zeros(n_rows)
    m, e = np.zeros(5), np.zeros(5)
    j_m, j_l, viscous, dry, offset = b[_J_M], b[_J_L], b[_B], b[_C], b[_OFFSET]
    far_viscous, far_dry, k, c = b[_B_L], b[_C_L], b[_K], b[_D]
    spring = half * k + c
    with_numbers = n_rows > STATES
    for piece in range(bounds.size - 1):
        v0, q0, twist, slip = start[piece, 0], start[piece, 1], start[piece, 2], start[piece, 3]
        v, x, w, q = v0, q0, v0 - slip, q0 - twist
        if at_load:
            v, x, w, q = v0 + slip, q0 + twist, v0, q0
        if n_rows > 0:
            _begin(dv, dx, dw, dq, at_load)
        for t in range(bounds[piece], bounds[piece + 1]):
            motion[0, t] = w if at_load else v
            motion[1, t] = q if at_load else x
            for i in range(n_rows):
                rows[0, i, t] = dw[i] if at_load else dv[i]
                rows[1, i, t] = dq[i] if at_load else dx[i]
            for j in range(steps):
                push = u[t, j] - offset
                s = 1.0 if v > 0.0 else (-1.0 if v < 0.0 else 0.0)
                r = 1.0 if w > 0.0 else (-1.0 if w < 0.0 else 0.0)
                give_m, give_l = abs(s) / j_m, abs(r) / j_l if far_dry > 0.0 else 1.0 / j_l
                free_m = give_m * (push - viscous * v - s * dry)
                free_l = -give_l * (far_viscous * w + r * far_dry)
                give = give_m + give_l
                wide = v - w + half * (free_m - free_l)
                d = 1.0 + half * spring * give
                torque = (k * (x - q) + spring * wide) / d
                v_new = _kicked(v, push - torque - viscous * v, dry, viscous, j_m, h, m)
                w_new = _kicked(w, torque - far_viscous * w, far_dry, far_viscous, j_l, h, e)
                if n_rows > 0:
                    by_d = k / d
                    by_v = spring * (1.0 - half * give_m * viscous) / d
                    by_w = -spring * (1.0 - half * give_l * far_viscous) / d
                    if with_numbers:
                        a = half * spring / d
                        e_t[_J_M] = a * give_m * (torque * give_m - free_m)
                        e_t[_J_L] = a * give_l * (torque * give_l + free_l)
                        e_t[_B], e_t[_C], e_t[_OFFSET] = -a * give_m * v, -a * give_m * s, -a * give_m
                        e_t[_B_L], e_t[_C_L] = a * give_l * w, a * give_l * r
                        e_t[_D] = (wide - half * give * torque) / d
                        e_t[_K] = (x - q) / d + half * e_t[_D]
                        e_v[_J_M], e_v[_B], e_v[_C], e_v[_OFFSET] = m[4], m[3] - m[1] * v, m[2], -m[1]
                        e_w[_J_L], e_w[_B_L], e_w[_C_L] = e[4], e[3] - e[1] * w, e[2]
                    own = m[0] - m[1] * viscous, e[0] - e[1] * far_viscous
                    _carry((dv, dx, dw, dq), (e_t, e_v, e_w), (by_d, by_v, by_w), own, m[1], e[1], half)
                x += half * (v + v_new)
                q += half * (w + w_new)
                v, w = v_new, w_new
            if not (abs(v) < 1e150 and abs(w) < 1e150):
                v, w = 0.0, 0.0
        if ends.size > 0:
            ends[piece, 0], ends[piece, 1] = (w, q) if at_load else (v, x)
            ends[piece, 2], ends[piece, 3] = x - q, v - w
    return motion
