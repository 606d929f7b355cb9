"""Data that no candidate has seen decide, and a simpler one is taken where they do not."""

from __future__ import annotations

import numpy as np
import pytest

from whsklearn.effects import FrictionLaw, Power
from whsklearn.recursion.batch.simulation_error import Fitted, FittedChain
from whsklearn.recursion.batch.simulation_search import record
from whsklearn.recursion.batch.structure_choice import simplest

LINEAR = FrictionLaw([Power(1.0, 1)])
N = 4000


def gain(k, error, extra=0):
    """y = k u, with surplus zeros that do nothing, and the error that it is said to have left in the fit."""
    one = np.ones(1)
    return Fitted(
        FittedChain(np.append(k, np.zeros(extra))[None, :], one, one, one, LINEAR, one), error, float(error @ error)
    )


@pytest.fixture
def later():
    rng = np.random.default_rng(0)
    u = rng.standard_normal(N)
    data = record(u[:, None], u + 0.1 * rng.standard_normal(N), np.arange(N) == 0)
    return data._replace(counts=np.arange(N) >= N // 2)


ERROR = 0.1 * np.random.default_rng(1).standard_normal(3000)


def test_the_simplest_of_equals(later):
    candidates = [gain(1.0, ERROR), gain(1.0, 0.9999 * ERROR, 2), gain(1.0005, 0.9999 * ERROR, 4)]
    assert simplest(candidates, later) is candidates[0]


@pytest.mark.parametrize("k", [0.96, 0.985, np.inf])
def test_what_is_worse_on_the_held_out_data_is_not_taken(later, k):
    """By more than 3 % of the error, by less but three standard errors, or altogether."""
    candidates = [gain(k, ERROR), gain(1.0, 0.9999 * ERROR, 2)]
    assert simplest(candidates, later) is candidates[1]


def test_one_sample_that_is_missed_by_far_counts_although_it_makes_the_mean_uncertain(later):
    """The standard error of a difference that stands in one batch is as large as the difference."""
    u = later.u.copy()
    u[0, 3000] = 100.0
    y = later.y.copy()
    y[3000] = 100.0
    candidates = [gain(0.985, ERROR), gain(1.0, 0.9999 * ERROR, 2)]
    assert simplest(candidates, later._replace(u=u, y=y)) is candidates[1]


def test_what_further_parameters_gain_in_the_fit_counts_where_held_out_data_agree(later):
    """A gain that chance does not give, and a difference of less than two standard errors on the held-out data."""
    candidates = [gain(0.9985, 1.01 * ERROR), gain(1.0, ERROR, 2)]
    assert simplest(candidates, later) is candidates[1]
    assert simplest([gain(0.9985, 1.0005 * ERROR), candidates[1]], later).chain.b1[0, 0] == 0.9985
