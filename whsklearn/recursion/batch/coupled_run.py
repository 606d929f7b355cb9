"""Free run of two masses, motor and load with a spring and a damper between them, with exact sensitivities.

J_m dv/dt = u - o - T - B v - C sign(v), J_l dw/dt = T - B_l w - C_l sign(w), T = k d + c dd/dt, d = q_m - q_l.

The steps are those of `whsklearn.systems._servo_kernel`: half a drift, a kick, half a drift, with the torque of the
coupling by the implicit midpoint rule.  A step in which either mass stops is divided there, as in
`whsklearn.recursion.batch.axis_free_run`.  The loop differentiates by the inertias, stiffness and damping; `slopes_of`
takes that to resonance, share and damping ratio.
"""

from __future__ import annotations

import math

import numpy as np

from whsklearn._numba import njit, part
from whsklearn.effects.base import Array

NUMBERS, STATES = 9, 4
STOPS = 4  # of both masses in a step, after which it is not divided again
_J_M, _J_L, _B, _C, _OFFSET, _B_L, _C_L, _K, _D = range(NUMBERS)
# Rows of derivatives: of both masses' motion and of the length of a step; what a step needs: of both velocities after
# it, of its torque and of these velocities by the numbers alone, and of its length before it was cut at a stop
WORK = 12
_V, _X, _W, _Q, _H, _NEW, _FAR, _E_T, _E_V, _E_W, _LEFT, _PULL = range(WORK)


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
def _side(v, net, dry):
    """The side on which dry friction acts, and whether the mass moves; at rest, that on which it is pushed."""
    pushed = v if v != 0.0 else net
    moves = v != 0.0 or abs(net) > dry or dry == 0.0
    return (1.0 if pushed > 0.0 else -1.0) if moves else 0.0, 1.0 if moves else 0.0


@part
def _torque(moving, push, sides, goes, b, h):
    """Torque of the coupling over a step, its denominator, and slip and accelerations without it."""
    v, x, w, q = moving
    give_m, give_l = goes[0] / b[_J_M], goes[1] / b[_J_L]
    free_m = give_m * (push - b[_B] * v - sides[0] * b[_C])
    free_l = -give_l * (b[_B_L] * w + sides[1] * b[_C_L])
    wide, spring = v - w + 0.5 * h * (free_m - free_l), 0.5 * h * b[_K] + b[_D]
    d = 1.0 + 0.5 * h * spring * (give_m + give_l)
    return (b[_K] * (x - q) + spring * wide) / d, d, wide, free_m, free_l


@part
def _kicked(v, pull, side, goes, viscous, inertia, h):
    """Velocity after a kick against dry friction on a side; a mass at rest does not move against it."""
    new = v + goes * h / (inertia + 0.5 * h * viscous) * pull
    return 0.0 if v == 0.0 and side * new < 0.0 else new


@part
def _begin(by, at_load):
    """Derivatives of both masses' motion at the start of a piece, by its velocity, position, twist and slip."""
    by[:] = 0.0
    at = by.shape[1] - STATES
    by[_V, at] = by[_W, at] = by[_X, at + 1] = by[_Q, at + 1] = 1.0
    if at_load:
        by[_X, at + 2] = by[_V, at + 3] = 1.0
    else:
        by[_Q, at + 2] = by[_W, at + 3] = -1.0


@part
def _by_numbers(by, moving, after, step, sides, goes, moves, b, h):
    """Slopes of torque and velocities in a ``step`` by the numbers; ``after``: both velocities behind it."""
    v, x, w, q = moving
    torque, d, wide, free_m, free_l = step
    half = 0.5 * h
    give_m, give_l = goes[0] / b[_J_M], goes[1] / b[_J_L]
    a = half * (half * b[_K] + b[_D]) / d
    by[_E_T, _J_M], by[_E_T, _J_L] = a * give_m * (torque * give_m - free_m), a * give_l * (torque * give_l + free_l)
    by[_E_T, _B], by[_E_T, _C], by[_E_T, _OFFSET] = -a * give_m * v, -a * give_m * sides[0], -a * give_m
    by[_E_T, _B_L], by[_E_T, _C_L] = a * give_l * w, a * give_l * sides[1]
    by[_E_T, _D] = (wide - half * (give_m + give_l) * torque) / d
    by[_E_T, _K] = (x - q) / d + half * by[_E_T, _D]
    g, kick = moves[0] * h / (b[_J_M] + half * b[_B]), after[0] - v
    by[_E_V, _J_M], by[_E_V, _B], by[_E_V, _C] = -g * kick / h, -g * (0.5 * kick + v), -g * sides[0]
    by[_E_V, _OFFSET] = -g
    g, kick = moves[1] * h / (b[_J_L] + half * b[_B_L]), after[1] - w
    by[_E_W, _J_L], by[_E_W, _B_L], by[_E_W, _C_L] = -g * kick / h, -g * (0.5 * kick + w), -g * sides[1]


@part
def _derived(by, moving, after, step, sides, goes, push, b, h, varies):
    """Derivatives of both velocities ``after`` a step of ``h`` s, which ``varies`` with the numbers at a stop."""
    v, w = moving[0], moving[2]
    torque, d, wide, free_m, free_l = step
    half, give_m, give_l = 0.5 * h, goes[0] / b[_J_M], goes[1] / b[_J_L]
    spring = half * b[_K] + b[_D]
    moves = (
        0.0 if v == 0.0 and after[0] == 0.0 else goes[0],
        0.0 if w == 0.0 and after[1] == 0.0 else goes[1],
    )
    if by.shape[1] > STATES:
        _by_numbers(by, moving, after, step, sides, goes, moves, b, h)
    g_m, g_l = moves[0] * h / (b[_J_M] + half * b[_B]), moves[1] * h / (b[_J_L] + half * b[_B_L])
    by_v = spring * (1.0 - half * give_m * b[_B]) / d
    by_w = -spring * (1.0 - half * give_l * b[_B_L]) / d
    longer_m = longer_l = 0.0
    if varies:
        sum_of, loose = give_m + give_l, free_m - free_l
        by_h = 0.5 * (b[_K] * wide + spring * loose - torque * (spring + half * b[_K]) * sum_of) / d
        longer_m = (g_m / h) ** 2 * b[_J_M] * (push - torque - b[_B] * v - sides[0] * b[_C]) - g_m * by_h
        longer_l = (g_l / h) ** 2 * b[_J_L] * (torque - b[_B_L] * w - sides[1] * b[_C_L]) + g_l * by_h
    own_m, own_l, by_d = moves[0] - g_m * b[_B], moves[1] - g_l * b[_B_L], b[_K] / d
    # loops of one sum each, which the compiler takes several numbers at a time
    for i in range(by.shape[1]):
        by[_PULL, i] = by_d * (by[_X, i] - by[_Q, i]) + by_v * by[_V, i] + by_w * by[_W, i] + by[_E_T, i]
    for i in range(by.shape[1]):
        by[_NEW, i] = own_m * by[_V, i] - g_m * by[_PULL, i] + by[_E_V, i] + longer_m * by[_H, i]
    for i in range(by.shape[1]):
        by[_FAR, i] = own_l * by[_W, i] + g_l * by[_PULL, i] + by[_E_W, i] + longer_l * by[_H, i]


@part
def _shorten(by, first, before, after, left):
    """Derivatives of the time of the ``first`` stop in a step, at v / (v - v_new) of its length."""
    own, new = (_V, _NEW) if first == 1 else (_W, _FAR)
    apart = before - after
    for i in range(by.shape[1]):
        by[_LEFT, i] = by[_H, i]
        by[_H, i] = before / apart * by[_H, i] + left * (before * by[new, i] - after * by[own, i]) / apart**2


@part
def _drift(by, first, h, speed, far_speed):
    """Derivatives of both masses' motion after a step at these mean speeds, and of the time left behind a stop."""
    half = 0.5 * h
    if first:
        stopped = _NEW if first == 1 else _FAR
        for i in range(by.shape[1]):
            by[stopped, i] = 0.0
    for i in range(by.shape[1]):
        by[_X, i] += half * (by[_V, i] + by[_NEW, i]) + speed * by[_H, i]
    for i in range(by.shape[1]):
        by[_Q, i] += half * (by[_W, i] + by[_FAR, i]) + far_speed * by[_H, i]
    for i in range(by.shape[1]):
        by[_V, i] = by[_NEW, i]
    for i in range(by.shape[1]):
        by[_W, i] = by[_FAR, i]
    if first:
        for i in range(by.shape[1]):
            by[_H, i] = by[_LEFT, i] - by[_H, i]


@part
def _moved(moving, push, left, b, by, stops):
    """Both masses after a step of ``left`` s or up to the first stop in it, after ``stops`` others, and the time left.

    With steps across a stop the run is of the first order only, and its least squares are rough: they ended at five
    times the noise, and an inertia 0.005 % too small (`benchmarks.two_masses`).
    """
    v, x, w, q = moving
    twisted = b[_K] * (x - q) + b[_D] * (v - w)
    side, go = _side(v, push - twisted, b[_C])
    far_side, far_go = _side(w, twisted, b[_C_L])
    sides, goes, h, first = (side, far_side), (go, far_go), left, 0
    while True:
        step = _torque(moving, push, sides, goes, b, h)
        v_new = _kicked(v, push - step[0] - b[_B] * v - side * b[_C], side, go, b[_B], b[_J_M], h)
        w_new = _kicked(w, step[0] - b[_B_L] * w - far_side * b[_C_L], far_side, far_go, b[_B_L], b[_J_L], h)
        if by.shape[1] > 0:
            _derived(by, moving, (v_new, w_new), step, sides, goes, push, b, h, first + stops > 0)
        if first or stops == STOPS:
            break
        share = 1.0
        if b[_C] > 0.0 and v * v_new < 0.0:
            share, first = v / (v - v_new), 1
        if b[_C_L] > 0.0 and w * w_new < 0.0 and w / (w - w_new) < share:
            share, first = w / (w - w_new), 2
        if not first:
            break
        if by.shape[1] > 0:
            _shorten(by, first, v if first == 1 else w, v_new if first == 1 else w_new, left)
        h = share * left
    v_new, w_new = 0.0 if first == 1 else v_new, 0.0 if first == 2 else w_new
    speed, far_speed = 0.5 * (v + v_new), 0.5 * (w + w_new)
    if by.shape[1] > 0:
        _drift(by, first, h, speed, far_speed)
    return (v_new, x + h * speed, w_new, q + h * far_speed), left - h if first else 0.0


@njit(cache=True, error_model="numpy")
def coupled_pass(b, at_load, u, bounds, chosen, start, dt, rows, ends):
    """Return velocity and position at the encoder, (2, n).

    Derivatives are written into rows (2, k, n) and the states behind the pieces into ends (pieces, 4), unless empty.
    The derivatives are by the last k of the nine numbers ``b`` and of velocity, position, twist and slip at the start
    of each piece: k is 13, or 4 for those of the state alone. Only of the ``chosen`` pieces (bool).
    """
    n_samples, steps = u.shape
    n_rows = rows.shape[1]
    motion = np.zeros((2, n_samples))
    by = np.zeros((WORK, n_rows))
    for piece in np.flatnonzero(chosen):
        v0, q0, twist, slip = start[piece, 0], start[piece, 1], start[piece, 2], start[piece, 3]
        moving = (v0 + slip, q0 + twist, v0, q0) if at_load else (v0, q0, v0 - slip, q0 - twist)
        if n_rows > 0:
            _begin(by, at_load)
        for t in range(bounds[piece], bounds[piece + 1]):
            motion[0, t] = moving[2] if at_load else moving[0]
            motion[1, t] = moving[3] if at_load else moving[1]
            for i in range(n_rows):
                rows[0, i, t] = by[_W if at_load else _V, i]
                rows[1, i, t] = by[_Q if at_load else _X, i]
            for j in range(steps):
                left, stops = dt / steps, 0
                for i in range(n_rows):
                    by[_H, i] = 0.0
                while left > 0.0:
                    moving, left = _moved(moving, u[t, j] - b[_OFFSET], left, b, by, stops)
                    stops += 1
            if not (abs(moving[0]) < 1e150 and abs(moving[2]) < 1e150):
                moving = 0.0, moving[1], 0.0, moving[3]
        if ends.size > 0:
            ends[piece, 0], ends[piece, 1] = (moving[2], moving[3]) if at_load else (moving[0], moving[1])
            ends[piece, 2], ends[piece, 3] = moving[1] - moving[3], moving[0] - moving[2]
    return motion
