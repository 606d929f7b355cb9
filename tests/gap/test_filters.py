"""Derivative kernels are exact on parabolas, and whitening leaves white noise."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from whsklearn.gap.filters import autoregression, gaussian_derivatives, whiten


@pytest.mark.parametrize("sigma", [0.002, 0.01])
def test_kernels_are_exact_on_parabolas(sigma):
    dt = 0.001
    g, g1, g2 = gaussian_derivatives(sigma, dt)
    t = np.arange(400) * dt
    parabola = 100.0 + 3.0 * t + 2.0 * t**2
    inside = t[g.size // 2 : t.size - g.size // 2]
    np.testing.assert_allclose(np.convolve(parabola, g1, mode="valid"), 3.0 + 4.0 * inside, rtol=1e-6)
    np.testing.assert_allclose(np.convolve(parabola, g2, mode="valid"), 4.0, rtol=1e-4)


def test_a_constant_has_no_derivative():
    _, g1, g2 = gaussian_derivatives(0.004, 0.001)
    assert abs(g1.sum()) < 1e-9 * np.abs(g1).sum()
    assert abs(g2.sum()) < 1e-9 * np.abs(g2).sum()  # else a position offset would be a phantom torque


def test_whitening_undoes_the_colour():
    white = np.random.default_rng(0).normal(size=20_000)
    coloured = lfilter([1.0], [1.0, -0.9], white)
    ar = autoregression(coloured, 4, 0.0)
    left = whiten(coloured, ar)
    assert np.var(left) == pytest.approx(1.0, rel=0.05)
    assert abs(np.corrcoef(left[1:], left[:-1])[0, 1]) < 0.03
