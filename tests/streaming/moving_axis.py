"""A moving axis as a stream of rows, and a monitor that learns it."""

from __future__ import annotations

import numpy as np

from whsklearn import InverseDynamicsLags, RLSRegressor
from whsklearn.streaming import Options, StreamMonitor
from whsklearn.streaming.monitor import alarm_of_averages

TRUE = [0.02, 0.05, 0.3]
RATE = 500.0


def axis(n, seed=0):
    """Time, position and drive of an axis with an inertia of 0.02 kg m2, 0.05 Nm s/rad and 0.3 Nm."""
    t = np.arange(n) / RATE
    parts = [(0.5, 3.0), (0.3, 8.2)]
    q, v, a = (sum(A * w**k * np.sin(w * t + k * np.pi / 2) for A, w in parts) for k in range(3))
    rng = np.random.default_rng(seed)
    u = 0.02 * a + 0.05 * v + 0.3 * np.sign(v) + rng.normal(0, 1e-3, n)
    return t, q + rng.normal(0, 1e-6, n), u, v


def monitor_of(turns=()):
    told = []
    options = Options(
        timed=True, max_step=2.5 / RATE, step=1.0 / RATE, positions=(1,), turns=turns, restart_after_hole=True
    )
    model = RLSRegressor(InverseDynamicsLags(RATE, causal=True))
    return StreamMonitor(model, alarm_of_averages(), options, told.append), told


def streamed(table, cut=1000, turns=()):
    monitor, told = monitor_of(turns)
    for k in range(0, len(table), cut):
        monitor.take(table[k : k + cut], first=k + 1)
    return monitor, told
