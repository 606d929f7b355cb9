"""An MJCF model behind the three methods, and its repair."""

from __future__ import annotations

import numpy as np
import pytest

from whsklearn.effects import (
    ActuatorLag,
    CableSpring,
    Cogging,
    DisturbanceTone,
    EndStop,
    GravityImbalance,
    HardeningSpring,
    InputDelay,
    InputOffset,
    QuadraticDrag,
    Saturation,
    Viscous,
)  # fmt: skip
from whsklearn.gap.record import ServoRecord
from whsklearn.simulators import MuJoCoSimulator

mujoco = pytest.importorskip("mujoco", reason="mujoco is not installed (extra mujoco)")

XML = """<mujoco><compiler angle="radian"/><option timestep="0.001" integrator="implicitfast" gravity="0 0 0"/>
<worldbody><body><joint name="axis" type="hinge" axis="0 -1 0" damping="0.1" {joint}/>
<inertial pos="0 0 0" mass="1" diaginertia="0.05 0.05 0.05"/></body></worldbody>
<actuator><general name="motor" joint="axis" gainprm="1"/></actuator></mujoco>"""


@pytest.fixture(scope="module")
def record():
    t = np.arange(1500) / 250.0
    drive = 0.8 * np.sin(2 * np.pi * 0.8 * t) + 0.5 * np.sin(2 * np.pi * 2.3 * t + 1)
    first = ServoRecord(t, drive, np.zeros_like(t))
    position = np.zeros_like(t)
    for _ in range(2):  # the replay is held near the log, so the log is its own
        position = MuJoCoSimulator(XML.format(joint=""), joint="axis").replay(
            ServoRecord(t, drive, position + 1e-12 * t), 100.0
        )
    return ServoRecord(t, first.drive, position)


def test_it_replays_its_own_log(record):
    y = MuJoCoSimulator(XML.format(joint=""), joint="axis").simulate(record)
    assert np.std(record.position - y) < 1e-3 * np.std(record.position)


@pytest.mark.parametrize(
    "effect",
    [
        ActuatorLag(0.01), CableSpring(0.5, 0.1), Cogging(0.1, 9.0), EndStop(5.0, 0.3), GravityImbalance(0.2, 0.4),
        HardeningSpring(0.2, 0.1), InputDelay(0.008), InputOffset(0.1), QuadraticDrag(0.05), Saturation(0.6),
        Viscous(0.1),
    ],
    ids=lambda e: e.name,
)  # fmt: skip
def test_an_effect_acts_and_is_written(effect, record, tmp_path):
    simulator = MuJoCoSimulator(XML.format(joint=""), joint="axis").with_effect(effect)
    y = simulator.simulate(record)
    assert np.std(y - record.position) > 1e-4
    again = MuJoCoSimulator(simulator.write(tmp_path / "repaired.xml"), joint="axis", actuator="motor")
    np.testing.assert_allclose(again.simulate(record), y, atol=1e-6)


def test_what_mujoco_lacks_is_refused():
    with pytest.raises(NotImplementedError, match="disturbance_tone"):
        MuJoCoSimulator(XML.format(joint=""), joint="axis").with_effect(DisturbanceTone(0.1, 5.0))


def test_refit_finds_a_wrong_damping(record):
    wrong = MuJoCoSimulator(XML.format(joint="").replace('damping="0.1"', 'damping="0.15"'), joint="axis")
    found = wrong.refit(record, np.ones(len(record), dtype=bool))
    assert found.parameters["damping"] == pytest.approx(0.1, rel=0.05)


def test_friction_that_is_not_there_is_tried():
    assert [e.name for e in MuJoCoSimulator(XML.format(joint=""), joint="axis").also_try] == ["coulomb"]


def test_a_joint_that_is_not_there_is_named():
    with pytest.raises(ValueError, match="no joint 'elbow'"):
        MuJoCoSimulator(XML.format(joint=""), joint="elbow", actuator="motor")
