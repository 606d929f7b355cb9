"""The columns of a scan over many orders."""

from __future__ import annotations

import numpy as np
import pytest

from whsklearn.effects.orders import waves

RNG = np.random.default_rng(0)
ANGLE, BLUR, FRONT = np.cumsum(RNG.normal(size=(3, 400)) * 0.1, axis=1)


@pytest.mark.parametrize(("dtype", "rounding"), [(np.float64, 1e-12), (np.float32, 1e-7)])
@pytest.mark.parametrize(("first", "step", "count"), [(1.0, 1.0, 128), (2.3, 0.01, 25), (4.0, 0.0, 1)])
def test_waves_are_blurred_cosines_and_sines_of_every_order(first, step, count, dtype, rounding):
    k = first + step * np.arange(count)
    size = FRONT[:, None] * np.exp(-0.5 * (BLUR[:, None] * k) ** 2)
    exact = np.hstack([size * np.cos(ANGLE[:, None] * k), size * np.sin(ANGLE[:, None] * k)])
    out = np.empty(exact.shape, dtype)
    waves(out, ANGLE, BLUR, FRONT, first, step)
    assert out == pytest.approx(exact, abs=rounding * np.abs(FRONT).max())
