"""The motion that effects are looked at along, and the shapes at which they are."""

from __future__ import annotations

import numpy as np
import pytest

from tests.gap.plants.example_simulator import RECORD, TIME
from whsklearn.effects import ContactStop, LuGre
from whsklearn.gap import ServoRecord
from whsklearn.gap.plants.simulator_look import catalogue, gone, motion, sized_by_drive


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


def test_what_is_gone_is_told_as_a_share_of_the_acceleration():
    record = ServoRecord(TIME, np.cos(TIME), np.sin(2.0 * TIME))
    error = 1e-3 * np.sin(20.0 * TIME)  # a hundred times the share in the acceleration that it has in the position
    assert gone(motion(record), error, np.zeros_like(error), record) == pytest.approx(0.1, rel=0.05)
    assert gone(motion(record), np.zeros_like(error), error, record) == 0.0


def test_a_hole_is_no_acceleration():
    torn = ServoRecord(RECORD.time + np.where(TIME < 2.0, 0.0, 5.0), RECORD.drive,
                       RECORD.position + np.where(TIME < 2.0, 0.0, 3.0), starts=(int(np.sum(TIME < 2.0)),))  # fmt: skip
    whole, seen = motion(RECORD), motion(torn)
    assert 0.8 * whole.usable.sum() < seen.usable.sum() < whole.usable.sum()
    both = seen.usable & whole.usable
    a, b = (m.seen(r.position, 2)[both] for m, r in ((whole, RECORD), (seen, torn)))
    np.testing.assert_allclose(b, a, atol=1e-6 * np.abs(a).max())
    assert seen.signals.time[-1] == pytest.approx(TIME[-1] + 5.0)
    assert [len(r) for r in torn.segments] == [torn.starts[0], TIME.size - torn.starts[0]]
    assert RECORD.segments[0] is RECORD
