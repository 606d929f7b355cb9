"""The public call on simulated axes: named, silent, or unable to tell with the reason."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from tests.compare.linear import TRUTH, rows
from whsklearn import RigidBodyLags, RLSRegressor, ServoAxis
from whsklearn.change import ChangeAlarm
from whsklearn.compare import at_an_alarm, at_an_alarm_of, compare_records
from whsklearn.compare.estimate import estimate
from whsklearn.compare.records import change_point, compare_rows, course, scatter, spread
from whsklearn.datasets import default_arm, make_arm_log, make_servo_log
from whsklearn.effects import Cogging, Coulomb, GravityImbalance, Viscous, get_effect
from whsklearn.gap import ServoRecord
from whsklearn.streaming import Options, StreamMonitor


def many(factors):
    every = [rows(TRUTH * [1, 1, f, 1, 1], seed=k, label=f"day {k}") for k, f in enumerate(factors)]
    return every, [estimate(r) for r in every]


def test_a_step_stands_between_two_records():
    found, _ = change_point(*many([1.0, 1.0, 1.0, 1.3, 1.3, 1.3]), 0.01)
    assert [c.name for c in found] == ["coulomb"]
    assert found[0].between == ("day 2", "day 3")
    low, high = found[0].interval
    assert low < 0.3 * 0.2 < high


def test_copies_that_scatter_are_no_step_but_a_spread():
    every, parts = many([1.0, 1.3, 0.8, 1.2, 0.9, 1.1])
    assert change_point(every, parts, 0.01)[0] == []
    found = scatter(every, parts, 0.01)
    assert [c.name for c in found] == ["coulomb"]
    assert found[0].between == ("day 2", "day 1")


def test_equal_records_have_neither():
    every, parts = many([1.0] * 6)
    assert change_point(every, parts, 0.01)[0] == []
    assert scatter(every, parts, 0.01) == []


def test_spread_between_is_that_of_the_draw():
    rng = np.random.default_rng(0)
    found = [spread(1.0 + 0.1 * rng.standard_normal(20), np.full(20, 0.02**2))[1] for _ in range(50)]
    assert abs(np.median(found) - 0.1) < 0.02


def test_two_records_spread_by_the_difference_beyond_their_errors_even_if_one_of_them_hardly_knows_the_number():
    """For two records, DerSimonian and Laird's estimate is the squared difference less both variances, halved."""
    for variances in (np.array([0.3, 0.1]), np.array([1e-12, 1e6])):
        difference = 3.0 * np.sqrt(variances.sum())
        between = spread(np.array([0.0, difference]), variances)[1] ** 2
        assert between == pytest.approx((difference**2 - variances.sum()) / 2.0, rel=1e-6)


def test_a_trend_is_told_from_a_step_and_from_scatter():
    rng = np.random.default_rng(1)
    n, error = 8, 0.02
    shapes = {"trend": 0.05 * np.arange(n), "change point": 0.3 * (np.arange(n) > 4), "neither": np.zeros(n)}
    for word, shape in shapes.items():
        told = [course(1.0 + shape + error * rng.standard_normal(n), np.full(n, error**2), 0.01) for _ in range(60)]
        assert np.mean([c.word == word for c in told]) > 0.9
        if word == "trend":
            assert np.mean([abs(c.slope - 0.05) < 2.0 * c.standard_error for c in told]) > 0.85
    scattered = [course(1.0 + 0.2 * rng.standard_normal(n), np.full(n, error**2), 0.01).word for _ in range(60)]
    assert np.mean([word == "neither" for word in scattered]) > 0.9  # the scatter is the noise of a trend


def test_a_number_that_falls_from_record_to_record_is_told_with_its_slope():
    every, _ = many([1.0, 0.9, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3])
    found = compare_rows(every, 0.01)
    (coulomb,) = [r for r in found.numbers if r["name"] == "coulomb"]
    assert coulomb["course"] == "trend"
    assert abs(coulomb["slope"] + 0.02) < 3.0 * coulomb["slope_standard_error"]
    assert any("coulomb falls by" in note for note in found.notes)


SECONDS = 20.0


def record(*effects, seed=0, **changed):
    log = make_servo_log(effects, duration=SECONDS, sample_rate=500.0, random_state=seed)
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


def test_a_wave_whose_zero_each_record_has_for_itself_is_fitted_and_not_compared():
    a, b = record(Cogging(0.3, 12.0), seed=1), record(Cogging(0.3, 12.0), seed=2)
    turned = replace(b, position=b.position - b.position[0] + 0.1)  # as an encoder without an index counts
    found = compare_records([a, turned], same_zero=False)
    assert (found.verdict, found.changes) == ("nothing", [])
    assert "cogging was fitted to each record, and cannot be compared" in found.notes[-1]
    assert "cogging" not in {r["name"] for r in found.numbers}
    tighter = record(Cogging(0.3, 12.0), Coulomb(0.2), seed=2)
    tighter = replace(tighter, position=tighter.position - tighter.position[0] + 0.1)
    assert [c.name for c in compare_records([a, tighter], same_zero=False).changes] == ["coulomb"]


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
    assert f"{found.smallest_seen['input_offset']:.2g} Nm of input offset" in found.sentence
    assert " s of delay" in found.sentence
    assert re.search(r" [\d.]+(e-\d+)?( to [\d.]+)? % of the drive is in none of these numbers", found.sentence)


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


RATE, SIDE_SECONDS = 250.0, 24.0


def axis(coulomb):
    return ServoAxis(law=[Viscous(0.1), Coulomb(coulomb)], sample_rate=RATE)


def side(coulomb=0.2, seed=0, drift=None):
    """(experiments, rows) of time, drive, position."""
    log = make_servo_log([], axis=axis(coulomb), duration=SIDE_SECONDS, random_state=seed, disturbance=drift)
    rows = log[["time_s", "torque_nm", "position_rad"]].to_numpy()
    return np.zeros(len(rows)), rows + np.array([SIDE_SECONDS * seed, 0.0, 0.0])


@pytest.fixture(scope="module")
def position():
    return at_an_alarm(["time_s", "torque_nm", "position_rad"])


def test_friction_that_rose_is_named_and_sized(position):
    told = position(side(), side(0.3, seed=1))
    assert (told["verdict"], told["changes"][0]["name"]) == ("moved", "coulomb")
    low, high = told["changes"][0]["interval"]
    assert low < 0.1 < high


def test_an_offset_that_walks_on_over_the_alarm_is_a_drift_and_no_change(position):
    walk = np.cumsum(np.random.default_rng(2).standard_normal(2 * round(SIDE_SECONDS * RATE)))
    first, second = np.split(0.1 * walk / np.std(walk), 2)
    told = position(side(drift=first), side(seed=1, drift=second))
    assert told["verdict"] == "nothing", told["sentence"]
    assert any("input offset walks" in note for note in told["notes"])


def test_a_velocity_in_other_units_and_a_pause_are_the_same_axis():
    def slower(s):
        _, rows = s
        speed = np.gradient(rows[:, 2], rows[:, 0])
        now = np.column_stack([1e3 * rows[:, 0], 1e3 * rows[:, 1], np.degrees(speed)])
        keep = np.abs(np.arange(len(now)) - 3000) > 200  # a pause: two experiments
        return (np.arange(len(now)) > 3000)[keep].astype(float), now[keep]

    compare = at_an_alarm(["t_ms", "torque_mnm", "velocity_deg_s"])
    told = compare(slower(side()), slower(side(0.3, seed=1)))
    assert told["changes"][0]["name"] == "coulomb"
    assert told["changes"][0]["unit"] == "mNm"


@pytest.mark.parametrize("restart", [0.0, -SIDE_SECONDS])
def test_a_clock_that_restarts_or_goes_on_is_the_same_axis(position, restart):
    rows = side()[1]
    half = len(rows) // 2
    rows = rows + np.outer(np.arange(len(rows)) >= half, [restart, 0.0, 0.0])
    told = position(((np.arange(len(rows)) >= half).astype(float), rows), side(0.3, seed=1))
    assert [c["name"] for c in told["changes"]] == ["coulomb"], told["sentence"]


def test_a_velocity_in_rpm_is_compared(position):
    def in_rpm(s):
        experiments, rows = s
        return experiments, np.column_stack([rows[:, :2], np.gradient(rows[:, 2], rows[:, 0]) * 30.0 / np.pi])

    told = at_an_alarm(["time_s", "torque_nm", "speed_rpm"])(in_rpm(side()), in_rpm(side(0.3, seed=1)))
    as_position = position(side(), side(0.3, seed=1))["changes"][0]
    assert told["changes"][0]["name"] == "coulomb"
    assert told["changes"][0]["interval"] == pytest.approx(as_position["interval"], rel=0.1)


@pytest.mark.parametrize("columns", [["t", "u", "y"], ["time_s", "voltage_v", "temperature"], ["time_s", "torque_nm"]])
def test_columns_of_no_axis_are_not_compared(columns):
    assert at_an_alarm(columns) is None


def test_rows_without_a_time_are_compared_by_their_rate(position):
    untimed = at_an_alarm(["torque_nm", "position_rad"], dt=1.0 / RATE)
    before, after = side(), side(0.3, seed=1)
    told = untimed(*((experiments, rows[:, 1:]) for experiments, rows in (before, after)))["changes"][0]
    assert told["interval"] == pytest.approx(position(before, after)["changes"][0]["interval"], rel=1e-6)


def test_rows_without_motion_say_why():
    still = np.column_stack([np.arange(3000) / RATE, np.ones(3000), np.ones(3000)])
    told = at_an_alarm(["time_s", "torque_nm", "position_rad"])((np.zeros(3000), still), (np.zeros(3000), still))
    assert told["verdict"] == "cannot_tell"


def test_friction_of_one_joint_of_an_arm():
    arm = default_arm()
    logs = [make_arm_log(arm, extra, duration=16.0, sample_rate=RATE, random_state=k, return_arrays=True)
            for k, extra in enumerate(({}, {"pitch": [Coulomb(0.3)]}))]  # fmt: skip
    sides = [(np.zeros(len(q)), np.hstack([q, u])) for q, u in logs]
    told = at_an_alarm_of(arm, 1.0 / RATE)(*sides)
    assert told["changes"][0]["name"] == "coulomb at pitch"


def streamed(extra, drift=0.0, alarm_at=None):
    """Records of the stream of an arm whose pitch joint gets an effect, or an offset that walks, half-way."""
    arm = default_arm()
    logs = [make_arm_log(arm, more, duration=s, sample_rate=RATE, random_state=k, return_arrays=True)
            for k, (more, s) in enumerate((({}, 16.0), (extra, 20.0)))]  # fmt: skip
    rows = np.concatenate(
        [np.column_stack([np.arange(len(q)) / RATE + 20.0 * k, q, u])[200:] for k, (q, u) in enumerate(logs)]
    )
    walk = np.cumsum(np.random.default_rng(5).standard_normal(len(rows)))
    rows[:, 4] += drift * np.std(rows[:, 4]) * walk / np.std(walk)
    told, lags = [], RigidBodyLags.of_arm(arm, RATE, causal=True)
    monitor = StreamMonitor(
        RLSRegressor(lags, P0=1.0), ChangeAlarm(interval=1e5, n_reference=400, n_settle=100),
        Options(every=1000, timed=True, max_step=0.01, outputs=arm.joints), told.append,
        at_an_alarm_of(arm),
    )  # fmt: skip
    monitor.take(rows[:alarm_at])
    if alarm_at is not None:
        monitor.sides.alarm(alarm_at)
        monitor.take(rows[alarm_at:])
    monitor.tell_moved(wait=120.0)
    return [r for r in told if r.get("cause") == "change"], [r for r in told if r["kind"] == "moved"]


def test_the_stream_of_an_arm_says_what_moved_at_its_alarm():
    (alarm,), (moved,) = streamed({"pitch": [Coulomb(0.3)]})
    assert moved["alarm_row"] == alarm["row"]
    assert alarm["joint"] == "pitch"
    assert moved["changes"][0]["name"] == "coulomb at pitch"
    low, high = moved["changes"][0]["interval"]
    assert low < 0.3 < high


def test_an_alarm_during_a_drift_is_no_change():
    _, moved = streamed({}, drift=0.2, alarm_at=3900)
    assert moved
    assert "moved" not in {r["verdict"] for r in moved}, [r["sentence"] for r in moved]
