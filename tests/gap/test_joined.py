"""Several records are one diagnosis: offsets and timing differ and are no gap, what all lack is named."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from whsklearn.datasets import make_servo_log
from whsklearn.effects import Cogging, GravityImbalance
from whsklearn.gap import GapFinder, ServoRecord
from whsklearn.gap.joined import joined
from whsklearn.identification.drive_lead import earlier


def record(*effects, seed=0, offset=0.0, late=0, rate=1000.0):
    log = make_servo_log(effects, duration=12.0, sample_rate=rate, random_state=seed)
    made = ServoRecord.from_frame(log)
    return replace(made, drive=earlier(made.drive, -late) + offset, reference=None)


def test_offsets_and_ages_are_brought_to_their_mean():
    both = joined([record(seed=1), record(seed=1, offset=0.2, late=4)])
    first, second = both.drive[: both.starts[0]], both.drive[both.starts[0] :]
    assert abs(np.mean(second - first)) < 0.02
    inside = slice(20, -20)
    assert np.std((second - first)[inside]) < 0.02 * np.std(first)


def test_segments_are_kept_and_time_goes_on():
    a = record(seed=1)
    holed = replace(a, time=a.time + (a.time > 6.0), starts=(6001,))
    both = joined([a, holed])
    assert both.starts == (12000, 18001)
    assert np.all(np.diff(both.time) > 0.0)
    assert joined([a]) is a


def test_another_offset_in_each_record_is_no_gap():
    finder = GapFinder("servo").fit([record(seed=1, offset=-0.1, rate=250.0), record(seed=2, offset=0.1, rate=250.0)])
    assert finder.verdict_ == "no_gap"


def test_what_both_lack_is_named_with_one_size():
    logs = [record(Cogging(0.1, 12.0), seed=seed, late=late, rate=250.0) for seed, late in ((1, 0), (2, 1))]
    finder = GapFinder("servo").fit(logs)
    assert [e.name for e in finder.effects_] == ["cogging"]
    assert finder.effects_[0].parameters["amplitude_nm"] == pytest.approx(0.1, rel=0.05)


@pytest.mark.slow
def test_gravity_does_not_pass_for_an_offset_or_a_skew():
    """Each log sees its own part of the turn, so its offset is known only beside the gravity that they share."""
    hidden = GravityImbalance(0.2, 0.3)
    finder = GapFinder("servo").fit([record(hidden, seed=1, offset=0.1), record(hidden, seed=2, offset=-0.2, late=24)])
    gravity, offset = finder.effects_
    assert finder.verdict_ == "named"
    assert (gravity.name, offset.name) == ("gravity_imbalance", "input_offset")
    assert gravity.parameters["amplitude_nm"] == pytest.approx(0.2, rel=0.02)
    assert offset.parameters["torque_nm"] == pytest.approx(-0.05, rel=0.05)


def test_rates_and_kinds_must_agree():
    a = record(seed=1)
    with pytest.raises(ValueError, match="samples a second"):
        joined([a, replace(a, time=2.0 * a.time)])
    with pytest.raises(ValueError, match="units"):
        joined([a, replace(a, units=("A", "rad"))])


def test_a_record_at_rest_is_told_by_its_number():
    a = record(seed=1)
    with pytest.raises(ValueError, match="Record 2: The axis does not move"):
        joined([a, replace(a, position=np.zeros(len(a)))])
