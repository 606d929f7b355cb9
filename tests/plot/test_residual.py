"""Residual panels show what the tests behind them say."""

from __future__ import annotations

import numpy as np

from whsklearn.plot import ResidualDisplay


def test_residual_band_is_exceeded_by_white_noise_one_time_in_twenty():
    rng = np.random.default_rng(2)
    shown = [ResidualDisplay(rng.normal(size=500)) for _ in range(200)]
    outside = [np.mean(np.abs(d.whiteness.r) > d.band) for d in shown]
    assert 0.035 < np.mean(outside) < 0.06


def test_residuals_of_a_missed_delay_show_at_its_lag():
    u, e = np.random.default_rng(3).normal(size=(2, 2000))
    shown = ResidualDisplay(0.1 * e + np.roll(u, 3), u, max_lag=10)
    assert shown.dependence.lags[np.argmax(np.abs(shown.dependence.r))] == 3


def test_residual_panels_count_what_is_outside(model, record):
    shown = ResidualDisplay.from_estimator(model, *record)
    assert "of 25 outside 95 %" in shown.axes_[0].get_title()
