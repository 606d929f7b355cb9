"""A step among many records has its place; records that scatter have no step."""

from __future__ import annotations

import numpy as np

from tests.compare.linear import TRUTH, rows
from whsklearn.compare.estimate import estimate
from whsklearn.compare.series import change_point, scatter, spread


def many(factors):
    every = [rows(TRUTH * [1, 1, f, 1, 1], seed=k, label=f"day {k}") for k, f in enumerate(factors)]
    return every, [estimate(r) for r in every]


def test_a_step_stands_between_two_records():
    found, _ = change_point(*many([1.0, 1.0, 1.0, 1.3, 1.3, 1.3]), 0.01)
    assert [c.name for c in found] == ["coulomb"]
    assert found[0].between == ("day 2", "day 3")
    low, high = found[0].interval
    assert low < 0.3 * 0.2 < high


def test_copies_that_scatter_are_no_step_but_a_spread():
    every, parts = many([1.0, 1.3, 0.8, 1.2, 0.9, 1.1])
    assert change_point(every, parts, 0.01)[0] == []
    found = scatter(every, parts, 0.01)
    assert [c.name for c in found] == ["coulomb"]
    assert found[0].between == ("day 2", "day 1")


def test_equal_records_have_neither():
    every, parts = many([1.0] * 6)
    assert change_point(every, parts, 0.01)[0] == []
    assert scatter(every, parts, 0.01) == []


def test_spread_between_is_that_of_the_draw():
    rng = np.random.default_rng(0)
    found = [spread(1.0 + 0.1 * rng.standard_normal(20), np.full(20, 0.02**2))[1] for _ in range(50)]
    assert abs(np.median(found) - 0.1) < 0.02
