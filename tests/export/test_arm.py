"""An exported arm is the same arm in MuJoCo and read again, and what its file does not hold is told."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from tests.systems.drawn_arms import drawn_arm
from whsklearn import Arm
from whsklearn.datasets import default_arm, make_arm_log
from whsklearn.effects import (
    Backlash,
    CableSpring,
    Cogging,
    Coulomb,
    EndStop,
    HardeningSpring,
    InputOffset,
    LoadFriction,
    LoadSideViscous,
    QuadraticDrag,
    Viscous,
)
from whsklearn.export import export_model
from whsklearn.export.robots import arm_urdf
from whsklearn.filtering import motion
from whsklearn.identification import identify_arm
from whsklearn.models import ArmModel, save_model

mujoco = pytest.importorskip("mujoco")


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("to", ["mjcf", "urdf"])
def test_the_file_has_the_torques_of_the_arm(to, seed, tmp_path):
    arm = drawn_arm(4, seed, gravity=(0, 0, -9.81)).with_effects({"j1": (Viscous(0.3), Coulomb(0.2))})
    if to == "mjcf":
        arm = dataclasses.replace(arm.with_effects({"j0-j2": (Viscous(0.3),)}), sum_armature={"j0-j2": 0.1})
    again = Arm.from_file(export_model(arm, to=to, out=tmp_path).paths[0])
    motion = arm.drawn_motion(10)
    columns = [again.index(j) for j in arm.joints]
    back = np.argsort(columns)
    theirs = again.inverse_dynamics(*(m[:, back] for m in motion))[:, columns]
    np.testing.assert_allclose(theirs, arm.inverse_dynamics(*motion), atol=1e-8)


AT_JOINTS = {
    "pitch": [Viscous(0.2), Coulomb(0.2), QuadraticDrag(0.1), CableSpring(3.0, 0.2), InputOffset(0.3),
              Cogging(0.2, 6.0, 0.4)],
    "yaw": [Viscous(0.2), HardeningSpring(2.0, 0.1), EndStop(200.0, 0.1)],
}  # fmt: skip


@pytest.mark.parametrize("joints", [(), ("pitch",), ("yaw",)])
def test_mujoco_replays_the_exported_arm_with_the_effects_at_its_joints(joints, tmp_path):
    arm = default_arm().with_effects({j: AT_JOINTS[j] for j in joints})
    model = mujoco.MjModel.from_xml_path(str(export_model(arm, to="mjcf", out=tmp_path).paths[0]))
    data, drive = mujoco.MjData(model), np.column_stack([np.sin(np.arange(500) / 40), np.cos(np.arange(500) / 60)])
    theirs = []
    for u in drive:
        theirs.append(data.qpos.copy())
        data.ctrl[:2] = u
        mujoco.mj_step(model, data, 2)
    ours = arm.simulate_drive(drive, sample_rate=1000.0).true_position
    assert np.abs(ours - theirs).max() < 0.005 * np.ptp(ours)


def test_mujoco_replays_an_identified_arm_beside_its_log(tmp_path):
    q, u = make_arm_log(duration=12.0, random_state=1, return_arrays=True)
    found = identify_arm(*make_arm_log(duration=12.0, return_arrays=True), dt=0.002, robot=default_arm()).model
    model = mujoco.MjModel.from_xml_path(str(export_model(found, to="mjcf", out=tmp_path).paths[0]))
    data, steps, window = mujoco.MjData(model), round(0.002 / model.opt.timestep), 250  # half a second
    start = [motion(x, 500.0, 50.0) for x in q.T]
    error = []
    for k in range(window, len(q)):
        if k % window == 0:
            mujoco.mj_resetData(model, data)
            data.qpos[:], data.qvel[:] = ([getattr(m, s)[k] for m in start] for s in ("position", "velocity"))
        error.append(q[k] - data.qpos)
        data.ctrl[:] = u[k]
        mujoco.mj_step(model, data, steps)
    assert np.sqrt(np.mean(np.square(error), axis=0)) == pytest.approx(0.0, abs=0.05 * q.std())


END = {"mjcf": "xml", "urdf": "urdf", "c": "c"}


@pytest.mark.parametrize("to", END)
def test_a_play_is_told_and_the_friction_behind_it_is_held_at_the_closed_joint(to, tmp_path):
    arm = dataclasses.replace(drawn_arm(2, 0, gravity=(0, 0, -9.81)), armature=[0.1, 0.2])
    loose = arm.with_effects({"j1": [Viscous(0.1), Backlash(0.02, load_coulomb=0.7), LoadSideViscous(0.2)]})
    closed = arm.with_effects({"j1": [Viscous(0.1), Coulomb(0.7), Viscous(0.2)]})
    both = [export_model(a, to=to, out=tmp_path / f"{i}.{END[to]}") for i, a in enumerate((loose, closed))]
    more = [str(loss) for loss in both[0].losses if loss not in both[1].losses]
    assert len(more) == 1
    assert more[0].startswith("j1's backlash (gap 0.02 rad")
    if to != "c":
        one, two = (Arm.from_file(done.paths[0]).inverse_dynamics(*arm.drawn_motion(5)) for done in both)
        np.testing.assert_array_equal(one, two)


def test_what_a_file_does_not_hold_is_told_by_joint(tmp_path):
    arm = default_arm().with_effects({"pitch": [LoadFriction(0.2), Coulomb(-0.3)]})  # 0.2 Nm are there
    told = sorted(str(x) for x in export_model(arm, to="mjcf", out=tmp_path).losses)
    assert len(told) == 2
    assert "pitch's coulomb (torque -0.1" in told[0], "the sum, which is negative"
    assert told[1].startswith("pitch's load_friction (coefficient 0.2")
    assert "pitch's load_friction" in (tmp_path / "model.xml").read_text()
    urdf = [x.name for x in export_model(arm, to="urdf", out=tmp_path).losses]
    assert "yaw's motor" in urdf


def test_what_a_sliding_joint_loses_has_its_units():
    arm = Arm(["lift"], [-1], [True], [np.eye(3)], [[0, 0, 0]], [[0, 0, 1]], armature=[2.0])
    losses = arm_urdf(arm.with_body("lift", 1.0, inertia=np.eye(3)).with_effects({"lift": [InputOffset(0.5)]}))[1]
    assert [x.size for x in losses] == ["armature 2 kg", "torque 0.5 N"]


def test_a_model_file_is_exported_and_other_formats_refuse(tmp_path):
    save_model(ArmModel(default_arm(), {}, dt=0.001, logged="position"), tmp_path / "model.json")
    assert export_model(tmp_path / "model.json", to="mjcf", out=tmp_path).losses == []
    with pytest.raises(ValueError, match="mjcf, urdf or c, not to st"):
        export_model(default_arm(), to="st", out=tmp_path)
