"""Twins: logs in which nothing is missing, made by the fitted model in the same experiment.

The twin follows the measured path under a soft controller of its own on top of the logged drive, with
the measured noise on its encoder.  Whatever the diagnosis finds in it is a false alarm, so the best
score that a candidate reaches on twins is the null of the real one.
"""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from whsklearn.gap.axis_kernel import dry, push, sensor
from whsklearn.gap.axis_model import AxisModel
from whsklearn.gap.bench import Bench

Array = NDArray[Any]


@njit(cache=True, nogil=True)
def _closed_loop(inertia, timing, codes, q, drive, path, speed, noise, quantum, dt, substeps, kp, kd):
    n = drive.size
    u = np.empty(n)
    y = np.empty(n)
    h = dt / substeps
    th = path[0]
    v = speed[0]
    for k in range(n):
        t = k * dt
        y[k] = sensor(codes, q, th, t) + noise[k]
        if quantum > 0.0:
            y[k] = quantum * math.floor(y[k] / quantum + 0.5)
        u[k] = drive[k] + kp * (path[k] - y[k]) + kd * (speed[k] - v)
        whole = math.floor(timing)
        part = timing - whole
        held = u[k] if whole < 0 else (1.0 - part) * u[k] + part * u[max(k - 1, 0)]
        for _ in range(substeps):
            s = 1.0 if v > 0.0 else (-1.0 if v < 0.0 else 0.0)
            if s == 0.0:
                f = push(codes, q, th, 0.0, held, t, 0.0)
                if f > dry(codes, q, th, 0.0, held, t, 1.0):
                    s = 1.0
                elif -f > dry(codes, q, th, 0.0, held, t, -1.0):
                    s = -1.0
                else:
                    continue
            a = (push(codes, q, th, v, held, t, 0.0) - s * dry(codes, q, th, v, held, t, s)) / inertia
            new = v + h * a
            if new * v < 0.0:
                new = 0.0
            th += 0.5 * h * (v + new)
            v = new
    return u, y


def twin(bench: Bench, model: AxisModel, rng: np.random.Generator) -> Bench:
    """The bench with a twin of its record in place of the record."""
    codes, q = model.arrays()
    record, dt = bench.record, bench.scene.dt
    w = 2 * np.pi * min(4.0, 0.03 / dt)
    quiet = 0.0 if bench.quantum == 0 else bench.quantum / np.sqrt(12)
    sigma = np.sqrt(max(bench.noise**2 - quiet**2, (0.3 * bench.noise) ** 2))
    u, y = _closed_loop(
        model.inertia, model.timing, codes, q, record.drive, *bench.start, sigma * rng.standard_normal(len(record)),
        bench.quantum, dt, max(1, int(np.ceil(dt / 1e-4))), model.inertia * w * w, 1.4 * model.inertia * w,
    )  # fmt: skip
    return dataclasses.replace(bench, record=dataclasses.replace(record, drive=u, position=y))
