"""Whether the errors of a model still depend on anything that a chain knows of."""

from __future__ import annotations

import numpy as np
import pytest

from tests.gap.plants.example_chain import PLAIN, SCALES, TRUE, setting, term
from whsklearn.effects import Cogging, DeadZone
from whsklearn.gap.plants import chain_evidence as rules
from whsklearn.gap.plants.chain_remainder import remainder, whiteness


def test_under_the_truth_nothing_is_left():
    left = remainder(PLAIN, TRUE, SCALES)
    assert left.p_value > rules.LEFT_OVER
    assert left.share < 0.05


@pytest.mark.parametrize(
    ("hidden", "named"), [(Cogging(0.1, 0.7, 0.2), ("cogging", 0.1 * np.cos(0.2), -0.1 * np.sin(0.2), 0.7)),
                          (DeadZone(0.2), ("dead_zone", 0.2))]
)  # fmt: skip
def test_what_is_missing_is_seen_until_it_is_named(hidden, named):
    s = setting(hidden)
    before, after = remainder(s, TRUE, SCALES), remainder(s, TRUE.plus(term(*named)), SCALES)
    assert before.p_value < 1e-8
    assert before.share > 0.2
    assert after.p_value > rules.LEFT_OVER


def test_outliers_are_no_colour_and_colour_is():
    rng = np.random.default_rng(0)
    e = rng.normal(size=3000)
    assert whiteness(e).p_value > 1e-3
    spoilt = e.copy()
    for at in rng.integers(0, 2990, 20):
        spoilt[at : at + 5] += 30.0
    assert whiteness(spoilt).p_value > 1e-3
    assert whiteness(e[1:] + 0.3 * e[:-1]).p_value < 1e-6
