"""Recursive least squares on given rows."""

from __future__ import annotations

import numpy as np
import pytest

from whsklearn import MILSRegressor, RLSRegressor, WienerHammersteinLags
from whsklearn.datasets import make_wiener_hammerstein


def test_it_is_batch_least_squares():
    rng = np.random.default_rng(0)
    X = rng.standard_normal((100, 3))
    y = X @ [1.0, -2.0, 0.5] + 0.1 * rng.standard_normal(100)
    model = RLSRegressor(P0=1e9).fit(X, y)
    theta, rss = np.linalg.lstsq(X, y, rcond=None)[:2]
    np.testing.assert_allclose(model.theta_, theta, rtol=1e-7)
    np.testing.assert_allclose(model.covariance_, rss[0] / 97 * np.linalg.inv(X.T @ X), rtol=1e-6)
    np.testing.assert_array_equal(model.predict(X), X @ model.theta_)


def test_on_the_true_regressors_it_finds_the_truth():
    X, y, truth = make_wiener_hammerstein(300, snr_db=None, random_state=1, return_truth=True)
    rows = WienerHammersteinLags(theta=truth.theta).fit_transform(X, y)
    np.testing.assert_allclose(RLSRegressor(P0=1e10).fit(rows, y).theta_, truth.theta, rtol=1e-6)


@pytest.mark.parametrize("model", [RLSRegressor(P0=1e8), MILSRegressor(p=4, P0=1e8)])
def test_intervals_cover_the_truth(model):
    """95 % intervals on known regressors over 200 seeds; 9 x 200 draws scatter by about 1 %."""
    hits = []
    for seed in range(200):
        X, y, truth = make_wiener_hammerstein(300, random_state=seed, return_truth=True)
        rows = WienerHammersteinLags(theta=truth.theta).fit_transform(X, y)
        model.fit(rows, y)
        hits.append(np.abs(model.theta_ - truth.theta) < 1.96 * model.standard_errors_)
    assert 0.92 <= np.mean(hits) <= 0.98


def test_forgetting_tracks_a_parameter_that_changes():
    rng = np.random.default_rng(2)
    X = rng.standard_normal((1000, 2))
    y = X @ [1.0, -1.0]
    y[500:] = X[500:] @ [3.0, -1.0]
    errors = {f: abs(RLSRegressor(forgetting=f).fit(X, y).theta_[0] - 3.0) for f in (1.0, 0.95)}
    assert errors[0.95] < 1e-6 < 0.5 < errors[1.0]


def test_theta0_and_p0_are_a_prior():
    X, y = np.array([[1.0]]), np.array([4.0])
    model = RLSRegressor(P0=3.0, theta0=[2.0]).fit(X, y)
    assert model.theta_[0] == pytest.approx((3.0 * 4.0 + 2.0) / 4.0)


def test_without_degrees_of_freedom_there_is_no_standard_error():
    model = RLSRegressor().fit(np.ones((1, 2)), [1.0])
    with pytest.warns(UserWarning, match="standard errors are NaN"):
        assert np.isnan(model.standard_errors_).all()


@pytest.mark.parametrize("n", [1, 50])
def test_an_axis_at_rest_does_not_wind_up(n):
    rng = np.random.default_rng(3)
    X = rng.standard_normal((200, 2))
    y = X @ [1.0, -2.0]
    model = RLSRegressor(forgetting=0.9).fit(X, y)
    for _ in range(10_000 // n):
        model.partial_fit(np.zeros((n, 2)), np.zeros(n))
    assert np.isfinite(model.state_["ud"]).all()
    np.testing.assert_allclose(model.theta_, [1.0, -2.0], rtol=1e-6)
    model.partial_fit(X, X @ [5.0, 1.0])
    np.testing.assert_allclose(model.theta_, [5.0, 1.0], rtol=1e-3)
