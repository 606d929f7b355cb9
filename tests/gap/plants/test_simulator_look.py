"""What a simulator may lack, seen by its error differentiated twice."""

from __future__ import annotations

import numpy as np
import pytest

from tests.gap.plants.example_simulator import RECORD, TIME
from whsklearn.effects import ContactStop, DisturbanceTone, EndStop, LuGre
from whsklearn.gap import ServoRecord
from whsklearn.gap.plants.simulator_look import catalogue, gains, motion, sized_by_drive


def test_of_two_effects_the_one_that_is_missing_gains_more():
    """The error of a mass on which a torque acts is that torque integrated twice."""
    path = 0.5 * np.sin(2.0 * TIME) + 0.2 * np.sin(5.3 * TIME)
    torque = np.maximum(path - 0.3, 0.0)
    error = np.cumsum(np.cumsum(torque - torque.mean())) * (TIME[1] - TIME[0]) ** 2
    m, train = motion(ServoRecord(TIME, np.cos(TIME), path)), np.ones(TIME.size, dtype=bool)
    stop, tone = gains(m, error, [EndStop(1.0, 0.3), DisturbanceTone(1.0, 1.7, 0.0)], train)
    assert 0.0 <= tone < 0.1 * stop <= 0.1


def test_the_smoothed_motion_of_a_wave_is_the_wave_and_its_derivatives():
    m = motion(ServoRecord(TIME, np.cos(TIME), np.sin(2.0 * TIME)))
    inside = slice(500, -500)
    s = m.signals
    np.testing.assert_allclose(s.position[inside], np.sin(2.0 * TIME)[inside], atol=1e-3)
    np.testing.assert_allclose(s.velocity[inside], 2.0 * np.cos(2.0 * TIME)[inside], atol=2e-3)
    np.testing.assert_allclose(s.acceleration[inside], -4.0 * np.sin(2.0 * TIME)[inside], atol=4e-3)


def test_further_shapes_are_looked_at_where_a_simulator_asks_for_them():
    plain = catalogue(RECORD, motion(RECORD).signals)
    asked = catalogue(RECORD, motion(RECORD).signals, (LuGre, ContactStop))
    assert {type(e) for e in plain["end_stop"]}.isdisjoint({ContactStop})
    stops = [e for e in asked["end_stop"] if isinstance(e, ContactStop)]
    assert {e.side for e in stops} == {"upper", "lower", "both"}
    low, high = RECORD.position.min(), RECORD.position.max()
    assert all(low < end < high for e in stops for end in e.ends if np.isfinite(end))
    assert sum(isinstance(e, LuGre) for e in asked["presliding_hysteresis"]) == 24


def test_a_stop_is_as_stiff_as_the_drive_pushes_against_it():
    path = 0.5 * np.sin(2.0 * TIME)
    true = ContactStop(30.0, 0.4, relaxation=0.02)
    velocity, acceleration = np.cos(2.0 * TIME), -2.0 * np.sin(2.0 * TIME)
    drive = 0.05 * acceleration + 0.1 * velocity + true.value(position=path, velocity=velocity)
    m = motion(ServoRecord(TIME, drive, path))
    found = sized_by_drive(m, true.resized(1.0), np.ones(TIME.size, dtype=bool))
    assert found.stiffness == pytest.approx(30.0, rel=0.02)
    assert (found.angle, found.side) == (0.4, "upper")
