"""The data check: a clipped reading is told from an axis that turns around or comes to rest at its extreme."""

from __future__ import annotations

import numpy as np
import pytest

from whsklearn.gap.data_check import check_servo, cut_at_speed
from whsklearn.gap.record import ServoRecord

RATE = 200.0
T = np.arange(2400) / RATE
STEP = 2 * np.pi / 4096


def codes(position):
    drive = np.sin(T) + 0.1 * np.sin(7 * T)
    return [p.code for p in check_servo(ServoRecord(T, drive, position))]


def counted(x):
    return np.round(x / STEP) * STEP


def test_a_slow_axis_that_turns_on_one_count_is_not_clipped():
    slow = counted(0.2 * np.sin(2 * np.pi * 0.1 * T))
    assert "data-rest-at-extreme" in codes(slow)
    assert "data-clipped-position" not in codes(slow)


def test_an_axis_that_is_held_at_its_extreme_is_not_clipped():
    phase = T % 4.0
    up = np.clip(phase, 0.0, 1.0)
    held = counted(up * up * (3 - 2 * up) - np.where(phase > 3.0, (phase - 3.0) ** 2 * (9 - 2 * phase), 0.0))
    assert "data-clipped-position" not in codes(held)


@pytest.mark.parametrize("limit", [0.3, 0.6])
def test_a_sine_cut_off_at_speed_is_clipped(limit):
    assert "data-clipped-position" in codes(counted(np.clip(np.sin(2 * np.pi * 0.5 * T), -limit, limit)))


@pytest.mark.parametrize("factor", [1e-3, 1.0, 1e3])
def test_the_unit_of_the_position_does_not_matter(factor):
    whole = counted(np.sin(2 * np.pi * 0.5 * T))
    assert cut_at_speed(factor * np.clip(whole, -0.5, 0.5), 1 / RATE)
    assert not cut_at_speed(factor * whole, 1 / RATE)


@pytest.mark.parametrize(("rate", "slow"), [(20.0, False), (19.9, False), (19.5, True)])
def test_twenty_samples_a_second_are_enough_whatever_the_last_digit_of_the_stamps(rate, slow):
    t = 84211.3 + np.arange(2000) / rate
    found = check_servo(ServoRecord(t, np.sin(t) + 0.1 * np.sin(7 * t), np.sin(t)))
    assert ("data-time-unit" in [p.code for p in found]) == slow


def test_a_slow_log_is_told_to_log_faster_and_not_asked_for_a_unit():
    """Whether the unit of the time was read or assumed is known to the reader alone: `whsklearn.logs.slips` asks."""
    t = np.arange(400) / 10.0
    (found,) = check_servo(ServoRecord(t, np.sin(t) + 0.1 * np.sin(7 * t), np.sin(t)))
    assert found.explanation.endswith("at least 20 a second. Log faster.")
