"""One pass over a record through a Wiener-Hammerstein chain: free run or one-step prediction, with or without effects.

`WienerHammersteinSystem` simulates with it and the gap workflow predicts with it, so both use the same equations.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from whsklearn._numba import borrowed, njit, part
from whsklearn.effects import codes as k
from whsklearn.effects.base import Effect
from whsklearn.effects.equations import N_STATES
from whsklearn.effects.own import WHICH, address_of
from whsklearn.effects.terms import term
from whsklearn.effects.transmission import FlexibleCoupling
from whsklearn.systems.chain_ports import added, arrived, driven, occupied, sensed, transmitted, unsensed

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
    """Effects as `run` takes them.

    Raises ValueError if an effect has no place in a Wiener-Hammerstein chain.
    """
    for e in effects:
        if not isinstance(e, Effect) or e.code < 0:
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
