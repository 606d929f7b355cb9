"""What a sample weighs: 1 / variance, and nothing at zero."""

from __future__ import annotations

import numpy as np
import pytest
from sklearn.base import clone
from sklearn.linear_model import LinearRegression

from whsklearn import (
    DifferentialEvolutionRegressor,
    InverseDynamicsLags,
    MILSRegressor,
    PEMRegressor,
    RLSRegressor,
    RMILSRegressor,
    StreamingPEMRegressor,
    WienerHammersteinLags,
    WienerHammersteinSystem,
)
from whsklearn.checks import state_difference
from whsklearn.datasets import make_wiener_hammerstein
from whsklearn.metrics import nmse

OPEN = WienerHammersteinLags(1, 1, 1, 0, law="polynomial", delays=(0, 0))
MODELS = {
    "RMILS": RMILSRegressor(WienerHammersteinLags(), n_starts=16, memory=512, random_state=0),
    "MILS": MILSRegressor(WienerHammersteinLags(), n_starts=16, memory=512, random_state=0),
    "memory=0": RMILSRegressor(WienerHammersteinLags(), n_starts=4, memory=0, random_state=0),
    "published": RMILSRegressor(WienerHammersteinLags(), gradient="pseudolinear"),
    "PEM": PEMRegressor(n_starts=4, random_state=0),
    "swarm": DifferentialEvolutionRegressor(n_generations=3, random_state=0),
    "simulation": PEMRegressor(OPEN, criterion="simulation"),
    "one pass": StreamingPEMRegressor(OPEN, n_start=300, block=100),
}


@pytest.fixture(scope="module")
def record():
    return make_wiener_hammerstein(600, snr_db=20, random_state=3)


def test_on_rows_it_is_weighted_least_squares():
    rng = np.random.default_rng(0)
    X, w = rng.standard_normal((80, 3)), rng.uniform(0.0, 3.0, 80)
    w[::7] = 0.0
    y = X @ [1.0, -2.0, 0.5] + rng.standard_normal(80)
    best = LinearRegression(fit_intercept=False).fit(X, y, sample_weight=w)
    model = RLSRegressor(P0=1e9).fit(X, y, sample_weight=w)
    np.testing.assert_allclose(model.theta_, best.coef_, rtol=1e-6)
    residual = w @ (y - X @ best.coef_) ** 2 / (np.count_nonzero(w) - 3)
    np.testing.assert_allclose(model.covariance_, residual * np.linalg.inv((X * w[:, None]).T @ X), rtol=1e-5)
    stream = RLSRegressor(P0=1e9)
    for s in (slice(0, 11), slice(11, 12), slice(12, 80)):
        stream.partial_fit(X[s], y[s], sample_weight=w[s])
    np.testing.assert_array_equal(stream.theta_, model.theta_)


@pytest.mark.parametrize("name", list(MODELS))
def test_ones_change_nothing_and_the_unit_of_weights_is_no_matter(record, name):
    X, y = record
    plain = clone(MODELS[name]).fit(X, y)
    ones = clone(MODELS[name]).fit(X, y, sample_weight=np.ones(len(y)))
    assert state_difference(plain.get_state(), ones.get_state()) == 0.0
    if name in ("PEM", "simulation", "one pass", "swarm"):  # recursions weigh them against P0
        fours = clone(MODELS[name]).fit(X, y, sample_weight=np.full(len(y), 4.0))
        np.testing.assert_allclose(fours.predict(X), plain.predict(X), atol=1e-6 * np.std(y))
        if name != "swarm":
            np.testing.assert_allclose(fours.standard_errors_, plain.standard_errors_, rtol=1e-3)


@pytest.mark.parametrize("name", ["RMILS", "MILS", "PEM", "simulation", "one pass"])
def test_spikes_of_weight_zero_do_no_harm(record, name):
    """Outputs that a bad contact spoilt: with weight zero as good as without them, without it far off."""
    system = WienerHammersteinSystem.example()
    if name in ("simulation", "one pass"):
        u = np.random.default_rng(1).standard_normal((600, 1))
        x = np.zeros(600)
        for t in range(600):
            x[t] = u[t, 0] + (0.5 * x[t - 1] if t else 0.0)
        X, y, fresh = u, x + 0.2 * x**2, x + 0.2 * x**2
    else:
        X, y = record
        X_new, fresh = make_wiener_hammerstein(600, snr_db=None, random_state=9, system=system)
    spoilt, weight = y.copy(), np.ones(len(y))
    bad = np.arange(40, 600, 45)
    spoilt[bad] += 30.0 * np.std(y)
    weight[bad] = 0.0
    if name in ("RMILS", "MILS", "PEM"):  # there past outputs are regressors too
        for k in (1, 2):
            weight[bad[bad + k < 600] + k] = 0.0
    X_new = X if name in ("simulation", "one pass") else X_new
    with_weights = clone(MODELS[name]).fit(X, spoilt, sample_weight=weight)
    assert nmse(fresh, with_weights.predict(X_new)) < 0.03
    assert nmse(fresh, clone(MODELS[name]).fit(X, spoilt).predict(X_new)) > 0.1


@pytest.mark.parametrize("name", ["RMILS", "memory=0", "published", "one pass"])
def test_a_stream_of_weighted_samples_knows_no_chunks(record, name):
    X, y = record
    w = np.random.default_rng(5).uniform(0.0, 2.0, len(y)) * (np.arange(len(y)) % 9 > 0)
    whole = clone(MODELS[name]).partial_fit(X, y, sample_weight=w)
    parts = clone(MODELS[name])
    for a, b in ((0, 1), (1, 2), (2, 130), (130, 399), (399, 600)):
        parts.partial_fit(X[a:b], y[a:b], sample_weight=w[a:b])
    assert state_difference(whole.get_state(), parts.get_state()) == 0.0


def test_noise_of_two_sizes_is_weighed_by_its_variance():
    """Half of the record twenty times as noisy: weights of 1 / variance give half the error or less, over 6 seeds."""
    errors = []
    for seed in range(6):
        rng = np.random.default_rng(seed)
        u = rng.standard_normal((1000, 1))
        x = np.convolve(u[:, 0], 0.5 ** np.arange(40))[:1000]
        y = x + 0.2 * x**2
        sd = np.where(np.arange(1000) % 200 < 100, 0.02, 0.4) * np.std(y)
        noisy = y + sd * rng.standard_normal(1000)
        models = [PEMRegressor(OPEN, criterion="simulation").fit(u, noisy, sample_weight=w) for w in (None, 1 / sd**2)]
        errors.append([nmse(y, m.predict(u)) for m in models])
    plain, weighted = np.median(errors, axis=0)
    assert weighted < 0.5 * plain


def test_filtered_rows_take_no_weights():
    q = 0.3 * np.sin(np.arange(2000) / 200.0)
    with pytest.raises(ValueError, match="filters samples into fewer rows"):
        RLSRegressor(InverseDynamicsLags(200.0)).fit(q[:, None], np.gradient(q), sample_weight=np.linspace(0, 1, 2000))
