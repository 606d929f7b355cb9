"""The standard deviation of a prediction holds what is measured."""

from __future__ import annotations

import numpy as np
import pytest

from whsklearn import (
    DifferentialEvolutionRegressor,
    InverseDynamicsLags,
    PEMRegressor,
    RLSRegressor,
    RMILSRegressor,
    WienerHammersteinLags,
    WienerHammersteinSystem,
)
from whsklearn.datasets import make_wiener_hammerstein
from whsklearn.estimators._spread import draws, noise_spread

ORDERS = WienerHammersteinLags(2, 1, 1, 0, law="polynomial", delays=(0, 0))


def test_on_rows_it_is_the_textbook_s():
    rng = np.random.default_rng(0)
    X = rng.standard_normal((60, 2))
    y = X @ [1.0, -2.0] + 0.3 * rng.standard_normal(60)
    model = RLSRegressor(P0=1e9).fit(X, y)
    y_hat, std = model.predict(X, return_std=True)
    s2 = np.sum((y - X @ model.theta_) ** 2) / 58
    leverage = np.einsum("ti,ij,tj->t", X, np.linalg.inv(X.T @ X), X)
    np.testing.assert_allclose(std, np.sqrt(s2 * (1 + leverage)), rtol=1e-5)
    np.testing.assert_array_equal(y_hat, model.predict(X))


def test_noise_through_a_denominator_grows_to_its_stationary_size():
    std = noise_spread(4.0, np.array([-0.8]), np.isin(np.arange(200), (0, 100)))
    np.testing.assert_allclose(std[[0, 1]], [2.0, 2.0 * np.sqrt(1 + 0.64)])
    assert std[99] == pytest.approx(2.0 / np.sqrt(1 - 0.64), rel=1e-6)
    assert std[100] == 2.0  # from rest again


@pytest.mark.parametrize("estimator", ["RMILS", "PEM"])
def test_95_percent_of_new_measurements_lie_within(estimator):
    """Noise by (2), before L2's denominator; 8 fits, a fresh noisy record each."""
    system, inside = WienerHammersteinSystem.example(), []
    for seed in range(8):
        X, y = make_wiener_hammerstein(1000, snr_db=10, random_state=seed, system=system)
        new_X, new_y = make_wiener_hammerstein(1000, snr_db=10, random_state=[seed, 1], system=system)
        model = (
            RMILSRegressor(WienerHammersteinLags(), random_state=seed)
            if estimator == "RMILS"
            else PEMRegressor(n_starts=6, random_state=seed)
        ).fit(X, y)
        y_hat, std = model.predict(new_X, return_std=True)
        inside.append(np.abs(new_y - y_hat) < 1.96 * std)
    assert 0.93 < np.mean(inside) < 0.97


def test_where_the_free_run_is_fitted_the_noise_is_the_output_s():
    rng = np.random.default_rng(2)
    u = rng.standard_normal((2000, 1))
    x = np.convolve(u[:, 0], 0.7 ** np.arange(40))[:2000]
    y = x + 0.1 * x**2 + 0.5 * rng.standard_normal(2000)
    model = PEMRegressor(ORDERS, criterion="simulation").fit(u[:1000], y[:1000])
    y_hat, std = model.predict(u, return_std=True)
    assert 0.93 < np.mean(np.abs(y - y_hat)[1000:] < 1.96 * std[1000:]) < 0.97
    assert std.min() > 0.45


def test_twice_the_standard_errors_are_twice_the_spread():
    """Of parameters known well enough for the free run to be linear in them, whatever the noise."""
    X, y = make_wiener_hammerstein(500, snr_db=30, random_state=0)
    model = PEMRegressor(ORDERS, criterion="simulation").fit(X, y)
    natural, structure, restart = model._natural(), model._structure()._replace(advance=0), np.arange(500) == 0
    small = 1e-6 * model._natural_covariance()
    once, twice = (draws(natural, k * small, structure, X, restart) for k in (1.0, 4.0))
    np.testing.assert_allclose(twice[10:], 2.0 * once[10:], rtol=0.02)


def test_rows_of_an_axis_have_it_too():
    t = np.arange(4000) / 500.0
    q = 0.4 * np.sin(2 * t) + 0.1 * np.sin(7 * t)
    v, a = np.gradient(q, t), np.gradient(np.gradient(q, t), t)
    torque = 0.05 * a + 0.6 * v + 0.3 * np.sign(v) + 0.02 * np.random.default_rng(0).standard_normal(4000)
    model = RLSRegressor(InverseDynamicsLags(500.0, cutoff=50.0)).fit(q[:, None], torque)
    std = model.predict(q[:, None], return_std=True)[1]
    assert std.shape == (4000,)
    assert np.isfinite(std).all()


def test_it_is_refused_without_a_covariance_and_infinite_without_knowledge():
    X, y = make_wiener_hammerstein(60, random_state=0)
    with pytest.raises(ValueError, match="has no covariance"):
        DifferentialEvolutionRegressor(n_generations=1, random_state=0).fit(X, y).predict(X, return_std=True)
    two = np.ones((2, 3))
    assert np.isinf(RLSRegressor().fit(two, [1.0, 2.0]).predict(two, return_std=True)[1]).all()
