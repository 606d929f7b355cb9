"""The multi-innovation stochastic gradient."""

from __future__ import annotations

import numpy as np

from whsklearn import MultiInnovationGradientRegressor, WienerHammersteinLags
from whsklearn.datasets import make_wiener_hammerstein


def test_the_first_step_is_the_written_one():
    X, y = np.array([[1.0, 2.0]]), np.array([5.0])
    model = MultiInnovationGradientRegressor(p=3).fit(X, y)
    np.testing.assert_allclose(model.theta_, X[0] * 5.0 / 5.0)


def test_more_innovations_come_closer_in_one_pass():
    rng = np.random.default_rng(0)
    X = rng.standard_normal((1500, 3))
    truth = np.array([1.0, -2.0, 0.5])
    miss = [np.linalg.norm(MultiInnovationGradientRegressor(p=p).fit(X, X @ truth).theta_ - truth) for p in (1, 4, 16)]
    assert miss[0] > 2 * miss[1] > 4 * miss[2]


def test_it_has_no_standard_errors():
    model = MultiInnovationGradientRegressor().fit(np.eye(3), np.ones(3))
    assert np.isnan(model.standard_errors_).all()
    assert np.isnan(model.covariance_).all()


def test_it_runs_on_the_paper_s_rows_and_stays_finite():
    X, y = make_wiener_hammerstein(500, random_state=1)
    model = MultiInnovationGradientRegressor(WienerHammersteinLags(), p=8, forgetting=0.7).fit(X, y)
    assert np.isfinite(model.theta_).all()
    assert np.isfinite(model.predict(X)).all()
