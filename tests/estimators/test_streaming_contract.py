"""The streaming contract, for every estimator that learns sample by sample."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sklearn.base import clone

from whsklearn import (
    MILSRegressor,
    MultiInnovationGradientRegressor,
    RLSRegressor,
    RMILSRegressor,
    WienerHammersteinLags,
)
from whsklearn.change import set_forgetting
from whsklearn.checks import state_difference, streaming_checks
from whsklearn.datasets import make_wiener_hammerstein

LAGS = WienerHammersteinLags()
ESTIMATORS = {
    "RLS on rows": RLSRegressor(forgetting=0.99),
    "RMILS on rows": RMILSRegressor(p=3, random_state=0),
    "RLS": RLSRegressor(LAGS, n_starts=4, memory=128, random_state=0),
    "MILS": MILSRegressor(LAGS, p=3, n_starts=4, memory=128, random_state=0),
    "RMILS": RMILSRegressor(LAGS, p=4, n_starts=4, memory=128, random_state=0),
    "RMILS without memory": RMILSRegressor(LAGS, p=4, n_starts=4, memory=0, forgetting=0.999, random_state=0),
    "MILS as published": MILSRegressor(LAGS, p=4, gradient="pseudolinear"),
    "RMILS as published": RMILSRegressor(LAGS, p=4, gradient="pseudolinear"),
    "gradient": MultiInnovationGradientRegressor(LAGS),
}


def record(name, n=300):
    if "rows" in name:
        rng = np.random.default_rng(0)
        X = rng.normal(size=(n, 3))
        return X, X @ [1.0, -2.0, 0.5] + 0.1 * rng.normal(size=n)
    return make_wiener_hammerstein(n_samples=n, snr_db=20, random_state=0)


@pytest.mark.parametrize("check", [pytest.param(c, id=n) for n, c in streaming_checks()])
@pytest.mark.parametrize("name", list(ESTIMATORS))
def test_contract(name, check):
    check(ESTIMATORS[name], *record(name))


@pytest.mark.parametrize("name", ["RLS on rows", "RMILS", "RMILS without memory", "RMILS as published"])
@given(cuts=st.lists(st.integers(1, 299), max_size=12, unique=True), seed=st.integers(0, 99))
@settings(max_examples=10)
def test_no_chunking_makes_a_difference(name, cuts, seed):
    X, y = record(name)
    X = X * np.random.default_rng(seed).choice([1e-3, 1.0, 1e3])
    whole, parts = (clone(ESTIMATORS[name]) for _ in range(2))
    whole.partial_fit(X, y)
    for a, b in zip([0, *sorted(cuts)], [*sorted(cuts), 300], strict=True):
        parts.partial_fit(X[a:b], y[a:b])
    assert state_difference(whole.get_state(), parts.get_state()) <= 1e-12


@pytest.mark.parametrize("name", list(ESTIMATORS))
def test_the_state_does_not_grow(name):
    X, y = record(name)
    model = clone(ESTIMATORS[name])

    def size():
        return sum(np.asarray(v).nbytes for v in model.get_state()["state"].values())

    model.partial_fit(X, y)
    before = size()
    for _ in range(5):
        model.partial_fit(X, y)
    assert size() <= before


@pytest.mark.parametrize("name", ["RLS on rows", "RMILS", "RMILS as published"])
def test_forgetting_can_be_lowered_and_raised_mid_stream(name):
    X, y = record(name)
    model = clone(ESTIMATORS[name]).partial_fit(X, y)
    before = model.theta_
    set_forgetting(model, 0.9)
    np.testing.assert_array_equal(model.theta_, before)
    model.partial_fit(X, y)
    quick = np.trace(model.covariance_)
    set_forgetting(model, 1.0)
    model.partial_fit(X, y)
    model.partial_fit(X, y)
    if name != "RMILS":  # whose memory is read again at full weight
        assert np.trace(model.covariance_) < quick
    with pytest.raises(ValueError, match="forgetting"):
        set_forgetting(model, 1.1)
