"""A difference is named by its cause; equal records are named nothing; a repeated path cancels what no model holds."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.compare.linear import NAMES, TRUTH, rows
from whsklearn.compare.estimate import estimate
from whsklearn.compare.hypotheses import between, changes_between

FACTOR = 1.4


def changes(a, b, alpha=0.01):
    parts = [estimate(a), estimate(b)]
    d = between([a, b], parts[:1], parts[1:])
    return changes_between(d, a.units, alpha), d


@pytest.mark.parametrize("i", range(4), ids=NAMES[:4])
def test_the_number_that_moved_is_named_with_its_size(i):
    other = TRUTH.copy()
    other[i] *= 3.0 if i == 3 else FACTOR
    found, _ = changes(rows(seed=1), rows(other, seed=2))
    assert [c.name for c in found] == [NAMES[i]]
    assert found[0].rivals == []
    low, high = found[0].interval
    assert low < other[i] - TRUTH[i] < high
    assert found[0].p_value < 1e-3


def test_all_numbers_alike_are_the_gain_of_the_drive():
    found, _ = changes(rows(seed=1), rows(TRUTH / FACTOR, seed=2))
    assert [c.name for c in found] == ["gain"]
    assert abs(found[0].after - FACTOR) < 2.5 * found[0].standard_error + 0.02


def test_two_numbers_that_moved_are_both_named():
    other = TRUTH * np.array([1.4, 1.0, 0.6, 1.0, 1.0])
    found, _ = changes(rows(seed=1), rows(other, seed=2))
    assert {c.name for c in found} == {"inertia", "coulomb"}


def test_equal_records_are_named_nothing():
    named = [changes(rows(seed=s, walk=w), rows(seed=100 + s, walk=w))[0] for s in range(20) for w in (0.0, 0.1)]
    assert sum(map(bool, named)) == 0


def test_what_both_records_of_one_path_hold_cancels():
    a, b = rows(seed=1), rows(seed=1, label="b")
    wrong = 0.1 * np.sin(3.0 * a.path) * np.abs(a.path)  # no column says that
    a = replace(a, target=a.target + wrong)
    b = replace(b, target=b.columns @ (TRUTH * [1, 1, 1.3, 1, 1]) + wrong)
    same, _ = changes(a, b)
    other = rows(seed=2)
    wrong = 0.1 * np.sin(3.0 * other.path) * np.abs(other.path)
    apart = changes(a, replace(other, target=other.target + wrong))[1]
    assert [c.name for c in same] == ["coulomb"]
    assert same[0].standard_error < 0.5 * np.sqrt(np.linalg.inv(apart.weight)[2, 2])
