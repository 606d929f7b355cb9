"""The torque balance along the measured motion: starts of a fit, and what is no axis."""

from __future__ import annotations

import numpy as np
import pytest

from tests.recursion.axis_log import TRUTH, axis_log, slow_drive
from whsklearn.identification.axis_inverse import balance, inverse_starts, next_wave, solved
from whsklearn.identification.view import view
from whsklearn.recursion.batch.axis_free_run import HANGS, AxisForm, axis_motion

U = slow_drive(3000, 1)
LOG = axis_log(U)
RIGID = AxisForm()


@pytest.fixture(scope="module")
def velocity():
    return axis_motion(TRUTH, LOG)


def test_starts_are_near_the_truth(velocity):
    for start in inverse_starts(view(U, velocity, 0.005, "velocity"), RIGID)[:2]:
        assert start.theta[:4] == pytest.approx(TRUTH[:4], rel=0.2, abs=0.02)
        assert start.holds(start.theta)
        assert not start.holds(np.r_[20.0 * start.theta[0], start.theta[1:]])


def test_a_fit_that_has_lost_its_inertia_is_no_axis():
    """Under a slow drive the torque balance hardly misses it, and the fine steps of such a model are without end."""
    slow = 4.0 * np.sin(0.0004 * np.arange(3000))
    velocity = axis_motion(TRUTH, axis_log(slow))
    for start in inverse_starts(view(slow, velocity, 0.005, "velocity"), RIGID):
        assert not start.holds(np.r_[1e-9 * start.theta[0], start.theta[1:]])


def test_a_drive_that_works_the_other_way_is_no_axis(velocity):
    with pytest.raises(ValueError, match=r"not a rigid axis; with the sign of the drive inverted .*--invert-drive"):
        inverse_starts(view(-U, velocity, 0.005, "velocity"), RIGID)


def test_a_drive_that_explains_no_motion_either_way_is_not_called_inverted(velocity):
    other = np.random.default_rng(0).permutation(U)
    with pytest.raises(ValueError, match="not a rigid axis") as found:
        inverse_starts(view(other, velocity - velocity.mean(), 0.005, "velocity"), RIGID)
    assert "inverted" not in str(found.value)


def test_the_direction_is_judged_with_gravity_in():
    """A pendulum moved so slowly that its drive holds it: without gravity the inertia would be below zero."""
    t = np.arange(4000) * 0.005
    q = 0.8 * np.sin(1.5 * t) + 0.3 * np.sin(0.7 * t)
    v, a = np.gradient(q, t), np.gradient(np.gradient(q, t), t)
    record = view(0.05 * a + 0.02 * v + 0.05 * np.sign(v) + 2.0 * np.sin(q), q, 0.005, "position")
    with pytest.raises(ValueError, match="see the axis with gravity"):
        inverse_starts(record, RIGID)
    start = inverse_starts(record, AxisForm(orders=HANGS))[0].theta
    assert start[[0, 4]] == pytest.approx([0.05, 2.0], rel=0.05)


@pytest.mark.parametrize("width", [1.5, 10.0])
def test_segments_do_not_reach_into_each_other(width):
    position = axis_motion(TRUTH, LOG._replace(of_position=True))
    y, u = np.r_[position[:1400], position[1600:] + 5.0], np.r_[U[:1400], U[1600:]]
    cut = view(u, y, 0.005, "position", np.r_[np.zeros(1400), np.ones(1400)])
    theta = solved(*balance(cut, width, RIGID))
    assert theta[:4] == pytest.approx(TRUTH[:4], rel=0.3, abs=0.03)


@pytest.mark.parametrize("order", [9.0, 40.3])
def test_a_wave_over_the_position_is_found_by_its_order_and_size(order):
    """Behind the Gaussian the higher one is left only where the axis moves slowly."""
    t = np.arange(6000) * 0.002
    q = 0.8 * np.sin(1.5 * t) + 0.3 * np.sin(3.7 * t)
    v, a = np.gradient(q, t), np.gradient(np.gradient(q, t), t)
    plain = 0.05 * a + 0.1 * v + 0.05 * np.sign(v) + 1e-3 * np.random.default_rng(0).standard_normal(t.size)
    drive = plain + 0.03 * np.cos(order * q + 0.4)
    found, share, size = next_wave(view(drive, q, 0.002, "position"), RIGID)
    assert found == pytest.approx(order, abs=0.02)
    assert share > 0.8
    assert 0.1 < size * np.std(drive) / (0.03 / np.sqrt(2.0)) < 1.1  # the Gaussian takes some
    *_, nothing = next_wave(view(plain, q, 0.002, "position"), RIGID)
    assert nothing < 0.1 * size
    spring, *_ = next_wave(view(plain + 0.5 * q, q, 0.002, "position"), RIGID)
    assert spring * np.ptp(q) > 3.99 * np.pi  # fewer than two periods are no wave
