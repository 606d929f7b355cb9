"""Error against horizon, on a model whose errors are known in closed form."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from whsklearn.validation import error_against_horizon


class FirstOrder:
    """y(t) = a y(t-1) + u(t-1), with a as this model believes it."""

    def __init__(self, a):
        self.a = a

    def predict(self, X):
        return lfilter([0.0, 1.0], [1.0, -self.a], np.asarray(X)[:, 0])

    def predict_ahead(self, X, y, horizon=1):
        free = self.predict(X)
        behind = np.r_[np.zeros(horizon), (np.asarray(y) - free)[:-horizon]]
        return free + self.a**horizon * behind


@pytest.fixture(scope="module")
def record():
    rng = np.random.default_rng(0)
    u = rng.normal(size=20_000)
    noise = 0.5 * rng.normal(size=u.size)
    return u[:, None], lfilter([0.0, 1.0], [1.0, -0.9], u) + lfilter([1.0], [1.0, -0.9], noise)


def test_errors_of_the_true_model_grow_as_theory_has_it(record):
    curve = error_against_horizon(FirstOrder(0.9), *record, horizons=(20, 1, 5))
    assert list(curve.horizons) == [1, 5, 20]
    expected = [0.5 * np.sqrt(sum(0.81**i for i in range(k))) for k in (1, 5, 20)]
    np.testing.assert_allclose(curve.rmse, expected, rtol=0.03)
    assert curve.free_run_rmse == pytest.approx(0.5 / np.sqrt(1 - 0.81), rel=0.05)
    assert np.all(np.diff(curve.nmse) > 0)


def test_one_step_hides_what_the_free_run_shows(record):
    X, _ = record
    y = FirstOrder(0.9).predict(X)
    curve = error_against_horizon(FirstOrder(0.97), X, y, horizons=(1, 200))
    assert curve.nmse[0] < 0.01
    assert curve.free_run_nmse > 0.2
    assert curve.nmse[1] == pytest.approx(curve.free_run_nmse, rel=0.01)


def test_all_horizons_are_judged_on_the_same_samples(record):
    X, y = record
    y = y.copy()
    y[:10] += 1e6  # spoils predictions that start from there, and only those
    curve = error_against_horizon(FirstOrder(0.9), X, y, horizons=(1, 2), skip=12)
    assert curve.rmse.max() < 1.0


def test_bad_requests_are_refused(record):
    with pytest.raises(ValueError, match="horizons"):
        error_against_horizon(FirstOrder(0.9), *record, horizons=(0, 1))
    with pytest.raises(ValueError, match="horizons"):
        error_against_horizon(FirstOrder(0.9), *record, horizons=())
    with pytest.raises(TypeError, match="predict_ahead"):
        error_against_horizon(object(), *record)
