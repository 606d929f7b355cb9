"""The rigid-body loops agree with Pinocchio on drawn trees, and with each other."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from tests.systems.drawn_arms import drawn_arm, drawn_mjcf
from whsklearn import Arm, ServoAxis
from whsklearn.effects import (
    Backlash,
    CableSpring,
    Cogging,
    Coulomb,
    FlexibleCoupling,
    InputDelay,
    LoadSideViscous,
    LuGre,
    Saturation,
    Viscous,
)
from whsklearn.export.robots import arm_mjcf
from whsklearn.systems import PIDController

ARMS = [(n, seed) for seed, n in enumerate([1, 2, 3, 5, 6, 7, 8])]


def with_pinocchio(pin, arm):
    """The same arm for Pinocchio, and where each joint stands in its vectors."""
    model = pin.Model()
    ids = []
    for k, name in enumerate(arm.joints):
        kind = pin.JointModelPrismaticUnaligned if arm.slides[k] else pin.JointModelRevoluteUnaligned
        parent = 0 if arm.parents[k] < 0 else ids[arm.parents[k]]
        ids.append(model.addJoint(parent, kind(arm.axes[k]), pin.SE3(arm.rotations[k], arm.places[k]), name))
        model.appendBodyToJoint(ids[-1], pin.Inertia.FromDynamicParameters(arm.inertial[k]), pin.SE3.Identity())
    model.gravity.linear = arm.gravity
    return model, np.array([model.idx_vs[i] for i in ids]), np.array(ids)


@pytest.mark.parametrize(("n", "seed"), ARMS)
def test_regressor_and_torque_are_pinocchios(n, seed):
    pin = pytest.importorskip("pinocchio")
    arm = drawn_arm(n, seed)
    model, at, ids = with_pinocchio(pin, arm)
    data = model.createData()
    columns = np.concatenate([np.arange(10) + 10 * (i - 1) for i in ids])
    motion = arm.drawn_motion(5, seed)
    regressor, torque = arm.regressor(*motion), arm.inverse_dynamics(*motion)
    for t in range(5):
        q, v, a = (np.zeros(n) for _ in range(3))
        q[at], v[at], a[at] = (m[t] for m in motion)
        theirs = np.atleast_2d(pin.computeJointTorqueRegressor(model, data, q, v, a))
        np.testing.assert_allclose(regressor[t], theirs[at][:, columns], rtol=0, atol=1e-10)
        np.testing.assert_allclose(torque[t], pin.rnea(model, data, q, v, a)[at], rtol=0, atol=1e-10)


@pytest.mark.parametrize(("n", "seed"), ARMS)
def test_regressor_times_numbers_is_the_torque_and_the_mass_matrix_its_slope(n, seed):
    arm = drawn_arm(n, seed)
    q, v, a = arm.drawn_motion(4, seed)
    rest = np.zeros_like(q)
    np.testing.assert_allclose(
        arm.regressor(q, v, a) @ arm.inertial.ravel(), arm.inverse_dynamics(q, v, a), rtol=0, atol=1e-10
    )
    held, mass = arm.inverse_dynamics(q, rest, rest), arm.mass_matrix(q)
    for i in range(n):
        unit = rest + np.eye(n)[i]
        np.testing.assert_allclose(arm.inverse_dynamics(q, rest, unit) - held, mass[:, :, i], rtol=0, atol=1e-10)


@pytest.mark.parametrize(("n", "seed"), ARMS)
def test_power_of_the_drives_is_the_rate_of_the_energy(n, seed):
    """Whatever the signs of a convention: tau . v = d/dt (v' M v / 2 + potential), with gravity off for brevity."""
    arm = drawn_arm(n, seed, gravity=(0, 0, 0))
    q, v, a = arm.drawn_motion(3, seed)
    h = 1e-5

    def energy(s):
        qs, vs = q + s * v + 0.5 * s * s * a, v + s * a
        return 0.5 * np.einsum("ti,tij,tj->t", vs, arm.mass_matrix(qs), vs)

    power = np.einsum("ti,ti->t", arm.inverse_dynamics(q, v, a), v)
    np.testing.assert_allclose(power, (energy(h) - energy(-h)) / (2 * h), rtol=1e-6)


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


# --- a motor apart from its link ------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("effects", "near"),
    [
        ((Viscous(0.1), Backlash(0.02, 0.6)), 1e-6),
        ((Viscous(0.1), LoadSideViscous(0.05), CableSpring(0.3, 0.1), Backlash(0.05, 0.6, 30.0, 0.1)), 1e-6),
        ((Viscous(0.1), LuGre(0.1), Backlash(0.02, 0.6)), 1e-6),
        ((Viscous(0.1), FlexibleCoupling(0.002, 0.6)), 1e-6),
        ((Viscous(0.1), Backlash(0.05, 0.6, load_coulomb=0.1)), 2e-3),
    ],
)
def test_one_joint_with_a_play_is_a_servo_axis_with_it(effects, near):
    drive = 0.6 * np.sin(np.arange(3000) / 1000 * 7)
    axis = ServoAxis(0.05, [Viscous(0.1)], effects[1:], friction="tanh", substeps=10)
    there = axis.simulate_drive(drive, noise=False)
    here = dataclasses.replace(one_joint(), inertial=0.6 * ONE, armature=[0.02], effects=[effects])
    here = here.simulate_drive(drive[:, None])
    span = np.ptp(there.true_position)
    assert np.abs(there.true_position - there.load_position).max() > 5e-4
    assert np.abs(here.true_position[:, 0] - there.true_position).max() < near * span
    assert np.abs(here.link_position[:, 0] - there.load_position).max() < near * span


def loose(gap, seed=2, **contact):
    """Three joints without friction; between the second motor and its link lies a play."""
    arm = dataclasses.replace(drawn_arm(3, seed, gravity=(0, 0, 0)), armature=[0.1, 0.2, 0.1])
    return arm.with_effects({"j1": Backlash(gap, **contact)})


@pytest.mark.parametrize("seed", [2, 4, 7])
def test_energy_is_kept_across_a_play_whose_contact_has_no_damper(seed):
    """The other joints feel the contact, too, or the energy of all would change."""
    gap, rigid = 0.05, dataclasses.replace(loose(0.0, seed), armature=[0.1, 0.0, 0.1], effects=())
    contact = loose(gap, seed, frequency=20.0, damping_ratio=0.0)
    start = np.random.default_rng(0).normal(size=(2, 3))
    how = {"position": [start[0]], "velocity": [start[1]], "link_velocity": [start[1] * [1.0, 0.2, 1.0]]}
    record = contact.simulate_drive(np.zeros((2000, 3)), link_position=[start[0]], substeps=20, **how)
    twist = (record.true_position - record.link_position)[:, 1]
    beyond = np.maximum(np.abs(twist) - gap / 2, 0.0)
    stiff = 0.2 * 0.5 * (2 * np.pi * 20.0) ** 2
    v = record.link_velocity
    energy = 0.5 * np.einsum("ti,tij,tj->t", v, rigid.mass_matrix(record.link_position), v)
    energy += 0.5 * 0.2 * record.velocity[:, 1] ** 2 + 0.5 * stiff * beyond**2
    assert np.count_nonzero(np.diff(np.sign(twist)) != 0) >= 4, "it crosses the play"
    assert beyond.max() > 1e-3
    assert np.ptp(energy) < 0.01 * energy[0]


def test_a_damped_contact_takes_energy_and_ends_in_contact_or_at_rest_within_the_play():
    arm = loose(0.05, frequency=60.0, damping_ratio=0.5)
    record = arm.simulate_drive(np.zeros((3000, 3)), velocity=[[0.0, 2.0, 0.0]], position=[[0.0] * 3], substeps=20)
    twist = (record.true_position - record.link_position)[:, 1]
    assert np.abs(twist).max() < 0.05 / 2 + 0.02
    slip = (record.velocity - record.link_velocity)[:, 1]
    assert np.abs(slip[-200:]).max() < 0.5 * np.abs(slip[:200]).max()


def test_a_play_of_no_width_is_a_rigid_joint_and_a_narrow_one_nearly():
    drive = np.sin(np.arange(600)[:, None] / 50 * np.arange(1, 4))
    rigid = dataclasses.replace(loose(0.0), effects=()).simulate_drive(drive).true_position
    np.testing.assert_array_equal(loose(0.0).simulate_drive(drive).true_position, rigid)
    errors = [
        np.abs(loose(gap, frequency=500.0, damping_ratio=1.0).simulate_drive(drive).true_position - rigid).max()
        for gap in (0.02, 0.002, 2e-4)
    ]
    assert errors[0] > 3 * errors[1] > 9 * errors[2]
    assert errors[2] < 2e-4, "the width"


@pytest.mark.parametrize(("seed", "damping", "ratio"), [(2, 0.3, 4.0), (4, 0.3, 4.0), (2, 0.0, 16.0), (4, 0.0, 16.0)])
def test_an_eighth_of_the_step_lessens_the_error_of_a_play(seed, damping, ratio):
    """In proportion where a damper acts at once, else in proportion to its square; where a contact begins, it jumps."""
    arm = loose(0.03, seed, frequency=30.0, damping_ratio=damping)
    drive = 3.0 * np.sin(np.arange(300)[:, None] / 50 * np.arange(1, 4))
    fine, part, whole = (arm.simulate_drive(drive, substeps=s).true_position for s in (640, 80, 10))
    errors = [np.abs(x - fine).max() for x in (part, whole)]
    assert errors[1] / errors[0] > ratio


@pytest.mark.parametrize("substeps", [1, 4, 10])
def test_a_stiff_contact_stays_finite_with_coarse_steps(substeps):
    arm = loose(1e-3, frequency=1000.0, damping_ratio=1.5)
    record = arm.simulate_drive(5.0 * np.sin(np.arange(2000)[:, None] / 50 * np.arange(1, 4)), substeps=substeps)
    assert np.abs(record.true_position - record.link_position).max() < 5e-3


def test_a_replay_begins_with_the_links_where_they_are_and_they_keep_their_place_behind_their_motors():
    arm = loose(0.05)
    drive = 3.0 * np.sin(np.arange(600)[:, None] / 50 * np.arange(1, 4))
    record = arm.simulate_drive(drive)
    at = {"position": record.true_position, "velocity": record.velocity}
    links = {"link_position": record.link_position, "link_velocity": record.link_velocity}
    kept, known = (arm.simulate_drive(drive, **at, **more, resync=0.1) for more in ({}, links))
    np.testing.assert_allclose(kept.true_position, record.true_position, atol=1e-9)
    np.testing.assert_allclose(known.true_position, record.true_position, atol=1e-9)
    off = arm.simulate_drive(drive, **at, link_position=record.link_position + 0.01, resync=0.1)
    assert np.abs(off.true_position - record.true_position).max() > 1e-5


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


def geared():
    """A wrist whose second motor turns both joints."""
    acting = {"j0": [Viscous(0.2)], "j1+j2": [Viscous(0.3), LuGre(0.1)]}
    arm = drawn_arm(3, 4, slides=0.0, gravity=(0, 0, -9.81)).with_effects(acting)
    return dataclasses.replace(arm, sum_armature={"j1+j2": 0.05})


def test_along_a_sum_of_joints_both_pay_for_friction_and_motor():
    arm, still = geared(), dataclasses.replace(geared(), sums={}, sum_armature={})
    d, rng = np.array([0.0, 1.0, 1.0]), np.random.default_rng(0)
    q, v, a = rng.normal(size=(3, 50, 3))
    along = dataclasses.replace(arm, sums={"j1+j2": [Viscous(0.3)]})
    more = along.inverse_dynamics(q, v, a) - still.inverse_dynamics(q, v, a)
    np.testing.assert_allclose(more, np.outer(0.3 * v @ d + 0.05 * a @ d, d), atol=1e-12)
    np.testing.assert_allclose(along.forward_dynamics(q, v, along.inverse_dynamics(q, v, a)), a, atol=1e-8)


def test_a_motor_along_a_sum_moves_as_the_same_friction_in_mujoco():
    mujoco = pytest.importorskip("mujoco")
    arm = dataclasses.replace(geared(), sums={"j1+j2": [Viscous(0.3)]})
    model = mujoco.MjModel.from_xml_string(arm_mjcf(arm)[0])
    model.opt.timestep, model.opt.integrator = 1e-4, mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    data, drive = mujoco.MjData(model), np.sin(np.arange(300)[:, None] / 20 * np.arange(1, 4))
    theirs = []
    for u in drive:
        theirs.append(data.qpos.copy())
        data.ctrl[:] = u
        mujoco.mj_step(model, data, 10)
    ours = arm.simulate_drive(drive, substeps=50).true_position
    without = dataclasses.replace(arm, sums={}, sum_armature={}).simulate_drive(drive, substeps=50).true_position
    assert np.abs(ours - np.array(theirs)).max() < 0.01 * np.abs(ours - without).max()


def test_an_axis_that_is_no_sum_of_its_joints_is_refused():
    with pytest.raises(ValueError, match="nor a sum of joints"):
        drawn_arm(3, 4).with_effects({"j1+hand": [Viscous(0.3)]})
