"""A stream's alarm and `compare` tell one story: a change is named and sized, a drift is a drift."""

from __future__ import annotations

import numpy as np
import pytest

from whsklearn import RigidBodyLags, RLSRegressor, ServoAxis
from whsklearn.change import ChangeAlarm
from whsklearn.compare import at_an_alarm, at_an_alarm_of
from whsklearn.datasets import default_arm, make_arm_log, make_servo_log
from whsklearn.effects import Coulomb, Viscous
from whsklearn.streaming import Options, StreamMonitor

RATE, SECONDS = 250.0, 24.0


def axis(coulomb):
    return ServoAxis(law=[Viscous(0.1), Coulomb(coulomb)], sample_rate=RATE)


def side(coulomb=0.2, seed=0, drift=None):
    """(experiments, rows) of time, drive, position."""
    log = make_servo_log([], axis=axis(coulomb), duration=SECONDS, random_state=seed, disturbance=drift)
    rows = log[["time_s", "torque_nm", "position_rad"]].to_numpy()
    return np.zeros(len(rows)), rows + np.array([SECONDS * seed, 0.0, 0.0])


@pytest.fixture(scope="module")
def position():
    return at_an_alarm(["time_s", "torque_nm", "position_rad"])


def test_friction_that_rose_is_named_and_sized(position):
    told = position(side(), side(0.3, seed=1))
    assert (told["verdict"], told["changes"][0]["name"]) == ("moved", "coulomb")
    low, high = told["changes"][0]["interval"]
    assert low < 0.1 < high


def test_an_offset_that_walks_on_over_the_alarm_is_a_drift_and_no_change(position):
    walk = np.cumsum(np.random.default_rng(2).standard_normal(2 * round(SECONDS * RATE)))
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


@pytest.mark.parametrize("restart", [0.0, -SECONDS])
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


def test_rows_without_motion_say_why():
    still = np.column_stack([np.arange(3000) / RATE, np.ones(3000), np.ones(3000)])
    told = at_an_alarm(["time_s", "torque_nm", "position_rad"])((np.zeros(3000), still), (np.zeros(3000), still))
    assert told["verdict"] == "cannot_tell"


def test_friction_of_one_joint_of_an_arm():
    arm = default_arm()
    logs = [make_arm_log(arm, extra, duration=16.0, sample_rate=RATE, random_state=k, return_arrays=True)
            for k, extra in enumerate(({}, {"pitch": [Coulomb(0.3)]}))]  # fmt: skip
    sides = [(np.zeros(len(q)), np.hstack([q, u])) for q, u in logs]
    told = at_an_alarm_of(arm, 1.0 / RATE, timed=False)(*sides)
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
        at_an_alarm_of(arm, 1.0 / RATE, timed=True),
    )  # fmt: skip
    monitor.take(rows[:alarm_at])
    if alarm_at is not None:
        monitor.sides.alarm(alarm_at)
        monitor.take(rows[alarm_at:])
    monitor.tell_moved(wait=120.0)
    return [r for r in told if r["kind"] == "alarm"], [r for r in told if r["kind"] == "moved"]


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
