"""Windows of p samples with the exact gradient."""

from __future__ import annotations

import numpy as np
import pytest

from tests.recursion.windows import LINEAR, example_problem, run
from whsklearn.effects import FrictionLaw
from whsklearn.effects.static import Power
from whsklearn.recursion.rows.covariance import covariance
from whsklearn.recursion.rows.subinnovations import (
    IDLE,
    MOVING,
    STILL,
    mark_still,
    relative_sharpness,
)


@pytest.mark.parametrize("frozen", [True, False])
@pytest.mark.parametrize("p", [1, 4, 8])
def test_each_sample_counts_once_in_all(linear, p, frozen):
    dims, X, y, rows = linear
    s = run(dims, LINEAR, np.zeros(3), X, y, p=p, frozen=frozen)
    weights = np.minimum(np.arange(len(y), 0, -1), p) / p
    information = (rows * weights[:, None]).T @ rows + np.eye(3)
    np.testing.assert_allclose(np.linalg.inv(covariance(s["ud"][0])), information, rtol=1e-8)
    np.testing.assert_allclose(s["theta"][0], np.linalg.solve(information, rows.T @ (weights * y)), rtol=1e-8)


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
