"""A repaired model is tested on a record that it never saw."""

from __future__ import annotations

import numpy as np
import pytest

from whsklearn.datasets import make_servo_log
from whsklearn.effects import Cogging
from whsklearn.gap import GapFinder
from whsklearn.gap.second_record import on_second_record

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
