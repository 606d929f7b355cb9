"""What changed between two estimates is named at the stated level."""

from __future__ import annotations

import numpy as np
import pytest

from whsklearn.change import compare_parameters


def test_what_changed_is_named_at_the_stated_level():
    rng = np.random.default_rng(3)
    names, theta, se = list("abcdefghi"), np.linspace(-1, 1, 9), 0.01
    false = 0
    for _ in range(1000):
        before, after = theta + se * rng.normal(size=(2, 9))
        false += any(c.significant for c in compare_parameters(names, before, [se**2] * 9, after, [se**2] * 9, 0.05))
    assert false / 1000 == pytest.approx(0.05, abs=0.021)


def test_the_surest_change_comes_first_and_reads_as_a_sentence():
    changes = compare_parameters(
        ["coulomb", "viscous", "d1"],
        [0.7, 0.05, 0.1],
        np.diag([1e-4, 1e-8, 1e-6]),
        [0.84, 0.06, -0.1],
        [1e-4, 1e-8, 1e-6],
    )
    assert [c.name for c in changes] == ["d1", "viscous", "coulomb"]
    assert [str(c).split(" (")[0] for c in changes] == ["d1 changed sign", "viscous rose 20 %", "coulomb rose 20 %"]


def test_exact_estimates_and_wrong_sizes():
    same, moved = compare_parameters(["a", "b"], [1, 0], [0, 0], [1, 2], [0, 0])[::-1]
    assert (same.significant, moved.significant) == (False, True)
    assert moved.percent == np.inf
    with pytest.raises(ValueError, match="2 names"):
        compare_parameters(["a", "b"], [1], [1], [1], [1])
    with pytest.raises(ValueError, match="variances >= 0"):
        compare_parameters(["a"], [1], [-1], [1], [0])
