"""References: the rich default, and the poor ones that should end in silence."""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter


def reference(kind: str, t: np.ndarray, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Position, velocity and acceleration asked for, shape (n,) each.

    rich: eight tones of 0.1 to 2.9 Hz on a triangle of 5 rad; small: the tones at 3 %;
    sine: 2 rad at 0.5 Hz; one_way: a ramp; random: a random walk of 1.5 rad, whose acceleration is white.
    """
    r, v, a = np.zeros_like(t), np.zeros_like(t), np.zeros_like(t)
    if kind == "random":
        dt = t[1] - t[0]
        pole = np.exp(-2 * np.pi * 0.5 * dt)
        r = lfilter([(1 - pole) ** 2], [1, -2 * pole, pole**2], rng.standard_normal(t.size))
        r *= 1.5 / r.std()
        return r, (v := np.gradient(r, dt)), np.gradient(v, dt)
    if kind == "sine":
        w = 2 * np.pi * 0.5
        return 2 * np.sin(w * t), 2 * w * np.cos(w * t), -2 * w * w * np.sin(w * t)
    if kind == "one_way":
        w = 2 * np.pi * 0.4
        return 3 * t + 0.3 * np.sin(w * t), 3 + 0.3 * w * np.cos(w * t), -0.3 * w * w * np.sin(w * t)
    scale = 0.03 if kind == "small" else 1.0
    for f in np.linspace(0.1, 2.9, 8) * rng.uniform(0.96, 1.04, 8):
        w, phase = 2 * np.pi * f, rng.uniform(0, 2 * np.pi)
        amplitude = scale * 0.4 * rng.uniform(0.7, 1.3) / (1.0 + f**1.7)
        r += amplitude * np.sin(w * t + phase)
        v += amplitude * w * np.cos(w * t + phase)
        a -= amplitude * w * w * np.sin(w * t + phase)
    if kind == "rich":
        period = rng.uniform(9.0, 14.0)
        x = (t / period) % 1.0
        height = rng.uniform(4.5, 5.5)
        r += height * (4 * np.abs(x - 0.5) - 1)
        v += np.where(x < 0.5, -1, 1) * 4 * height / period
    start = np.clip(t / 0.5, 0, 1)
    ramp = start * start * (3 - 2 * start)
    return ramp * r, ramp * v, ramp * a
