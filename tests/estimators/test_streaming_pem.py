"""The simulation-error fit in one pass."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter
from sklearn.base import clone

from whsklearn import StreamingPEMRegressor, WienerHammersteinLags
from whsklearn.checks import check_streaming, state_difference
from whsklearn.metrics import nmse

LAGS = WienerHammersteinLags(2, 1, 2, 1, law="cubic_spline", delays=(0, 0))


def saturated(n, seed, noise=0.01):
    rng = np.random.default_rng(seed)
    u = rng.standard_normal((n, 1))
    x = lfilter([0.5, 0.2], [1.0, -0.6], u[:, 0])
    clean = lfilter([1.0, 0.4], [1.0, -0.5], np.minimum(x, 0.4))
    return u, clean + noise * rng.standard_normal(n), clean


def test_it_keeps_the_contract_of_a_stream():
    u, y, _ = saturated(260, 0)
    small = WienerHammersteinLags(1, 1, 1, 0, law="cubic_spline:4", delays=(0, 0))  # it begins anew dozens of times
    check_streaming(StreamingPEMRegressor(small, n_start=100, block=50), u, y)


def test_blocks_come_nearer_to_the_truth_than_the_start_alone():
    u, y, _ = saturated(6000, 1, noise=0.2)
    U, _, clean = saturated(3000, 2)
    start = StreamingPEMRegressor(LAGS, n_start=600, block=300).fit(u[:600], y[:600])
    whole = StreamingPEMRegressor(LAGS, n_start=600, block=300).fit(u, y)
    assert nmse(clean, whole.predict(U), skip=300) < 0.5 * nmse(clean, start.predict(U), skip=300)
    assert nmse(clean, whole.predict(U), skip=300) < 2e-3


def test_memory_is_bounded():
    u, y, _ = saturated(3000, 3)
    model = StreamingPEMRegressor(LAGS, n_start=500, block=200).fit(u, y)
    assert model.state_["y"].size <= 300 + 200
    assert model.standard_errors_.shape == model.theta_.shape


def test_experiments_restart_at_rest():
    u, y, _ = saturated(1500, 4)
    again = np.concatenate([u, u]), np.concatenate([y, y])
    groups = np.repeat([0, 1], 1500)
    joined = StreamingPEMRegressor(LAGS, n_start=500, block=250).fit(*again, groups=groups)
    a, b = np.split(joined.predict(again[0], groups=groups), 2)
    np.testing.assert_allclose(a, b, atol=1e-9)
    assert nmse(y, a, skip=300) < 1e-3


@pytest.mark.parametrize("change", [{"lags__law": "polynomial:3"}, {"lags__n_a": 3}, {"lags__delays": (1, 0)}])
def test_another_structure_in_the_midst_of_a_stream_is_refused_and_taken_before_its_start(change):
    u, y, _ = saturated(600, 6)
    small = WienerHammersteinLags(1, 1, 1, 0, law="cubic_spline:4", delays=(0, 0))
    model = StreamingPEMRegressor(small, n_start=300, block=100)
    twin = StreamingPEMRegressor(clone(small), n_start=300, block=100).partial_fit(u[:200], y[:200])
    model.partial_fit(u[:400], y[:400]).set_params(**change)
    before = model.get_state()
    with pytest.raises(ValueError, match=r"begun with other orders, .* or call fit\."):
        model.partial_fit(u[400:], y[400:])
    assert state_difference(model.get_state(), before) == 0.0
    with pytest.raises(ValueError, match="begun with other orders"):
        StreamingPEMRegressor(model.lags, n_start=300, block=100).set_state(before)
    twin.set_params(**change).partial_fit(u[200:400], y[200:400])
    whole = model.fit(u[:400], y[:400])
    assert state_difference(twin.get_state(), whole.get_state()) == 0.0


def test_another_length_of_the_blocks_counts_from_the_next_sample_on_and_every_sample_once():
    u, y, _ = saturated(900, 7)
    small = WienerHammersteinLags(1, 1, 1, 0, law="cubic_spline:4", delays=(0, 0))
    model = StreamingPEMRegressor(small, n_start=300, block=200).partial_fit(u[:450], y[:450])
    counted = model.state_["loss"][1]
    model.set_params(block=100).partial_fit(u[450:451], y[450:451])
    assert model.state_["fitted"] == 450
    assert model.state_["loss"][1] == counted + 150
    model.set_params(block=200).partial_fit(u[451:650], y[451:650])
    assert model.state_["loss"][1] == counted + 350


@pytest.mark.parametrize("settings", [{"n_start": 3}, {"block": 2.5}, {"block": True}])
def test_settings_are_whole_numbers(settings):
    u, y, _ = saturated(200, 5)
    with pytest.raises(ValueError, match="whole number"):
        StreamingPEMRegressor(LAGS, **settings).fit(u, y)
