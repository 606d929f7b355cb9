"""One second of drive and of reference for an axis, and the chain of Example 5.1 with an input."""

from __future__ import annotations

import numpy as np

from whsklearn import WienerHammersteinSystem

T = np.arange(1000) / 1000
DRIVE = 0.9 * np.sin(9.0 * T) + 0.3 * np.cos(31.0 * T)
REFERENCE = 0.5 * np.sin(5.0 * T)
BLOCKS = {"a": [1.0, 2.2], "b": [1.0, 0.5], "c": [1.0, 0.2], "d": [0.15, 0.4]}
U = np.random.default_rng(3).normal(size=400)


def chain(*effects, law=None, dt=1.0):
    return WienerHammersteinSystem(**BLOCKS, law=law, effects=effects, dt=dt)
