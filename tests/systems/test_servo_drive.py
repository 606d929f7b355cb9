"""What becomes of the drive before it is a torque: delay, lag, dead zone, limit, offset."""

from __future__ import annotations

import numpy as np

from tests.systems.signals import DRIVE
from whsklearn.effects import (
    ActuatorLag,
    DeadZone,
    InputDelay,
    InputOffset,
    Saturation,
    Viscous,
)
from whsklearn.systems import Drive, ServoAxis


def test_a_delay_of_whole_samples_shifts_the_torque():
    torque = ServoAxis(effects=[InputDelay(0.007)]).simulate_drive(DRIVE).torque
    np.testing.assert_allclose(torque[7:], DRIVE[:-7], atol=1e-12)
    np.testing.assert_array_equal(torque[:7], DRIVE[0])


def test_a_delay_acts_the_same_from_the_axis_and_from_the_effect():
    one = ServoAxis(drive=Drive(delay=0.0033)).simulate_drive(DRIVE)
    two = ServoAxis(effects=[InputDelay(0.0033)]).simulate_drive(DRIVE)
    np.testing.assert_array_equal(one.position, two.position)


def test_the_motion_depends_smoothly_on_the_delay():
    base = ServoAxis(law=[Viscous(0.3)])
    runs = [base.with_effect(InputDelay(d)).simulate_drive(DRIVE).position for d in (0.00201, 0.00202, 0.00203)]
    np.testing.assert_allclose(runs[2] - runs[1], runs[1] - runs[0], rtol=1e-3, atol=1e-9)


def test_a_lag_answers_a_step_exponentially():
    step = np.r_[np.zeros(10), np.ones(100)]
    torque = ServoAxis(effects=[ActuatorLag(0.01)]).simulate_drive(step).torque
    lagged = 1.0 - np.exp(-(np.arange(100) + 0.5 / 20) * 1e-3 / 0.01)  # mean over the first fine step
    np.testing.assert_allclose(torque[10:], lagged, atol=1e-5)


def test_dead_zone_and_saturation_shape_the_torque():
    u = np.linspace(-2.0, 2.0, 401)
    axis = ServoAxis(effects=[DeadZone(0.2), Saturation(1.5)])
    np.testing.assert_allclose(axis.simulate_drive(u).torque, np.clip(u - np.clip(u, -0.2, 0.2), -1.5, 1.5))


def test_an_offset_must_be_paid_for_by_the_drive():
    axis = ServoAxis(law=[Viscous(0.1)])
    with_offset = axis.with_effect(InputOffset(0.2)).simulate_drive(DRIVE + 0.2).position
    np.testing.assert_allclose(with_offset, axis.simulate_drive(DRIVE).position, atol=1e-12)


def test_a_disturbance_adds_to_the_torque():
    axis = ServoAxis()
    one = axis.simulate_drive(DRIVE, disturbance=0.1 * np.ones(1000)).position
    np.testing.assert_allclose(one, axis.simulate_drive(DRIVE + 0.1).position, atol=1e-12)
