"""The public call on simulated axes: named, silent, or unable to tell with the reason."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from whsklearn.compare import compare_records
from whsklearn.datasets import make_servo_log
from whsklearn.effects import Cogging, GravityImbalance, get_effect
from whsklearn.gap import ServoRecord

SECONDS = 20.0


def record(*effects, seed=0, **changed):
    log = make_servo_log(effects, duration=SECONDS, random_state=seed)
    made = ServoRecord.from_frame(log, time="time_s", drive="torque_nm", position="position_rad")
    return replace(made, **changed)


@pytest.fixture(scope="module")
def plain():
    return record(seed=1)


def test_an_effect_that_came(plain):
    found = compare_records([plain, record(GravityImbalance(0.3), seed=2)])
    assert [c.name for c in found.changes] == ["gravity_imbalance"]
    low, high = found.changes[0].interval
    assert low < 0.3 < high
    assert "came" in found.sentence


def test_a_drive_that_reads_too_much_is_a_gain(plain):
    other = record(seed=2)
    found = compare_records([plain, replace(other, drive=1.25 * other.drive)])
    assert found.changes[0].name == "gain"
    assert abs(found.changes[0].after - 0.8) < 0.02


def test_a_play_that_widened_is_named_nothing_else():
    found = compare_records([record(get_effect("backlash")(gap), seed=k) for k, gap in enumerate((0.01, 0.03))])
    assert {c.name for c in found.changes} <= {"backlash"}


def test_nothing_moved_and_what_would_have_shown(plain):
    found = compare_records([plain, record(seed=2)])
    assert (found.verdict, found.changes) == ("nothing", [])
    inertia = next(r["mean"] for r in found.numbers if r["name"] == "inertia")
    assert found.smallest_seen["inertia"] < 0.1 * inertia
    assert "would have been detected" in found.sentence


def test_numbers_are_told_in_the_units_of_the_log(plain):
    def told(r):
        return ServoRecord(r.time, 1e3 * r.drive, np.degrees(r.position), units=("mNm", "deg"))

    a, b = plain, record(Cogging(0.2, 12.0), seed=2)
    si, own = compare_records([a, b]).changes[0], compare_records([told(a), told(b)]).changes[0]
    assert (si.name, own.name, si.unit, own.unit) == ("cogging", "cogging", "Nm", "mNm")
    assert own.after == pytest.approx(1e3 * si.after, rel=1e-6)


def test_a_drive_that_the_position_says_is_refused(plain):
    found = compare_records([plain, replace(plain, drive=0.4 * np.sin(plain.position))])
    assert found.verdict == "cannot_tell"
    assert "function of the position" in found.reason
    assert not found.usable


def test_a_record_at_rest_is_refused_with_its_name(plain):
    still = replace(plain, position=np.zeros(len(plain)))
    found = compare_records([plain, still], ["good.csv", "bad.csv"])
    assert found.verdict == "cannot_tell"
    assert found.reason.startswith("bad.csv")


def test_records_that_turn_different_ways_are_not_compared(plain):
    n, t = len(plain), plain.time
    way = 2.0 * t + 0.1 * np.sin(2 * np.pi * t)
    speed = 2.0 + 0.2 * np.pi * np.cos(2 * np.pi * t)
    drive = 0.02 * np.gradient(speed, t) + 0.05 * speed + 0.1 + 1e-3 * np.random.default_rng(0).standard_normal(n)
    one = ServoRecord(t, drive, way)
    found = compare_records([one, ServoRecord(t, -drive, -way)])
    assert found.verdict == "cannot_tell"
    assert "different ways" in found.reason


def test_one_record_that_never_reverses_is_compared_in_what_it_shows(plain):
    """Coulomb friction and offset of a run one way are one; a gain of the drive shows all the same."""
    n = len(plain)
    t, rng = plain.time, np.random.default_rng(0)
    way = 2.0 * t + 0.3 * np.sin(2 * np.pi * 0.7 * t)
    v = 2.0 + 0.3 * 2 * np.pi * 0.7 * np.cos(2 * np.pi * 0.7 * t)
    a = -0.3 * (2 * np.pi * 0.7) ** 2 * np.sin(2 * np.pi * 0.7 * t)
    back = np.sin(2 * np.pi * 0.4 * t), *(w * f(2 * np.pi * 0.4 * t) for w, f in (
        (2 * np.pi * 0.4, np.cos), (-(2 * np.pi * 0.4) ** 2, np.sin)))  # fmt: skip
    noise = 1e-3 * rng.standard_normal((2, n))
    both = ServoRecord(t, 0.02 * back[2] + 0.05 * back[1] + 0.1 * np.sign(back[1]) + noise[0], back[0])
    one = ServoRecord(t, 0.02 * a + 0.05 * v + 0.1 + noise[1], way)
    assert compare_records([both, one]).verdict != "moved"
    louder = compare_records([both, replace(one, drive=2.0 * one.drive)])
    assert louder.changes[0].name == "gain"
    assert louder.changes[0].after == pytest.approx(0.5, abs=0.05)


@pytest.mark.parametrize("records", [1, 0])
def test_one_record_is_refused(plain, records):
    with pytest.raises(ValueError, match="two records at least"):
        compare_records([plain] * records)


def test_kinds_of_drive_do_not_mix(plain):
    with pytest.raises(ValueError, match="one kind of drive"):
        compare_records([plain, replace(plain, units=("A", "rad"))])
