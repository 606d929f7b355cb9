"""Missing torque through its filter, and whitening that leaves white noise."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from whsklearn.filtering.records import CUTOFF_SIGMA, filtered, gaussian_derivatives
from whsklearn.gap.filters import autoregression, residual_filter, whiten


def test_whitening_many_columns_is_whitening_each():
    d, ar = np.random.default_rng(0).normal(size=(60, 5)), np.array([1.0, -0.4, 0.2])
    assert whiten(d, ar) == pytest.approx(np.column_stack([whiten(c, ar) for c in d.T]))


def test_whitening_undoes_the_colour():
    white = np.random.default_rng(0).normal(size=20_000)
    coloured = lfilter([1.0], [1.0, -0.9], white)
    ar = autoregression(coloured, 4, 0.0)
    left = whiten(coloured, ar)
    assert np.var(left) == pytest.approx(1.0, rel=0.05)
    assert abs(np.corrcoef(left[1:], left[:-1])[0, 1]) < 0.03


RNG = np.random.default_rng(0)


def test_filter_turns_a_lag_of_position_into_the_torque_behind_it():
    dt, inertia = 1e-3, 0.05
    seen_through = residual_filter(dt, inertia, 1e-6, 1.0, tracking=2.0, goal=0.004)
    t = np.arange(8000) * dt
    l1, l2 = seen_through.gains[0] / dt, seen_through.gains[1] / dt
    w = 2 * np.pi * 1.5
    torque = 0.1 * np.sin(w * t)
    response = 1.0 / (-(w**2) + 1j * w * l1 + l2)  # (p^2 + l1 p + l2)^-1
    e = 0.1 / inertia * np.imag(response * np.exp(1j * w * t))
    seen = seen_through.torque(e)[50:-50]
    smooth, *_ = gaussian_derivatives(CUTOFF_SIGMA / (2 * np.pi * seen_through.cutoff), dt)
    assert seen == pytest.approx(filtered(torque, smooth, seen_through.every)[50:-50], abs=2e-3)


def test_decimation_keeps_samples_in_place():
    seen_through = residual_filter(1e-3, 0.05, 1e-3, 1.0, tracking=2.0, goal=0.004)
    ramp = np.arange(6000.0)
    middle = slice(20, -20)
    level = seen_through.taps.sum()  # a ramp of the innovation gives a ramp of torque
    slope = np.diff(seen_through.torque(ramp)[middle])
    assert slope == pytest.approx(level * np.diff(ramp[:: seen_through.every][middle]), rel=1e-6)


def test_noise_gain_is_that_of_white_noise():
    seen_through = residual_filter(1e-3, 0.05, 1e-4, 1.0, tracking=2.0, goal=0.004)
    d = seen_through.torque(1e-4 * RNG.standard_normal(100_000))
    assert d[50:-50].std() == pytest.approx(1e-4 * seen_through.noise_gain, rel=0.1)


def test_whitening_whitens():
    x = np.zeros(20_000)
    w = RNG.standard_normal(x.size)
    for i in range(1, x.size):
        x[i] = 0.9 * x[i - 1] + w[i]
    e = whiten(x, autoregression(x, 12, 0.0))
    assert abs(e[1:] @ e[:-1] / (e @ e)) < 0.03
