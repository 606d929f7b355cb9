"""The axis driven by its own log and held near the measurement: one compiled pass.

The equation of motion J a = u_eff - sum of torques is stepped with the drive as logged (held
over a sample) and corrected, after every sample, by the innovation e = y - y_hat: position by
``gain_1 e``, velocity by ``gain_2 e`` (a Luenberger observer, Luenberger 1971, IEEE TAC 16(6)).
So no controller need be known, the trajectory stays the measured one, and what the model lacks
stands in e: to first order e = [p^2 + l1 p + l2]^-1 (missing torque / J), l1 = gain_1/dt, l2 = gain_2/dt.
With ``reset_every`` > 0 the same pass is a free simulation restarted at that many samples.

The steps themselves are in `axis_step`, the torques in `axis_torques`.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from whsklearn.gap.axis_step import coupling_of, step
from whsklearn.gap.axis_torques import *  # noqa: F403  # the codes are known by this module's name
from whsklearn.gap.axis_torques import (
    ACTUATOR_LAG,
    DEAD_ZONE,
    INPUT_DELAY,
    PRESLIDING,
    RECTIFICATION,
    SATURATION,
    sensor,
)


@njit(cache=True, nogil=True)
def follow(inertia, timing, codes, q, u, y, dt, substeps, gain_1, gain_2, reset_every, th0, v0, twist0):
    """Predicted position y_hat, axis angle, velocity (n,) and twist of the coupling with its rate (n, 2).

    ``timing`` is the age of the drive in samples (0: the logged value acts from its sample on).  A restart takes
    angle and velocity on the encoder's side from ``th0``, ``v0`` and, where it has rows, twist and rate from
    ``twist0``.
    """
    n = u.size
    twists = np.zeros((n, 2))
    y_hat, angle, speed = np.empty(n), np.empty(n), np.empty(n)
    delay, lag, limit, width, reach, folded = _chain(codes, q, timing, dt)
    coupling = coupling_of(codes, q, inertia)
    load_side = coupling[5]
    h = dt / substeps
    th, v, thl, vl = th0[0], v0[0], th0[0], v0[0]
    z, lagged = 0.0, u[0]
    fade = math.exp(-h / lag) if lag > 0.0 else 0.0
    for k in range(n):
        t = k * dt
        if reset_every > 0 and k % reset_every == 0:
            twist, slip = th - thl, v - vl
            if twist0.shape[0] > 0:
                twist, slip = twist0[k, 0], twist0[k, 1]
            side = -1.0 if folded and th < 0.0 else 1.0
            th = side * th0[k] + (twist if load_side else 0.0)
            v = side * v0[k] + (slip if load_side else 0.0)
            thl = th - twist
            vl = v - slip
        y_hat[k] = sensor(codes, q, thl if load_side else th, t)
        angle[k], speed[k] = th, v
        twists[k, 0], twists[k, 1] = th - thl, v - vl
        if gain_1 > 0.0:
            e = y[k] - y_hat[k]
            if folded and th < 0.0:
                e = -e
            th += gain_1 * e
            v += gain_2 * e
            thl += gain_1 * e
            vl += gain_2 * e
        held = _held(u, k, delay, limit, width)
        for j in range(substeps):
            ue = held
            if lag > 0.0:
                ue = held + (lagged - held) * (1.0 - fade) * lag / h
                lagged = held + (lagged - held) * fade
            th, v, thl, vl, z = step(codes, q, inertia, coupling, reach, h, t + j * h, ue, th, v, thl, vl, z)
    return y_hat, angle, speed, twists


@njit(cache=True, nogil=True)
def _chain(codes, q, timing, dt):
    """What surrounds the axis: delay in samples, lag, limit, dead zone, reach of presliding, folded sensor."""
    delay, lag, limit, width, reach, folded = timing, 0.0, math.inf, 0.0, 0.0, False
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
    return delay, lag, limit, width, reach, folded


@njit(cache=True, nogil=True)
def _held(u, k, delay, limit, width):
    """The drive that acts during sample k: delayed, limited, without its dead zone."""
    whole = math.floor(delay)
    part = delay - whole
    i0 = min(max(k - whole, 0), u.size - 1)
    i1 = min(max(k - whole - 1, 0), u.size - 1)
    held = (1.0 - part) * u[i0] + part * u[i1]
    if limit < math.inf:
        held = min(max(held, -limit), limit)
    if width > 0.0:
        held -= min(max(held, -width), width)
    return held
