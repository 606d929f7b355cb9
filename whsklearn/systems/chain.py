"""One pass over a record through a Wiener-Hammerstein chain: free run or one-step prediction, with or without effects.

`WienerHammersteinSystem` simulates with it and the gap workflow predicts with it, so both use the same equations.

.. code-block:: text

    u -> [drive] -> L1 -> x -> [transmission] -> x_l -> law + friction, position, time -> v -> L2 -> q -> [sensor] -> y

Drive effects change u as on an axis: u_eff = u - the torque of the effect.  Friction, position, time and user-defined
effects add to v as functions of x_l and dx = x_l(t) - x_l(t-1); sensor effects act on q.  The equations are those of
`whsklearn.effects`; an effect is its code and its `Effect.row`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from whsklearn._numba import borrowed, njit, part
from whsklearn.effects import codes as k
from whsklearn.effects import equations
from whsklearn.effects.base import Effect
from whsklearn.effects.equations import N_STATES
from whsklearn.effects.own import WHICH, address_of
from whsklearn.effects.rows import has_memory, load_torque, motor_torque, on_load, reading, term
from whsklearn.effects.transmission import FlexibleCoupling, play, resonance

LEAST_SLOPE = 0.05  # of a folded reading: below, dividing by it would only amplify noise


@njit(cache=False, error_model="numpy")
def at_drive(code):
    """Whether a code acts on the drive before L1."""
    return (
        k.INPUT_OFFSET <= code <= k.TORQUE_RIPPLE
        or k.DEAD_ZONE <= code <= k.SATURATION
        or code == k.CHANGE_GAIN
        or k.INPUT_DELAY <= code <= k.ACTUATOR_LAG
        or code == k.TONE_U
        or code == k.SPRING_U
        or code == k.PLAY_U
    )


@njit(cache=False, error_model="numpy")
def at_transmission(code):
    """Whether a code acts between L1 and the law."""
    return code == k.BACKLASH or code == k.FLEXIBLE_COUPLING or code == k.SATURATION_X or code == k.DEAD_ZONE_X


@njit(cache=False, error_model="numpy")
def at_sensor(code):
    """Whether a code acts on the reading."""
    return k.OUTPUT_OFFSET <= code <= k.QUANTIZATION or code == k.USER_OUTPUT or code == k.RESONANCE_Y


@njit(cache=False, error_model="numpy")
def occupied(codes):
    """(drive, transmission, sensor, law): whether any effect acts there."""
    drive, between, sensor, law = False, False, False, False
    for c in codes:
        if at_drive(c):
            drive = True
        elif at_transmission(c):
            between = True
        elif at_sensor(c):
            sensor = True
        else:
            law = True
    return drive, between, sensor, law


@njit(cache=False, error_model="numpy", forceinline=True)
def arrived(codes, rows, u, t, dt):
    """The command that arrives at t, after all delays."""
    w = u[t]
    for j in range(codes.size):
        if codes[j] == k.INPUT_DELAY:
            whole, part = equations.delayed(max(rows[j, 0] / dt, 0.0))
            newer = u[t - whole] if t >= whole else 0.0
            older = u[t - whole - 1] if t > whole else 0.0
            w = (1.0 - part) * newer + part * older
    return w


@njit(cache=False, error_model="numpy", forceinline=True)
def driven(codes, rows, memory, w, t, x, before, ahead, dt):
    """u_eff(t) of the command that has arrived.

    ``memory``, shape (n_effects, n_states), holds what a lag remembers; ``before`` is x(t-1), and ``ahead`` is x(t+1)
    without u_eff(t).
    """
    for j in range(codes.size):
        c = codes[j]
        if c == k.SPRING_U:
            w -= held_pull(rows[j, 0], rows[j, 1], x, before, ahead + w)
        elif at_drive(c) and c != k.INPUT_DELAY:
            w = passed(c, rows, memory, j, w, t * dt, x, dt)
    return w


@njit(cache=False, error_model="numpy", forceinline=True)
def held_pull(stiffness, centre, x, before, ahead):
    """The constant force over a sample that moves the mass as the spring does, whose force f changes with x.

    A smooth f moves a mass by f(t) + f''/12 in x(t+1) - 2 x(t) + x(t-1), a held one by the mean of its last two values.
    Both agree if f(t + 1/2) - f''/24 is held, here from the parabola through t-1, t and t+1, where x is first taken to
    be ``ahead``, without a spring.  With f(t) alone the spring would act half a sample late.
    """
    here = equations.hardening_spring(stiffness, centre, x)
    later = equations.hardening_spring(stiffness, centre, ahead - here)
    return (2.0 * later + 5.0 * here - equations.hardening_spring(stiffness, centre, before)) / 6.0


@njit(cache=False, error_model="numpy", forceinline=True)
def passed(c, rows, memory, j, w, time, x, dt):
    """The drive after effect j."""
    if c == k.ACTUATOR_LAG:
        memory[j, 0] = equations.lagged(w, memory[j, 0], rows[j, 0], dt)[1]
        return memory[j, 0]
    if c == k.PLAY_U:
        memory[j, 0] = play(rows[j, 0], memory[j, 0], w)
        return memory[j, 0]
    if c == k.DEAD_ZONE:
        return w - equations.dead_zone(rows[j, 0], w)
    if c == k.SATURATION:
        return w - equations.saturation(rows[j, 0], w)
    if c == k.TONE_U:
        return w + equations.disturbance_tone(rows[j, 0], rows[j, 1], rows[j, 2], time)
    return w - motor_torque(c, rows, j, time, x, 0.0, 0.0, 0.0, w)[0]


@njit(cache=False, error_model="numpy", forceinline=True)
def transmitted(codes, rows, memory, x, dt):
    """x after the transmission."""
    for j in range(codes.size):
        if codes[j] == k.BACKLASH:
            x = play(rows[j, 0], memory[j, 0], x)
            memory[j, 0] = x
        elif codes[j] == k.FLEXIBLE_COUPLING:
            x = coupled(rows[j, 0], rows[j, 1], memory, j, x, dt)
        elif codes[j] == k.SATURATION_X:
            x -= equations.saturation(rows[j, 0], x)
        elif codes[j] == k.DEAD_ZONE_X:
            x -= equations.dead_zone(rows[j, 0], x)
    return x


@njit(cache=False, error_model="numpy")
def coupled(frequency, ratio, memory, j, x, dt):
    """x after a resonance with static gain one; ``memory`` holds its last two values and x."""
    a0, a1, b1, b2 = resonance(frequency, ratio, dt)
    out = a0 * x + a1 * memory[j, 2] - b1 * memory[j, 0] - b2 * memory[j, 1]
    memory[j, 1] = memory[j, 0]
    memory[j, 0] = out
    memory[j, 2] = x
    return out


@njit(cache=False, error_model="numpy", forceinline=True)
def added(codes, rows, memory, own, u, x, dx, ddx, t, dt, kappa):
    """What friction, position and time effects add to v(t); ``ddx`` is the change of dx."""
    total = 0.0
    s, ds = equations.smooth_sign(dx, kappa)
    for j in range(codes.size):
        c = codes[j]
        if at_drive(c) or at_sensor(c) or at_transmission(c):
            total += 0.0
        elif c == k.USER_TORQUE:
            if own is not None:
                total += own(int(rows[j, WHICH]), rows[j], t * dt, x, dx, u)
        elif c == k.CHANGE_INERTIA:
            total += equations.parameter_change(rows[j, 0], rows[j, 1], t * dt, ddx)
        elif has_memory(c):
            equations.advance_hysteresis(c, rows, memory, j, dx, dx)
            total += rows[j, 0] * equations.hysteresis_torque(c, rows, memory, j, dx)[0]
        elif on_load(c):
            total += load_torque(c, rows, j, t * dt, x, dx)
        else:
            total += motor_torque(c, rows, j, t * dt, x, dx, s, ds, u)[0]
    return total


@njit(cache=False, error_model="numpy", forceinline=True)
def sensed(codes, rows, memory, own, q, t, dt):
    """Reading of the true output q, after a resonance behind L2 if there is one."""
    for j in range(codes.size):
        if codes[j] == k.RESONANCE_Y:
            q = coupled(rows[j, 0], rows[j, 1], memory, j, q, dt)
    y = q
    for j in range(codes.size):
        c = codes[j]
        if c == k.USER_OUTPUT:
            if own is not None:
                y += own(int(rows[j, WHICH]), rows[j], t * dt, q, 0.0, 0.0)
        elif at_sensor(c) and c != k.RESONANCE_Y:
            folds = c == k.SENSOR_RECTIFICATION or c == k.QUANTIZATION
            y += reading(c, rows, j, t * dt, y if folds else q)
    return y


@njit(cache=False, error_model="numpy", forceinline=True)
def unsensed(codes, rows, own, y, expected, t, dt):
    """The output q that gives a reading y, with the ``expected`` sign if a folded reading is ambiguous."""
    q = y
    for j in range(codes.size - 1, -1, -1):
        c = codes[j]
        if not at_sensor(c) or c == k.QUANTIZATION or c == k.RESONANCE_Y:
            continue
        if c == k.SENSOR_RECTIFICATION:
            slope = 1.0 - 2.0 * rows[j, 0]
            if expected < 0.0 and q * slope < 0.0:
                q /= math.copysign(max(abs(slope), LEAST_SLOPE), slope)
        else:
            start = q
            for _ in range(4):  # q + e(q) = y; e is small and smooth, so this iteration contracts
                here = 0.0
                if c != k.USER_OUTPUT:
                    here = reading(c, rows, j, t * dt, q)
                elif own is not None:
                    here = own(int(rows[j, WHICH]), rows[j], t * dt, q, 0.0, 0.0)
                q = start - here
    return q


FAR = 1e30  # at which signals are clipped, so that an unstable trial ends in large errors and not in NaN


class PackedChain(NamedTuple):
    """The chain that a record passes through, without the parameters theta."""

    dims: Any  # (5,): sizes of a, b, c, d and of the law
    law: Any  # law, shapes (n_terms,), (n_terms, 3): codes and shape numbers of the law's terms
    shapes: Any
    kappa: float  # sharpness of sign(dx); infinite for the sign itself
    dt: float  # sampling time


class Ports(NamedTuple):
    """The effects of a chain."""

    codes: Any  # codes, rows (n_effects,), (n_effects, 8): codes and numbers of the effects
    rows: Any
    own: Any  # user-defined effects, see `whsklearn.effects.own.address_of`


@njit(nogil=True, error_model="numpy")
def run(theta, chain, ports, u, y, noise, free, x, v, y_hat):
    """(1), the law and (2) from rest, with the effects at their ports; fills x, v and y_hat, each of shape (n,).

    ``free``: y_hat is the output from u and ``noise`` of (2) alone; otherwise it is predicted one step ahead with
    the readings y.  theta = [a[1:], b, weights of the law, c[1:], d].  ``ports`` is None without effects: Numba then
    leaves their branches out, which makes the pass twice as fast.
    """
    if ports is None:
        _pass(theta, chain, None, free, (u, y, noise), (x, v, y_hat), (u, x, y_hat if free else y), None)
    else:
        # the input that drives L1, x before the transmission, y before the sensor
        ue, raw, q = np.empty(u.size), np.empty(u.size), np.empty(u.size)
        memory = np.zeros((ports.codes.size, N_STATES))
        _pass(theta, chain, ports, free, (u, y, noise), (x, v, y_hat), (ue, raw, q), memory)


@part
def _pass(theta, chain, ports, free, given, found, inner, memory):
    """The pass of `run`, on borrowed arrays whose owners live there."""
    theta, (u, y, noise), (x, v, y_hat), (ue, raw, q) = borrowed((theta, given, found, inner))
    dims, law, shapes, kappa, dt = borrowed(chain)
    na, nb, nc, nd, nw = dims[0], dims[1], dims[2], dims[3], dims[4]
    b0, w0 = na - 1, na - 1 + nb
    c0 = w0 + nw
    d0 = c0 + nc - 1
    n = u.size
    if ports is not None:
        codes, rows, memory, own = borrowed(ports.codes), borrowed(ports.rows), borrowed(memory), ports.own
        # a port without an effect is skipped: its call would cost more than the rest of the sample
        drive, between, sensor, law_port = occupied(codes)
    dx_old = ahead = before = 0.0  # x(t) without u_eff(t-1), and x(t-1)
    for t in range(n):
        s = min(max(ahead + (ue[t - 1] if t > 0 else 0.0), -FAR), FAR)
        raw[t] = s
        ahead = 0.0
        for i in range(1, min(na, t + 1)):
            ahead += theta[i - 1] * ue[t - i]
        for j in range(min(nb, t + 1)):
            ahead -= theta[b0 + j] * raw[t - j]
        if ports is not None:
            if between:
                s = transmitted(codes, rows, memory, s, dt)
            ue[t] = u[t]
            if drive:
                w = arrived(codes, rows, u, t, dt)
                ue[t] = driven(codes, rows, memory, w, t, s, before, ahead + s - raw[t], dt)
        x[t] = s
        dx = s - before
        before = s
        f = 0.0
        for i in range(nw):
            f += theta[w0 + i] * term(law[i], shapes[i, 0], shapes[i, 1], shapes[i, 2], s, dx, kappa)[0]
        if ports is not None and law_port:
            f += added(codes, rows, memory, own, u[t], s, dx, dx - dx_old, t, dt, kappa)
            dx_old = dx
        v[t] = min(max(f, -FAR), FAR)
        s = noise[t]
        if t > 0:
            s += v[t - 1]
        for i in range(1, min(nc, t)):
            s += theta[c0 + i - 1] * v[t - 1 - i]
        for i in range(min(nd, t)):
            s -= theta[d0 + i] * q[t - 1 - i]
        s = min(max(s, -FAR), FAR)
        if ports is None:
            y_hat[t] = s
        elif not sensor:
            y_hat[t] = s
            q[t] = s if free else y[t]
        else:
            y_hat[t] = sensed(codes, rows, memory, own, s, t, dt)
            q[t] = s if free else unsensed(codes, rows, own, y[t], s, t, dt)


def packed(effects: Sequence[Effect]) -> Ports | None:
    """Effects as `run` takes them. Raises ValueError if an effect has no place in a Wiener-Hammerstein chain."""
    for e in effects:
        if not isinstance(e, Effect) or e.code < 0 or e.code == k.EARLY_REVERSAL:  # which takes an inertia
            raise ValueError(f"{e!r} has no place in a Wiener-Hammerstein chain; take one of the catalogue.")
        if isinstance(e, FlexibleCoupling):
            raise ValueError("A FlexibleCoupling joins two inertias; in a chain give it as a ChainResonance.")
    own = [type(e) for e in effects if e.code in (k.USER_TORQUE, k.USER_OUTPUT)]
    rows = np.zeros((len(effects), k.N_NUMBERS))
    for row, effect in zip(rows, effects, strict=True):
        numbers = effect.row
        row[: len(numbers)] = numbers
        if type(effect) in own:
            row[WHICH] = own.index(type(effect))
    if not effects:
        return None
    return Ports(np.array([e.code for e in effects], dtype=np.int64), rows, address_of(tuple(own)))
