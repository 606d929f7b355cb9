"""Recursions on given rows against batch least squares and the block form."""

from __future__ import annotations

import numpy as np
import pytest

from tests.recursion.windows import LINEAR, example_problem, one_sample_on, run
from whsklearn.recursion.rows.covariance import covariance
from whsklearn.recursion.rows.least_squares import block_update, run_gradient, run_rows
from whsklearn.recursion.rows.predictor import by_block, past_of, predict, state_size


def stream(rows, y, p=1, variance=1.0, forgetting=1.0, p0=1e6, chunks=1, theta0=None):
    """theta, P and loss after the rows, in chunks."""
    n = rows.shape[1]
    theta = np.zeros(n) if theta0 is None else theta0.copy()
    ud, loss, recent, targets, since = np.eye(n) * p0, np.zeros(2), np.zeros((p, n)), np.zeros(p), 0
    for part in np.array_split(np.arange(len(y)), chunks):
        since = run_rows(theta, ud, loss, recent, targets, since, forgetting, np.inf, p, variance, rows[part], y[part])
    return theta, covariance(ud), loss


@pytest.fixture
def regression():
    rng = np.random.default_rng(0)
    rows = rng.standard_normal((120, 4)) @ np.diag([1.0, 0.1, 3.0, 1.0])
    return rows, rows @ [1.0, -2.0, 0.5, 3.0] + 0.1 * rng.standard_normal(120)


def test_rls_is_batch_least_squares_with_the_prior(regression):
    rows, y = regression
    theta, p, loss = stream(rows, y, p0=10.0)
    information = rows.T @ rows + np.eye(4) / 10.0
    batch = np.linalg.solve(information, rows.T @ y)
    np.testing.assert_allclose(theta, batch, rtol=1e-9)
    np.testing.assert_allclose(p, np.linalg.inv(information), rtol=1e-9)
    residual = y - rows @ batch
    assert loss[0] == pytest.approx(residual @ residual + batch @ batch / 10.0)
    assert loss[1] == 120


@pytest.mark.parametrize("p", [2, 4, 7])
def test_each_row_counts_once_in_all(regression, p):
    rows, y = regression
    _, covariance_, loss = stream(rows, y, p=p, variance=float(p), p0=10.0)
    weights = np.minimum(np.arange(len(y), 0, -1), p) / p  # the last rows have not been in p windows yet
    np.testing.assert_allclose(
        np.linalg.inv(covariance_), (rows * weights[:, None]).T @ rows + np.eye(4) / 10, rtol=1e-9
    )
    assert loss[1] == pytest.approx(weights.sum())


def test_to_the_letter_each_row_counts_p_times(regression):
    rows, y = regression
    _, letter, _ = stream(rows, y, p=4, variance=1.0)
    _, once, _ = stream(rows, y, p=1)
    np.testing.assert_allclose(np.trace(once) / np.trace(letter), 4.0, rtol=0.1)


@pytest.mark.parametrize("variance", [1.0, 3.0])
def test_sub_innovations_are_the_block_update(regression, variance):
    rows, y = regression
    p = 3
    theta, P = np.zeros(4), np.eye(4) * 100.0
    for t in range(len(y)):
        window = slice(max(0, t - p + 1), t + 1)
        theta, P = block_update(theta, P, rows[window].T, y[window], variance)
    got, got_P, _ = stream(rows, y, p=p, variance=variance, p0=100.0)
    np.testing.assert_allclose(got, theta, rtol=1e-9)
    np.testing.assert_allclose(got_P, P, rtol=1e-8)


def test_forgetting_weights_rows_by_age(regression):
    rows, y = regression
    weights = 0.95 ** np.arange(len(y) - 1, -1, -1)
    information = (rows * weights[:, None]).T @ rows
    theta, P, loss = stream(rows, y, forgetting=0.95, p0=1e9)
    batch = np.linalg.solve(information, rows.T @ (weights * y))
    np.testing.assert_allclose(theta, batch, rtol=1e-6)
    np.testing.assert_allclose(P, np.linalg.inv(information), rtol=1e-6)
    assert loss[1] == pytest.approx(weights.sum())
    assert loss[0] == pytest.approx(np.sum(weights * (y - rows @ batch) ** 2), rel=1e-5)


@pytest.mark.parametrize("chunks", [2, 13, 120])
def test_chunks_make_no_difference(regression, chunks):
    rows, y = regression
    for whole, cut in zip(
        stream(rows, y, p=4, variance=4.0), stream(rows, y, p=4, variance=4.0, chunks=chunks), strict=True
    ):
        np.testing.assert_array_equal(whole, cut)


def gradient(rows, y, p, forgetting):
    n = rows.shape[1]
    theta, loss, power = np.zeros(n), np.zeros(2), np.zeros(1)
    run_gradient(theta, loss, np.zeros((p, n)), np.zeros(p), 0, power, forgetting, p, rows, y)
    return theta


def test_more_innovations_make_the_gradient_converge_faster():
    rng = np.random.default_rng(1)
    rows = rng.standard_normal((2000, 3))
    truth = np.array([1.0, -2.0, 0.5])
    miss = [np.linalg.norm(gradient(rows, rows @ truth, p, 1.0) - truth) for p in (1, 2, 4, 8)]
    assert miss == sorted(miss, reverse=True)
    assert miss[-1] < 0.05 * miss[0]


@pytest.mark.parametrize("forgetting", [0.1, 0.5, 0.9])
def test_the_gradient_never_diverges(forgetting):
    """With p = 16 and fast forgetting r(t) alone would let the step overshoot eightfold."""
    rng = np.random.default_rng(2)
    rows = rng.standard_normal((3000, 3))
    truth = np.array([1.0, -2.0, 0.5])
    np.testing.assert_allclose(gradient(rows, rows @ truth, 16, forgetting), truth, atol=1e-3)


@pytest.mark.parametrize("p", [1, 3])
def test_an_idle_axis_is_neither_learnt_nor_forgotten(regression, p):
    """Zeros count from where the window holds nothing else until it holds something again."""
    rows, y = regression
    idle = np.zeros((p - 1, 4)), np.zeros(p - 1)
    long = np.zeros((5000, 4)), np.zeros(5000)
    short_rest, long_rest = (
        stream(np.vstack([rows, *parts[0], rows]), np.concatenate([y, *parts[1], y]), p, float(p), 0.98)
        for parts in (([idle[0]], [idle[1]]), ([idle[0], long[0]], [idle[1], long[1]]))
    )
    for a, b in zip(short_rest, long_rest, strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-12)


def test_frozen_and_sub_innovations_agree_where_no_row_depends_on_theta(linear):
    dims, X, y, _ = linear
    a, b = (run(dims, LINEAR, np.zeros(3), X, y, frozen=f) for f in (True, False))
    np.testing.assert_allclose(a["theta"], b["theta"], rtol=1e-9)
    np.testing.assert_allclose(covariance(a["ud"][0]), covariance(b["ud"][0]), rtol=1e-9)


def test_the_frozen_window_is_the_literal_block_update():
    """(7)-(9) with rows psi at theta(t-1), linearised there, weight 1/p."""
    dims, law, theta, X, y = example_problem(40)
    p, kappa = 3, 3.0
    got = run(dims, law, theta, X, y, p=p, frozen=True, p0=0.01, kappa=kappa)
    P, state = np.eye(9) * 0.01, np.zeros(state_size(dims))
    u_pad, y_pad = np.zeros(p + 2), np.zeros(p + 2)  # newest first
    for t in range(len(y)):
        u_pad, y_pad = np.r_[X[t], u_pad[:-1]], np.r_[y[t], y_pad[:-1]]
        window, work, rows, targets = min(p, t + 1), state.copy(), [], []
        blocks = by_block(theta, dims)
        for i in range(window):
            now = window - 1 - i
            if i:
                one_sample_on(blocks, law.codes, law.shapes, kappa, past_of(work, 0, dims, 0), u_pad[now + 2 :])
            psi = np.empty(9)
            e = y_pad[now] - predict(blocks, past_of(work, 0, dims, 0), 0, y_pad[now + 1 :], psi, by_block(psi, dims))
            rows.append(psi)
            targets.append(e + psi @ theta)
        theta, P = block_update(theta, P, np.array(rows).T, np.array(targets), float(p))
        if t + 1 >= p:
            blocks = by_block(theta, dims)
            one_sample_on(blocks, law.codes, law.shapes, kappa, past_of(state, 0, dims, 0), u_pad[p:])
    np.testing.assert_allclose(got["theta"][0], theta, rtol=1e-9)
    np.testing.assert_allclose(covariance(got["ud"][0]), P, rtol=1e-8)
