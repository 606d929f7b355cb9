"""All records get the same columns behind the same filter, and only those that stand apart in every one."""

from __future__ import annotations

import numpy as np
import pytest

from tests.compare.test_records import record
from whsklearn import ServoAxis
from whsklearn.compare.axis import LAW, axis_rows
from whsklearn.compare.estimate import estimate
from whsklearn.datasets import make_servo_log
from whsklearn.effects import CableSpring, Cogging, Coulomb, Viscous, as_law, get_effect
from whsklearn.gap import ServoRecord


def test_one_record_that_needs_a_column_gives_it_to_all():
    rows = axis_rows([record(seed=1), record(Cogging(0.2, 12.0), seed=2)], ["a", "b"], 0.01, np.random.default_rng(0))
    assert rows[0].names == rows[1].names == ("inertia", *LAW, "cogging", "cogging", "delay")
    assert rows[0].step == rows[1].step
    assert rows[0].units == rows[1].units


def test_of_effects_that_look_alike_the_one_that_fits_is_taken():
    """On a short path a spring looks like gravity, until both are fitted."""
    log = make_servo_log([get_effect("cable_spring")(0.5)], amplitude=0.7, duration=20.0, random_state=3)
    rows = axis_rows([record(seed=1), ServoRecord.from_frame(log)], ["a", "b"], 0.01, np.random.default_rng(0))
    assert "cable_spring" in rows[0].names
    assert "gravity_imbalance" not in rows[0].names


def test_an_axis_that_stops_often_has_no_cogging_and_its_spring_is_no_gravity():
    """Where it rests nobody knows the friction, and what the filters make of that is ten times the noise."""
    t = np.arange(0.0, 25.0, 0.002)
    moves = np.where(t % 2.0 < 0.4, np.where(t // 2.0 % 4.0 < 2.0, 2.0, -2.0), 0.0).cumsum() * 0.002
    axis = ServoAxis(inertia=0.05, law=as_law([Viscous(0.1), Coulomb(0.4)]), sample_rate=500.0)
    records = [
        ServoRecord.from_frame(
            make_servo_log(effects, axis=axis, reference=moves, random_state=seed, noise=1e-5, resolution=1e-4)
        )
        for seed, effects in ((1, []), (2, [CableSpring(0.13)]))
    ]
    rows = axis_rows(records, ["a", "b"], 0.01, np.random.default_rng(0))
    assert rows[0].names == ("inertia", *LAW, "cable_spring", "delay")


def test_numbers_times_columns_are_the_drive():
    (rows,) = axis_rows([record(seed=1)], ["a"], 0.01, np.random.default_rng(0))
    fit, *_ = np.linalg.lstsq(rows.columns, rows.target, rcond=None)
    assert np.std(rows.target - rows.columns @ fit) < 0.005 * rows.scale  # without what filters leave: 2 % else
    assert all(fit[:3] > 0.0)


def test_a_drive_that_is_held_over_its_sample_has_no_delay():
    (rows,) = axis_rows([record(seed=1)], ["a"], 0.01, np.random.default_rng(0))
    found = estimate(rows)
    assert abs(found.values[-1]) < 2.0 * found.errors[-1]  # ten of them with the hold and the filters in it


@pytest.mark.parametrize("samples", [3, 8, -6])
def test_a_drive_that_acts_late_has_that_age(samples):
    """To first order about zero, a delay of several samples is sin(w T) / w at the frequency w: 12 % too small."""
    log = make_servo_log([], duration=20.0, random_state=1)
    dt = float(log["time_s"].diff().median())
    moved = log.assign(torque_nm=np.roll(log["torque_nm"], -samples)).iloc[10:-10]
    (rows,) = axis_rows([ServoRecord.from_frame(moved)], ["a"], 0.01, np.random.default_rng(0))
    (still,) = axis_rows([ServoRecord.from_frame(log)], ["a"], 0.01, np.random.default_rng(0))
    late, usual = (estimate(r) for r in (rows, still))
    assert late.values[-1] - usual.values[-1] == pytest.approx(samples * dt, abs=2.0 * late.errors[-1])
    assert late.values[0] == pytest.approx(usual.values[0], rel=0.01)


def test_a_record_that_sticks_is_judged_while_it_moves():
    """Half of the time at rest with a drive that wanders inside the friction: the numbers are those of the motion."""
    t = np.arange(0.0, 20.0, 0.002)
    way = np.where(t % 4.0 < 2.0, t % 4.0, 2.0)  # up in two seconds, held for two
    turn = (t // 4.0) % 2
    q = np.where(turn == 0.0, 1.0 - np.cos(0.5 * np.pi * way), 1.0 + np.cos(0.5 * np.pi * way))
    v, a = np.gradient(q, t), np.gradient(np.gradient(q, t), t)
    still = np.abs(v) < 1e-3
    drive = 0.05 * a + 0.1 * v + 0.2 * np.sign(v)
    drive[still] = 0.19 * np.sin(7.0 * t[still])
    made = ServoRecord(t, drive + 1e-3 * np.random.default_rng(0).standard_normal(t.size), q)
    (rows,) = axis_rows([made], ["a"], 0.01, np.random.default_rng(0))
    values = dict(zip(rows.names, estimate(rows).values, strict=True))
    assert abs(values["coulomb"] - 0.2) < 0.02
    assert abs(values["inertia"] - 0.05) < 0.005
