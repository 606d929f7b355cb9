"""The posterior over the signs in doubt."""

from __future__ import annotations

import numpy as np
import pytest

from tests.recursion.memory.test_linearised import DIMS, TRUTH, N, linearised, listed, record
from whsklearn.recursion.memory.multistart import NEAR
from whsklearn.recursion.memory.sign_posterior import (
    by_reach,
    frozen,
    log_density,
    next_temperature,
    posed,
    resample,
    sample,
    turn,
)

__all__ = ["record"]  # a fixture


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
    """Over 20 draws it is off by less than what ends the rough rounds (`multistart.NEAR`)."""
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


# --- The log density over the signs in doubt ------------------------------------------------------------------------
n = TRUTH.size


@pytest.fixture(scope="module")
def problem(record):
    page = linearised(record, TRUTH)
    chosen = np.arange(N - 2)
    signs = listed(page, record, chosen)
    return posed(page.rows.T @ page.rows, TRUTH, DIMS, N, signs)


def curvature(record):
    return listed(linearised(record, TRUTH), record, np.arange(N)).curvature


def scratch(p):
    return np.empty((n + 1, n + 1)), np.zeros((p.rows.shape[0], n + 1)), np.empty(p.rows.shape[0], dtype=np.int64)


def test_turned_signs_give_the_squared_errors_of_the_parameters_moved(problem, record):
    """But for what is of second order while no sign turns."""
    rng, compared = np.random.default_rng(1), 0
    at_truth = linearised(record, TRUTH)
    frozen_sign = np.sign(at_truth.motion[:, 1])
    for _ in range(30):
        delta = np.zeros(n)
        delta[:3] = np.array([0.1, 0.01, 0.01]) * rng.standard_normal(3)
        moved = linearised(record, TRUTH + delta)
        matrix, change, touched = scratch(problem)
        turn(delta[:3], problem, matrix, change, touched)
        assert not change.any()
        first = delta[:3]
        slope = at_truth.gradient + 0.5 * curvature(record) @ first
        sign = np.sign(at_truth.motion[:, 1] + slope @ first)
        if (sign == frozen_sign).all():
            np.testing.assert_array_equal(matrix, problem.matrix)
        if (sign == frozen_sign).all() or (sign != np.sign(moved.motion[:, 1])).any():
            continue  # nothing turns, or dx is bent further than its curvature says
        z = np.append(-delta, 1.0)
        true = moved.rows[:, -1] @ moved.rows[:, -1]
        assert abs(z @ matrix @ z - true) < 0.2 * abs(z @ problem.matrix @ z - true)
        compared += 1
    assert compared >= 5


def test_turned_signs_give_the_rows_that_they_enter(problem, record):
    """All derivatives of them, written out over the record: v(t) passes through 1 + c_2 / q, from rest at a restart."""
    delta = np.array([0.3, 0.02, -0.03])
    page = linearised(record, TRUTH)
    dx = page.motion[:, 1] + (page.gradient + 0.5 * curvature(record) @ delta) @ delta
    jump = np.sign(dx) - np.sign(page.motion[:, 1])
    jump[N - 2 :] = 0.0  # not among the signs of the problem
    assert np.count_nonzero(jump) > 10
    (coulomb, c2), psi = TRUTH[[4, 6]], page.rows.copy()
    for begin, end in ((0, 140), (140, N)):
        lag1, lag2 = (np.append(np.zeros(k), jump[begin:end])[: end - begin] for k in (1, 2))
        psi[begin:end, 4] += lag1 + c2 * lag2
        psi[begin:end, 6] += coulomb * lag2
        psi[begin:end, n] -= coulomb * (lag1 + c2 * lag2)
    matrix, change, touched = scratch(problem)
    turn(delta, problem, matrix, change, touched)
    np.testing.assert_allclose(matrix, psi.T @ psi, rtol=1e-9, atol=1e-9)


def test_the_profile_is_least_squares_of_the_rest(problem):
    delta = np.array([0.01, 0.001, -0.001])
    matrix, change, touched = scratch(problem)
    turn(delta, problem, matrix, change, touched)
    z = np.append(-delta, 1.0)
    at = np.r_[0:3, n]
    h, q = matrix[3:n, 3:n], matrix[3:n][:, at] @ z
    squares = z @ matrix[np.ix_(at, at)] @ z - q @ np.linalg.solve(h, q)
    rest = np.empty(n - 3)
    log, s = log_density(delta, problem, *scratch(problem), np.zeros((n - 3, n - 3)), rest, np.empty(problem.dims[1]))
    np.testing.assert_allclose(s, squares, rtol=1e-8)
    np.testing.assert_allclose(rest, np.linalg.solve(h, q), rtol=1e-6)
    np.testing.assert_allclose(log, -0.5 * (N - n + 3) * np.log(s) - 0.5 * np.linalg.slogdet(h)[1], rtol=1e-8)


def test_the_order_of_reach_leaves_out_no_sign_that_turns(problem):
    """From parameters at which some are turned already."""
    covariance = np.array([[4.0, 0.5, -0.3], [0.5, 0.2, 0.1], [-0.3, 0.1, 0.3]]) * 1e-2
    turned = problem._replace(sign=np.where(np.arange(problem.dx.size) % 9, 1.0, -1.0) * problem.sign)
    rng, asked = np.random.default_rng(0), []
    for p in (problem, turned):
        ordered = by_reach(p, covariance)
        assert (np.diff(ordered.reach) >= 0.0).all()
        for size in (0.01, 0.3, 3.0):
            delta = size * np.linalg.cholesky(covariance) @ rng.standard_normal(3)
            matrices = []
            for q in (p, ordered):
                matrix, change, touched = scratch(q)
                turn(delta, q, matrix, change, touched)
                matrices.append(matrix)
            np.testing.assert_allclose(*matrices, rtol=1e-9, atol=1e-9)
            asked.append(np.mean(ordered.reach <= np.sqrt(delta @ ordered.metric @ delta)))
    assert min(asked) < 0.1
    assert max(asked) > 0.3


def test_an_unstable_block_has_no_density(problem):
    low, rest, b = np.zeros((n - 3, n - 3)), np.empty(n - 3), np.empty(problem.dims[1])
    log, _ = log_density(np.array([0.0, 0.0, 1.0]), problem, *scratch(problem), low, rest, b)
    assert log == -np.inf
