"""Sentences of a diagnosis."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from whsklearn.gap.localisation import NOWHERE
from whsklearn.gap.sentences import article_list, summary

PLANT = SimpleNamespace(gap_word="missing torque", whole="drive", subject="")


def effect(name, aliases=()):
    return SimpleNamespace(
        name=name,
        label=name,
        aliases=list(aliases),
        told=[("size", 0.5, None, "Nm"), ("phase", 1.0, None, "rad")],
        orders=[],
    )


def diagnosis(verdict="named", effects=(), figures=(0.1, 0.02, 0.01), closure=0.9, **more):
    return SimpleNamespace(
        verdict=verdict, effects=list(effects), figures=figures, closure=closure, learned=None, shortfall="",
        where_sentence="", interrupted=False, **more,
    )  # fmt: skip


def test_names_are_joined_as_in_prose():
    assert article_list(["cogging"]) == "cogging"
    assert article_list(["cable_spring", "stribeck"]) == "cable spring and stribeck"
    assert article_list(["a", "b", "c"]) == "a, b and c"


def test_a_name_comes_with_size_and_with_what_cannot_be_told_from_it():
    text = summary(diagnosis(effects=[effect("input_offset", ["asymmetric_coulomb"])]), PLANT)
    assert "input offset (size 0.5 Nm)" in text
    assert "does not distinguish it from asymmetric coulomb" in text
    assert "10.00 %" in text
    assert "90 %" in text


def test_an_open_name_does_not_put_a_certain_one_in_doubt():
    text = summary(diagnosis("ambiguous", [effect("cogging"), effect("input_offset", ["cable_spring"])]), PLANT)
    assert "Consistent with cogging (size 0.5 Nm). More is missing" in text
    assert "cannot tell which: input offset or cable spring. " in text
    text = summary(diagnosis("ambiguous", [effect("input_offset", ["cable_spring"]), effect("cogging")]), PLANT)
    open_one = "Something is missing, and this record cannot tell which: input offset or cable spring. "
    assert open_one + "Beside it, it is consistent with cogging (size 0.5 Nm). " in text
    text = summary(diagnosis("ambiguous", [effect("input_offset", ["cable_spring"])]), PLANT)
    assert "Something is missing" in text
    assert "Consistent" not in text


@pytest.mark.parametrize(
    ("after", "said"), [(0.02, "falls to 2.00 %"), (0.09999, "stays at 10.00 %"), (0.11, "rises to 11.00 %")]
)
def test_what_a_name_takes_of_the_gap_is_said_as_it_is(after, said):
    text = summary(diagnosis("partial", [effect("backlash")], figures=(0.1, after, 0.01), closure=0.1), PLANT)
    assert f"The missing torque {said}, and 10 % of the gap in simulation is closed." in text


@pytest.mark.parametrize(
    ("after", "closure", "said"), [(0.02, 0.9, "most"), (0.09, 0.9, "only a part"), (0.02, 0.3, "only a part")]
)
def test_most_of_the_gap_is_most_of_the_drive_and_of_the_run(after, closure, said):
    text = summary(diagnosis("partial", [effect("backlash")], figures=(0.1, after, 0.01), closure=closure), PLANT)
    assert f"which explains {said} of it" in text


def test_a_part_is_told_with_what_the_record_cannot_tell_from_it():
    found = [effect("gravity_imbalance", aliases=["cable_spring", "input_offset"]), effect("stribeck")]
    text = summary(diagnosis("partial", found, figures=(0.1, 0.05, 0.01), closure=0.4), PLANT)
    assert "resembles gravity imbalance (or cable spring or input offset) and stribeck, which" in text


def test_a_repair_that_runs_no_closer_is_not_said_to_close_anything():
    text = summary(diagnosis("partial", [effect("cogging")], figures=(0.1, 0.05, 0.01), closure=-1.8), PLANT)
    assert "falls to 5.00 %, and the simulation comes no closer to the record." in text


def test_silence_speaks_of_what_is_larger_than_the_tolerance():
    text = summary(diagnosis("no_gap", figures=(0.0110, 0.0110, 0.0104)), PLANT)
    assert "within noise and the tolerance: nothing larger is missing" in text


def test_a_coarse_reading_is_not_said_to_close_a_gap():
    text = summary(diagnosis(effects=[effect("quantization")], figures=(0.02, 0.02, 0.019), closure=0.0), PLANT)
    assert "quantization" in text
    assert "nothing else is missing" in text
    assert "closed" not in text


@pytest.mark.parametrize("verdict", ["named", "ambiguous", "partial"])
def test_every_verdict_with_effects_says_what_is_left(verdict):
    assert "falls to 2.00 %" in summary(diagnosis(verdict, [effect("cogging", ["torque_ripple"])]), PLANT)


def test_what_was_not_shown_is_not_said_to_be_absent():
    text = summary(diagnosis("unknown", figures=(0.3, 0.3, 0.01)), PLANT)
    assert "could be shown" in text
    assert "none of the effects" not in text


def test_a_gap_the_size_of_noise_that_lies_nowhere_does_not_contradict_itself():
    d = diagnosis("unknown", figures=(0.19771, 0.19771, 0.19769))
    d.where_sentence = NOWHERE
    text = summary(d, PLANT)
    assert "no larger than noise, but it is not noise" in text
    assert "follows none of the signals" not in text


def test_more_missing_than_there_is_gets_a_word_on_why():
    assert "worse than none" in summary(diagnosis("unknown", figures=(1.4, 1.4, 0.01)), PLANT)
    assert "worse than none" not in summary(diagnosis("unknown", figures=(0.9, 0.9, 0.01)), PLANT)
