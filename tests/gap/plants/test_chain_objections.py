"""What speaks against an effect of a chain."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from tests.gap.plants.example_chain import PLAIN, SCALES, THETA, TRUE, U, setting, term
from whsklearn.effects import DeadZone, QuadraticDrag
from whsklearn.gap.plants import chain_evidence as rules
from whsklearn.gap.plants import chain_objections as objections
from whsklearn.gap.plants.chain_model import ChainModel


@pytest.mark.parametrize(
    ("bad", "said"),
    [
        (term("dead_zone", -0.1), "size would be -0.1"),
        (term("dead_zone", 0.95 * SCALES.u_peak), "width runs to the end"),
        (term("cogging", 0.1, 0.1, 20.0 / SCALES.x), "order runs to the end"),
    ],
)
def test_numbers_at_the_end_of_their_range_are_unphysical(bad, said):
    assert said in objections.unphysical(bad, SCALES)


@pytest.mark.parametrize(
    "good", [term("dead_zone", 0.3), term("cable_spring", -0.1, 0.0), term("sensor_rectification", 1.0)]
)
def test_sound_numbers_are_not(good):
    assert objections.unphysical(good, SCALES) == ""


def test_reversals_that_only_one_model_has_are_where_x_moves_the_other_way():
    other = ChainModel(THETA * np.array([0.8, 1, 1, 1, 1, 1, 1, 1, 1]))
    events = objections.turned(PLAIN, TRUE, other)
    assert 0 < events.size < 0.3 * U.size
    assert objections.turned(PLAIN, TRUE, TRUE).size == 0
    beside = objections.beside_turned(PLAIN, TRUE, other)
    assert beside[events + 1].all()
    assert not objections.beside_turned(PLAIN, TRUE, TRUE).any()


def test_a_sign_is_remembered_for_a_few_samples():
    behind = objections.behind(30, np.array([3, 20]))
    assert behind[:4].tolist() == [-1] * 4  # L2 answers a sample late
    assert behind[4 : 4 + rules.SIGN_REMEMBERED].tolist() == [0] * rules.SIGN_REMEMBERED
    assert behind[4 + rules.SIGN_REMEMBERED] == -1
    assert behind[21] == 1


def test_what_sits_in_five_samples_is_seen():
    s = setting(QuadraticDrag(0.1))
    whole = objections.few_samples(s, TRUE, TRUE.plus(term("quadratic_drag", 0.1)))
    assert whole < 0.2
    spoilt = PLAIN.y.copy()
    spoilt[np.flatnonzero(PLAIN.fit)[10:13]] += 0.3

    few = objections.few_samples(dataclasses.replace(PLAIN, y=spoilt), ChainModel(0.999 * THETA), TRUE)
    assert few > whole


def test_the_free_run_tells_a_better_model_from_a_worse():
    s = setting(DeadZone(0.3))
    with_it = TRUE.plus(term("dead_zone", 0.3))
    assert objections.worsened(s, TRUE, with_it) < 0.5
    assert objections.worsened(PLAIN, TRUE, with_it) > rules.RUNS_WORSE


def test_a_wave_of_order_one_is_gravity_and_no_drag():
    gravity = TRUE.plus(term("gravity_imbalance", 0.1, 0.05))
    cogging = TRUE.plus(term("cogging", 0.1, 0.05, 1.0))
    drag = TRUE.plus(term("quadratic_drag", 0.1))
    assert objections.same_signature(PLAIN, gravity, cogging, SCALES)
    assert not objections.same_signature(PLAIN, gravity, drag, SCALES)
