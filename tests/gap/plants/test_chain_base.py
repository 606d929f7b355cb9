"""The base model of a chain: its least minimum, its knots, and a reading whose sign was lost."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from tests.gap.plants.example_chain import PLAIN, TRUE
from whsklearn.gap.plants.chain_base import base_of, never_negative, with_knots
from whsklearn.gap.plants.chain_fit import cost
from whsklearn.gap.plants.chain_law import REACH, law_choice
from whsklearn.gap.plants.chain_model import chain, free_run


@pytest.fixture(scope="module")
def found():
    return base_of(PLAIN, law_choice(None), np.random.default_rng(0))


def test_minima_are_sorted_separate_and_the_least_is_as_good_as_the_truth(found):
    costs = [m.cost for m in found.minima]
    assert costs == sorted(costs)
    assert len(costs) == len(set(costs))
    assert costs[0] < 1.02 * cost(PLAIN, TRUE)
    assert found.folded is None
    assert all(m.on is PLAIN for m in found.minima)


def test_a_free_run_of_the_base_model_explains_the_record(found):
    miss = (PLAIN.y - free_run(PLAIN, found.minima[0]))[PLAIN.held >= 0]
    assert np.mean(miss**2) < 0.05 * np.var(PLAIN.y)


def test_what_stays_on_one_side_and_touches_zero_may_have_lost_its_sign():
    wave = np.sin(np.linspace(0, 30, 2001))
    assert never_negative(np.abs(wave))
    assert not never_negative(wave)
    assert not never_negative(np.abs(wave) + 0.1)


def test_knots_lie_at_the_quantiles_of_x_and_a_law_with_them_explains_as_much(found):
    choice = law_choice("piecewise_linear:6,coulomb")
    straight = dataclasses.replace(PLAIN, law=choice.first(), dims=np.array([2, 2, 2, 2, len(choice.first())]))
    start = base_of(straight, law_choice("polynomial,coulomb"), np.random.default_rng(0)).minima[0]
    x = chain(straight, start)[0]
    at, model = with_knots(straight, start, choice)
    knots = [t.knot for t in at.law.terms if hasattr(t, "knot")]
    np.testing.assert_allclose(knots, np.quantile(x, np.linspace(*REACH, 6)))
    assert int(at.dims[4]) == len(at.law) == 8
    assert model.cost < 1.1 * start.cost


def test_a_lost_sign_is_found_and_the_model_of_the_readings_kept():
    folded = dataclasses.replace(PLAIN, y=np.abs(PLAIN.y))
    found = base_of(folded, law_choice(None), np.random.default_rng(0))
    assert found.folded is not None
    (model,) = found.minima
    assert [t.name for t in model.terms] == ["sensor_rectification"]
    assert model.n_base == 1
    assert model.cost < 0.5 * found.folded.cost
