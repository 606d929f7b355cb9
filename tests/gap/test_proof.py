"""Closure is a share of the gap, and never flatters."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from whsklearn.datasets import make_servo_log
from whsklearn.effects import Cogging
from whsklearn.gap import GapFinder
from whsklearn.gap.proof import closure, on_second_record

positive = st.floats(1e-6, 1e3)


@given(positive, positive, positive)
def test_it_lies_between_minus_one_and_one(before, after, floor):
    assert -1.0 <= closure(before, after, floor) <= 1.0


@given(positive, positive, positive)
def test_units_do_not_matter(before, after, floor):
    np.testing.assert_allclose(closure(before, after, floor), closure(8 * before, 8 * after, 8 * floor), atol=1e-9)


@given(positive, positive, positive, positive)
def test_a_smaller_error_never_closes_less(before, one, other, floor):
    small, large = sorted((one, other))
    assert closure(before, small, floor) >= closure(before, large, floor) - 1e-9


def test_the_ends():
    assert closure(2.0, 1.0, 1.0) == 1.0
    assert closure(2.0, 2.0, 1.0) == 0.0
    assert closure(1.0, 0.5, 1.0) == 0.0  # no gap, nothing to close


def test_a_model_that_diverges_is_no_yardstick():
    assert closure(1e6, 4.0, 0.0, spread=5.0) < 0.25
    assert closure(1e6, 7.0, 0.0, spread=5.0) == 0.0


@pytest.mark.parametrize(
    ("before", "after", "floor", "share"), [(2, 1, 1, 1.0), (2, 2, 1, 0.0), (2, 3, 1, -1.0), (1, 1, 1, 0.0)]
)
def test_closure(before, after, floor, share):
    assert closure(before, after, floor) == pytest.approx(share)


def test_beside_a_base_that_diverges_a_repair_counts_from_no_model_at_all():
    assert closure(1e6, 2.0, 1.0, spread=3.0) == pytest.approx(closure(3.0, 2.0, 1.0))
    assert closure(1e6, 5.0, 1.0, spread=3.0) == 0.0  # better than the base, and no better than none
    assert closure(1e6, 2e6, 1.0, spread=3.0) < 0.0
    assert closure(2.0, 1.5, 1.0, spread=3.0) == pytest.approx(0.5)


COLUMNS = {"time": "time_s", "drive": "torque_nm", "position": "position_rad"}


def test_the_free_run_on_another_record_closes_and_on_a_short_one_is_refused():
    first, second = (make_servo_log([Cogging(0.3, 12.0)], duration=12.0, random_state=s) for s in (0, 1))
    finder = GapFinder("servo").fit(first, **COLUMNS)
    assert finder.verdict_ == "named"
    for row in on_second_record(finder, second, **COLUMNS):
        assert row["after"] < 0.05 * row["before"]
    degrees = second.assign(angle_deg=np.rad2deg(second["position_rad"]), torque_mnm=1e3 * second["torque_nm"])
    odd = on_second_record(finder, degrees, time="time_s", drive="torque_mnm", position="angle_deg")
    assert [r["after"] for r in odd] == pytest.approx([r["after"] for r in on_second_record(finder, second, **COLUMNS)])
    with pytest.raises(ValueError, match="samples of the record that was fitted"):
        on_second_record(finder, first.iloc[1000:].reset_index(), **COLUMNS)
    with pytest.raises(ValueError, match="in A and its position in rad, the first in Nm and rad"):
        on_second_record(finder, second.rename(columns={"torque_nm": "u_a"}), **COLUMNS | {"drive": "u_a"})
    with pytest.raises(ValueError, match="second record cannot be used"):
        on_second_record(finder, second.iloc[:50], **COLUMNS)


def test_without_a_model_there_is_nothing_to_test():
    short = make_servo_log([], duration=12.0, random_state=0).iloc[:50]
    finder = GapFinder("servo").fit(short, **COLUMNS)
    with pytest.raises(ValueError, match="no model to test"):
        on_second_record(finder, short, **COLUMNS)
