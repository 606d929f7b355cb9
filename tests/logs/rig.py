"""A short record of an axis, as columns, for the readers' tests."""

from __future__ import annotations

import numpy as np

RATE = 200.0


def columns(n: int = 1200, seed: int = 0) -> dict[str, np.ndarray]:
    """Time, drive and position of an axis that swings; noise on both."""
    t = np.arange(n) / RATE
    rng = np.random.default_rng(seed)
    return {
        "time_s": t,
        "torque_nm": np.sin(3 * t) + 0.01 * rng.normal(size=n),
        "position_rad": np.cos(2 * t) + 1e-6 * rng.normal(size=n),
    }
