"""Fits of a chain: from nothing to the truth, through wrong signs, beside an effect."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from benchmarks.blind_logs import wiener_hammerstein as blind
from tests.gap.plants.example_chain import PLAIN, THETA, TRUE, record, term
from whsklearn.effects import FrictionLaw, Hinge, QuadraticDrag, as_law
from whsklearn.gap.plants import chain_fit as cf
from whsklearn.gap.plants.chain_model import ChainModel, Record, free_run, rms_dx, simulate


def drawn(seed):
    """(record, truth) of a drawn system of another author's equations."""
    case = blind.make_case("none", seed, n=1500)
    u, y = (case.frame[k].to_numpy().copy() for k in ("u", "y"))
    s = {k: np.array(v) for k, v in case.system.items()}
    theta = np.concatenate([s["a"][1:], s["b"], s["law"], s["c"][1:], s["d"]])
    return Record.of(u, y, 1.0, np.array([2, 2, 2, 2, 3]), as_law(None)), ChainModel(theta)


@pytest.mark.parametrize("seed", [8101, 8102, 8103])
def test_the_least_minimum_is_that_of_the_truth(seed):
    s, truth = drawn(seed)
    found = cf.minima(s, cf.base_starts(s, np.random.default_rng(0)))
    # three in a thousand of n = 1460: less than a superfluous number explains by chance
    assert cf.cost(s, found[0]) < 1.003 * cf.cost(s, cf.polished(s, cf.coloured(s, truth)))


def test_without_noise_a_fit_nearby_ends_at_the_truth():
    s = record(noise=0.0)
    near = dataclasses.replace(TRUE, theta=THETA * (1.0 + 0.03 * np.cos(np.arange(9))))
    fitted = cf.sharpened(s, near, (3.0, 30.0, 300.0, 1000.0))
    np.testing.assert_allclose(fitted.theta, THETA, atol=5e-3)  # the last sign is a tanh still


def test_a_fit_never_ends_worse_than_it_began():
    m = cf.coloured(PLAIN, TRUE)
    assert cf.cost(PLAIN, cf.polished(PLAIN, m)) <= cf.cost(PLAIN, m)


def test_a_number_that_no_error_follows_stays_where_it_is():
    law = FrictionLaw([*PLAIN.law.terms, Hinge(0.0, 1e3)])  # a kink where x never is
    s = dataclasses.replace(PLAIN, law=law, dims=PLAIN.dims + np.array([0, 0, 0, 0, 1]))
    m = cf.moved(s, ChainModel(np.insert(THETA, 6, 0.0)), 1.0, np.random.default_rng(0))
    assert m.theta[6] == 0.0
    assert np.all(np.delete(m.theta, 6) != THETA)
    assert np.abs(np.delete(m.theta, 6) - THETA).max() < 1.0


def test_an_effect_is_fitted_together_with_the_blocks():
    s = record(QuadraticDrag(0.1))
    fitted = cf.sharpened(s, TRUE.plus(term("quadratic_drag", 0.01)), (30.0, 300.0, 1000.0))
    assert fitted.terms[0].q[0] == pytest.approx(0.1, rel=0.1)
    assert cf.cost(s, fitted) < 0.5 * cf.cost(s, cf.polished(s, TRUE))


def test_weights_come_from_least_squares_beside_effects():
    one = term("output_offset", 0.4)
    s = PLAIN.with_output(free_run(PLAIN, TRUE.plus(one)))
    m = ChainModel(cf.weighed(s, THETA[:3], THETA[6:], (one,)), (one,))
    np.testing.assert_array_equal(np.delete(m.theta, [3, 4, 5]), np.delete(THETA, [3, 4, 5]))
    kappa = 1.0 / rms_dx(s, m)  # the weights are those of the softest sign

    def rest(model):
        return np.std((s.y - simulate(s, model, kappa)[2])[s.fit])

    assert rest(m) < 0.5 * np.std(s.y[s.fit])
    assert rest(m) < rest(TRUE.plus(one))


def test_the_divisions_of_the_linear_model_have_all_its_poles():
    for theta in cf.divided(PLAIN, cf.linear_model(PLAIN, PLAIN.u)):
        poles = np.concatenate([np.roots([1.0, *theta[1:3]]), np.roots([1.0, *theta[7:]])])
        ratio = cf.linear_model(PLAIN, PLAIN.u)
        np.testing.assert_allclose(np.sort(np.abs(poles)), np.sort(np.abs(np.roots(ratio.a))), atol=1e-6)
