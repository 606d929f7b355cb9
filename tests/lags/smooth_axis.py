"""An axis on a smooth path, exact by its inverse dynamics."""

from __future__ import annotations

import numpy as np

RATE = 500.0


TRUTH = {"inertia": 0.05, "viscous": 0.12, "coulomb": 0.4, "input_offset": -0.07}


def smooth_axis(seconds=12.0, noise=0.0, seed=0):
    """Position and torque of an axis on a smooth path, exact by its inverse dynamics."""
    t = np.arange(int(seconds * RATE)) / RATE
    frequencies, amplitudes = np.array([0.21, 0.5, 1.3]), np.array([1.0, 0.6, 0.15])
    w = 2 * np.pi * frequencies
    q = np.sin(np.outer(t, w)) @ amplitudes
    v = np.cos(np.outer(t, w)) @ (amplitudes * w)
    a = -np.sin(np.outer(t, w)) @ (amplitudes * w**2)
    torque = 0.05 * a + 0.12 * v + 0.4 * np.sign(v) - 0.07
    rng = np.random.default_rng(seed)
    return (q + noise * rng.normal(size=q.size))[:, None], torque


def solve(phi, target):
    return np.linalg.lstsq(phi, target, rcond=None)[0]
