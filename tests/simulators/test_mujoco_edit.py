"""Effects by MuJoCo's own means: each acts, is written, and is read back."""

from __future__ import annotations

import numpy as np
import pytest

from tests.simulators.axis_xml import XML
from whsklearn.effects import (
    ActuatorLag,
    CableSpring,
    Cogging,
    ContactStop,
    Coulomb,
    DisturbanceTone,
    EndStop,
    GravityImbalance,
    HardeningSpring,
    InputDelay,
    InputOffset,
    LuGre,
    QuadraticDrag,
    Saturation,
    Viscous,
)  # fmt: skip
from whsklearn.simulators import MuJoCoSimulator

mujoco = pytest.importorskip("mujoco", reason="mujoco is not installed (extra mujoco)")


@pytest.mark.parametrize(
    "effect",
    [
        ActuatorLag(0.01), CableSpring(0.5, 0.1), Cogging(0.1, 9.0), EndStop(5.0, 0.3), GravityImbalance(0.2, 0.4),
        HardeningSpring(0.2, 0.1), InputDelay(0.008), InputOffset(0.1), QuadraticDrag(0.05), Saturation(0.6),
        Viscous(0.1), ContactStop(50.0, 0.3, relaxation=0.02, centre=0.1, side="both"),
        ContactStop(50.0, 0.3, relaxation=0.02), LuGre(0.1, 0.01, ratio=1.4, velocity=0.5, damping=0.02),
    ],
    ids=lambda e: type(e).__name__,
)  # fmt: skip
def test_an_effect_acts_and_is_written(effect, record, tmp_path):
    simulator = MuJoCoSimulator(XML.format(joint=""), joint="axis").with_effect(effect)
    y = simulator.simulate(record)
    assert np.std(y - record.position) > 1e-4
    again = MuJoCoSimulator(simulator.write(tmp_path / "repaired.xml"), joint="axis", actuator="motor")
    np.testing.assert_allclose(again.simulate(record), y, atol=1e-6)


@pytest.mark.parametrize(("stated", "same"), [('solreffriction="0.006 1"', True), ("", False)])
def test_dry_friction_turns_as_softly_as_the_joint_says(stated, same, record):
    """A log of the file itself had been bristles of 7 urad, with certainty: friction that was added turned hard."""
    given = MuJoCoSimulator(XML.format(joint=stated), joint="axis").with_effect(Coulomb(0.2))
    whole = MuJoCoSimulator(XML.format(joint=f'{stated} frictionloss="0.2"'), joint="axis")
    assert np.allclose(given.simulate(record), whole.simulate(record), atol=1e-9) == same


def test_what_mujoco_lacks_is_refused():
    with pytest.raises(NotImplementedError, match="disturbance_tone"):
        MuJoCoSimulator(XML.format(joint=""), joint="axis").with_effect(DisturbanceTone(0.1, 5.0))


def test_a_contact_is_the_spring_and_damper_of_its_numbers():
    """Thrown at the stop without a drive: the same path as J a = -k (d + tau dd/dt), but for MuJoCo's impedance."""
    stop = ContactStop(40.0, 0.2, relaxation=0.015)
    simulator = MuJoCoSimulator(XML.format(joint="").replace('damping="0.1"', ""), joint="axis").with_effect(stop)
    data = mujoco.MjData(simulator.model)
    data.qvel[0], v, q, h, depth = 1.5, 1.5, 0.0, simulator.model.opt.timestep, [0.0, 0.0]
    for _ in range(int(0.5 / h)):
        mujoco.mj_step(simulator.model, data)
        v -= h * max(40.0 * ((q - 0.2) + 0.015 * v), 0.0) / 0.05 if q > 0.2 else 0.0
        q += h * v
        depth = [max(depth[0], data.qpos[0] - 0.2), max(depth[1], q - 0.2)]
    assert depth[0] == pytest.approx(depth[1], rel=0.05)
    assert data.qvel[0] == pytest.approx(v, abs=0.1)  # thrown back as fast


def test_a_contact_that_pulls_is_refused():
    with pytest.raises(ValueError, match="contact"):
        MuJoCoSimulator(XML.format(joint=""), joint="axis").with_effect(ContactStop(-1.0, 0.2))


def test_a_wave_that_cannot_be_held_is_refused_and_not_left_out_in_silence():
    with pytest.raises(ValueError, match="whole orders"):
        MuJoCoSimulator(XML.format(joint=""), joint="axis").with_effect(Cogging(0.1, 6.12))
