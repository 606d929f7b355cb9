"""What all identified models share."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from sklearn.base import clone
from sklearn.metrics import r2_score
from sklearn.model_selection import GridSearchCV, TimeSeriesSplit
from sklearn.pipeline import Pipeline
from sklearn.preprocessing import StandardScaler

import whsklearn.metrics  # noqa: F401  enters the scorers' names
from tests.estimators.fitted_models import MODELS
from whsklearn import (
    InverseDynamicsLags,
    MILSRegressor,
    RLSRegressor,
    RMILSRegressor,
    StreamingPEMRegressor,
    WienerHammersteinLags,
)
from whsklearn.checks import state_difference
from whsklearn.datasets import make_wiener_hammerstein


@pytest.mark.filterwarnings("ignore:The free run is worse")
@pytest.mark.parametrize("name", list(MODELS))
def test_score_is_the_r2_of_the_free_run(fitted, record, name):
    X, y = record
    assert fitted[name].score(X, y) == pytest.approx(r2_score(y, fitted[name].predict(X)))


@pytest.mark.filterwarnings("ignore:The free run is worse")
@pytest.mark.parametrize("name", list(MODELS))
def test_predicting_changes_nothing_and_knows_no_output(fitted, record, name):
    X, y = record
    model = fitted[name]
    before = model.get_state()
    first = model.predict(X)
    model.predict_ahead(X, y, horizon=3)
    model.predict(X[:20])
    model.score(X, -y)
    assert state_difference(before, model.get_state()) == 0.0
    np.testing.assert_array_equal(model.predict(X), first)
    np.testing.assert_array_equal(model.predict(X[:50]), first[:50])  # causal


def in_mid_stream(record):
    """A model of every kind that learns as it goes, fed in blocks, and its record."""
    X, y = record
    lags = WienerHammersteinLags()
    kinds = [
        RLSRegressor(lags, random_state=0),
        MILSRegressor(lags, random_state=0),
        MODELS["published"],
        RMILSRegressor(lags, random_state=0),
        MODELS["gradient"],
        StreamingPEMRegressor(n_start=400, block=200),
    ]
    for kind in kinds:
        model = clone(kind)
        for k in range(0, len(y), 300):
            model.partial_fit(X[k : k + 300], y[k : k + 300])
        yield model


def test_the_running_estimate_answers_at_once_and_changes_nothing():
    X, y = make_wiener_hammerstein(1200, snr_db=20, random_state=0)
    for model in in_mid_stream((X, y)):
        before = model.get_state()
        ahead = model.predict_ahead(X[-300:], y[-300:], settle=False)
        assert state_difference(before, model.get_state()) == 0.0
        # of the same arrays, checked in full
        np.testing.assert_array_equal(ahead, model.predict_ahead(X[-300:].tolist(), y[-300:].tolist(), settle=False))
        settled = model.predict_ahead(X[-300:], y[-300:])
        assert np.std(y[-300:] - ahead) < 1.2 * np.std(y[-300:] - settled), type(model).__name__


def test_before_its_start_a_streaming_fit_has_no_running_estimate(record):
    model = StreamingPEMRegressor(n_start=400).partial_fit(*record)
    with pytest.raises(ValueError, match="no running estimate before 400 samples, and 160 were learned"):
        model.predict_ahead(*record, settle=False)


@pytest.mark.parametrize("name", list(MODELS))
def test_a_horizon_beyond_the_record_is_the_free_run(fitted, record, name):
    X, y = record
    model = fitted[name]
    np.testing.assert_allclose(
        model.predict_ahead(X, y, horizon=len(y)), model.predict(X, output="simulation"), atol=1e-9
    )
    one = model.predict_ahead(X, y)
    changed = y.copy()
    changed[100] += 1.0
    moved = np.flatnonzero(model.predict_ahead(X, changed) != one)
    assert moved.min() == 101
    assert moved.max() <= 100 + model._lags.n_d
    far = np.flatnonzero(model.predict_ahead(X, changed, horizon=5) != model.predict_ahead(X, y, horizon=5))
    assert far.size == 0 or far.min() >= 105


@pytest.mark.parametrize("name", list(MODELS))
def test_experiments_are_predicted_from_rest(fitted, record, name):
    X, y = record
    groups = np.repeat([1, 2], 80)
    apart = np.concatenate([fitted[name].predict(X[:80]), fitted[name].predict(X[80:])])
    np.testing.assert_array_equal(fitted[name].predict(X, groups=groups), apart)
    ahead = [fitted[name].predict_ahead(X[s], y[s]) for s in (slice(80), slice(80, None))]
    np.testing.assert_array_equal(fitted[name].predict_ahead(X, y, groups=groups), np.concatenate(ahead))


def test_grid_search_over_window_prior_and_orders_by_the_library_s_scorers(record):
    X, y = record
    search = GridSearchCV(
        clone(MODELS["RMILS"]), {"p": [1, 4], "P0": [1.0, 100.0], "lags__n_a": [1, 2]}, scoring="neg_nmse",
        cv=TimeSeriesSplit(2, gap=6),
    ).fit(X, y)  # fmt: skip
    assert np.isfinite(search.cv_results_["mean_test_score"]).all()
    assert search.best_estimator_.lags_.n_a == search.best_params_["lags__n_a"]
    assert search.best_estimator_.score(X, y) <= 1.0
    several = GridSearchCV(
        clone(MODELS["published"]), {"p": [1, 2]}, scoring=["neg_nmse", "neg_rmse", "neg_abs_mu_e"], refit="neg_rmse",
        cv=TimeSeriesSplit(2, gap=6),
    ).fit(X, y)  # fmt: skip
    assert {"mean_test_neg_nmse", "mean_test_neg_abs_mu_e"} <= set(several.cv_results_)


def test_the_last_step_of_a_pipeline_after_a_scaler(record):
    X, y = record
    pipe = Pipeline([("scale", StandardScaler()), ("rmils", clone(MODELS["published"]))])
    search = GridSearchCV(pipe, {"rmils__p": [1, 2], "rmils__P0": [1e2, 1e6]}, cv=TimeSeriesSplit(2, gap=6))
    search.fit(7.0 + 3.0 * X, y)
    assert search.best_params_["rmils__p"] in (1, 2)
    alone = clone(MODELS["published"]).set_params(**{k[7:]: v for k, v in search.best_params_.items()})
    scaled = StandardScaler().fit_transform(X)
    np.testing.assert_allclose(search.predict(7.0 + 3.0 * X), alone.fit(scaled, y).predict(scaled), atol=1e-6)


def test_frames_and_lists_are_input_too(record):
    X, y = record
    array = clone(MODELS["published"]).fit(X, y)
    frame = clone(MODELS["published"]).fit(pd.DataFrame(X, columns=["u"]), pd.Series(y))
    listed = clone(MODELS["published"]).fit(X.tolist(), y.tolist())
    for other in (frame, listed):
        np.testing.assert_array_equal(array.theta_, other.theta_)
    assert list(frame.feature_names_in_) == ["u"]
    assert "feature_names_in" in frame.get_state()


def test_rows_of_a_lag_transformer_are_predicted_group_by_group():
    rate, t = 200.0, np.arange(800) / 200.0
    q = 0.4 * np.sin(2 * t) + 0.1 * np.sin(7 * t)
    v = 0.8 * np.cos(2 * t) + 0.7 * np.cos(7 * t)
    torque = 0.6 * v + 0.3 * np.sign(v) - 0.08 * np.sin(2 * t) - 0.245 * np.sin(7 * t)
    groups = np.repeat(["a", "b"], 400)
    model = RLSRegressor(InverseDynamicsLags(sample_rate=rate)).fit(q[:, None], torque, groups=groups)
    together = model.predict(q[:, None], groups=groups)
    apart = np.concatenate([model.predict(q[:400, None]), model.predict(q[400:, None])])
    np.testing.assert_allclose(together, apart, atol=1e-9)
    assert set(model.parameters_) == {"inertia", "viscous", "coulomb", "input_offset"}
