"""Residual tests hold their false-alarm rate and see what they claim to see."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from whsklearn.validation import (
    cross_correlation_test,
    residual_tests,
    whiteness_test,
)


def coloured(rng, n, pole):
    return lfilter([1.0], [1.0, -pole], rng.normal(size=n + 200))[200:]


def binomial_band(rate, runs):
    """Three standard errors around a rate."""
    return pytest.approx(rate, abs=3 * (rate * (1 - rate) / runs) ** 0.5)


def test_the_band_is_over_root_n_and_holds_95_percent():
    rng = np.random.default_rng(0)
    tests = [whiteness_test(rng.normal(size=400), 10) for _ in range(300)]
    assert tests[0].band == pytest.approx(1.959964 / 20, rel=1e-6)
    assert np.mean([np.abs(t.r) > t.band for t in tests]) == pytest.approx(0.05, abs=0.012)


def test_correlations_of_a_first_order_process():
    r = whiteness_test(coloured(np.random.default_rng(1), 200_000, 0.8), 5).r
    np.testing.assert_allclose(r, 0.8 ** np.arange(1, 6), atol=0.02)


def test_whiteness_keeps_its_level_and_agrees_with_its_definition():
    rng = np.random.default_rng(2)
    p = np.array([whiteness_test(rng.normal(size=500), 20).p_value for _ in range(400)])
    assert np.mean(p < 0.05) == binomial_band(0.05, 400)
    e = rng.normal(size=300)
    test = whiteness_test(e, 10)
    assert test.statistic == pytest.approx(300 * 302 * sum(test.r[k - 1] ** 2 / (300 - k) for k in range(1, 11)))
    assert whiteness_test(e, 10, n_params=4).degrees == 6


def test_whiteness_sees_colour():
    assert whiteness_test(coloured(np.random.default_rng(3), 400, 0.4)).p_value < 1e-4


@pytest.mark.parametrize("negative_lags", [False, True])
@pytest.mark.parametrize("pole", [0.0, 0.9])
def test_cross_correlation_keeps_its_level_whatever_the_colour(pole, negative_lags):
    rng = np.random.default_rng(4)
    p = []
    for _ in range(400):
        e, u = coloured(rng, 800, pole), coloured(rng, 800, pole)
        p.append(cross_correlation_test(e, u, 15, negative_lags=negative_lags).p_value)
    assert np.mean(np.array(p) < 0.05) == binomial_band(0.05, 400)
    assert np.mean(p) == pytest.approx(0.5, abs=0.05)


@pytest.mark.parametrize("lag", [0, 7, 15])
def test_a_forgotten_delay_is_found_at_its_lag(lag):
    rng = np.random.default_rng(lag)
    u = rng.normal(size=1000)
    test = cross_correlation_test(rng.normal(size=1000) + 0.3 * np.roll(u, lag), u, 15)
    assert test.p_value < 0.01
    assert test.lags[np.argmax(np.abs(test.r))] == lag


def test_feedback_shows_at_negative_lags_only():
    rng = np.random.default_rng(5)
    e = rng.normal(size=1000)
    u = rng.normal(size=1000) + 0.4 * np.roll(e, 3)
    assert cross_correlation_test(e, u, 10).p_value > 0.05
    both = cross_correlation_test(e, u, 10, negative_lags=True)
    assert both.p_value < 0.01
    assert both.lags[np.argmax(np.abs(both.r))] == -3


@pytest.mark.parametrize(("left", "seen_by"), [("even", "u^2, e"), ("odd", "u^2, e^2"), ("linear", "u, e")])
def test_each_test_sees_its_family(left, seen_by):
    rng = np.random.default_rng(6)
    u = rng.normal(size=4000)
    shape = {"even": u**2, "odd": u**3 - 3 * u, "linear": u}[left]  # the odd one has no linear part left
    tests = residual_tests(rng.normal(size=4000) + 0.4 * shape, u)
    assert tests[seen_by].p_value < 0.05 / len(tests)
    if left == "odd":
        assert tests["u, e"].p_value > 0.05 / len(tests)


@pytest.mark.parametrize(
    ("e", "u", "lags", "said"),
    [
        (np.ones(500), np.arange(500.0), 5, "e is constant"),
        (np.arange(500.0), np.zeros(500), 5, "u is constant"),
        (np.arange(500.0), np.arange(499.0), 5, "500 samples and u 499"),
        (np.arange(50.0), np.arange(50.0), 5, "50 samples for 6 lags"),
        (np.arange(5.0), np.arange(5.0), 5, "longer record"),
        (np.r_[np.nan, np.arange(500.0)], np.arange(501.0), 5, "NaN"),
        (["a"] * 500, np.arange(500.0), 5, "not numbers"),
    ],
)
def test_bad_input_is_refused(e, u, lags, said):
    with pytest.raises(ValueError, match=said):
        cross_correlation_test(e, u, lags)


def test_degrees_out_of_range_are_refused():
    with pytest.raises(ValueError, match="n_params"):
        whiteness_test(np.arange(100.0), 5, n_params=5)
