"""How much earlier or later than the position the drive was logged."""

from __future__ import annotations

import numpy as np
import pytest

from tests.recursion.axis_log import axis_log, slow_drive
from whsklearn.identification import identify
from whsklearn.identification.drive_lead import earlier, moved, skew
from whsklearn.identification.view import view
from whsklearn.recursion.batch.axis_free_run import free_run

THETA = np.array([0.05, 0.1, 0.2, 0.02, 1.5, 0.4])
U = 2.0 * slow_drive(4000, 1)
Y = free_run(THETA, axis_log(U, hangs=True)._replace(of_position=True))
NOISY = Y + 1e-5 * np.random.default_rng(0).standard_normal(Y.size)


@pytest.mark.parametrize("late", [-8, -4, 0, 4, 8])
def test_a_skew_of_up_to_40_ms_is_found_either_way(late):
    record = view(earlier(U, -late), NOISY, 0.005, "position")
    assert skew(record) == pytest.approx(late, abs=1)


def test_a_linear_system_of_more_poles_is_not_moved():
    from scipy.signal import lfilter

    u = np.random.default_rng(1).standard_normal(3000)
    y = lfilter([0.0, 0.0, 0.0, 0.01], np.poly([0.9, 0.8, 0.95, 0.7]), u)
    assert skew(view(u, y, 0.005, "velocity")) == 0


def test_moving_knows_its_segments():
    record = moved(view(np.arange(120.0), np.arange(120.0) ** 2, 0.01, "velocity", np.repeat([0, 1], 60)), 3)
    assert record.u[[0, 56, 57, 59, 60, 119]].tolist() == [3.0, 59.0, 59.0, 59.0, 63.0, 119.0]


def test_it_is_told_and_all_structures_see_the_moved_log():
    found = identify(earlier(U, -6)[:290], NOISY[:290], dt=0.005, logged="position")  # too short for a chain
    assert found.own[0].lead == pytest.approx(6, abs=1)
    assert found.recommended.kind == "axis"
    assert "30 ms after" in found.on_drive or "25 ms after" in found.on_drive
