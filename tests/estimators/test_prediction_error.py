"""One-step errors of a record and their derivatives, as the batch fit minimises them."""

from __future__ import annotations

import numpy as np
import pytest

from whsklearn import WienerHammersteinSystem
from whsklearn.datasets import make_wiener_hammerstein
from whsklearn.estimators._model import Structure
from whsklearn.estimators._prediction_error import PredictionError

SYSTEM = WienerHammersteinSystem.example()
LAW = SYSTEM.law
THETA = np.concatenate([SYSTEM.a[1:], SYSTEM.b, LAW.weights, SYSTEM.c[1:], SYSTEM.d])
STRUCTURE = Structure(np.array([2, 2, 2, 2, 3], dtype=np.int64), 1, LAW, LAW.key)


def errors_of(snr_db=None, weights=None, n=300):
    X, y = make_wiener_hammerstein(n, snr_db=snr_db, random_state=0)
    return PredictionError(STRUCTURE, X, y, np.arange(n) == 0, np.random.default_rng(0), weights)


def test_at_the_truth_nothing_is_left_and_an_unstable_block_is_refused():
    p = errors_of()
    np.testing.assert_allclose(p.residuals(THETA, np.inf), 0.0, atol=1e-10)
    unstable = THETA.copy()
    unstable[p.b] = -2.2, 1.1
    assert np.min(np.abs(p.residuals(unstable, np.inf))) > 100.0 * np.std(p.y)
    assert not p.jacobian(unstable, 1.0).any()


def test_the_jacobian_is_that_of_the_residuals():
    p, theta, h = errors_of(20.0), 0.9 * THETA, 1e-6
    rows = p.jacobian(theta, 2.0)
    for i in range(theta.size):
        step = h * (np.arange(theta.size) == i)
        slope = (p.residuals(theta + step, 2.0) - p.residuals(theta - step, 2.0)) / (2 * h)
        np.testing.assert_allclose(rows[:, i], slope, atol=1e-5 * np.abs(slope).max())


def test_weights_multiply_squares():
    weights = np.random.default_rng(1).uniform(0.1, 2.0, 300)
    plain, weighted = errors_of(20.0), errors_of(20.0, weights)
    np.testing.assert_allclose(
        weighted.residuals(0.9 * THETA, 5.0) ** 2, weights * plain.residuals(0.9 * THETA, 5.0) ** 2
    )


def test_climbing_ends_where_no_start_of_it_was_better():
    p = errors_of(20.0)
    start = 0.8 * THETA
    cost, theta = p.climb(start)
    assert cost < 0.5 * np.sum(p.residuals(start, np.inf) ** 2)
    assert cost == pytest.approx(np.sum(p.residuals(theta, np.inf) ** 2))


def test_a_parameter_that_moves_nothing_has_no_variance():
    p = errors_of(20.0)
    p.u[:] = 0.0  # nothing passes L1: its numbers and the law's move no error
    inverse = p.inverse_information(THETA)
    assert np.isnan(inverse[0]).all()
    assert np.isfinite(inverse[-1, -1])
