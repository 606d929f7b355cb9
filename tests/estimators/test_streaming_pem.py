"""The simulation-error fit in one pass."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from whsklearn import StreamingPEMRegressor, WienerHammersteinLags
from whsklearn.checks import check_streaming
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


@pytest.mark.parametrize("settings", [{"n_start": 3}, {"block": 2.5}, {"block": True}])
def test_settings_are_whole_numbers(settings):
    u, y, _ = saturated(200, 5)
    with pytest.raises(ValueError, match="whole number"):
        StreamingPEMRegressor(LAGS, **settings).fit(u, y)
