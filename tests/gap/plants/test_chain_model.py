"""Vectors, sensitivities and robust sums of squares of the model under diagnosis."""

from __future__ import annotations

import numpy as np
import pytest

from whsklearn import WienerHammersteinSystem
from whsklearn.effects import as_law
from whsklearn.gap.plants import chain_model as bm
from whsklearn.gap.plants.chain_candidates import CATALOGUE
from whsklearn.gap.plants.chain_evidence import CAP
from whsklearn.gap.plants.chain_fit import deviance, weights_of

THETA = np.array([2.2, 1.0, 0.5, 0.05, 0.7, 0.2, 0.2, 0.15, 0.4])


@pytest.fixture(scope="module")
def setting():
    rng = np.random.default_rng(1)
    u = rng.normal(size=600)
    y = WienerHammersteinSystem.example().simulate(u, 0.05 * rng.normal(size=600))
    fit = np.arange(600) >= 40
    dims = np.array([2, 2, 2, 2, 3])
    return bm.Setting(u, y, 1.0, dims, as_law(None), fit, np.full(600, -1))


def kind(name):
    return next(k for k in CATALOGUE if k.name == name)


@pytest.mark.parametrize(("name", "q"), [
    ("cogging", (0.1, -0.2, 0.6)), ("dead_zone", (0.2,)), ("output_offset", (0.3,)),
                                     ("stribeck", (0.2, 1.0, 2.0)), ("sensor_rectification", (0.3,))])  # fmt: skip
def test_vector_and_model_are_inverses(setting, name, q):
    m = bm.ChainModel(THETA, (bm.Term(kind(name), q),), kappa=5.0)
    z = bm.signal_scales(setting, m)
    again = bm.from_vector(m, bm.to_vector(m, z), z)
    np.testing.assert_allclose(again.theta, m.theta)
    np.testing.assert_allclose(again.terms[0].q, q)


@pytest.mark.parametrize(("name", "q"), [
    ("cogging", (0.1, -0.2, 0.6)), ("actuator_lag", (0.8,)), ("output_offset", (0.3,)),
                                     ("load_friction", (0.2,)), ("hardening_spring", (0.01, 0.0))])  # fmt: skip
def test_sensitivities_are_central_differences(setting, name, q):
    m = bm.ChainModel(THETA, (bm.Term(kind(name), q),), ar=np.array([0.3, -0.1, 0.0, 0.0, 0.0, 0.05]), kappa=0.5)
    z = bm.signal_scales(setting, m)
    rows = bm.jacobian(setting, m, z, bm.raw_errors(setting, m))
    x = bm.to_vector(m, z)
    for i in range(x.size):
        h = 1e-5 * max(abs(x[i]), 0.1)
        up, down = x.copy(), x.copy()
        up[i] += h
        down[i] -= h
        e = [
            bm.coloured(bm.raw_errors(setting, n), n.ar) for n in (bm.from_vector(m, up, z), bm.from_vector(m, down, z))
        ]
        slope = (e[0] - e[1]) / (2 * h)
        assert np.linalg.norm(rows[:, i] - slope) <= 5e-3 * np.linalg.norm(slope) + 1e-6


def test_one_step_errors_are_the_noise_under_the_truth(setting):
    u = setting.u
    d = np.random.default_rng(7).normal(size=u.size)
    y = WienerHammersteinSystem.example().simulate(u, d)
    truth = bm.Setting(u, y, 1.0, setting.dims, setting.law, setting.fit, setting.held)
    np.testing.assert_allclose(bm.raw_errors(truth, bm.ChainModel(THETA)), d, atol=1e-9)


def test_the_sum_of_squares_of_gaussian_errors_is_theirs():
    e = np.random.default_rng(0).normal(size=4000)
    assert deviance(e)[0] == pytest.approx(float(e @ e), rel=0.02)


def test_an_outlier_costs_no_more_than_the_cap():
    e = np.random.default_rng(0).normal(size=4000)
    bad = e.copy()
    bad[10] = 1e4
    drift = e.size * np.log(deviance(bad)[0] / deviance(e)[0])
    assert 0.0 < drift < CAP + 3.0
    assert weights_of(bad)[0][10] < 1e-6


def test_the_colour_of_the_noise_cannot_take_a_constant_out_of_the_errors():
    difference = np.array([-1.0, 0.0, 0.0, 0.0, 0.0, 0.0])  # A(q) = 1 - q^-1 leaves nothing of a constant
    held = bm.shortened_colour(difference)
    assert np.abs(np.roots([1.0, *held])).max() < bm.LONGEST_COLOUR
    assert bm.coloured(np.ones(200), held)[-1] > 0.04
    short = np.array([-0.9, 0.1, 0.0, 0.0, 0.0, 0.0])
    np.testing.assert_array_equal(bm.shortened_colour(short), short)
