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
    Backlash,
    CableSpring,
    Cogging,
    ContactStop,
    Coulomb,
    EarlyReversal,
    EndStop,
    FlexibleCoupling,
    FrictionLaw,
    GravityImbalance,
    HardeningSpring,
    InputDelay,
    InputOffset,
    LoadSideViscous,
    LuGre,
    QuadraticDrag,
    Saturation,
    SpeedHinge,
    Stribeck,
    TorqueRipple,
    Viscous,
)
from whsklearn.effects.base import rms
from whsklearn.export import export_model


def test_urdf_holds_dynamics_and_limits(tmp_path):
    axis = ServoAxis(effects=[Saturation(2.0), EndStop(100.0, 1.5), Cogging(0.1, 12.0)])
    done = export_model(axis, to="urdf", out=tmp_path)
    joint = ET.parse(done.paths[0]).getroot().find("joint")
    assert joint.find("dynamics").attrib == {"damping": "0.12", "friction": "0.3"}
    assert joint.find("limit").attrib == {"effort": "2", "velocity": "1e9", "lower": "-1.5", "upper": "1.5"}
    assert {x.name for x in done.losses} == {"cogging", "end_stop"}


def test_a_weight_in_urdf_pulls_as_it_does(tmp_path):
    mujoco = pytest.importorskip("mujoco", reason="needs the extra mujoco")
    weights = [GravityImbalance(0.3, 0.4), GravityImbalance(0.2, -2.0)]
    done = export_model(ServoAxis(inertia=0.05, effects=weights), to="urdf", out=tmp_path)
    assert [x.name for x in done.losses] == ["gravity"]  # which URDF leaves to the simulator
    model = mujoco.MjModel.from_xml_path(str(done.paths[0]))
    data, inertia = mujoco.MjData(model), np.empty(1)
    for q in (-2.0, 0.0, 0.7, 3.0):
        data.qpos[0] = q
        mujoco.mj_forward(model, data)
        assert data.qfrc_bias[0] == pytest.approx(sum(w.value(position=q) for w in weights), abs=1e-9)
        mujoco.mj_mulM(model, data, inertia, np.ones(1))
        assert inertia[0] == pytest.approx(0.05, rel=1e-9)


def test_isaac_is_python_with_friction_and_delay(tmp_path):
    axis = ServoAxis(effects=[InputDelay(0.004), Saturation(2.0)])
    done = export_model(axis, to="isaac", out=tmp_path)
    call = ast.parse(done.paths[0].read_text()).body[-1].value
    values = {k.arg: ast.literal_eval(k.value) for k in call.keywords}
    assert values["armature"] == axis.inertia
    assert (values["friction"], values["viscous_friction"]) == (0.3, 0.12)
    assert (values["min_delay"], values["max_delay"], values["effort_limit"]) == (4, 4, 2.0)
    assert not done.losses


def replay(mujoco, model, drive):
    """Position of the axis in MuJoCo under a drive that is held over 1 ms, shape (n,)."""
    data, y = mujoco.MjData(model), np.empty_like(drive)
    for k, u in enumerate(drive):
        y[k] = data.qpos[0]
        data.ctrl[0] = u
        mujoco.mj_step(model, data, round(1e-3 / model.opt.timestep))
    return y


HELD = [
    ActuatorLag(3e-3), Cogging(0.1, 12.0, 0.3), EarlyReversal(9.5e-3), EndStop(10.0, 0.5), FlexibleCoupling(1e-2),
    FlexibleCoupling(1e-2, load_coulomb=0.1), GravityImbalance(0.3, 0.2), HardeningSpring(0.1, 0.1),
    InputDelay(3e-3), InputOffset(0.05), LuGre(0.1, 0.01), QuadraticDrag(0.02), Saturation(0.8),
]  # fmt: skip


@pytest.mark.parametrize("effect", HELD, ids=lambda e: e.name)
def test_the_replay_agrees(effect, drive, tmp_path):
    mujoco = pytest.importorskip("mujoco", reason="mujoco is not installed (extra mujoco)")
    axis = ServoAxis(effects=[CableSpring(0.5), effect], substeps=4)
    done = export_model(axis, to="mjcf", out=tmp_path)
    assert not done.losses
    y = replay(mujoco, mujoco.MjModel.from_xml_path(str(done.paths[0])), drive)
    own = axis.simulate_drive(drive, noise=False).true_position
    without = ServoAxis(effects=[CableSpring(0.5)], substeps=4).simulate_drive(drive, noise=False).true_position
    error = np.sqrt(np.mean((y - own) ** 2))
    assert error < 0.01 * np.std(own)
    assert error < 0.4 * np.sqrt(np.mean((without - own) ** 2))  # the effect is in the file


def test_friction_of_the_load_is_held_where_the_load_is(drive, tmp_path):
    """It was left out, and the file was said to represent the whole model."""
    mujoco = pytest.importorskip("mujoco", reason="mujoco is not installed (extra mujoco)")
    loose = [FlexibleCoupling(1e-2), LoadSideViscous(0.1)]
    for effects, whole in ((loose, 0.01), ([LoadSideViscous(0.1)], 0.01)):
        axis = ServoAxis(effects=effects, substeps=4)
        done = export_model(axis, to="mjcf", out=tmp_path)
        assert not done.losses
        model = mujoco.MjModel.from_xml_path(str(done.paths[0]))
        replayed = replay(mujoco, model, drive)
        own = axis.simulate_drive(drive, noise=False).true_position
        assert rms(replayed - own) < whole * np.std(own)


@pytest.mark.parametrize(("to", "of"), [("urdf", "dynamics"), ("isaac", ""), ("mjcf", "joint")])
def test_a_free_law_is_held_as_the_nearest_damping_and_friction(to, of, tmp_path):
    """Its slope at standstill alone, which is negative where friction falls, drove MuJoCo's axis away."""
    curve = [Viscous(-0.16), Coulomb(0.25), SpeedHinge(0.2, 0.4), SpeedHinge(-0.02, 0.9), SpeedHinge(0.001, 3.4)]
    done = export_model(ServoAxis(law=curve), to=to, out=tmp_path)
    told = [x for x in done.losses if x.name == "free law over speed"]
    assert len(told) == 1
    assert told[0].size.startswith("3 kinks up to 3.4 rad/s, ")
    text = done.paths[0].read_text()
    if to == "isaac":
        values = {k.arg: ast.literal_eval(k.value) for k in ast.parse(text).body[-1].value.keywords}
        damping, dry = values["viscous_friction"], values["friction"]
    else:
        found = next(ET.fromstring(text).iter(of)).attrib
        damping, dry = float(found["damping"]), float(found.get("friction", found.get("frictionloss")))
    v = np.linspace(0.01, 3.4, 200)
    off = FrictionLaw(curve)(0.0, v) - damping * v - dry
    assert damping >= 0.0
    assert abs(np.mean(off)) < 1e-3
    assert np.max(np.abs(off)) < 0.1


def test_steady_motion_takes_the_friction_of_a_load_behind_a_play(tmp_path):
    loose = ServoAxis(law="viscous", effects=[Backlash(0.01, load_coulomb=0.2), LoadSideViscous(0.1)])
    closed = ServoAxis(law=[Viscous(), Coulomb(0.2), Viscous(0.1)])
    for to in ("urdf", "isaac"):
        texts = [export_model(a, to=to, out=tmp_path / to).paths[0].read_text() for a in (loose, closed)]
        one, other = ([line for line in t.splitlines() if "friction" in line and "Not" not in line] for t in texts)
        assert one == other


@pytest.mark.parametrize(
    ("effect", "share"), [(Stribeck(0.09, 0.12), 0.01), (Stribeck(0.05, 0.02), 0.015), (Stribeck(0.2, 0.05), 0.05)]
)
def test_an_axis_that_sticks_on_a_stribeck_curve_is_replayed(effect, share, tmp_path):
    """With bristles of 1e-4 rad and 2 ms of damping, sines were 4 to 8 % off at the first of these curves."""
    mujoco = pytest.importorskip("mujoco", reason="mujoco is not installed (extra mujoco)")
    axis = ServoAxis(0.012, law=[Viscous(0.03), Coulomb(0.18)], effects=[effect], substeps=20)
    model = mujoco.MjModel.from_xml_path(str(export_model(axis, to="mjcf", out=tmp_path).paths[0]))
    t = np.arange(3000) / 1000.0
    for frequency, amplitude in ((0.5, 0.5), (2.0, 0.6), (4.0, 0.7)):
        u = amplitude * np.sin(2.0 * np.pi * frequency * t) + 0.02
        own = axis.simulate_drive(u, noise=False).true_position
        assert rms(replay(mujoco, model, u) - own) < share * np.std(own)


@pytest.mark.parametrize("behind", [(), (FlexibleCoupling(1e-2),)], ids=["one mass", "two masses"])
@pytest.mark.parametrize("side", ["upper", "both"])
def test_a_stop_is_damped_in_contact_only(side, behind, tmp_path):
    """As a spring without its damper the free run was 84 % off."""
    mujoco = pytest.importorskip("mujoco", reason="mujoco is not installed (extra mujoco)")
    stop = ContactStop(40.0, 0.5, relaxation=0.005, side=side)
    axis = ServoAxis(0.012, law=[Viscous(0.03), Coulomb(0.18)], effects=[stop, *behind], substeps=20)
    done = export_model(axis, to="mjcf", out=tmp_path)
    assert not done.losses
    t = np.arange(3000) / 1000.0
    u = sum(a * np.sin(2.0 * np.pi * f * t + p) for a, f, p in ((0.45, 0.9, 0.0), (0.2, 2.7, 1.0), (0.1, 5.3, 0.0)))
    replayed = replay(mujoco, mujoco.MjModel.from_xml_path(str(done.paths[0])), u)
    own = axis.simulate_drive(u, noise=False).true_position
    assert np.mean(own > 0.5) > 0.02
    assert rms(replayed - own) < 0.02 * np.std(own)


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
