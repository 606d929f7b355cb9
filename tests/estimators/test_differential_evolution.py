"""The population search."""

from __future__ import annotations

import numpy as np
import pytest

from whsklearn import DifferentialEvolutionRegressor, WienerHammersteinLags, WienerHammersteinSystem
from whsklearn.datasets import make_wiener_hammerstein
from whsklearn.effects.law import polynomial_law


def test_it_finds_a_small_system_from_the_free_run():
    law = polynomial_law([0.0, 1.0, 0.4])
    system = WienerHammersteinSystem([1.0], [-0.6], [1.0], [0.3], law)
    X, y = make_wiener_hammerstein(150, snr_db=None, random_state=0, system=system)
    model = DifferentialEvolutionRegressor(
        WienerHammersteinLags(1, 1, 1, 1, law=law), n_generations=150, random_state=0
    ).fit(X, y)
    assert model.score(X, y) > 0.999
    assert model.parameters_["b"][0] == pytest.approx(-0.6, abs=0.02)
    assert model.cost_ == pytest.approx(np.sum((y - model.predict(X)) ** 2))


def test_the_same_seed_gives_the_same_answer_and_more_generations_a_better_one():
    X, y = make_wiener_hammerstein(80, random_state=1)
    one, two, more = (DifferentialEvolutionRegressor(n_generations=g, random_state=3).fit(X, y) for g in (2, 2, 15))
    np.testing.assert_array_equal(one.theta_, two.theta_)
    assert more.cost_ < one.cost_
    assert np.isnan(one.standard_errors_).all()


@pytest.mark.parametrize("name", ["n_generations", "bound"])
@pytest.mark.parametrize("value", [0, -1, "many", True, np.nan])
def test_settings_that_cannot_be_are_refused(name, value):
    with pytest.raises(ValueError, match=f"{name} is"):
        DifferentialEvolutionRegressor(**{name: value}).fit(np.ones((20, 1)), np.ones(20))


def test_units_of_the_output_make_no_difference():
    X, y = make_wiener_hammerstein(80, random_state=1)
    one, large, small = (DifferentialEvolutionRegressor(n_generations=8, random_state=3).fit(X, s * y).predict(X) / s
                         for s in (1.0, 2.0**30, 2.0**-30))  # fmt: skip
    np.testing.assert_allclose(large, one, rtol=1e-9)
    np.testing.assert_allclose(small, one, rtol=1e-9)
