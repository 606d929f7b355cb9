"""One fine step of the axis.

Half a drift, a kick, half a drift (second order).  The kick is a linearly implicit
midpoint step, so that a steep friction curve stays stable, and dry friction is resolved
as the set-valued law it is: when velocity would change sign within the step, the instant
is located, friction at rest is compared with what pulls, and the rest of the step is
either standstill or motion the other way.  No threshold velocity is needed, standstill
is exactly zero velocity, and the step cannot chatter.
"""

from __future__ import annotations

import math

from numba import njit

from whsklearn.effects import codes
from whsklearn.effects.hysteresis import advance_hysteresis
from whsklearn.systems._servo_torques import all_torques


@njit
def advance_memories(effects, p, z, dx, v):
    """Move every hysteresis along a path."""
    for i in range(effects.size):
        if codes.DAHL <= effects[i] <= codes.BOUC_WEN:
            advance_hysteresis(effects[i], p, z, i, dx, v)


@njit
def implicit_gain(slope, inertia, h):
    """Divisor of the linearly implicit step: midpoint where it resolves the slope, Euler where it does not."""
    stiffness = h * slope / inertia
    if stiffness < 0.5:
        return max(1.0 + 0.5 * stiffness, 0.5)
    return 1.0 + stiffness


@njit
def from_rest(pull, dry, asymmetric, slope, inertia, h):
    """Velocity and path after h from rest: zero while friction can hold the pull."""
    low = min(asymmetric - dry, asymmetric)
    high = max(asymmetric + dry, asymmetric)
    if low <= pull <= high:
        return 0.0, 0.0
    excess = pull - high if pull > high else pull - low
    v = h * excess / inertia / implicit_gain(slope, inertia, h)
    return v, 0.5 * h * v


@njit
def kick_smooth(v, pull, inertia, h, kappa, parts):
    """Velocity and path with sign(v) = tanh(kappa v)."""
    smooth, slope, dry, dry_slope, asymmetric = parts
    s = math.tanh(kappa * v)
    ds = kappa * (1.0 - s * s)
    force = pull - smooth - dry * s - asymmetric * s * s
    total = slope + dry * ds + dry_slope * abs(s) + 2.0 * asymmetric * s * ds
    v_new = v + h * force / inertia / implicit_gain(total, inertia, h)
    return v_new, 0.5 * h * (v + v_new)


@njit
def kick_dry(effects, p, z, x, q, v, u, t, pull, inertia, h, parts, one_mass, user):
    """Velocity and path with set-valued dry friction."""
    smooth, slope, dry, dry_slope, asymmetric = parts
    if v != 0.0:
        s = 1.0 if v > 0.0 else -1.0
        force = pull - smooth - s * dry - asymmetric
        v_new = v + h * force / inertia / implicit_gain(slope + dry_slope, inertia, h)
        if v_new * s > 0.0 or (dry == 0.0 and asymmetric == 0.0):
            return v_new, 0.5 * h * (v + v_new)
        share = v / (v - v_new)
        smooth, slope, dry, dry_slope, asymmetric, load, _ = all_torques(effects, p, z, x, q, 0.0, u, t, user)
        rest = pull - smooth - (load if one_mass else 0.0)
        v_new, path = from_rest(rest, dry, asymmetric, slope, inertia, (1.0 - share) * h)
        return v_new, 0.5 * share * h * v + path
    return from_rest(pull - smooth, dry, asymmetric, slope, inertia, h)


@njit
def coupling_torque(twist, rate, motor, load, stiffness, damping, gap, give, h):
    """Mean torque of the coupling over a step: implicit midpoint, pushing only where there is play.

    ``motor`` and ``load`` are the accelerations without the coupling, ``give`` what each gains by a torque of one.
    """
    side = 0.0
    if gap > 0.0:
        ahead = twist + 0.5 * h * rate
        if abs(ahead) <= 0.5 * gap:
            return 0.0
        side = 1.0 if ahead > 0.0 else -1.0
    stretch = twist - side * 0.5 * gap
    spring = 0.5 * h * stiffness + damping
    free = rate + 0.5 * h * (motor - load)
    torque = (stiffness * stretch + spring * free) / (1.0 + 0.5 * h * spring * (give[0] + give[1]))
    return 0.0 if side * torque < 0.0 else torque


@njit
def fine_step(effects, p, z, state, axis, u, t, h, user):
    """Advance ``state`` = [q_motor, v_motor, q_load, v_load] by h under the torque u."""
    inertia, share, stiffness, damping, gap, kappa = axis
    x, v, q, w = state[0], state[1], state[2], state[3]
    two = share > 0.0
    x_mid = x + 0.5 * h * v
    q_mid = q + 0.5 * h * w if two else x_mid
    advance_memories(effects, p, z, 0.5 * h * v, v)
    smooth, slope, dry, dry_slope, asymmetric, load, added = all_torques(
        effects, p, z, x_mid, q_mid, v, u, t + 0.5 * h, user
    )
    pull = u
    if two:
        j_motor = (1.0 - share) * inertia
        j_load = share * inertia + added
        s = math.tanh(kappa * v) if kappa < math.inf else (1.0 if v > 0.0 else (-1.0 if v < 0.0 else 0.0))
        stuck = s == 0.0 and kappa == math.inf
        free = 0.0 if stuck else (u - smooth - s * dry - asymmetric * s * s) / j_motor
        give = (0.0 if stuck else 1.0 / j_motor, 1.0 / j_load)
        coupling = coupling_torque(x - q, v - w, free, -load / j_load, stiffness, damping, gap, give, h)
        w_new = w + h * (coupling - load) / j_load
        state[2] = q + 0.5 * h * (w + w_new)
        state[3] = w_new
        pull -= coupling
        inertia = j_motor
    else:
        inertia += added
        smooth += load
    parts = (smooth, slope, dry, dry_slope, asymmetric)
    if kappa < math.inf:
        v_new, path = kick_smooth(v, pull, inertia, h, kappa, parts)
    else:
        v_new, path = kick_dry(effects, p, z, x_mid, q_mid, v, u, t + 0.5 * h, pull, inertia, h, parts, not two, user)
    advance_memories(effects, p, z, path - 0.5 * h * v, v_new)
    state[0] = x + path
    state[1] = v_new
    if not two:
        state[2] = state[0]
        state[3] = v_new
