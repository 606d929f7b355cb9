"""What L1 makes of a record."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from whsklearn.recursion.memory.blocks import KNOWN, first_block, increment_rms

DIMS = np.array([3, 2, 1, 1, 1])
THETA = np.array([0.4, -0.2, -1.1, 0.5, 9.0, 9.0, 9.0])  # (a, b), and what L1 has no use for
U, RESTART = np.random.default_rng(0).standard_normal((400, 1)), np.isin(np.arange(400), (0, 150))


def filtered(a, b):
    """x of the two experiments by SciPy."""
    parts = np.split(U[:, 0], [150])
    return np.concatenate([lfilter(np.append([0.0, 1.0], a), np.append(1.0, b), u) for u in parts])


def test_it_is_the_filter_from_rest_in_each_experiment():
    signals, size = first_block(THETA, DIMS, U, RESTART, KNOWN)
    x = filtered(THETA[:2], THETA[2:4])
    dx = x - np.where(RESTART, 0.0, np.roll(x, 1))
    np.testing.assert_allclose(signals, [x, dx], atol=1e-12)
    assert size == increment_rms(THETA, DIMS, U, RESTART) == pytest.approx(np.sqrt(np.mean(dx**2)))


def test_two_inputs_have_a_numerator_each_over_one_denominator():
    u = np.random.default_rng(1).standard_normal((100, 2))
    theta, restart = np.array([0.7, 0.4, -0.2, -0.5]), np.arange(100) == 0  # a_1 of the first input is one
    x = first_block(theta, np.array([4, 1, 1, 1, 1]), u, restart, KNOWN)[0][0]
    under = [1.0, -0.5]
    np.testing.assert_allclose(x, lfilter([0, 1.0, 0.4], under, u[:, 0]) + lfilter([0, 0.7, -0.2], under, u[:, 1]))


def test_the_certainty_of_a_sign_is_its_mean_over_what_is_not_known():
    """Against 4,000 draws of (a, b), which know that a mean of signs is sure to 1 / sqrt(4000)."""
    spread = 1e-4 * np.array([[2.0, 0.5, 0, 0], [0.5, 1, 0.2, 0], [0, 0.2, 0.3, -0.1], [0, 0, -0.1, 0.2]])
    signals = first_block(THETA, DIMS, U, RESTART, spread)[0]
    draws = np.random.default_rng(2).multivariate_normal(THETA[:4], spread, 4000)
    signs = np.mean([np.sign(first_block(t, DIMS, U, RESTART, KNOWN)[0][1]) for t in draws], axis=0)
    assert (signals[2] < 0.99).sum() > 10
    np.testing.assert_allclose(signals[2] * np.sign(signals[1]), signs, atol=0.08)


def test_what_runs_away_stays_a_number():
    signals, size = first_block(np.array([0.0, 0.0, -3.0, 0.0]), DIMS, U, np.arange(400) == 0, np.eye(4))
    assert np.isfinite(signals).all()
    assert np.isfinite(size)
