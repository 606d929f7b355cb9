"""How a verdict follows from closure, rivals and what is left."""

from __future__ import annotations

import itertools

import pytest

from whsklearn.gap import evidence as rules
from whsklearn.gap.verdict import VERDICTS, verdict_of

ONE = {"names": ["cogging"], "closure": 0.99, "rivals": [[]], "quiet": False, "follows": 0.5}
NONE = {"names": [], "closure": 0.0, "rivals": [], "quiet": False, "follows": 0.0}


@pytest.mark.parametrize(
    ("case", "expected"),
    [
        (NONE | {"quiet": True, "follows": 0.9}, "no_gap"),
        (NONE | {"follows": 0.9}, "unknown"),
        (NONE, "coloured_noise"),
        (ONE, "named"),
        (ONE | {"rivals": [["torque_ripple"]]}, "ambiguous"),
        (ONE | {"closure": 0.0}, "unknown"),
        (ONE | {"names": ["cogging", "stribeck"], "rivals": [[], []], "left": 1e9}, "partial"),
        (ONE | {"still": 0.9}, "partial"),
    ],
)
def test_each_case(case, expected):
    assert verdict_of(**case) == expected


def test_more_closure_never_makes_a_verdict_weaker():
    rank = {"unknown": 0, "partial": 1, "named": 2}
    grid = [i / 100 for i in range(101)]
    for low, high in itertools.pairwise(grid):
        found = [verdict_of(["a"], c, [[]], quiet=False, follows=1.0) for c in (low, high)]
        assert rank[found[0]] <= rank[found[1]]
    assert rules.PARTIAL < rules.NAMED


def test_all_words_are_known():
    assert len(set(VERDICTS)) == len(VERDICTS) == 8


def test_what_still_follows_the_motion_keeps_a_name_from_being_confident():
    from whsklearn.gap.verdict import verdict_of

    assert verdict_of(["stribeck"], 0.97, [[]], quiet=False, follows=0.7, left=1.1, still=0.0) == "named"
    assert verdict_of(["stribeck"], 0.97, [[]], quiet=False, follows=0.7, left=1.1, still=0.08) == "partial"
