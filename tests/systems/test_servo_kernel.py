"""The compiled kernel is its own reference: run uncompiled, it gives the same numbers."""

from __future__ import annotations

import dataclasses
import os
import subprocess
import sys

import numpy as np
import pytest

from tests.systems.signals import REFERENCE
from whsklearn.systems import Drive, PIDController, ServoAxis

SCRIPT = """
import numpy as np
from whsklearn.effects import (BoucWen, Coulomb, Cogging, EncoderEccentricity, FrictionDrift, GeneralizedMaxwellSlip,
    InputDelay, ActuatorLag, DeadZone, LoadFriction, LuGre, PositionFriction, Stribeck, TorqueRipple, Viscous, Backlash)
from whsklearn.systems import ServoAxis, Sensor
law = [Viscous(0.1), Coulomb(0.2), Stribeck(0.1, 0.1, 1.5)]
late = [InputDelay(0.0013), ActuatorLag(0.002), DeadZone(0.02), TorqueRipple(0.1, 3.0), EncoderEccentricity(1e-3)]
dry = [PositionFriction(0.05, 2.0), LoadFriction(0.05), FrictionDrift(0.1, 1.0), Cogging(0.05, 8.0, 1.0)]
path = [LuGre(0.1, 0.01), GeneralizedMaxwellSlip(0.1, 0.01, 4.0, 1.3), BoucWen(0.1, 0.01), Backlash(0.01)]
reference = 0.3 * np.sin(np.arange(60) / 8.0)
for effects in (late, dry, path):
    for friction in ("stick", "tanh"):
        axis = ServoAxis(0.05, law, effects, friction=friction, sensor=Sensor(1e-5, 1e-5), substeps=4)
        record = axis.simulate(reference, random_state=1)
        print(*(repr(float(record[k][-1])) for k in ("true_position", "drive", "load_position")))
"""


def test_uncompiled_is_the_same(capsys):
    exec(SCRIPT, {})
    compiled = np.array([float(x) for x in capsys.readouterr().out.split()])
    environment = os.environ | {"NUMBA_DISABLE_JIT": "1"}
    run = subprocess.run([sys.executable, "-c", SCRIPT], env=environment, capture_output=True, text=True, check=True)
    plain = np.array([float(x) for x in run.stdout.split()])
    assert compiled.size == 18
    np.testing.assert_allclose(compiled, plain, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("derivative_on", ["error", "measurement"])
def test_controller_is_the_discrete_pid_of_its_docstring(derivative_on):
    c = PIDController(20.0, 5.0, 0.5, 0.1, 0.05, derivative_on=derivative_on, derivative_filter=0.003)
    record = ServoAxis(controller=c, drive=Drive(gain=0.5)).simulate(REFERENCE)
    error = REFERENCE - record.position
    source = error if derivative_on == "error" else -record.position
    blend = 0.003 / (0.003 + 1e-3)
    derivative, filtered = np.r_[0.0, np.diff(source)] * 1000, np.zeros(1000)
    for k in range(1, 1000):
        filtered[k] = blend * filtered[k - 1] + (1 - blend) * derivative[k]
    velocity = np.gradient(REFERENCE) * 1000
    out = 20.0 * error + 5.0 * np.cumsum(error) / 1000 + 0.5 * filtered
    out += 0.1 * velocity + 0.05 * np.gradient(velocity) * 1000
    np.testing.assert_allclose(record.drive, 0.5 * out, atol=1e-9)


def test_the_log_shows_the_torque_within_the_controllers_limit():
    axis = ServoAxis(controller=PIDController(limit=0.7))
    record = axis.simulate(np.ones(1000), initial_position=0.0)
    assert np.abs(record.drive).max() == pytest.approx(0.7)


def test_the_integral_does_not_wind_up():
    free = PIDController(20.0, 40.0, 2.0)
    step = np.ones(4000)
    bounded = ServoAxis(controller=dataclasses.replace(free, limit=0.6)).simulate(step, initial_position=0.0)
    overshoot = bounded.true_position.max() - 1.0
    # the same bound outside the controller's sight: its integral winds up
    blind = ServoAxis(controller=free, drive=Drive(limit=0.6)).simulate(step, initial_position=0.0)
    assert overshoot < 0.5 * (blind.true_position.max() - 1.0)
