"""The three forms of a model's parameters, its free run and its predictions."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

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
from whsklearn.effects import Coulomb, FrictionLaw, Viscous
from whsklearn.effects.law import polynomial_law, reduced_law
from whsklearn.estimators import _model as wh
from whsklearn.estimators._model import draws, noise_spread
from whsklearn.recursion.memory.starts import random_stable

LAWS = [reduced_law(), polynomial_law([0.1, 1.0, 0.3]), FrictionLaw([Coulomb(), Viscous()]), FrictionLaw([Coulomb()])]


def structure(orders=(2, 2, 2, 2), law=LAWS[0], n_inputs=1):
    dims = np.array([orders[0] * n_inputs, *orders[1:], len(law)], dtype=np.int64)
    return wh.Structure(dims, n_inputs, law, -1 if law.key is None else law.key)


def natural_of(system):
    return np.concatenate([system.a[1:], system.b, system.law.weights, system.c[1:], system.d])


ORDERS = st.tuples(st.integers(1, 3), st.integers(0, 3), st.integers(1, 3), st.integers(0, 3))
CASES = {"orders": ORDERS, "law": st.integers(0, 3), "n_inputs": st.integers(1, 3), "seed": st.integers(0, 999)}


@settings(max_examples=60)
@given(**CASES)
def test_paper_and_natural_are_each_other_s_inverse(orders, law, n_inputs, seed):
    s = structure(orders, LAWS[law], n_inputs)
    natural = np.random.default_rng(seed).normal(size=s.slices()[-1].stop)
    if s.key >= 0:
        natural[s.slices()[2].start + s.key] += 3.0  # g is not zero
    np.testing.assert_allclose(wh.natural_vector(wh.paper_vector(natural, s), s), natural, rtol=1e-9, atol=1e-12)


@settings(max_examples=30)
@given(**CASES)
def test_the_jacobian_is_that_of_the_map(orders, law, n_inputs, seed):
    s = structure(orders, LAWS[law], n_inputs)
    natural = np.random.default_rng(seed).normal(size=s.slices()[-1].stop)
    numeric = np.empty((natural.size, natural.size))
    for k in range(natural.size):
        step = np.eye(natural.size)[k] * 1e-6
        numeric[:, k] = (wh.paper_vector(natural + step, s) - wh.paper_vector(natural - step, s)) / 2e-6
    np.testing.assert_allclose(wh.paper_jacobian(natural, s), numeric, atol=1e-7)


def test_the_paper_s_vector_is_theta_of_six():
    system = WienerHammersteinSystem.example()
    np.testing.assert_allclose(wh.paper_vector(natural_of(system), structure()), system.theta)


def test_names_and_errors_have_one_layout():
    s = structure((2, 1, 2, 1), n_inputs=2)
    natural = np.arange(1.0, s.slices()[-1].stop + 1)
    named = wh.named(natural, s)
    assert named["a"].shape == (2, 2)
    assert named["a"][0, 0] == named["c"][0] == 1.0
    assert list(named) == ["a", "b", "c", "d", "viscous", "coulomb", "stribeck"]
    errors = wh.named_errors(natural**2, s)
    assert {k: np.shape(v) for k, v in errors.items()} == {k: np.shape(v) for k, v in named.items()}
    assert errors["a"][0, 0] == errors["c"][0] == 0.0
    assert errors["a"][1, 1] == natural[2]
    assert errors["viscous"] == named["viscous"]


@settings(max_examples=60)
@given(st.lists(st.floats(-4, 4), max_size=4))
def test_poles_are_drawn_inside_and_stable_ones_left_alone(d):
    d = np.array(d)
    inside = wh.inside(d)
    largest = np.abs(np.roots(np.r_[1.0, inside])).max(initial=0.0)
    assert largest < 1.0 + 1e-6
    if np.abs(np.roots(np.r_[1.0, d])).max(initial=0.0) < 0.999:
        np.testing.assert_array_equal(inside, d)


@pytest.mark.parametrize("seed", range(5))
def test_the_free_run_is_the_simulator(seed):
    rng = np.random.default_rng(seed)
    na, nb, nc, nd = orders = rng.integers([1, 0, 1, 0], 4)
    system = WienerHammersteinSystem(
        np.r_[1.0, rng.normal(size=na - 1)], random_stable(nb, rng), np.r_[1.0, rng.normal(size=nc - 1)],
        random_stable(nd, rng), LAWS[1],
    )  # fmt: skip
    X, y = make_wiener_hammerstein(120, snr_db=None, random_state=seed, system=system)
    s = structure(tuple(orders), LAWS[1])
    got = wh.free_run(natural_of(system), s, X, np.arange(120) == 0)
    np.testing.assert_allclose(got, y, atol=1e-9 * np.abs(y).max())


def test_predictions_between_one_step_and_the_free_run():
    """Horizon 1 has the equation noise as its error, a horizon beyond the record is the free run."""
    X, y, truth = make_wiener_hammerstein(400, snr_db=5, random_state=0, return_truth=True)
    natural, s, restart = natural_of(truth.system), structure(), np.arange(400) == 0
    errors = {h: y - wh.predictions(natural, s, X, y, restart, h) for h in (1, 2, 3, 5, 400)}
    np.testing.assert_allclose(errors[1], truth.d, atol=1e-12)
    np.testing.assert_allclose(errors[400], y - truth.y, atol=1e-12)
    # 1/D = 1 - 0.15 q^-1 + (0.15^2 - 0.4) q^-2 ...: the error of two steps ahead is d(t) - 0.15 d(t-1)
    np.testing.assert_allclose(errors[2][1:], truth.d[1:] - 0.15 * truth.d[:-1], atol=1e-12)
    variances = [errors[h].var() for h in (1, 2, 3, 5, 400)]
    assert variances == sorted(variances)


def test_the_expected_output_of_a_chain_that_responds_earlier_is_the_same_one_earlier():
    X, _, truth = make_wiener_hammerstein(200, snr_db=5, random_state=0, return_truth=True)
    natural, s, restart = natural_of(truth.system), structure(), np.arange(200) == 0
    covariance = 0.01 * np.eye(natural.size)
    expected = wh.free_run(natural, s, X, restart, covariance)
    earlier = wh.free_run(natural, s._replace(advance=1), X, restart, covariance)
    np.testing.assert_allclose(earlier[:-1], expected[1:], atol=1e-12)
    assert np.abs(expected - wh.free_run(natural, s, X, restart)).max() > 1e-3


def test_experiments_start_at_rest_in_every_prediction():
    X, y, truth = make_wiener_hammerstein(60, snr_db=5, random_state=1, return_truth=True)
    natural, s = natural_of(truth.system), structure()
    restart = np.zeros(60, dtype=bool)
    restart[[0, 25]] = True
    for horizon in (0, 1, 3):
        together = wh.predictions(natural, s, X, y, restart, horizon)
        apart = [wh.predictions(natural, s, X[i], y[i], restart[i], horizon) for i in (slice(25), slice(25, 60))]
        np.testing.assert_array_equal(together, np.concatenate(apart))


LAGS = WienerHammersteinLags(2, 1, 1, 0, law="polynomial", delays=(0, 0))


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
            else PEMRegressor(n_starts=3, random_state=seed)
        ).fit(X, y)
        y_hat, std = model.predict(new_X, return_std=True)
        inside.append(np.abs(new_y - y_hat) < 1.96 * std)
    assert 0.93 < np.mean(inside) < 0.97


def test_where_the_free_run_is_fitted_the_noise_is_the_output_s():
    rng = np.random.default_rng(2)
    u = rng.standard_normal((2000, 1))
    x = np.convolve(u[:, 0], 0.7 ** np.arange(40))[:2000]
    y = x + 0.1 * x**2 + 0.5 * rng.standard_normal(2000)
    model = PEMRegressor(LAGS, criterion="simulation").fit(u[:1000], y[:1000])
    y_hat, std = model.predict(u, return_std=True)
    assert 0.93 < np.mean(np.abs(y - y_hat)[1000:] < 1.96 * std[1000:]) < 0.97
    assert std.min() > 0.45


def test_twice_the_standard_errors_are_twice_the_spread():
    """Of parameters known well enough for the free run to be linear in them, whatever the noise."""
    X, y = make_wiener_hammerstein(500, snr_db=30, random_state=0)
    model = PEMRegressor(LAGS, criterion="simulation").fit(X, y)
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
