"""How much earlier or later than the position the drive was logged."""

from __future__ import annotations

import numpy as np
import pytest

from tests.recursion.axis_log import axis_log, slow_drive
from whsklearn.datasets import make_servo_log
from whsklearn.effects import GravityImbalance, as_law
from whsklearn.identification import identify
from whsklearn.identification.drive_lead import earlier, moved, skew
from whsklearn.identification.view import view
from whsklearn.recursion.batch.axis_free_run import HANGS, axis_motion
from whsklearn.systems import PIDController, ServoAxis

THETA = np.array([0.05, 0.1, 0.2, 0.02, 1.5, 0.4])
U = 2.0 * slow_drive(2000, 1)
Y = axis_motion(THETA, axis_log(U, orders=HANGS)._replace(of_position=True))
NOISY = Y + 1e-5 * np.random.default_rng(0).standard_normal(Y.size)


@pytest.mark.parametrize("late", [-8, -4, 0, 4, 8])
def test_a_skew_of_up_to_40_ms_is_found_either_way(late):
    record = view(earlier(U, -late), NOISY, 0.005, "position")
    assert skew(record) == pytest.approx(late, abs=1)


@pytest.mark.parametrize(
    ("effects", "size", "turn", "late"),
    [("gravity_imbalance", 0.3, 65_536, 0), ("stribeck", 0.05, 4_096, 0), ((), 0.05, 4_096, -8), ((), 0.05, 65_536, 8)],
)
def test_a_skew_is_found_in_plain_counts(effects, size, turn, late):
    """The sine of a count is noise; taken for a weight, it moved the first two drives by 6 and -2 ms."""
    log = make_servo_log(effects, sizes=size, duration=8.0, sample_rate=500.0, random_state=3)
    u, counts = earlier(log.torque_nm.to_numpy(), -late), np.round(log.position_rad.to_numpy() * turn / (2.0 * np.pi))
    record = view(u, counts, 0.002, "position", si=((1.0, "Nm"), (1.0, "counts")))
    assert skew(record) == pytest.approx(late, abs=1)
    assert not record.angle
    assert not view(u, counts, 0.002, "position").angle  # whole numbers, whatever is stated


def test_a_skew_is_found_in_counts_over_more_than_a_turn_of_gravity():
    """Nobody says how many counts a turn has, and a cubic does not follow a weight over one and a half."""
    axis = ServoAxis(0.03, as_law("viscous,coulomb").reweighted([0.1, 0.1]), [GravityImbalance(1.0, 0.3)],
                     controller=PIDController(15.0, 0.0, 0.8), sample_rate=500.0, substeps=8)  # fmt: skip
    t = np.arange(5000) / 500.0
    run = axis.simulate(2.5 * np.sin(1.3 * t) + 2.5 * np.sin(3.1 * t))
    assert np.ptp(run.position) > 2.5 * np.pi
    counts = np.round(run.position * 4096 / (2 * np.pi))
    record = view(earlier(run.drive, -4), counts, 0.002, "auto", si=((1.0, "Nm"), (1.0, "counts")))
    assert record.logged == "position"
    assert skew(record) == 4


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


def test_friction_does_not_bias_the_skew():
    """Inverse dynamics alone misses these three samples: it reads friction from the signs of a smoothed velocity."""
    axis = ServoAxis(0.02, as_law("viscous,coulomb").reweighted([0.05, 0.1]), controller=PIDController(8.0, 0.0, 0.5),
                     sample_rate=250.0, substeps=16)  # fmt: skip
    t = np.arange(3000) / 250.0
    record = axis.simulate(np.sin(1.3 * t) + 0.4 * np.sin(5.1 * t))
    noise = 3e-4 * np.random.default_rng(0).standard_normal(t.size)
    for late in (0, 3):
        assert skew(view(earlier(record.drive, -late), record.position + noise, 0.004, "position")) == late
