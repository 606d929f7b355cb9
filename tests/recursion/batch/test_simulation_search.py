"""The search for a chain's structure and its least simulation error."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from whsklearn.effects import FrictionLaw, Power, as_law
from whsklearn.recursion.batch.simulation_error import Fitted, FittedChain, run
from whsklearn.recursion.batch.simulation_search import SearchedOrders, best_in_turn, record, search, simplest, square

RNG = np.random.default_rng(0)


@pytest.mark.parametrize("shape", [lambda x: np.minimum(x, 0.4), np.abs, lambda x: x + 0.5 * x**2])
def test_a_chain_is_found_from_the_record_alone(shape):
    u = RNG.standard_normal(2000)
    clean = lfilter([1.0, 0.4], [1.0, -0.5], shape(lfilter([0.5, 0.2], [1.0, -0.6], u)))
    y = clean + 0.02 * np.std(clean) * RNG.standard_normal(2000)
    data = record(u[:, None], y, np.arange(2000) == 0)
    found = search(data, as_law("cubic_spline"), (SearchedOrders(((2, 2),), square(1)),))
    error = (clean - run(found.chain, data).y)[data.counts]
    assert np.std(error) < 0.015 * np.std(clean)
    assert found.chain.stable


def test_every_way_to_divide_the_poles_goes_on_before_a_second_of_any():
    law = FrictionLaw([Power(1.0, 1.0)])

    def candidate(n1, n2, cost):
        a1, a2 = (np.append(1.0, np.zeros(n)) for n in (n1, n2))
        return Fitted(FittedChain(np.ones((1, 1)), a1, np.ones(1), a2, law, np.ones(1)), np.zeros(1), cost)

    pool = [candidate(3, 5, c) for c in (1.0, 1.1, 1.2)] + [candidate(3, 3, 2.0), candidate(3, 3, 2.5)]
    kept = best_in_turn(pool, 3)
    assert [f.cost for f in kept] == [1.0, 2.0, 1.1]
    assert [f.cost for f in best_in_turn(pool, 9)] == [1.0, 2.0, 1.1, 2.5, 1.2]


# --- Data that no candidate has seen decide, and a simpler one is taken where they do not ---------------------------
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
