"""Windows of p samples with the exact gradient."""

from __future__ import annotations

import numpy as np
import pytest

from whsklearn import WienerHammersteinSystem
from whsklearn.datasets import make_wiener_hammerstein
from whsklearn.effects import FrictionLaw
from whsklearn.effects.law import polynomial_law
from whsklearn.effects.static import Power
from whsklearn.recursion.covariance import covariance
from whsklearn.recursion.least_squares import block_update
from whsklearn.recursion.predictor import advance, predict, record_errors, state_size
from whsklearn.recursion.subinnovations import (
    IDLE,
    MOVING,
    STILL,
    Models,
    Samples,
    mark_still,
    relative_sharpness,
    run_windows,
)

LINEAR = polynomial_law([0.0, 1.0, 0.5])  # with n_a = 1, n_b = 0, n_c = 1 the model is linear in its parameters


def run(
    dims, law, theta0, X, y, p=4, frozen=False, p0=1.0, kappa=3.0, forgetting=(1.0, 1.0, 0.99), chunks=1, weight=None
):
    """All state arrays of one model after the record."""
    n = theta0.size
    lags = p + max(dims[0], dims[3], 1)
    s = {
        "theta": theta0[None].copy(), "ud": np.eye(n)[None] * p0, "before": np.zeros((1, state_size(dims))),
        "loss": np.zeros((1, 2)), "motion": np.zeros((1, 2)),
        "recent_u": np.zeros(lags), "recent_y": np.zeros(lags),
    }  # fmt: skip
    since, seen, forgetting = 0, 0, np.array(forgetting)
    weight, recent_weight = np.ones(len(y)) if weight is None else weight, np.ones(lags)
    for part in np.array_split(np.arange(len(y)), chunks):
        since = run_windows(
            Models(*(s[name] for name in Models._fields)), Samples(s["recent_u"], s["recent_y"], recent_weight), since,
            seen, forgetting, np.inf, np.array([kappa]), 0.0, (dims, law.codes, law.shapes), p, frozen,
            Samples(X[part], y[part], weight[part]), np.zeros(len(part), dtype=np.uint8),
        )  # fmt: skip
        seen += len(part)
    return s


@pytest.fixture
def linear():
    system = WienerHammersteinSystem([1.0], [], [1.0], [0.3], LINEAR)
    X, y = make_wiener_hammerstein(150, snr_db=20, random_state=0, system=system)
    dims = np.array([1, 0, 1, 1, 2], dtype=np.int64)
    rows = np.empty((150, 3))
    record_errors(np.zeros(3), dims, LINEAR.codes, LINEAR.shapes, 1.0, X, y, np.arange(150) == 0, np.empty(150), rows)
    return dims, X, y, rows


@pytest.mark.parametrize("frozen", [True, False])
@pytest.mark.parametrize("p", [1, 4, 8])
def test_each_sample_counts_once_in_all(linear, p, frozen):
    dims, X, y, rows = linear
    s = run(dims, LINEAR, np.zeros(3), X, y, p=p, frozen=frozen)
    weights = np.minimum(np.arange(len(y), 0, -1), p) / p
    information = (rows * weights[:, None]).T @ rows + np.eye(3)
    np.testing.assert_allclose(np.linalg.inv(covariance(s["ud"][0])), information, rtol=1e-8)
    np.testing.assert_allclose(s["theta"][0], np.linalg.solve(information, rows.T @ (weights * y)), rtol=1e-8)


def test_frozen_and_sub_innovations_agree_where_no_row_depends_on_theta(linear):
    dims, X, y, _ = linear
    a, b = (run(dims, LINEAR, np.zeros(3), X, y, frozen=f) for f in (True, False))
    np.testing.assert_allclose(a["theta"], b["theta"], rtol=1e-9)
    np.testing.assert_allclose(covariance(a["ud"][0]), covariance(b["ud"][0]), rtol=1e-9)


def example_problem(n=80):
    system = WienerHammersteinSystem.example()
    X, y = make_wiener_hammerstein(n, snr_db=15, random_state=1)
    theta = np.concatenate([system.a[1:], system.b, system.law.weights, system.c[1:], system.d])
    return np.array([2, 2, 2, 2, 3], dtype=np.int64), system.law, theta * 0.8, X, y


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
        for i in range(window):
            now = window - 1 - i
            if i:
                advance(theta, dims, law.codes, law.shapes, kappa, work, u_pad, now + 2)
            psi = np.empty(9)
            e = y_pad[now] - predict(theta, dims, work, y_pad, now + 1, psi)
            rows.append(psi)
            targets.append(e + psi @ theta)
        theta, P = block_update(theta, P, np.array(rows).T, np.array(targets), float(p))
        if t + 1 >= p:
            advance(theta, dims, law.codes, law.shapes, kappa, state, u_pad, p)
    np.testing.assert_allclose(got["theta"][0], theta, rtol=1e-9)
    np.testing.assert_allclose(covariance(got["ud"][0]), P, rtol=1e-8)


def test_with_one_sample_a_window_both_are_the_recursive_prediction_error_method():
    dims, law, theta, X, y = example_problem()
    a, b = (run(dims, law, theta, X, y, p=1, frozen=f, p0=0.01) for f in (True, False))
    np.testing.assert_allclose(a["theta"], b["theta"], rtol=1e-12)


@pytest.mark.parametrize("chunks", [2, 9, 80])
def test_chunks_make_no_difference(chunks):
    dims, law, theta, X, y = example_problem()
    whole, cut = (run(dims, law, theta, X, y, p0=0.01, chunks=c) for c in (1, chunks))
    for name in whole:
        np.testing.assert_array_equal(whole[name], cut[name], err_msg=name)


def test_l1_stays_stable_and_numbers_stay_numbers():
    dims, law, theta, X, y = example_problem(300)
    s = run(dims, law, theta, X, 100.0 * y[::-1].copy(), p0=1e4)
    poles = np.roots(np.r_[1.0, s["theta"][0, 1:3]])
    assert np.abs(poles).max() < 0.9995
    assert all(np.isfinite(v).all() for v in s.values())


def test_a_spike_that_overflows_the_gradient_teaches_nothing():
    law = FrictionLaw([Power(1.0, 1), Power(1.0, 9)])
    dims = np.array([2, 1, 1, 1, 2], dtype=np.int64)
    rng = np.random.default_rng(2)
    X, y = rng.standard_normal((100, 1)), rng.standard_normal(100)
    X[50] = 1e30
    s = run(dims, law, np.array([0.1, 0.2, 0.3, 0.1, 0.1]), X, y)
    assert np.isfinite(s["theta"]).all()
    assert np.isfinite(s["ud"]).all()
    assert np.isfinite(s["loss"]).all()


def test_forgetting_holds_p_from_shrinking():
    dims, law, theta, X, y = example_problem(80)
    held = run(dims, law, theta, X, y, p0=0.01, forgetting=(0.9, 0.9, 0.99))
    free = run(dims, law, theta, X, y, p0=0.01)
    assert np.trace(covariance(held["ud"][0])) > np.trace(covariance(free["ud"][0]))


def test_sharpness_rises_from_one_to_its_limit():
    rising = np.array([relative_sharpness(float(n), 80.0) for n in range(0, 2000, 10)])
    assert rising[0] == 1.0
    assert rising[-1] == 80.0
    assert (np.diff(rising) >= 0).all()


@pytest.mark.parametrize("chunks", [1, 4, 40])
def test_still_is_what_repeats_all_that_the_window_sees(chunks):
    """Lags of 5 samples: marked from the fifth repetition on, until u or y moves."""
    u, y = np.zeros((40, 1)), np.arange(40.0)
    u[10:30], y[10:30] = 1.0, 2.0
    y[22] = 2.1
    still, repeats, recent_u, recent_y = np.zeros(40), np.zeros(2, dtype=int), np.zeros(5), np.zeros(5)
    known = np.zeros(1)
    for part in np.array_split(np.arange(40), chunks):
        mark_still(
            repeats, recent_u, recent_y, known, 0.9, u[part], y[part], marked := np.zeros(len(part), dtype=np.uint8)
        )
        still[part] = marked
        recent_u[0], recent_y[0] = u[part[-1], 0], y[part[-1]]
    assert known[0] == pytest.approx((1 - 0.9 ** np.sum(still == MOVING)) / 0.1)
    assert np.flatnonzero(still).tolist() == [14, *range(15, 22), *range(27, 30)]


def test_an_input_that_stood_still_for_long_leaves_an_idle_axis():
    """Noise goes on, so the record does not stand still; what is known counts on, undiminished."""
    y = np.random.default_rng(0).normal(size=1000)
    known, still = np.zeros(1), np.zeros(1000, dtype=np.uint8)
    u = np.ones((1000, 1))
    u[600] = 2.0
    mark_still(np.zeros(2, dtype=int), np.zeros(5), np.zeros(5), known, 0.99, u, y, still)
    assert np.flatnonzero(still == IDLE).tolist() == [*range(256, 600), *range(857, 1000)]
    assert not np.any(still == STILL)
    assert known[0] > 343 * 0.99**257 + 143
