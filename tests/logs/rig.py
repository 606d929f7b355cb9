"""A short record of an axis, as columns, for the readers' tests."""

from __future__ import annotations

import numpy as np
import pytest

RATE = 200.0
NAMES = {"time": "time_s", "drive": "torque_nm", "position": "position_rad"}


def columns(n: int = 1200, seed: int = 0) -> dict[str, np.ndarray]:
    """Time, drive and position of an axis that swings; noise on both."""
    t = np.arange(n) / RATE
    rng = np.random.default_rng(seed)
    return {
        "time_s": t,
        "torque_nm": np.sin(3 * t) + 0.01 * rng.normal(size=n),
        "position_rad": np.cos(2 * t) + 1e-6 * rng.normal(size=n),
    }


TABLE = columns(400)


def same(log, atol=1e-9):
    """Whether a log that was read holds `TABLE`."""
    assert np.allclose(log.X[:, 0], TABLE["torque_nm"], rtol=0, atol=atol)
    assert np.allclose(log.y, TABLE["position_rad"], rtol=0, atol=atol)
    assert log.sample_rate == pytest.approx(RATE, rel=1e-6)


HEAD = ["time_s", "torque_nm", "position_rad"]


def text(sep=",", head=HEAD, before=(), decimal=".", line="\n", after=()):
    """Three hundred rows as a program writes them, in one dialect of CSV."""
    table = columns(300)
    rows = [sep.join(f"{v:.9f}".replace(".", decimal) for v in row) for row in zip(*table.values(), strict=True)]
    return line.join([*before, *([sep.join(head)] if head else []), *after, *rows]) + line
