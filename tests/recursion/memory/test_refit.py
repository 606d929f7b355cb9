"""Re-runs of the memory: batch least squares for a linear model, and nothing lost where a page is turned."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.accuracy import lags_of, random_system
from tests.recursion.starts_side_by_side import LINEAR, reading, rows_of, streamed
from whsklearn import RMILSRegressor, WienerHammersteinSystem
from whsklearn.datasets import make_wiener_hammerstein
from whsklearn.effects.law import polynomial_law
from whsklearn.recursion.memory import multistart
from whsklearn.recursion.rows.covariance import covariance


@pytest.fixture(scope="module")
def linear_record():
    return make_wiener_hammerstein(700, snr_db=20, random_state=0, system=LINEAR)


def test_a_memory_re_run_of_a_linear_model_is_batch_least_squares(linear_record):
    X, y = (v[:200] for v in linear_record)
    r = reading(LINEAR, memory=256)
    state = streamed(r, X, y)
    multistart.consolidate(state, r)
    rows = rows_of(LINEAR, X, y)
    weights = np.minimum(np.arange(len(y), 0, -1) / r.p, 1.0)  # the windows of p to come count the rest
    information = (rows * weights[:, None]).T @ rows + state["prior_information"][0]
    expected = np.linalg.solve(information, rows.T @ (weights * y) + state["prior_information"][0] @ np.zeros(4))
    np.testing.assert_allclose(state["theta"][0], expected, rtol=1e-5, atol=1e-9)
    np.testing.assert_allclose(np.linalg.inv(covariance(state["ud"][0])), information, rtol=1e-6, atol=1e-9)


def test_the_recursion_goes_on_from_a_re_run_as_if_it_had_been_linear_all_along(linear_record):
    """One sample on: the windows then count every sample but the last p - 1 in full."""
    X, y = linear_record
    r = reading(LINEAR, memory=256)
    state = streamed(r, X[:150], y[:150])
    multistart.consolidate(state, r)
    multistart.run(state, r, X[150:160], y[150:160], np.zeros(10, dtype=bool))
    rows = rows_of(LINEAR, X[:160], y[:160])
    weights = np.minimum(np.arange(160, 0, -1) / r.p, 1.0)
    information = (rows * weights[:, None]).T @ rows + state["prior_information"][0]
    np.testing.assert_allclose(np.linalg.inv(covariance(state["ud"][0])), information, rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(
        state["theta"][0], np.linalg.solve(information, rows.T @ (weights * y[:160])), rtol=1e-5, atol=1e-9
    )


def test_turning_the_page_loses_nothing_for_a_linear_model(linear_record):
    X, y = (v[:650] for v in linear_record)
    one, many = reading(LINEAR, memory=1024), reading(LINEAR, memory=100)
    whole, paged = streamed(one, X, y), streamed(many, X, y)
    for state, r in ((whole, one), (paged, many)):
        multistart.consolidate(state, r)
    assert paged["blocks"] == 6
    p_whole, p_paged = covariance(whole["ud"][0]), covariance(paged["ud"][0])
    np.testing.assert_allclose(p_paged, p_whole, rtol=0.01, atol=0.003 * np.abs(p_whole).max())
    errors = np.sqrt(np.diag(p_whole) * whole["loss"][0, 0] / whole["loss"][0, 1])
    assert (np.abs(paged["theta"][0] - whole["theta"][0]) / errors).max() < 0.2


@pytest.mark.parametrize("factors", [(0.995, 0.995), (1.0, 0.99)])
def test_pages_forget_what_the_recursion_forgot(factors, linear_record):
    """A linear model over many pages is weighted least squares, the factors those that held when samples came."""
    X, y = (v[:650] for v in linear_record)
    state = None
    for part, forgetting in zip(np.array_split(np.arange(650), 2), factors, strict=True):
        r = reading(LINEAR, memory=100, forgetting=forgetting, p0=1e6)
        state = state or multistart.initial_state(r)
        multistart.run(state, r, X[part], y[part], part == 0)
    multistart.consolidate(state, r)
    assert state["blocks"] >= 5
    kept = np.repeat(factors, 325)
    weights = np.append(np.cumprod(kept[:0:-1])[::-1], 1.0)
    rows = rows_of(LINEAR, X, y) * np.sqrt(weights)[:, None]
    batch = np.linalg.lstsq(rows, y * np.sqrt(weights), rcond=None)[0]
    covariance_ = np.linalg.inv(rows.T @ rows)
    assert state["known"][0] == pytest.approx(weights.sum())
    np.testing.assert_allclose(covariance(state["ud"][0]), covariance_, rtol=0.1, atol=0.02 * covariance_.max())
    spread = np.sqrt(np.diag(covariance_) * np.mean((y - rows_of(LINEAR, X, y) @ batch) ** 2))
    assert (np.abs(state["theta"][0] - batch) / spread).max() < 0.3


@pytest.mark.parametrize("memory", [0, 100, 1000])
def test_the_past_can_be_let_go_however_long_it_was(memory):
    """A gain that doubles after 1,500 samples is found from 150 more."""
    other = WienerHammersteinSystem(LINEAR.a, LINEAR.b, LINEAR.c, LINEAR.d, polynomial_law([0.0, 2.0, 0.5]))
    (X, y), (X2, y2) = (make_wiener_hammerstein(1500, snr_db=25, random_state=1, system=s) for s in (LINEAR, other))
    r = reading(LINEAR, memory=memory, n_starts=2)
    state = streamed(r, X, y)
    multistart.forget_past(state, 10.0)
    assert state["known"][0] == 10.0
    fresh = np.arange(150) == 0
    multistart.run(state, r, X2[:150], y2[:150], fresh)
    multistart.consolidate(state, r)
    assert state["theta"][multistart.answer(state), 0] == pytest.approx(2.0, abs=0.25)


def test_fresh_starts_leave_a_wrong_minimum_that_all_carried_models_share():
    # the best of the models that the first 128 samples left has eleven times the noise's variance
    system = random_system(3051)
    X, y, truth = make_wiener_hammerstein(1000, snr_db=20.0, random_state=[3051, 6], system=system, return_truth=True)
    model = RMILSRegressor(lags_of(system), random_state=3051).fit(X, y)
    assert model.innovation_variance_ < 1.1 * float(np.mean(truth.d**2))
