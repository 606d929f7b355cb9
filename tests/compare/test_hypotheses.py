"""What a hypothesis explains, what it costs, and the smallest change that is named."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from whsklearn.compare.estimate import Estimate, Summand
from whsklearn.compare.hypotheses import Difference, alone, changed, hypotheses, smallest, weigh

NAMES = ("inertia", "viscous", "gravity", "gravity", "delay")


def difference(values, error=0.01, degrees=18.0):
    mean = np.array([1.0, 0.5, 0.6, 0.3, 0.0])
    values, half = np.array(values, dtype=float), (Summand(error**2 / 2 * np.eye(5), degrees / 2),)
    first, second = (Estimate("", mean + by * values, half, np.zeros(1), {}) for by in (-0.5, 0.5))
    return Difference(NAMES, {}, first, second, mean, np.full(5, error), np.ones(5))


def test_every_name_once_and_the_gain():
    assert [h.name for h in hypotheses(difference(np.zeros(5)))] == ["inertia", "viscous", "gravity", "delay", "gain"]


def test_a_pair_is_free_in_both_and_the_gain_leaves_the_delay():
    found = {h.name: h.basis for h in hypotheses(difference(np.zeros(5)))}
    assert found["gravity"].shape == (5, 2)
    np.testing.assert_allclose(found["gain"][:, 0], [1.0, 0.5, 0.6, 0.3, 0.0])


def test_what_is_explained_never_exceeds_the_whole():
    d = difference([0.3, 0.1, -0.2, 0.1, 0.05])
    whole = float(d.values @ d.values) / 0.01**2
    nothing = np.zeros((5, 0))
    assert all(0.0 <= weigh(d, h, nothing).chi2 <= whole * (1 + 1e-9) for h in hypotheses(d))


def test_the_smallest_change_is_the_smallest_that_is_named():
    least = smallest(difference(np.zeros(5)), 0.01)
    for i, name in ((0, "inertia"), (1, "viscous"), (4, "delay")):
        values = np.zeros(5)
        for factor, named in ((1.1, [name]), (0.9, [])):
            values[i] = factor * least[name]
            assert [f.hypothesis.name for f, _ in changed(difference(values), 0.01)] == named


def test_a_spring_takes_the_offset_that_it_covers_along():
    d = replace(difference([0.0, 0.4, 0.0, 0.0, -0.3]), names=("a", "spring", "b", "c", "offset"))
    d = replace(d, covers={"spring": ("offset",)})
    assert [f.hypothesis.name for f, _ in changed(d, 0.01)] == ["spring"]


def test_a_number_that_differs_only_if_all_others_are_held_equal_is_not_named():
    """Of two numbers known by their sum, a difference of the sum is seen, but not which of them moved."""
    d = difference([0.2, 0.0, 0.0, 0.0, 0.0])
    both = np.eye(5)
    both[0, 1] = both[1, 0] = -0.9999
    apart = (
        replace(d.first, parts=(Summand(0.2**2 * both, 9.0),)),
        replace(d.second, parts=(Summand(0.2**2 * both, 9.0),)),
    )
    d = replace(d, first=apart[0], second=apart[1])
    inertia = hypotheses(d)[0]
    assert weigh(d, inertia, np.zeros((5, 0))).p_value < 1e-6
    assert alone(d, inertia) > 0.1
    assert changed(d, 0.01) == []


def test_of_two_that_fit_alike_the_one_that_none_can_stand_in_for_is_named():
    """Gravity in two numbers, one of which is nearly an offset: the other says that gravity moved."""
    shared = np.diag([0.01, 0.3, 0.3, 0.01, 0.01]) ** 2 / 2
    shared[1, 2] = shared[2, 1] = -0.9997 * shared[1, 1]
    d = replace(difference(np.zeros(5)), names=("inertia", "offset", "gravity", "gravity", "delay"))
    first = replace(d.first, parts=(Summand(shared, 30.0),))
    second = replace(first, values=first.values + np.array([0.0, 0.0, 0.1, 0.033, 0.0]))
    d = replace(d, first=first, second=second, sizes=np.array([1.0, 1.0, 1.0, 0.05, 1.0]))
    offset, gravity = hypotheses(d)[1:3]
    nothing = np.zeros((5, 0))
    assert weigh(d, offset, nothing).evidence > weigh(d, gravity, nothing).evidence
    assert alone(d, offset) > 0.1
    ((found, rivals),) = changed(d, 0.01)
    assert found.hypothesis.name == "gravity"
    assert "offset" in [f.hypothesis.name for f in rivals]
