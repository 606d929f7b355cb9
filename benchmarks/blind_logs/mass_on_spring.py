"""A mass on a hardening spring after the Silverbox, m y'' + d y' + a y + b y^3 = u, all in volts, by Runge-Kutta steps.

The structure is that of Wigren and Schoukens 2013, Three free data sets for development and benchmarking in nonlinear
system identification, European Control Conference.  The numbers are round ones near those that others have identified
(resonance 68 Hz, damping 0.05, static gain one, b = 4 / V^2), not the owners'.
"""

from __future__ import annotations

import numpy as np
import pandas as pd
from numba import njit

RATE = 1e7 / 2**14  # Hz
MASS, DAMPING, STIFFNESS, CUBIC = 5.4e-6, 2.2e-4, 1.0, 4.0
BAND = 200.0  # Hz, of the odd random-phase multisine
FINE = 20  # steps of the integration a sample
COLUMNS = {"input": "u", "output": "y"}


@njit(cache=True)
def _acceleration(q, v, u, cubic):
    return (u - DAMPING * v - STIFFNESS * q - cubic * q * q * q) / MASS


@njit(cache=True)
def _run(u, cubic):
    """y at every sample, the input held between them."""
    y = np.empty(u.size)
    q, v, h = 0.0, 0.0, 1.0 / (RATE * FINE)
    for k in range(u.size):
        y[k] = q
        for _ in range(FINE):
            a1 = _acceleration(q, v, u[k], cubic)
            v2 = v + 0.5 * h * a1
            a2 = _acceleration(q + 0.5 * h * v, v2, u[k], cubic)
            v3 = v + 0.5 * h * a2
            a3 = _acceleration(q + 0.5 * h * v2, v3, u[k], cubic)
            v4 = v + h * a3
            a4 = _acceleration(q + h * v3, v4, u[k], cubic)
            q += h / 6.0 * (v + 2.0 * v2 + 2.0 * v3 + v4)
            v += h / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4)
    return y


def record(seed: int, n: int = 3000, rms: float = 0.022, noise: float = 2e-4, cubic: float = CUBIC) -> pd.DataFrame:
    """A log of ``n`` samples: input of ``rms`` volts, output to some 0.2 V with ``noise`` volts of white noise."""
    rng = np.random.default_rng(seed)
    t = np.arange(n) / RATE
    lines = np.arange(1, int(BAND * 4096 / RATE), 2) * RATE / 4096
    phases = rng.uniform(0, 2 * np.pi, lines.size)
    u = np.cos(2.0 * np.pi * np.outer(t, lines) + phases).sum(axis=1)
    u = u * rms / np.std(u)
    return pd.DataFrame({"time_s": t, "u": u, "y": _run(u, cubic) + noise * rng.standard_normal(n)})
