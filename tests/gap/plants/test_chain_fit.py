"""Fits of a chain: down to the minimum, through wrong signs, to separate minima."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from tests.gap.plants.example_chain import PLAIN, SCALES, THETA, TRUE, setting, term
from whsklearn.effects import QuadraticDrag
from whsklearn.gap.plants.chain_fit import climb, cost, deviance, refit, separate, weights_of


def test_without_noise_a_fit_nearby_ends_at_the_truth():
    s = setting(noise=0.0)
    near = dataclasses.replace(TRUE, theta=THETA * (1.0 + 0.03 * np.cos(np.arange(9))), ar=np.zeros(0))
    fitted, value = refit(s, near, SCALES)
    np.testing.assert_allclose(fitted.theta, THETA, atol=2e-3)
    assert value < 1e-4 * cost(s, near)


def test_a_climb_never_ends_higher_and_says_where_it_is():
    near = dataclasses.replace(TRUE, theta=0.9 * THETA, ar=np.zeros(0), kappa=2.0)
    fitted, value = climb(PLAIN, near, SCALES)
    assert value < 0.9 * cost(PLAIN, near)
    assert value == pytest.approx(cost(PLAIN, fitted))
    again, same = climb(PLAIN, fitted, SCALES, steps=3)
    assert same <= value
    assert np.abs(again.theta - fitted.theta).max() < 0.1


def test_an_effect_is_fitted_together_with_the_blocks():
    s = setting(QuadraticDrag(0.1))
    fitted, value = refit(s, TRUE.plus(term("quadratic_drag", 0.01)), SCALES)
    assert fitted.terms[0].q[0] == pytest.approx(0.1, rel=0.1)
    assert value < 0.5 * refit(s, TRUE, SCALES)[1]


def test_a_few_errors_on_the_wrong_side_leave_the_variance_alone():
    e = np.random.default_rng(0).normal(size=2000)
    spoilt = e.copy()
    spoilt[::100] += 20.0
    w, variance = weights_of(spoilt)
    assert variance == pytest.approx(1.0, rel=0.1)
    assert w[::100].max() < 1e-3 < 0.9 < np.median(w)
    assert deviance(3.0 * e)[0] == pytest.approx(9.0 * deviance(e)[0])


def test_of_minima_that_are_one_the_least_stays():
    found = [(1.0, "a"), (1.0005, "b"), (1.2, "c"), (1.2001, "d"), (9.0, "e")]
    assert [m for _, m in separate(found, 1e-3)] == ["a", "c", "e"]
