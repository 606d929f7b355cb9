"""An axis in closed loop at 20 kHz: classical Runge-Kutta on the smooth part, stiction after Karnopp.

Karnopp 1985, J. Dyn. Sys. Meas. Control 107(1): inside a narrow band of velocity the axis
rests while what drives it stays below breakaway.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

FINE_HZ = 20_000

# Slots of the flat parameter array; everything that is zero is absent.
NAMES = (
    "inertia viscous coulomb asymmetric_coulomb asymmetric_viscous stribeck stribeck_v stribeck_delta quadratic "
    "load_friction position_friction position_friction_k position_friction_phase presliding presliding_x "
    "friction_drift friction_drift_tau offset dead_zone saturation delay lag ripple ripple_k ripple_phase "
    "backlash flex_ratio flex_stiffness flex_damping cogging cogging_k cogging_phase gravity gravity_phase "
    "spring spring_centre cubic end_stop end_stop_at output_offset output_drift rectify eccentricity eccentricity_k "
    "eccentricity_phase quantum tone tone_hz tone_phase step_inertia step_viscous step_coulomb step_at "
    "x_theta_v x_dead_velocity x_square x_square_k x_warm_spring x_accel x_sin_v duration load_side "
    "x_bump x_bump_at x_bump_width x_patch x_patch_at x_patch_width x_hump x_hump_at x_hump_width "
    "x_bend x_bend_at x_bend_width"
).split()
SLOT = {name: i for i, name in enumerate(NAMES)}
(
    P_J, P_B, P_FC, P_AC, P_AV, P_ST, P_STV, P_STD, P_QD, P_LF, P_PF, P_PFK, P_PFP, P_PS, P_PSX, P_FD, P_FDT, P_OFF,
    P_DZ, P_SAT, P_DEL, P_LAG, P_RIP, P_RIPK, P_RIPP, P_BL, P_FR, P_FK, P_FDAMP, P_CG, P_CGK, P_CGP, P_GR, P_GRP,
    P_SP, P_SPC, P_CU, P_ES, P_ESA, P_OO, P_OD, P_RECT, P_EC, P_ECK, P_ECP, P_Q, P_TO, P_TOF, P_TOP, P_SJ, P_SB,
    P_SFC, P_SAT_T, P_XTV, P_XDV, P_XSQ, P_XSQK, P_XWS, P_XA, P_XSV, P_T, P_LS,
    P_XB, P_XBA, P_XBW, P_XP, P_XPA, P_XPW, P_XH, P_XHA, P_XHW, P_XN, P_XNA, P_XNW,
) = range(len(NAMES))  # fmt: skip


@njit(cache=True)
def _smooth(p, th, v, u, t):
    """Torque that acts on the first mass, without what needs the sign of the velocity."""
    b = p[P_B] + (p[P_SB] if t > p[P_SAT_T] else 0.0)
    f = u + p[P_OFF] - b * v - p[P_AV] * abs(v) - p[P_QD] * v * abs(v)
    f -= p[P_CG] * math.sin(p[P_CGK] * th + p[P_CGP]) + p[P_GR] * math.sin(th + p[P_GRP])
    f -= p[P_SP] * (th - p[P_SPC]) + p[P_CU] * th**3
    if p[P_ES] != 0.0 and abs(th) > p[P_ESA]:
        f -= p[P_ES] * (abs(th) - p[P_ESA]) * (1.0 if th > 0 else -1.0)
    f += p[P_RIP] * u * math.sin(p[P_RIPK] * th + p[P_RIPP])
    f += p[P_TO] * math.sin(2 * math.pi * p[P_TOF] * t + p[P_TOP])
    f -= p[P_XTV] * th * v + p[P_XSV] * math.sin(th) * v + p[P_XWS] * th * t / p[P_T]
    if p[P_XB] != 0.0:
        f -= p[P_XB] * math.exp(-(((th - p[P_XBA]) / p[P_XBW]) ** 2))
    if p[P_XN] != 0.0:
        f -= p[P_XN] * math.tanh((th - p[P_XNA]) / p[P_XNW])
    if p[P_XSQ] != 0.0:
        f -= p[P_XSQ] * (1.0 if math.sin(p[P_XSQK] * th) > 0 else -1.0) * math.sin(3.0 * t)
    return f


@njit(cache=True)
def _dry(p, th, v, u, t, s):
    """Braking torque in the direction s, the part that jumps at rest."""
    fc = p[P_FC] + (p[P_SFC] if t > p[P_SAT_T] else 0.0)
    if p[P_FD] != 0.0:
        g = t / p[P_T] if p[P_FDT] == 0.0 else 1.0 - math.exp(-t / p[P_FDT])
        fc += p[P_FD] * g
    fc += s * p[P_AC] + p[P_LF] * abs(u)
    if p[P_ST] != 0.0:
        fc += p[P_ST] * math.exp(-((abs(v) / p[P_STV]) ** p[P_STD]))
    if p[P_PF] != 0.0:
        fc += p[P_PF] * math.sin(p[P_PFK] * th + p[P_PFP])
    if p[P_XP] != 0.0:
        fc += p[P_XP] * math.exp(-(((th - p[P_XPA]) / p[P_XPW]) ** 2))
    if p[P_XH] != 0.0:
        fc += p[P_XH] * math.exp(-(((abs(v) - p[P_XHA]) / p[P_XHW]) ** 2))
    if p[P_XDV] != 0.0:
        fc += p[P_XDV] * max(abs(v) - 2.0, 0.0)
    return fc


@njit(cache=True)
def _acceleration(p, th, v, u, t, s, z, coupling):
    j = p[P_J] * (1.0 - p[P_FR]) + (p[P_SJ] if t > p[P_SAT_T] else 0.0)
    f = _smooth(p, th, v, u, t) - p[P_PS] * z - coupling
    if s != 0.0:
        f -= s * _dry(p, th, v, u, t, s)
    return f / (j * (1.0 + p[P_XA] * math.cos(th)))


@njit(cache=True)
def _sense(p, th, v, u, t, z, coupling):
    """Sign of the motion against which dry friction acts; at rest, of what overcomes it, or zero."""
    if v != 0.0:
        return 1.0 if v > 0.0 else -1.0
    push = _smooth(p, th, 0.0, u, t) - p[P_PS] * z - coupling
    if push > _dry(p, th, 0.0, u, t, 1.0):
        return 1.0
    return -1.0 if -push > _dry(p, th, 0.0, u, t, -1.0) else 0.0


@njit(cache=True)
def _moved(p, th, v, u, t, s, z, coupling):
    """Angle and speed after a fine step; one in which the speed would change its sign ends at rest."""
    h = 1.0 / FINE_HZ
    a1 = _acceleration(p, th, v, u, t, s, z, coupling)
    a2 = _acceleration(p, th + 0.5 * h * v, v + 0.5 * h * a1, u, t, s, z, coupling)
    v3 = v + 0.5 * h * a2
    a3 = _acceleration(p, th + 0.5 * h * (v + 0.5 * h * a1), v3, u, t, s, z, coupling)
    a4 = _acceleration(p, th + h * v3, v + h * a3, u, t, s, z, coupling)
    dv = h * (a1 + 2 * a2 + 2 * a3 + a4) / 6.0
    if v != 0.0 and (v + dv) * v < 0.0:
        f = v / (v - (v + dv))
        return th + 0.5 * f * h * v, 0.0
    return th + h * (v + h * (a1 + a2 + a3) / 6.0), v + dv


@njit(cache=True)
def _read(p, angle, t):
    """The angle with the encoder's offset, drift and eccentricity."""
    return angle + p[P_OO] + p[P_OD] * t + p[P_EC] * math.sin(p[P_ECK] * angle + p[P_ECP])


@njit(cache=True)
def _coupling(p, twist, slip):
    """Torque between the two masses; within the play there is none, and no contact pulls."""
    if p[P_BL] <= 0.0:
        return p[P_FK] * twist + p[P_FDAMP] * slip
    half = 0.5 * p[P_BL]
    if abs(twist) <= half:
        return 0.0
    twist -= half if twist > 0 else -half
    torque = p[P_FK] * twist + p[P_FDAMP] * slip
    return 0.0 if torque * twist < 0.0 else torque


@njit(cache=True)
def simulate(p, r, dr, ddr, ctrl, noise, disturbance, steps, lead):
    """The loop at FINE_HZ; one row of outputs a controller period.

    ctrl = (kp, kd, ki, derivative filter weight, feedforward inertia, viscous, coulomb, torque limit)
    """
    n = r.size
    u_log = np.empty(n)
    y_log = np.empty(n)
    h = 1.0 / FINE_HZ
    th = v = thl = vl = z = lagged = 0.0
    held = past_y = dy = integral = 0.0
    n_delay = int(p[P_DEL] / h + 0.5)
    line = np.zeros(n_delay + 1)
    head = 0
    two_mass = p[P_FR] > 0.0
    jl = p[P_J] * p[P_FR]
    for k in range(n):
        t = k * steps * h
        y = _read(p, thl if (two_mass and p[P_LS] > 0.5) else th, t) + noise[k]
        if p[P_Q] > 0.0:
            y = p[P_Q] * math.floor(y / p[P_Q] + 0.5)
        y_seen = abs(y) if p[P_RECT] > 0.5 else y
        if k > 0:
            dy += ctrl[3] * ((y - past_y) / (steps * h) - dy)
        past_y = y
        e = r[k] - y
        integral += e * steps * h
        u = ctrl[0] * e + ctrl[1] * (dr[k] - dy) + ctrl[2] * integral
        u += ctrl[4] * ddr[k] + ctrl[5] * dr[k] + ctrl[6] * math.tanh(dr[k] / 0.05)
        u = min(max(u, -ctrl[7]), ctrl[7])
        u_log[k] = u
        y_log[k] = y_seen
        for i in range(steps):
            if lead <= i:
                held = u
            ti = t + i * h
            head = (head + 1) % (n_delay + 1)
            line[head] = held
            ue = line[(head + 1) % (n_delay + 1)]
            if p[P_SAT] > 0.0:
                ue = min(max(ue, -p[P_SAT]), p[P_SAT])
            if p[P_DZ] > 0.0:
                ue = ue - min(max(ue, -p[P_DZ]), p[P_DZ])
            if p[P_LAG] > 0.0:
                lagged += (ue - lagged) * (1.0 - math.exp(-h / p[P_LAG]))
                ue = lagged
            ue += disturbance[k] + (disturbance[min(k + 1, n - 1)] - disturbance[k]) * i / steps
            coupling = 0.0
            if two_mass:
                coupling = _coupling(p, th - thl, v - vl)
                vl += h * coupling / jl
                thl += h * vl
            if p[P_PS] > 0.0:
                z += h * (v - abs(v) * z) / p[P_PSX]
                z = min(max(z, -1.0), 1.0)
            s = _sense(p, th, v, ue, ti, z, coupling)
            if s != 0.0:
                th, v = _moved(p, th, v, ue, ti, s, z, coupling)
    return u_log, y_log
