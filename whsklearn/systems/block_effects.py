"""Effects in a Wiener-Hammerstein chain, each in its place, sample by sample.

.. code-block:: text

    u -> [drive] -> L1 -> x -> [transmission] -> x_l -> law + friction, position, time -> v -> L2 -> q -> [sensor] -> y

Drive effects change u as on an axis: u_eff = u - what the effect asks for.  Friction, position and time
effects add to v as functions of x_l and dx = x_l(t) - x_l(t-1); sensor effects act on q.  An effect is a
code of `whsklearn.effects` and five numbers; waves A cos(k x + phi) are held as their cosine and sine weights.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numba import njit

from whsklearn.effects import codes as k
from whsklearn.effects.base import Effect
from whsklearn.effects.law import FrictionLaw
from whsklearn.effects.terms import POSITION_FRICTION, smooth_sign, term

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

N_NUMBERS = 5

# probes: what no catalogue holds, to ask whether anything at all is left at a port
HAT_U, HAT_X, HAT_DX, HAT_T, LAG_U, LAG_V, PRODUCT, HAT_Q, TONE_U = 300, 301, 302, 303, 304, 305, 306, 307, 308


@njit(cache=True, error_model="numpy")
def hat(value, centre, width):
    """Triangle of height one."""
    return max(0.0, 1.0 - abs(value - centre) / width)


@njit(cache=True, error_model="numpy")
def driven(ecodes, eq, lag, u, ue, t, x, dt):
    """u_eff(t) of the command up to t; ``lag`` holds one state an effect."""
    w = u[t]
    for j in range(ecodes.size):
        if ecodes[j] == k.INPUT_DELAY:
            shift = max(eq[j, 0] / dt, 0.0)
            whole = math.floor(shift)
            part = shift - whole
            newer = u[t - whole] if t >= whole else 0.0
            older = u[t - whole - 1] if t > whole else 0.0
            w = (1.0 - part) * newer + part * older
    for j in range(ecodes.size):
        c = ecodes[j]
        p = eq[j, 0]
        if c == k.INPUT_OFFSET:
            w -= p
        elif c == k.DEAD_ZONE:
            w -= min(max(w, -p), p)
        elif c == k.SATURATION:
            w = min(max(w, -p), p)
        elif c == k.TORQUE_RIPPLE:
            w *= 1.0 - p * math.cos(eq[j, 2] * x) - eq[j, 1] * math.sin(eq[j, 2] * x)
        elif c == k.CHANGE_GAIN:
            if t * dt > eq[j, 1]:
                w *= 1.0 + p
        elif c == k.ACTUATOR_LAG:
            share = 1.0 - math.exp(-dt / max(p, 1e-9 * dt))
            lag[j] += share * (w - lag[j])
            w = lag[j]
        elif c == HAT_U:
            w += p * hat(u[t], eq[j, 1], eq[j, 2])
        elif c == LAG_U:
            i = t - int(eq[j, 1])
            w += p * (u[i] if i >= 0 else 0.0)
        elif c == TONE_U:
            phase = 2.0 * math.pi * eq[j, 2] * t * dt
            w += p * math.cos(phase) + eq[j, 1] * math.sin(phase)
    return w


@njit(cache=True, error_model="numpy")
def transmitted(ecodes, eq, memory, x, dt):
    """x behind the transmission; ``memory`` of shape (n_effects, 4) holds what a transmission remembers."""
    for j in range(ecodes.size):
        if ecodes[j] == k.BACKLASH:
            half = 0.5 * eq[j, 0]
            out = memory[j, 0]
            out = x - half if x - half > out else (x + half if x + half < out else out)
            memory[j, 0] = out
            x = out
        elif ecodes[j] == k.FLEXIBLE_COUPLING:
            radius = math.exp(-2.0 * math.pi * eq[j, 1] * eq[j, 0] * dt)
            turn = 2.0 * math.pi * eq[j, 0] * dt * math.sqrt(max(1.0 - eq[j, 1] ** 2, 0.0))
            p1, p2 = -2.0 * radius * math.cos(turn), radius * radius
            out = (1.0 + p1 + p2) * x - p1 * memory[j, 0] - p2 * memory[j, 1]
            memory[j, 1] = memory[j, 0]
            memory[j, 0] = out
            x = out
    return x


@njit(cache=True, error_model="numpy")
def added(ecodes, eq, memory, drive, x, dx, dx_old, t, dt, kappa, v):
    """What friction, position and time effects add to v(t)."""
    total = 0.0
    for j in range(ecodes.size):
        c = ecodes[j]
        p = eq[j, 0]
        if c == POSITION_FRICTION or c == k.COGGING or c == k.GRAVITY_IMBALANCE:
            order = 1.0 if c == k.GRAVITY_IMBALANCE else eq[j, 2]
            wave = p * math.cos(order * x) + eq[j, 1] * math.sin(order * x)
            total += wave * smooth_sign(dx, kappa)[0] if c == POSITION_FRICTION else wave
        elif c < 100:
            total += p * term(c, eq[j, 1], eq[j, 2], eq[j, 3], x, dx, kappa)[0]
        elif c == k.LOAD_FRICTION:
            total += p * abs(drive) * smooth_sign(dx, kappa)[0]
        elif c == k.FRICTION_DRIFT:
            total -= p * math.expm1(-t * dt / eq[j, 1]) * smooth_sign(dx, kappa)[0]
        elif c == k.DAHL:
            if dx != 0.0:
                s = 1.0 if dx > 0.0 else -1.0
                memory[j, 0] = s + (memory[j, 0] - s) * math.exp(-abs(dx) / eq[j, 1])
            total += p * memory[j, 0]
        elif c == k.CABLE_SPRING:
            total += p * (x - eq[j, 1])
        elif c == k.HARDENING_SPRING:
            total += p * (x - eq[j, 1]) ** 3
        elif c == k.END_STOP:
            total += p * (max(x - eq[j, 1], 0.0) - max(-x - eq[j, 1], 0.0))
        elif c == k.DISTURBANCE_TONE:
            phase = 2.0 * math.pi * eq[j, 2] * t * dt
            total += p * math.cos(phase) + eq[j, 1] * math.sin(phase)
        elif c == k.CHANGE_VISCOUS or c == k.CHANGE_COULOMB or c == k.CHANGE_INERTIA:
            if t * dt > eq[j, 1]:
                if c == k.CHANGE_VISCOUS:
                    total += p * dx
                elif c == k.CHANGE_COULOMB:
                    total += p * smooth_sign(dx, kappa)[0]
                else:
                    total += p * (dx - dx_old)
        elif c >= HAT_X:
            total += p * _probe(c, eq[j, 1], eq[j, 2], x, dx, drive, t, v, kappa)
    return total


@njit(cache=True, error_model="numpy")
def _probe(c, centre, width, x, dx, drive, t, v, kappa):
    """Generic functions at the law's port."""
    if c == HAT_X:
        return hat(x, centre, width)
    if c == HAT_DX:
        return hat(dx, centre, width)
    if c == HAT_T:
        return hat(float(t), centre, width)
    if c == LAG_V:
        i = t - int(centre)
        return v[i] if i >= 0 else 0.0
    if c == PRODUCT:
        s = smooth_sign(dx, kappa)[0]
        if centre == 0.0:
            return x * dx
        if centre == 1.0:
            return x * s
        if centre == 2.0:
            return drive * dx
        if centre == 3.0:
            return abs(drive) * s
        if centre == 4.0:
            return t * dx
        if centre == 5.0:
            return t * s
        if centre == 6.0:
            return x * drive
        return x * abs(dx)
    return 0.0


@njit(cache=True, error_model="numpy")
def sensed(ecodes, eq, q, t, dt):
    """Reading of the true output q."""
    y = q
    for j in range(ecodes.size):
        c = ecodes[j]
        p = eq[j, 0]
        if c == k.OUTPUT_OFFSET:
            y += p
        elif c == k.OUTPUT_DRIFT:
            y += p * t * dt
        elif c == k.SENSOR_RECTIFICATION:
            y = (1.0 - p) * y + p * abs(y)
        elif c == k.ENCODER_ECCENTRICITY:
            y += p * math.cos(eq[j, 2] * q) + eq[j, 1] * math.sin(eq[j, 2] * q)
        elif c == HAT_Q:
            y += p * hat(q, eq[j, 1], eq[j, 2])
        elif c == k.QUANTIZATION:
            if p > 0.0:
                y = p * math.floor(y / p + 0.5)
    return y


@njit(cache=True, error_model="numpy")
def unsensed(ecodes, eq, y, expected, t, dt):
    """The output q that a reading y stands for, ``expected`` where the reading leaves a choice."""
    q = y
    for j in range(ecodes.size - 1, -1, -1):
        c = ecodes[j]
        p = eq[j, 0]
        if c == k.OUTPUT_OFFSET:
            q -= p
        elif c == k.OUTPUT_DRIFT:
            q -= p * t * dt
        elif c == k.SENSOR_RECTIFICATION:
            slope = 1.0 - 2.0 * p
            if expected < 0.0 and q * slope < 0.0:
                q = q / (math.copysign(max(abs(slope), 0.05), slope))
        elif c == k.ENCODER_ECCENTRICITY:
            start = q
            for _ in range(4):
                q = start - p * math.cos(eq[j, 2] * q) - eq[j, 1] * math.sin(eq[j, 2] * q)
        elif c == HAT_Q:
            q -= p * hat(q, eq[j, 1], eq[j, 2])
    return q


@njit(cache=True, nogil=True, error_model="numpy")
def run_chain(theta, dims, codes, shapes, kappa, ecodes, eq, u, y, noise, dt, free, x, v, y_hat):
    """The chain along a record; fills x, v and y_hat.

    ``free``: y_hat is the output from u and ``noise`` of (2) alone.  Otherwise it is predicted one step
    ahead with the readings y.  ``theta`` is laid out as in `whsklearn.recursion.predictor`.
    """
    na, nb, nc, nd, nw = dims[0], dims[1], dims[2], dims[3], dims[4]
    b0, w0 = na - 1, na - 1 + nb
    c0 = w0 + nw
    d0 = c0 + nc - 1
    n = u.size
    ue = np.zeros(n)
    raw = np.zeros(n)
    q = np.zeros(n)
    lag = np.zeros(ecodes.size)
    memory = np.zeros((ecodes.size, 4))
    dx_old = 0.0
    some = ecodes.size > 0
    for t in range(n):
        s = ue[t - 1] if t > 0 else 0.0
        for i in range(1, min(na, t)):
            s += theta[i - 1] * ue[t - 1 - i]
        for j in range(min(nb, t)):
            s -= theta[b0 + j] * raw[t - 1 - j]
        s = min(max(s, -1e30), 1e30)
        raw[t] = s
        x[t] = transmitted(ecodes, eq, memory, s, dt) if some else s
        dx = x[t] - (x[t - 1] if t > 0 else 0.0)
        ue[t] = driven(ecodes, eq, lag, u, ue, t, x[t], dt) if some else u[t]
        f = 0.0
        for i in range(nw):
            f += theta[w0 + i] * term(codes[i], shapes[i, 0], shapes[i, 1], shapes[i, 2], x[t], dx, kappa)[0]
        if some:
            f += added(ecodes, eq, memory, u[t], x[t], dx, dx_old, t, dt, kappa, v)
        v[t] = min(max(f, -1e30), 1e30)
        dx_old = dx
        s = noise[t]
        if t > 0:
            s += v[t - 1]
        for i in range(1, min(nc, t)):
            s += theta[c0 + i - 1] * v[t - 1 - i]
        for i in range(min(nd, t)):
            s -= theta[d0 + i] * q[t - 1 - i]
        s = min(max(s, -1e30), 1e30)
        y_hat[t] = sensed(ecodes, eq, s, t, dt) if some else s
        q[t] = s if free else (unsensed(ecodes, eq, y[t], s, t, dt) if some else y[t])


def run_effects(
    a: Array,
    b: Array,
    c: Array,
    d: Array,
    law: FrictionLaw,
    effects: Sequence[Effect],
    u: Array,
    noise: Array,
    dt: float,
) -> tuple[Array, Array, Array]:
    """x, v and y of a system with effects, at rest before the first sample."""
    dims = np.array([a.size, b.size, c.size, d.size, len(law)], dtype=np.int64)
    theta = np.concatenate([a[1:], b, law.weights, c[1:], d])
    x, v, y = np.empty(u.size), np.empty(u.size), np.empty(u.size)
    ecodes, eq = packed(effects)
    run_chain(theta, dims, law.codes, law.shapes, math.inf, ecodes, eq, u, u, noise, dt, True, x, v, y)
    return x, v, y


def packed(effects: Sequence[Effect]) -> tuple[NDArray[np.int64], Array]:
    """Codes and numbers of effects as `run_chain` takes them.

    Raises
    ------
    ValueError
        If an effect has no place in a Wiener-Hammerstein chain.
    """
    eq = np.zeros((len(effects), N_NUMBERS))
    for row, effect in zip(eq, effects, strict=True):
        numbers = numbers_of(effect)
        row[: len(numbers)] = numbers
    return np.array([e.code for e in effects], dtype=np.int64), eq


def numbers_of(effect: Effect) -> tuple[float, ...]:
    """Size (or cosine and sine weight) first, then the shape, in the kernel's order."""
    if not isinstance(effect, Effect) or effect.code < 0 or effect.code >= k.USER_TORQUE:
        raise ValueError(f"{effect!r} has no place in a Wiener-Hammerstein chain; take one of the catalogue.")
    if effect.name == "presliding_hysteresis" and effect.code != k.DAHL:
        raise ValueError(f"{type(effect).__name__} is not simulated in a chain; use PreslidingHysteresis.")
    if effect.name == "flexible_coupling":
        raise ValueError("A flexible_coupling of a chain is two more poles; raise the order n_b instead.")
    if effect.phased:
        shape = tuple(v for name, v in effect.shape.items() if name != "phase")
        cosine, sine = effect.coefficients
        return (float(cosine), float(sine), *shape)
    return (effect.magnitude, *effect.shape.values())[:N_NUMBERS]
