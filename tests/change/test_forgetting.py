"""The past is let go, and the estimate settles again."""

from __future__ import annotations

import numpy as np
import pytest

from whsklearn import RLSRegressor
from whsklearn.change import forgetting_after, set_forgetting


@pytest.mark.parametrize("samples", [50.0, 1e9])
def test_the_past_is_let_go_as_a_shorter_stream_would_know_it(samples):
    """After 20,000 rows, fifty at the most: a jump is followed as fast as after fifty."""
    rng = np.random.default_rng(0)
    X = rng.normal(size=(20_300, 2))
    y = X @ [1.0, -2.0] + 0.1 * rng.normal(size=len(X))
    y[20_000:] += X[20_000:] @ [0.5, 0.0]
    model = RLSRegressor().fit(X[:20_000], y[:20_000])
    theta, spread = model.theta_, model.standard_errors_
    model.forget_past(samples)
    np.testing.assert_array_equal(model.theta_, theta)
    np.testing.assert_allclose(model.standard_errors_, spread * max(1.0, np.sqrt(20_000 / samples)), rtol=0.05)
    model.partial_fit(X[20_000:], y[20_000:])
    assert model.theta_[0] == pytest.approx(1.5 if samples == 50.0 else 1.0, abs=0.12)


@pytest.mark.parametrize("samples", [0.0, -1.0, np.inf, np.nan])
def test_the_past_counts_for_a_positive_number_of_samples(samples):
    with pytest.raises(ValueError, match="samples is"):
        RLSRegressor().fit([[1.0], [2.0]], [1.0, 2.0]).forget_past(samples)


def test_forgetting_settles_after_a_change():
    factors = [forgetting_after(n, 0.9999) for n in range(0, 30_000, 100)]
    assert factors[0] == pytest.approx(0.995)
    assert np.all(np.diff(factors) >= 0)
    assert factors[-1] == 0.9999
    # what came first weighs less than what comes now, and no sample more than the next
    assert np.prod([forgetting_after(n) for n in range(1800)]) == pytest.approx(0.1, rel=0.01)


def test_forgetting_set_in_mid_stream_is_that_of_a_stream_from_there_on():
    X = np.random.default_rng(0).normal(size=(400, 2))
    y = X @ [1.0, -2.0] + 0.1 * np.random.default_rng(1).normal(size=400)
    y[200:] += X[200:, 0]
    kept, let = RLSRegressor().fit(X[:200], y[:200]), RLSRegressor().fit(X[:200], y[:200])
    set_forgetting(let, 0.95)
    np.testing.assert_array_equal(let.theta_, kept.theta_)  # what was learnt stays
    assert abs(let.partial_fit(X[200:], y[200:]).theta_[0] - 2.0) < 0.1
    assert abs(kept.partial_fit(X[200:], y[200:]).theta_[0] - 1.5) < 0.2
    with pytest.raises(ValueError, match="forgetting"):
        set_forgetting(let, 1.5)
