"""The posterior over the signs in doubt."""

from __future__ import annotations

import numpy as np
import pytest

from tests.recursion.memory.test_linearised import N, record
from tests.recursion.memory.test_sign_density import problem
from whsklearn.recursion.memory.posterior import NEAR
from whsklearn.recursion.memory.sign_posterior import frozen, next_temperature, resample, sample

__all__ = ["problem", "record"]


def test_signs_that_no_particle_turns_leave_least_squares(problem):
    far = problem._replace(dx=1e6 * problem.sign)
    start = frozen(problem.matrix, problem.theta, N)
    found = sample(far, start, np.random.default_rng(0))
    sd = np.sqrt(np.diag(start.covariance))
    assert (np.abs(found.mean - start.mean) < 0.35 * sd).all()
    np.testing.assert_allclose(np.sqrt(np.diag(found.covariance)), sd, rtol=0.35)


def test_particles_in_one_plane_are_no_start(problem):
    start = frozen(problem.matrix, problem.theta, N)
    flat = start.covariance.copy()
    flat[:3, :3] = np.outer([1.0, 2.0, 0.5], [1.0, 2.0, 0.5])
    flat[2], flat[:, 2] = 0.0, 0.0
    assert sample(problem, start._replace(covariance=flat), np.random.default_rng(0)) is None


def test_the_same_numbers_from_the_same_seed(problem):
    start = frozen(problem.matrix, problem.theta, N)
    a, b = (sample(problem, start, np.random.default_rng(3)) for _ in range(2))
    np.testing.assert_array_equal(a.mean, b.mean)


def test_a_rough_mean_says_where_to_linearise(problem):
    """Over 20 draws it is off by less than what ends the rough rounds (`posterior.NEAR`)."""
    start = frozen(problem.matrix, problem.theta, N)
    exact = sample(problem, start, np.random.default_rng(99))
    sd = np.sqrt(np.diag(exact.covariance))
    off = [
        (sample(problem, start, np.random.default_rng(k), rough=True).mean - exact.mean) / sd for k in range(20)
    ]  # fmt: skip
    assert np.sqrt(np.mean(np.square(off), axis=0)).max() < NEAR / 2


def test_the_temperature_rises_until_half_of_the_particles_count():
    gain, weight = np.random.default_rng(0).normal(0.0, 30.0, 200), np.empty(200)
    beta = next_temperature(0.0, gain, weight)
    assert 0.0 < beta < 1.0
    assert weight.sum() ** 2 / (weight**2).sum() == pytest.approx(100.0, rel=0.05)
    assert next_temperature(0.5, 1e-3 * gain, weight) == 1.0


def test_resampling_is_in_proportion_to_the_weights():
    parent = np.empty(1000, dtype=np.int64)
    resample(np.repeat(np.arange(4.0), 250), 0.5, parent)
    assert np.bincount(parent // 250, minlength=4).tolist() == pytest.approx([0, 167, 333, 500], abs=3)
