"""Indices of section 5.1: identities, limits, refusals, and the scorer names."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from sklearn.base import BaseEstimator, RegressorMixin
from sklearn.linear_model import Ridge
from sklearn.metrics import get_scorer, get_scorer_names, mean_squared_error, r2_score
from sklearn.model_selection import GridSearchCV, TimeSeriesSplit, cross_val_score, cross_validate

from whsklearn.metrics import SCORER_NAMES, abs_mu_e, free_run_scorer, mu_e, nmse, parameter_error, rmse
from whsklearn.metrics.indices import register_scorers


@pytest.mark.parametrize("name", SCORER_NAMES)
def test_a_name_is_a_scorer(name):
    assert callable(get_scorer(name))
    assert name in get_scorer_names()


def test_a_name_that_is_taken_stays():
    before = get_scorer("r2")
    register_scorers({"r2": get_scorer(next(iter(SCORER_NAMES)))})
    assert get_scorer("r2")._score_func is before._score_func


RECORDS = arrays(float, st.integers(2, 40), elements=st.floats(-1e3, 1e3))


@pytest.fixture
def record(rng):
    y = rng.normal(size=200)
    return y, y + 0.1 * rng.normal(size=200) + 0.05


@pytest.fixture
def rng():
    return np.random.default_rng(5)


def test_indices_agree_with_their_definitions_and_with_scikit_learn(record):
    y, y_hat = record
    e = y - y_hat
    assert nmse(y, y_hat) == pytest.approx(np.sum(e**2) / (y.size * np.var(y)), rel=1e-12)
    assert nmse(y, y_hat) == pytest.approx(1 - r2_score(y, y_hat), rel=1e-9)
    assert rmse(y, y_hat) == pytest.approx(np.sqrt(mean_squared_error(y, y_hat)), rel=1e-12)
    assert mu_e(y, y_hat) == pytest.approx(np.mean(e), rel=1e-12)


@given(RECORDS, st.floats(0.1, 100), st.floats(-50, 50))
@settings(max_examples=60)
def test_nmse_knows_neither_unit_nor_offset_and_rmse_splits_into_mean_and_spread(y, gain, offset):
    y_hat = np.roll(y, 1)
    e = y - y_hat
    assert rmse(y, y_hat) ** 2 == pytest.approx(mu_e(y, y_hat) ** 2 + np.var(e), rel=1e-6, abs=1e-9)
    assert mu_e(y, y_hat) == pytest.approx(-mu_e(y_hat, y), abs=1e-12)
    if np.std(y) > 1e-3:
        assert nmse(gain * y + offset, gain * y_hat + offset) == pytest.approx(nmse(y, y_hat), rel=1e-6)


def test_the_mean_as_model_has_nmse_one_and_the_record_itself_zero(record):
    y, _ = record
    assert nmse(y, np.full_like(y, y.mean())) == pytest.approx(1.0)
    assert nmse(y, y) == rmse(y, y) == mu_e(y, y) == 0.0


def test_skip_leaves_out_the_start_and_nothing_else(record):
    y, y_hat = record
    spoilt = y_hat.copy()
    spoilt[:30] = 1e6
    for index in (nmse, rmse, mu_e, abs_mu_e):
        assert index(y, spoilt, skip=30) == index(y[30:], y_hat[30:])
        assert index(y, spoilt, skip=29) != index(y[29:], y_hat[29:])


def test_columns_and_lists_are_taken_and_integers_do_not_wrap():
    assert rmse(np.array([[3], [4]]), [0, 0]) == pytest.approx(np.sqrt(12.5))
    assert mu_e(np.array([0, 255], dtype=np.uint8), np.array([1, 0], dtype=np.uint8)) == 127.0


def test_a_run_beyond_floats_scores_infinite_without_a_warning():
    assert rmse([0.0, 1.0], [1e200, -1e200]) == np.inf


@pytest.mark.parametrize(
    ("y", "y_hat", "skip", "said"),
    [
        ([1.0, 2.0], [1.0], 0, "y has 2 samples and y_hat 1"),
        ([1.0, np.nan], [1.0, 2.0], 0, "y holds 1 NaN"),
        ([1.0, 2.0], [np.inf, 2.0], 0, "y_hat holds 1 NaN"),
        ([[1.0, 2.0]], [1.0, 2.0], 0, "shape"),
        ([], [], 0, "shape"),
        (["a", "b"], [1.0, 2.0], 0, "not numbers"),
        ([1.0, 2.0], [1.0, 2.0], 2, "skip is 2"),
        ([1.0, 2.0], [1.0, 2.0], -1, "skip is -1"),
        ([1.0, 2.0], [1.0, 2.0], 0.5, "skip is 0.5"),
        ([1.0, 2.0], [1.0, 2.0], True, "skip is True"),
        ([3.3, 3.3, 3.3], [1.0, 2.0, 3.0], 0, "constant"),
        ([9.9, 3.3, 3.3], [1.0, 2.0, 3.0], 1, "constant"),
    ],
)
def test_bad_input_is_refused_in_a_sentence(y, y_hat, skip, said):
    with pytest.raises(ValueError, match=said):
        nmse(y, y_hat, skip=skip)


def test_parameter_error_is_relative_and_symmetric_in_sign(rng):
    theta = rng.normal(size=9)
    assert parameter_error(theta, theta) == 0.0
    assert parameter_error(np.zeros(9), theta) == pytest.approx(1.0)
    assert parameter_error(-theta, theta) == pytest.approx(2.0)
    assert parameter_error(3 * 1.1 * theta, 3 * theta) == pytest.approx(0.1)


@pytest.mark.parametrize(("estimate", "truth"), [([1.0], [1.0, 2.0]), ([1.0], [0.0]), ([np.nan], [1.0])])
def test_parameter_error_refuses_what_it_cannot_compare(estimate, truth):
    with pytest.raises(ValueError, match="theta"):
        parameter_error(estimate, truth)


@pytest.mark.parametrize("name", sorted(SCORER_NAMES))
def test_scorers_work_by_name(name, rng):
    X = rng.normal(size=(80, 2))
    y = X @ [1.0, 2.0] + 0.1 * rng.normal(size=80)
    assert name in get_scorer_names()
    search = GridSearchCV(Ridge(), {"alpha": [0.1, 1e4]}, scoring=name, cv=TimeSeriesSplit(3)).fit(X, y)
    model = search.best_estimator_
    assert get_scorer(name)(model, X, y) == -SCORER_NAMES[name](y, model.predict(X))
    assert cross_val_score(Ridge(), X, y, scoring=name).max() <= 0.0
    if name != "neg_abs_mu_e":
        assert search.best_params_["alpha"] == 0.1


def test_several_names_at_once(rng):
    X = rng.normal(size=(60, 1))
    scores = cross_validate(Ridge(), X, X[:, 0], scoring=sorted(SCORER_NAMES), error_score="raise")
    assert {f"test_{name}" for name in SCORER_NAMES} <= set(scores)


def test_names_work_whichever_was_imported_first():
    use = "GridSearchCV(Ridge(), {'alpha': [1.0]}, scoring='neg_nmse').fit([[0.0], [1.0]] * 10, [0.0, 1.0] * 10)"
    imports = ["from sklearn.model_selection import GridSearchCV", "import whsklearn.metrics"]
    for order in (imports, imports[::-1]):
        code = "\n".join([*order, "from sklearn.linear_model import Ridge", use])
        subprocess.run([sys.executable, "-c", code], check=True)


class _FailsAtFirst(RegressorMixin, BaseEstimator):
    """Wrong in the first five samples of a run, right after."""

    def fit(self, X, y):
        return self

    def predict(self, X):
        y = np.asarray(X)[:, 0].copy()
        y[:5] += 10.0
        return y


def test_a_scorer_can_leave_out_the_start_of_every_fold(rng):
    X = rng.normal(size=(60, 1))
    scores = cross_val_score(_FailsAtFirst(), X, X[:, 0], scoring=free_run_scorer(nmse, skip=5), cv=3)
    assert np.all(scores == 0.0)
    assert np.all(cross_val_score(_FailsAtFirst(), X, X[:, 0], scoring="neg_nmse", cv=3) < -1.0)


class _Diverges(_FailsAtFirst):
    """Runs away into NaN."""

    def predict(self, X):
        return np.full(len(X), np.nan)


def test_predictions_that_are_not_finite_fail_the_fold(rng):
    X, y = rng.normal(size=(20, 1)), rng.normal(size=20)
    with pytest.raises(ValueError, match="y_hat holds"):
        get_scorer("neg_nmse")(_Diverges(), X, y)
