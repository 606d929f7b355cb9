"""The search for a chain's structure and its least simulation error."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from whsklearn.effects import FrictionLaw, Power, as_law
from whsklearn.recursion.batch.simulation_error import Fitted, FittedChain, run
from whsklearn.recursion.batch.simulation_search import SearchedOrders, best_in_turn, record, search, square

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
