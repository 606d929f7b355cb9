"""Experiments: replay, restarts at the measurement, batches, noise, logs, and runs that cannot be."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from tests.systems.signals import DRIVE, REFERENCE, T
from whsklearn.effects import (
    Cogging,
    LuGre,
    Viscous,
    get_effect,
)
from whsklearn.systems import PIDController, Sensor, ServoAxis, record_frame, simulate_many


def test_open_loop_repeats_the_closed_loop():
    axis = ServoAxis(effects=[Cogging(0.1, 7.0), LuGre(0.1, 0.01)])
    closed = axis.simulate(REFERENCE)
    opened = axis.simulate_drive(closed.drive, initial_position=REFERENCE[0], initial_velocity=0.0)
    np.testing.assert_allclose(opened.position, closed.position, atol=1e-10)
    assert np.isnan(opened.reference).all()


def test_resync_returns_to_the_measurement():
    truth = ServoAxis(inertia=0.05).simulate_drive(DRIVE)
    wrong = ServoAxis(inertia=0.06)
    options = {"position": truth.position, "velocity": truth.velocity}
    free = wrong.simulate_drive(DRIVE, **options).position
    often = wrong.simulate_drive(DRIVE, resync=0.1, **options)
    always = wrong.simulate_drive(DRIVE, resync=0.001, **options)
    np.testing.assert_array_equal(always.position, truth.position)
    np.testing.assert_array_equal(often.position[::100], truth.position[::100])
    assert np.std(often.position - truth.position) < 0.3 * np.std(free - truth.position)


def test_resync_without_velocity_takes_it_from_the_position():
    truth = ServoAxis().simulate_drive(DRIVE)
    again = ServoAxis().simulate_drive(DRIVE, position=truth.position, resync=0.2)
    assert np.abs(again.position - truth.position).max() < 2e-3


def test_a_linear_hold_interpolates():
    axis = ServoAxis(law=[Viscous(0.1)])
    slow = dataclasses.replace(axis, sample_rate=100.0, substeps=200)
    drive = np.sin(9.0 * np.arange(200) / 100)
    fine = axis.simulate_drive(np.sin(9.0 * np.arange(2000) / 1000), hold="linear").position[::10]
    errors = [np.std(slow.simulate_drive(drive, hold=h).position - fine) for h in ("linear", "zero")]
    assert errors[0] < 0.1 * errors[1]


def test_a_batch_is_the_same_as_one_by_one_in_threads_too():
    axes = [ServoAxis(effects=[get_effect(n)()]) for n in ("cogging", "backlash", "input_delay")]
    alone = [a.simulate(REFERENCE, noise=1e-4 * np.cos(T)) for a in axes]
    for jobs in (1, 2):
        batch = simulate_many(axes, reference=REFERENCE, noise=1e-4 * np.cos(T), n_jobs=jobs)
        for one, many in zip(alone, batch, strict=True):
            np.testing.assert_array_equal(one.position, many.position)


def test_a_batch_gives_each_axis_its_own_noise():
    axis = ServoAxis(sensor=Sensor(noise=1e-3))
    a, b, c = simulate_many([axis] * 3, reference=REFERENCE, random_state=[1, 2, 1])
    assert not np.array_equal(a.position, b.position)
    np.testing.assert_array_equal(a.position, c.position)


def test_a_log_has_the_agreed_columns():
    frame = record_frame(ServoAxis().simulate(REFERENCE))
    assert list(frame) == ["time_s", "reference_rad", "torque_nm", "position_rad"]


@pytest.mark.parametrize(
    ("options", "complaint"),
    [
        ({"reference": np.ones(5), "drive": np.ones(5)}, "either"),
        ({}, "either"),
        ({"drive": np.ones((5, 2))}, "1-D"),
        ({"drive": np.array([0.0, np.nan])}, "row 1"),
        ({"drive": np.ones(5), "resync": 1.0}, "position="),
        ({"drive": np.ones(5), "position": np.ones(4)}, "5 samples"),
        ({"drive": np.ones(5), "hold": "breath"}, "hold"),
        ({"drive": np.ones(5), "position": np.ones(5), "resync": 0.0}, "resync"),
    ],
)
def test_an_experiment_that_cannot_be_is_refused(options, complaint):
    with pytest.raises(ValueError, match=complaint):
        simulate_many([ServoAxis()], **options)


def test_a_run_that_blows_up_says_so_and_a_batch_goes_on():
    wild = ServoAxis(controller=PIDController(kp=1e9, ki=0.0, kd=0.0))
    with pytest.raises(FloatingPointError, match="no longer finite"):
        wild.simulate(REFERENCE)
    records = simulate_many([wild, ServoAxis()], reference=REFERENCE)
    assert np.isfinite(records[1].position).all()
