"""URDF and Isaac Lab."""

from __future__ import annotations

import ast
import xml.etree.ElementTree as ET

import numpy as np
import pytest

from whsklearn import ServoAxis
from whsklearn.effects import (
    ActuatorLag,
    AsymmetricCoulomb,
    CableSpring,
    Cogging,
    EarlyReversal,
    EndStop,
    FlexibleCoupling,
    GravityImbalance,
    HardeningSpring,
    InputDelay,
    InputOffset,
    LuGre,
    QuadraticDrag,
    Saturation,
    TorqueRipple,
)
from whsklearn.export import export_model


def test_urdf_holds_dynamics_and_limits(tmp_path):
    axis = ServoAxis(effects=[Saturation(2.0), EndStop(100.0, 1.5), Cogging(0.1, 12.0)])
    done = export_model(axis, to="urdf", out=tmp_path)
    joint = ET.parse(done.paths[0]).getroot().find("joint")
    assert joint.find("dynamics").attrib == {"damping": "0.12", "friction": "0.3"}
    assert joint.find("limit").attrib == {"effort": "2", "velocity": "1e9", "lower": "-1.5", "upper": "1.5"}
    assert {x.name for x in done.losses} == {"cogging", "end_stop"}


def test_isaac_is_python_with_friction_and_delay(tmp_path):
    axis = ServoAxis(effects=[InputDelay(0.004), Saturation(2.0)])
    done = export_model(axis, to="isaac", out=tmp_path)
    call = ast.parse(done.paths[0].read_text()).body[-1].value
    values = {k.arg: ast.literal_eval(k.value) for k in call.keywords}
    assert values["armature"] == axis.inertia
    assert (values["friction"], values["viscous_friction"]) == (0.3, 0.12)
    assert (values["min_delay"], values["max_delay"], values["effort_limit"]) == (4, 4, 2.0)
    assert not done.losses


HELD = [
    ActuatorLag(3e-3), Cogging(0.1, 12.0, 0.3), EarlyReversal(9.5e-3), EndStop(10.0, 0.5), FlexibleCoupling(1e-2),
    GravityImbalance(0.3, 0.2), HardeningSpring(0.1, 0.1), InputDelay(3e-3), InputOffset(0.05), LuGre(0.1, 0.01),
    QuadraticDrag(0.02), Saturation(0.8),
]  # fmt: skip


@pytest.mark.parametrize("effect", HELD, ids=lambda e: e.name)
def test_the_replay_agrees(effect, drive, tmp_path):
    mujoco = pytest.importorskip("mujoco", reason="mujoco is not installed (extra mujoco)")
    axis = ServoAxis(effects=[CableSpring(0.5), effect], substeps=4)
    done = export_model(axis, to="mjcf", out=tmp_path)
    assert not done.losses
    model = mujoco.MjModel.from_xml_path(str(done.paths[0]))
    data = mujoco.MjData(model)
    y = np.empty_like(drive)
    for k, u in enumerate(drive):
        y[k] = data.qpos[0]
        data.ctrl[0] = u
        mujoco.mj_step(model, data, round(1e-3 / model.opt.timestep))
    own = axis.simulate_drive(drive, noise=False).true_position
    without = ServoAxis(effects=[CableSpring(0.5)], substeps=4).simulate_drive(drive, noise=False).true_position
    error = np.sqrt(np.mean((y - own) ** 2))
    assert error < 0.01 * np.std(own)
    assert error < 0.4 * np.sqrt(np.mean((without - own) ** 2))  # the effect is in the file


def test_a_fitted_order_beside_a_whole_one_is_rounded_and_told(tmp_path):
    done = export_model(ServoAxis(effects=[Cogging(0.12, 11.9983)]), to="mjcf", out=tmp_path / "fitted.xml")
    whole = export_model(ServoAxis(effects=[Cogging(0.12, 12.0)]), to="mjcf", out=tmp_path / "whole.xml")
    assert [x.reason for x in done.losses] == ["written with a whole order, so that it repeats every turn"]
    assert not whole.losses
    one, other = (ET.parse(d.paths[0]).getroot() for d in (done, whole))
    assert [e.attrib for e in one.iter() if "model" not in e.attrib] == [
        e.attrib for e in other.iter() if "model" not in e.attrib
    ]


def test_what_mujoco_lacks_is_told(tmp_path):
    axis = ServoAxis(effects=[TorqueRipple(0.02, 6.0), AsymmetricCoulomb(0.1), Cogging(0.1, 5.5)])
    done = export_model(axis, to="mjcf", out=tmp_path / "axis.xml")
    assert {x.name for x in done.losses} == {"torque_ripple", "asymmetric_coulomb", "cogging"}
    text = done.paths[0].read_text()
    assert all(str(x) in text for x in done.losses)
