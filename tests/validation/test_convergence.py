"""Bound (22): what it tends to, and that recursive least squares stays below it."""

from __future__ import annotations

import numpy as np
import pytest

from whsklearn.validation import convergence_bound, excitation


def least_squares_path(phi, y, p0, theta0):
    """Estimates of (7) to (9) with p = 1 after each sample."""
    theta, P, path = theta0.copy(), p0 * np.eye(phi.shape[1]), []
    for row, out in zip(phi, y, strict=True):
        gain = P @ row / (1 + row @ P @ row)
        theta = theta + gain * (out - row @ theta)
        P = P - np.outer(gain, row @ P)
        path.append(theta)
    return np.array(path)


@pytest.mark.parametrize("p0", [1.0, 1e3, 1e6])
def test_the_measured_error_stays_below(p0):
    theta, n, runs = np.array([0.5, -1.0, 2.0]), 600, 40
    squared, worst = np.zeros(n), [np.inf, 0.0]
    for seed in range(runs):
        rng = np.random.default_rng(seed)
        phi = rng.normal(size=(n, 3))
        y = phi @ theta + 0.3 * rng.normal(size=n)
        squared += np.sum((least_squares_path(phi, y, p0, np.zeros(3)) - theta) ** 2, axis=1) / runs
        for t in (50, 200, 600):
            seen = excitation(phi[:t])
            worst = [min(worst[0], seen.alpha), max(worst[1], seen.beta)]
    t = np.arange(1, n + 1)
    bound = convergence_bound(t, *worst, 3, p0, 0.09, initial_error=float(theta @ theta))
    assert np.all(squared[49:] <= bound[49:])
    assert np.all(bound[49:] < 100 * squared[49:])  # a bound, not a platitude


def test_it_falls_as_log_t_over_t_and_grows_with_the_noise():
    t = np.array([1e3, 1e6, 1e9])
    bound = convergence_bound(t, 0.5, 2.0, 9, 1e6, 0.01)
    np.testing.assert_allclose(bound, 9 * np.log(2.0 * t * 1e6) * 0.01 / (0.5 * t), rtol=1e-3)
    np.testing.assert_allclose(convergence_bound(t, 0.5, 2.0, 9, 1e6, 0.02), 2 * bound, rtol=1e-6)
    np.testing.assert_allclose(convergence_bound(t, 0.5, 2.0, 9, 1e6, 0.004, epsilon=0.006), bound, rtol=1e-12)


def test_the_innovation_length_cancels():
    few = convergence_bound([10, 100], 0.5, 2.0, 9, 1e2, 0.01, p=1)
    np.testing.assert_array_equal(few, convergence_bound([10, 100], 0.5, 2.0, 9, 1e2, 0.01, p=8))


@pytest.mark.parametrize(
    "change",
    [
        {"alpha": 0},
        {"beta": 0.1},
        {"P0": -1},
        {"P0": np.inf},
        {"n_params": 0},
        {"noise_variance": -1},
        {"t": [0]},
        {"t": []},
    ],
)
def test_constants_out_of_range_are_refused(change):
    given = {"t": [10], "alpha": 0.5, "beta": 2.0, "n_params": 9, "P0": 1e6, "noise_variance": 0.01}
    with pytest.raises(ValueError, match="convergence_bound"):
        convergence_bound(**(given | change))
