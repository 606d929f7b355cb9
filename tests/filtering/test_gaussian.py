"""Derivative kernels are exact on polynomials."""

from __future__ import annotations

import numpy as np
import pytest

from whsklearn.filtering.gaussian import gaussian_derivatives


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


@pytest.mark.parametrize("dt", [1e-4, 1e-3, 5e-3, 0.02])
@pytest.mark.parametrize("width", [0.7, 1.0, 4.4, 20.0])
def test_derivative_kernels_are_exact_on_polynomials_at_every_rate_and_width(dt, width):
    t = np.arange(400) * dt
    for kernel, order in zip(gaussian_derivatives(width * dt, dt), range(3), strict=True):
        assert np.convolve(np.full(400, 100.0), kernel, mode="valid") * dt**order == pytest.approx(
            100.0 if order == 0 else 0.0, abs=1e-8
        )
        for power in range(1, 3):
            seen = np.convolve(t**power, kernel, mode="valid")
            half = kernel.size // 2
            inner = t[half : t.size - half]
            wanted = {(1, 1): 1.0, (1, 2): 0.0, (2, 1): 2 * inner, (2, 2): 2.0}.get((power, order))
            if wanted is not None:
                assert seen == pytest.approx(wanted, abs=1e-6 * t[-1] / dt**order)
