"""A step among many records has its place; records that scatter have no step."""

from __future__ import annotations

import numpy as np

from tests.compare.linear import TRUTH, rows
from whsklearn.compare.estimate import estimate
from whsklearn.compare.records import compare_rows
from whsklearn.compare.series import change_point, course, scatter, spread


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


def test_a_trend_is_told_from_a_step_and_from_scatter():
    rng = np.random.default_rng(1)
    n, error = 8, 0.02
    shapes = {"trend": 0.05 * np.arange(n), "change point": 0.3 * (np.arange(n) > 4), "neither": np.zeros(n)}
    for word, shape in shapes.items():
        told = [course(1.0 + shape + error * rng.standard_normal(n), np.full(n, error**2), 0.01) for _ in range(60)]
        assert np.mean([c.word == word for c in told]) > 0.9
        if word == "trend":
            assert np.mean([abs(c.slope - 0.05) < 2.0 * c.standard_error for c in told]) > 0.85
    scattered = [course(1.0 + 0.2 * rng.standard_normal(n), np.full(n, error**2), 0.01).word for _ in range(60)]
    assert np.mean([word == "neither" for word in scattered]) > 0.9  # the scatter is the noise of a trend


def test_a_number_that_falls_from_record_to_record_is_told_with_its_slope():
    every, _ = many([1.0, 0.9, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3])
    found = compare_rows(every, 0.01)
    (coulomb,) = [r for r in found.numbers if r["name"] == "coulomb"]
    assert coulomb["course"] == "trend"
    assert abs(coulomb["slope"] + 0.02) < 3.0 * coulomb["slope_standard_error"]
    assert any("coulomb falls by" in note for note in found.notes)
