"""An arm in motion obeys mechanics: energy, MuJoCo, and the servo axis where it has one joint."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from tests.systems.drawn_arms import drawn_arm, drawn_mjcf
from whsklearn import Arm, ServoAxis
from whsklearn.effects import Cogging, Coulomb, InputDelay, LuGre, Saturation, Viscous
from whsklearn.systems import PIDController

ONE = np.array([[0.0] * 9 + [0.05]])  # 0.05 kg m2 about z


def one_joint(*effects):
    return Arm(["axis"], [-1], [False], [np.eye(3)], [[0, 0, 0]], [[0, 0, 1]], ONE, effects=[effects])


def test_energy_is_kept_without_friction():
    arm = drawn_arm(3, 2, gravity=(0, 0, 0))
    start = np.random.default_rng(0).normal(size=(2, 3))
    record = arm.simulate_drive(np.zeros((2000, 3)), position=[start[0]], velocity=[start[1]], substeps=20)
    energy = 0.5 * np.einsum("ti,tij,tj->t", record.velocity, arm.mass_matrix(record.true_position), record.velocity)
    assert np.ptp(record.true_position, axis=0).max() > 0.5
    assert np.ptp(energy) < 1e-3 * energy[0]


def test_halving_the_step_halves_the_error():
    arm = drawn_arm(3, 4)
    drive = np.sin(np.arange(300)[:, None] / 50 * np.arange(1, 4))
    fine, half, whole = (arm.simulate_drive(drive, substeps=s).true_position for s in (160, 20, 10))
    errors = [np.abs(x - fine).max() for x in (half, whole)]
    assert 1.6 < errors[1] / errors[0] < 2.6


def test_it_moves_as_in_mujoco():
    mujoco = pytest.importorskip("mujoco")
    text = drawn_mjcf(3, 1)
    arm, model = Arm.from_file(text), mujoco.MjModel.from_xml_string(text)
    model.opt.timestep, model.opt.integrator = 1e-5, mujoco.mjtIntegrator.mjINT_RK4
    data, drive = mujoco.MjData(model), np.sin(np.arange(200)[:, None] / 20 * np.arange(1, arm.n_joints + 1))
    data.qpos[:] = 0.0
    theirs = []
    for u in drive:
        theirs.append(data.qpos.copy())
        data.qfrc_applied[:] = u
        mujoco.mj_step(model, data, 100)
    ours = arm.simulate_drive(drive, substeps=50).true_position
    assert np.abs(ours - np.array(theirs)).max() < 1e-3 * np.abs(ours).max()


@pytest.mark.parametrize(
    "effects",
    [
        (Viscous(0.1), Coulomb(0.2)),
        (Viscous(0.1), Cogging(0.1, 6)),
        (Viscous(0.1), InputDelay(0.004), Saturation(0.4)),
        (Viscous(0.1), LuGre(0.1)),
    ],
)
def test_one_joint_is_a_servo_axis(effects):
    drive = 0.6 * np.sin(np.arange(3000) / 1000 * 7)
    axis = ServoAxis(0.05, [Viscous(0.1)], effects[1:], friction="tanh", substeps=10)
    there = axis.simulate_drive(drive, noise=False)
    arm = one_joint(*effects)
    here = arm.simulate_drive(drive[:, None])
    assert np.ptp(there.true_position) > 0.1
    assert np.abs(here.true_position[:, 0] - there.true_position).max() < 2e-3 * np.ptp(there.true_position)


def test_a_joint_that_friction_holds_stays():
    arm = one_joint(Coulomb(0.5))
    record = arm.simulate_drive(np.full((1000, 1), 0.4))
    assert np.abs(record.velocity).max() < 2e-3, "less than a few times the smoothing"
    assert arm.simulate_drive(np.full((1000, 1), 0.6)).velocity[-1, 0] == pytest.approx(0.1 / 0.05, rel=0.01)


def test_controllers_follow_their_references_and_an_encoder_has_its_steps():
    arm = drawn_arm(2, 5, slides=0.0)
    reference = 0.3 * np.sin(np.arange(2000)[:, None] / 1000 * [2.0, 3.0])
    record = arm.simulate(reference, feed_forward=arm, resolution=1e-3)
    assert np.abs(record.true_position - reference).max() < 0.02
    np.testing.assert_allclose(record.position, np.round(record.position / 1e-3) * 1e-3, atol=1e-12)


def test_a_replay_that_returns_to_the_log_begins_there_anew():
    arm = one_joint(Viscous(0.1))
    drive = np.sin(np.arange(1000)[:, None] / 100)
    record = arm.simulate_drive(drive)
    other = dataclasses.replace(arm, inertial=1.1 * ONE)
    both = {"position": record.true_position, "velocity": record.velocity}
    free, held = other.simulate_drive(drive, **both), other.simulate_drive(drive, **both, resync=0.1)
    error = [np.abs(r.true_position - record.true_position).max() for r in (free, held)]
    assert error[1] < 0.2 * error[0]
    np.testing.assert_array_equal(held.true_position[100], record.true_position[100])


def test_what_does_not_stay_finite_is_told():
    with pytest.raises(FloatingPointError, match="use more substeps"):
        one_joint().simulate(np.eye(500)[:, 1:2], controller=PIDController(kp=1e9, ki=0.0, kd=0.0), substeps=1)
