"""Several records in one call, as a list or by groups."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from sklearn.base import clone

from tests.foreign_frame import ForeignFrame
from whsklearn import PEMRegressor, RLSRegressor, RMILSRegressor, StreamingPEMRegressor, WienerHammersteinLags
from whsklearn.checks import state_difference
from whsklearn.datasets import make_wiener_hammerstein
from whsklearn.estimators._advice import DYNAMIC, told_by_past
from whsklearn.estimators._records import checked_weights, joined

SIMPLE = WienerHammersteinLags(1, 1, 1, 0, law="polynomial", delays=(0, 0))
MODELS = {
    "RMILS": RMILSRegressor(WienerHammersteinLags(), n_starts=2, memory=64, random_state=0),
    "published": RMILSRegressor(WienerHammersteinLags(), gradient="pseudolinear"),
    "PEM": PEMRegressor(n_starts=1, random_state=0),
    "one pass": StreamingPEMRegressor(SIMPLE, n_start=50, block=20),
}


@pytest.fixture(scope="module")
def records():
    pairs = [make_wiener_hammerstein(n, random_state=n) for n in (70, 90, 60)]
    return [X for X, _ in pairs], [y for _, y in pairs]


@pytest.mark.parametrize("name", list(MODELS))
def test_a_list_is_the_same_as_groups(records, name):
    Xs, ys = records
    X, y, groups = np.concatenate(Xs), np.concatenate(ys), np.repeat([0, 1, 2], [70, 90, 60])
    listed, grouped = clone(MODELS[name]).fit(Xs, ys), clone(MODELS[name]).fit(X, y, groups=groups)
    assert state_difference(listed.get_state(), grouped.get_state()) == 0.0
    apart = listed.predict(Xs)
    assert [len(v) for v in apart] == [70, 90, 60]
    np.testing.assert_array_equal(np.concatenate(apart), grouped.predict(X, groups))
    np.testing.assert_array_equal(apart[1], listed.predict(Xs[1]))  # each from rest
    ahead = listed.predict_ahead(Xs, ys, horizon=2)
    np.testing.assert_array_equal(ahead[2], listed.predict_ahead(Xs[2], ys[2], horizon=2))
    y_hat, std = listed.predict(Xs, return_std=True)
    assert [len(v) for v in y_hat] == [len(v) for v in std] == [70, 90, 60]
    assert listed.score(Xs, ys) == grouped.score(X, y, groups=groups)


@pytest.mark.parametrize("name", ["RMILS", "published", "one pass"])
def test_every_record_of_a_list_begins_anew_in_a_stream(records, name):
    """Also where the last call's list ended with as many records."""
    Xs, ys = records
    streamed = clone(MODELS[name]).partial_fit(Xs[:1], ys[:1]).partial_fit(Xs[1:], ys[1:])
    by_groups = clone(MODELS[name])
    for k in range(3):
        by_groups.partial_fit(Xs[k], ys[k], groups=np.full(len(ys[k]), k))
    a, b = streamed.get_state(), by_groups.get_state()
    a["state"].pop("group"), b["state"].pop("group")
    assert state_difference(a, b) == 0.0


@pytest.mark.parametrize("frame", [pd.DataFrame, ForeignFrame])
def test_frames_keep_their_names(records, frame):
    Xs, ys = records
    model = clone(MODELS["published"]).fit([frame({"u": X[:, 0]}) for X in Xs], [pd.Series(y) for y in ys])
    assert model.feature_names_in_.tolist() == ["u"]
    np.testing.assert_array_equal(model.theta_, clone(MODELS["published"]).fit(Xs, ys).theta_)


def test_lists_of_rows_and_arrays_are_left_alone():
    for X in ([[1.0], [2.0]], np.zeros((3, 1)), np.zeros((2, 3, 1)), [np.zeros(2), np.zeros(2)]):
        assert joined(X, [1.0, 2.0]).X is X


def test_a_list_that_does_not_fit_is_refused_in_one_sentence(records):
    Xs, ys = records
    model = clone(MODELS["PEM"])
    with pytest.raises(ValueError, match="as a list of as many arrays"):
        model.fit(Xs, ys[:2])
    with pytest.raises(ValueError, match="as a list of as many arrays"):
        model.fit(Xs, np.concatenate(ys))
    with pytest.raises(ValueError, match="groups is not allowed"):
        model.fit(Xs, ys, groups=np.zeros(220))
    with pytest.raises(ValueError, match=r"have \[1, 2\] columns"):
        model.fit([Xs[0], np.zeros((90, 2))], ys[:2])


@pytest.mark.parametrize(
    ("weights", "said"),
    [
        (np.ones(3), "has shape"),
        (np.ones((4, 1)), "has shape"),
        ([1.0, -1.0, 1.0, 1.0], "invalid weights"),
        ([1.0, np.nan, 1.0, 1.0], "invalid weights"),
        (["a", "b", "c", "d"], "invalid weights|has shape"),
        (np.zeros(4), "zero for every sample"),
    ],
)
def test_weights_that_cannot_be_are_refused(weights, said):
    with pytest.raises(ValueError, match=said):
        checked_weights(weights, 4, some=True)


def test_weights_of_one_are_no_weights():
    assert checked_weights(np.ones(4), 4, some=True) is None
    assert checked_weights(1, 4, some=True) is None
    assert checked_weights(np.zeros(4), 4, some=False).tolist() == [0.0] * 4


def test_what_lags_was_left_out_for_is_said():
    u, y = make_wiener_hammerstein(300, random_state=0)
    with pytest.warns(UserWarning, match="give lags=WienerHammersteinLags"):
        RMILSRegressor().fit(u, y)
    with pytest.warns(UserWarning, match="explain 100 %"):
        RLSRegressor().fit(u[1:], u[:-1, 0])
    with pytest.warns(UserWarning, match="3 inputs of one Wiener-Hammerstein chain"):
        PEMRegressor(n_starts=1, random_state=0).fit(np.hstack([u, u**2, u**3]), y)


def test_example_5_1_is_told_from_a_static_regression():
    records = [make_wiener_hammerstein(1000, snr_db=7.462, random_state=seed) for seed in range(40)]
    shares = [told_by_past(X, y, np.arange(1000) == 0) for X, y in records]
    assert min(shares) > DYNAMIC


def test_a_static_regression_of_one_column_needs_no_warning():
    """White, slow or standing still, clean or noisy, and records that are too short to tell."""
    rng = np.random.default_rng(0)
    white = rng.standard_normal((300, 1))
    for u in (white, np.cumsum(white, axis=0), np.ones((300, 1))):
        for noise in (0.0, 1.0):
            RLSRegressor().fit(u, 2.0 * u[:, 0] + noise * rng.standard_normal(300))
    RLSRegressor().fit(white[1:40], white[:39, 0])
