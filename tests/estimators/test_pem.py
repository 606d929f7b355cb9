"""The batch prediction-error fit."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from whsklearn import PEMRegressor, WienerHammersteinLags, WienerHammersteinSystem
from whsklearn.datasets import make_wiener_hammerstein
from whsklearn.effects import Coulomb, Viscous
from whsklearn.effects.law import piecewise_linear_law, polynomial_law, smooth_law
from whsklearn.estimators._model import Structure
from whsklearn.estimators.pem import PredictionError
from whsklearn.metrics import nmse

SYSTEM = WienerHammersteinSystem.example()
LAW = SYSTEM.law
THETA = np.concatenate([SYSTEM.a[1:], SYSTEM.b, LAW.weights, SYSTEM.c[1:], SYSTEM.d])
STRUCTURE = Structure(np.array([2, 2, 2, 2, 3], dtype=np.int64), 1, LAW, LAW.key)


def errors_of(snr_db=None, weights=None, n=300):
    X, y = make_wiener_hammerstein(n, snr_db=snr_db, random_state=0)
    return PredictionError(STRUCTURE, X, y, np.arange(n) == 0, np.random.default_rng(0), weights)


def test_at_the_truth_nothing_is_left_and_an_unstable_block_is_refused():
    p = errors_of()
    np.testing.assert_allclose(p.residuals(THETA, np.inf), 0.0, atol=1e-10)
    unstable = THETA.copy()
    unstable[p.b] = -2.2, 1.1
    assert np.min(np.abs(p.residuals(unstable, np.inf))) > 100.0 * np.std(p.y)
    assert not p.jacobian(unstable, 1.0).any()


def test_the_jacobian_is_that_of_the_residuals():
    p, theta, h = errors_of(20.0), 0.9 * THETA, 1e-6
    rows = p.jacobian(theta, 2.0)
    for i in range(theta.size):
        step = h * (np.arange(theta.size) == i)
        slope = (p.residuals(theta + step, 2.0) - p.residuals(theta - step, 2.0)) / (2 * h)
        np.testing.assert_allclose(rows[:, i], slope, atol=1e-5 * np.abs(slope).max())


def test_weights_multiply_squares():
    weights = np.random.default_rng(1).uniform(0.1, 2.0, 300)
    plain, weighted = errors_of(20.0), errors_of(20.0, weights)
    np.testing.assert_allclose(
        weighted.residuals(0.9 * THETA, 5.0) ** 2, weights * plain.residuals(0.9 * THETA, 5.0) ** 2
    )


def test_climbing_ends_where_no_start_of_it_was_better():
    p = errors_of(20.0)
    start = 0.8 * THETA
    cost, theta = p.climb(start)
    assert cost < 0.5 * np.sum(p.residuals(start, np.inf) ** 2)
    assert cost == pytest.approx(np.sum(p.residuals(theta, np.inf) ** 2))


def test_a_parameter_that_moves_nothing_has_no_variance():
    p = errors_of(20.0)
    p.u[:] = 0.0  # nothing passes L1: its numbers and the law's move no error
    inverse = p.inverse_information(THETA)
    assert np.isnan(inverse[0]).all()
    assert np.isfinite(inverse[-1, -1])


SMOOTH = {
    "hammerstein": (WienerHammersteinSystem([1.0], [], [1.0, 0.4], [-0.5], polynomial_law([0.0, 1.0, 0.5]))),
    "wiener": (WienerHammersteinSystem([1.0, 0.4], [-0.5], [1.0], [], polynomial_law([0.0, 1.0, 0.5]))),
    "law (3)": WienerHammersteinSystem([1.0, 0.4], [-0.5], [1.0], [0.3], smooth_law([0.8, 2.0, 0.5, 0.7, 1.0, 0.3])),
    "piecewise linear": WienerHammersteinSystem(
        [1.0], [-0.5], [1.0], [0.3], piecewise_linear_law([-0.5, 0.5], [1.0, 0.2, 1.0])
    ),
}


def lags_of(system):
    return WienerHammersteinLags(system.a.size, system.b.size, system.c.size, system.d.size, law=system.law)


@pytest.mark.parametrize("name", list(SMOOTH))
def test_without_noise_it_is_the_system(name):
    system = SMOOTH[name]
    X, y = make_wiener_hammerstein(300, snr_db=None, random_state=0, system=system)
    model = PEMRegressor(lags_of(system), n_starts=6, random_state=0).fit(X, y)
    X2, y2 = make_wiener_hammerstein(300, snr_db=None, random_state=1, system=system)
    assert nmse(y2, model.predict(X2)) < 1e-6
    np.testing.assert_allclose(model.theta_, system.theta, atol=0.01)


def test_costs_tell_which_starts_met():
    X, y = make_wiener_hammerstein(300, random_state=0)
    model = PEMRegressor(n_starts=4, random_state=0).fit(X, y)
    assert model.costs_.shape == (4,)
    assert model.cost_ == model.costs_.min()
    assert model.cost_ == pytest.approx(np.sum((y - model.predict_ahead(X, y)) ** 2))


def test_standard_errors_cover_where_the_likelihood_is_smooth():
    """95 % intervals of a system without sign(), 60 seeds and 5 parameters; PEM from the true minimum."""
    system = SMOOTH["hammerstein"]
    hits = []
    for seed in range(60):
        X, y = make_wiener_hammerstein(300, snr_db=20, random_state=seed, system=system)
        model = PEMRegressor(lags_of(system), n_starts=3, random_state=0).fit(X, y)
        hits.append(np.abs(model.theta_ - system.theta) < 1.96 * model.standard_errors_)
    assert 0.9 <= np.mean(hits) <= 0.99


def test_parameter_errors_follow_by_the_delta_method():
    X, y = make_wiener_hammerstein(300, random_state=2)
    model = PEMRegressor(n_starts=2, random_state=0).fit(X, y)
    # viscous is theta's first entry, c[1:] and d stand in both
    errors, named = model.standard_errors_, model.parameter_standard_errors_
    assert errors[0] == pytest.approx(named["viscous"])
    np.testing.assert_allclose(errors[-2:], named["d"])
    assert named["a"][0] == 0.0


def test_a_law_without_linear_term_is_estimated_too():
    system = WienerHammersteinSystem([1.0, 0.5], [-0.4], [1.0], [0.3], [Coulomb(0.8)])
    X, y = make_wiener_hammerstein(400, snr_db=20, random_state=3, system=system)
    model = PEMRegressor(WienerHammersteinLags(2, 1, 1, 1, law="coulomb"), n_starts=6, random_state=0).fit(X, y)
    assert model.parameters_["coulomb"] == pytest.approx(0.8, abs=0.05)
    assert model.theta_.size == 4


def test_its_default_is_example_5_1():
    X, y = make_wiener_hammerstein(60, random_state=4)
    assert PEMRegressor(n_starts=1, random_state=0).fit(X, y).theta_.size == 9


@pytest.mark.parametrize("n_starts", [0, -1, 2.5, True, "some"])
def test_the_number_of_starts_is_a_whole_one(n_starts):
    with pytest.raises(ValueError, match="n_starts is"):
        PEMRegressor(n_starts=n_starts).fit(np.ones((20, 1)), np.ones(20))


def test_a_fit_that_is_interrupted_leaves_the_estimator_as_it_was(monkeypatch):
    X, y = make_wiener_hammerstein(100, snr_db=20, random_state=0)
    model = PEMRegressor(n_starts=1, random_state=0).fit(X, y)
    before = model.theta_

    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(PredictionError, "climb", interrupted)
    with pytest.raises(KeyboardInterrupt):
        model.fit(X[:80], y[:80])
    np.testing.assert_array_equal(model.theta_, before)


@pytest.mark.parametrize("law", ["cubic_spline:8", "piecewise_linear:16"])
def test_the_knots_of_a_named_law_follow_the_unit_of_the_input(law):
    rng = np.random.default_rng(0)
    u, new = rng.normal(size=(2, 1200))
    x = lfilter([0.0, 1.0, 0.4], [1.0, -0.9], [u, new])
    y, y_new = lfilter([0.0, 1.0], [1.0, -0.5], np.arctan(x))
    y += lfilter([1.0], [1.0, -0.5], 0.05 * np.std(y) * rng.normal(size=1200))
    lags, left = WienerHammersteinLags(2, 1, 1, 1, law=law), []
    for unit in (1e-8, 1.0, 1e6):
        model = PEMRegressor(lags, n_starts=4, random_state=0).fit(unit * u[:, None], y)
        left.append(nmse(y_new, model.predict(unit * new[:, None])))
    assert max(left) < 0.05**2, left


@pytest.mark.parametrize("seed", range(3))
def test_the_least_free_run_of_a_friction_is_found_from_any_of_the_one_step_minima(seed):
    rng = np.random.default_rng(seed)
    law = [Viscous(1.0), Coulomb(0.3)]
    blocks = [1.0, 2.9, 0.54], [-1.95, 1.25, -0.293], [1.0, -0.52], [-1.37, 0.63]
    u = lfilter([1.0], [1.0, -0.6], rng.normal(size=2500))
    dx = np.diff(lfilter(blocks[0], [1.0, *blocks[1]], u))
    system = WienerHammersteinSystem(*blocks, [Viscous(1.0 / np.std(dx)), Coulomb(0.33)])
    clean = system.simulate(u)
    y = clean + 0.05 * np.std(clean) * rng.normal(size=u.size)
    lags = WienerHammersteinLags(3, 3, 2, 2, law=law)
    model = PEMRegressor(lags, criterion="simulation", n_starts=8, random_state=seed).fit(u[:, None], y)
    assert nmse(clean, model.predict(u[:, None])) < 0.05**2
