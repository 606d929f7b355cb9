"""Linear candidates: exact without noise, and each best by its own criterion."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from whsklearn.identification import identify
from whsklearn.identification.linear_fit import fit_arx, fit_output_error
from whsklearn.identification.view import view

B, F = [0.0, 0.5, 0.2], [1.0, -1.2, 0.5]


def record(noise=0.0, of_equation=False, seed=0, n=600):
    rng = np.random.default_rng(seed)
    u, e = rng.standard_normal((2, n))
    y = lfilter(B, F, u) + 3.0 + noise * (lfilter([1.0], F, e) if of_equation else e)
    return view(u, y, 1.0, "output")


@pytest.mark.parametrize("fit", [fit_arx, fit_output_error])
def test_without_noise_it_is_the_system(fit):
    model = fit(record(), 2)
    np.testing.assert_allclose(model.numerator, B, atol=1e-6)
    np.testing.assert_allclose(model.denominator, F, atol=1e-6)
    assert model.offset == pytest.approx(3.0, abs=1e-6)


@pytest.mark.parametrize(("fit", "of_equation"), [(fit_arx, True), (fit_output_error, False)])
def test_intervals_cover_the_truth_where_the_noise_is_of_the_fits_own_kind(fit, of_equation):
    hits = []
    for seed in range(40):
        model = fit(record(0.3, of_equation, seed), 2)
        e = model.standard_errors
        hits += [abs(model.numerator[1] - 0.5) < 1.96 * e["b1"], abs(model.denominator[1] + 1.2) < 1.96 * e["f1"]]
    assert 0.85 <= np.mean(hits) <= 1.0


def test_noise_of_the_readings_bends_the_one_and_not_the_other():
    arx, oe = (fit(record(0.5), 2).denominator[1] for fit in (fit_arx, fit_output_error))
    assert abs(oe + 1.2) < 0.05 < abs(arx + 1.2)


def process(dead: int, seed: int, level: float = 20.0, n: int = 2000):
    """A heated mass far from zero: steps of the power, one slow pole, a dead time in samples; and its pole and gain."""
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.uniform(0.0, 100.0, n // 100), 100)
    pole = np.exp(-1.0 / 80.0)
    y = lfilter([*np.zeros(dead + 1), 0.8 * (1.0 - pole)], [1.0, -pole], u) + level
    return u, y + 0.05 * rng.standard_normal(n), pole


@pytest.mark.parametrize("dead", [0, 1, 15, 60])
def test_a_dead_time_is_found_and_the_numbers_are_right_within_their_intervals(dead):
    u, y, pole = process(dead, seed=dead)
    model = fit_output_error(view(u, y, 1.0, "output"), 1)
    assert model.delay == dead + 1
    found = model.parameters
    truth = {f"b{dead + 1}": 0.8 * (1.0 - pole), "f1": -pole, "offset": 20.0}
    assert found.keys() == {"b0", *truth}
    for name, value in truth.items():
        assert abs(found[name] - value) < 4.0 * model.standard_errors[name], name


def test_poles_are_not_taken_for_a_dead_time():
    rng = np.random.default_rng(0)
    u = rng.standard_normal(3000)
    y = lfilter([0.0, 0.02], np.poly([0.9, 0.8, 0.7]), u) + 0.01 * rng.standard_normal(3000)
    assert fit_output_error(view(u, y, 1.0, "output"), 3).delay == 1


def test_identify_recommends_the_dead_time_in_place_of_poles():
    u, y, _ = process(15, 0)
    found = identify(u, y)
    assert found.recommended.structure == {"order": 1, "dead_time": 15.0}
    assert found.white
    assert np.std(y - found.model.simulate(u)) < 0.053


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_of_two_linear_models_of_a_size_the_one_that_noise_biases_comes_second(seed):
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.standard_normal(25), 10)
    y = lfilter([0.0, 0.04], [1.0, -0.96], u) + 1e-3 * rng.standard_normal(250)
    order = [c.name for c in identify(u, y, logged="output").models if c.size == 4]
    assert order.index("output error, order 1") < order.index("ARX, order 1")


def test_a_slow_model_is_judged_from_its_state_where_the_held_out_part_begins():
    u, y, _ = process(15, seed=4)
    best = identify(u, y).recommended
    assert best.test["rmse"] < 0.06  # of noise 0.05
