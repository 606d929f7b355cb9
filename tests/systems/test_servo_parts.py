"""Parts refuse what cannot be, and do what their name says."""

from __future__ import annotations

import math

import numpy as np
import pytest

from whsklearn import ServoAxis
from whsklearn.systems import Drive, PIDController, Sensor, Transmission


@pytest.mark.parametrize(
    ("part", "wrong"),
    [
        (Drive, {"gain": -1.0}),
        (Drive, {"delay": math.nan}),
        (Sensor, {"side": "shaft"}),
        (Transmission, {"load_share": 1.0}),
        (Transmission, {"stiffness": math.inf}),
        (PIDController, {"derivative_on": "reference"}),
    ],
)
def test_a_number_that_cannot_be_is_refused_by_name(part, wrong):
    with pytest.raises(ValueError, match=f"{part.__name__}: {next(iter(wrong))}"):
        part(**wrong)


def test_a_delay_and_a_lag_move_the_torque_and_not_the_log():
    drive = np.r_[np.zeros(100), np.ones(400)]
    late = ServoAxis(0.05, "viscous", drive=Drive(delay=0.05)).simulate_drive(drive, noise=False)
    slow = ServoAxis(0.05, "viscous", drive=Drive(lag=0.05)).simulate_drive(drive, noise=False)
    np.testing.assert_array_equal(late.drive, drive)
    assert np.flatnonzero(late.torque > 0.5)[0] == pytest.approx(150, abs=1)
    assert slow.torque[150] == pytest.approx(1 - math.exp(-1.0), abs=0.02)  # one time constant behind the step


def test_a_sensor_rounds_and_is_noisy_by_as_much_as_it_says():
    run = ServoAxis(0.05, "viscous", sensor=Sensor(noise=1e-3)).simulate_drive(np.zeros(4000), random_state=0)
    assert np.std(run.position) == pytest.approx(1e-3, rel=0.1)
    stepped = ServoAxis(0.05, "viscous", sensor=Sensor(resolution=0.01)).simulate_drive(np.ones(500), noise=False)
    np.testing.assert_allclose(stepped.position / 0.01, np.round(stepped.position / 0.01), atol=1e-9)


def test_the_integral_removes_a_constant_error_and_stops_at_the_limit():
    from whsklearn.effects import InputOffset

    path = np.full(6000, 0.1)
    loaded = ServoAxis(0.05, "viscous", [InputOffset(0.5)])
    axis = loaded.simulate(path, noise=False)
    assert axis.position[-1] == pytest.approx(0.1, abs=1e-3)
    weak = ServoAxis(0.05, "viscous", [InputOffset(0.5)], controller=PIDController(limit=0.2)).simulate(
        path, noise=False
    )
    assert np.abs(weak.drive).max() <= 0.2 + 1e-12
