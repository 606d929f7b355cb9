"""An arm identified from its log: numbers within their intervals, errors per joint, and what looks wrong."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from tests.lags.test_rigid_body import RATE, smooth_log
from tests.systems.drawn_arms import drawn_arm
from whsklearn.cli.arm import document, numbers_table
from whsklearn.datasets import default_arm, make_arm_log
from whsklearn.effects import Cogging, Coulomb, InputOffset, LoadFriction, PreslidingHysteresis, Viscous
from whsklearn.filtering import motion
from whsklearn.identification import identify_arm
from whsklearn.identification.arm_fit import nominal_numbers, reversals_of, unsure
from whsklearn.lags import RigidBodyLags
from whsklearn.lags.arm_rows import records_of
from whsklearn.systems import Arm

DT = 0.002
ARM = default_arm()


@pytest.fixture(scope="module")
def log():
    return make_arm_log(duration=20.0, return_arrays=True)


@pytest.fixture(scope="module")
def found(log):
    return identify_arm(*log, dt=DT, robot=ARM)


def test_numbers_are_those_of_the_arm(found):
    truth, errors = found.nominal, found.model.standard_errors
    assert set(truth) == set(found.model.parameters)
    away = [(v - truth[k]) / max(errors[k], 0.01 * abs(truth[k])) for k, v in found.model.parameters.items()]
    assert np.sqrt(np.mean(np.square(away))) < 2.5


def test_coupled_it_misses_little_and_one_axis_at_a_time_much(found):
    assert list(found.missing) == ["yaw", "pitch"]
    assert max(found.missing.values()) < 0.02
    assert min(found.alone.values()) > 3.0 * max(found.missing.values())


@pytest.mark.parametrize("motors", [None, (0.05, 0.03)])
def test_links_stay_those_of_the_file_and_a_motor_is_what_exceeds_them(motors):
    arm = dataclasses.replace(ARM, armature=motors)
    q, torque = make_arm_log(arm, duration=12.0, return_arrays=True)
    fitted = identify_arm(q, torque, dt=DT, robot=dataclasses.replace(ARM, armature=None))
    np.testing.assert_allclose(fitted.model.arm.armature, motors or (0.0, 0.0), atol=0.002)
    np.testing.assert_allclose(fitted.model.arm.inertial[:, [0, 9]], ARM.inertial[:, [0, 9]], rtol=0.05)


def test_the_model_is_physical_and_gives_the_drives(found, log):
    arm = found.model.arm
    assert (arm.inertial[:, 0] > 0).all()
    assert [e.name for e in arm.effects[0]] == ["viscous", "coulomb", "input_offset"]
    phi, target, keep = found.lags.joint_rows(*log)
    error = np.where(keep, target - phi @ found.lags.weights_of(arm), 0.0)
    assert (error.std(axis=0) < 0.03 * target.std(axis=0)).all()


def test_friction_along_two_joints_is_found_where_it_is_and_nowhere_else(found):
    arm = drawn_arm(3, 5, slides=0.0, branch=0.0, gravity=(0, 0, -9.81))
    arm = arm.with_effects({joint: (Viscous(0.5), Coulomb(0.5)) for joint in arm.joints})
    a, b, c = arm.joints
    hidden = arm.with_effects({f"{b}-{c}": (Viscous(0.8), Coulomb(1.0))})
    q, torque = make_arm_log(hidden, return_arrays=True, duration=12.0)
    effects = identify_arm(q, torque, dt=DT, robot=arm).lags.effects
    assert set(effects) == {a, b, c, f"{b}-{c}"}
    assert found.lags.effects == "input_offset"


def test_an_effect_that_is_not_in_the_model_is_missing_at_its_joint_alone():
    q, torque = make_arm_log(effects={"pitch": [Cogging(0.3, 6.0)]}, duration=20.0, return_arrays=True)
    missing = identify_arm(q, torque, dt=DT, robot=ARM).missing
    assert missing["pitch"] > 0.02 > 0.01 > missing["yaw"]
    with_it = identify_arm(q, torque, dt=DT, robot=ARM, effects={"pitch": [Cogging(0.1, 6.0)]})
    assert with_it.missing["pitch"] < 0.005


def test_how_dry_friction_reverses_is_found_where_it_does_not_jump():
    arm = dataclasses.replace(drawn_arm(3, 7, slides=0.0, branch=0.0, gravity=(0, 0, -9.81)), effects=())
    q, torque = smooth_log(arm)
    q += 1e-5 * np.random.default_rng(0).standard_normal(q.shape)
    v, a = (np.column_stack([getattr(motion(x, RATE, 100.0), k) for x in q.T]) for k in ("velocity", "acceleration"))
    dry = 5.0 * np.where([False, True, False], np.tanh((v + 0.01 * a) / 0.15), np.sign(v))
    at_once, found = (identify_arm(q, torque + dry, dt=1.0 / RATE, robot=arm, **k) for k in ({"reversals": None}, {}))
    speed, lead = found.model.reversals["j1"]
    assert (speed, lead) == (pytest.approx(0.15, rel=0.15), pytest.approx(0.01, abs=0.001))
    assert found.missing["j1"] < 0.3 * at_once.missing["j1"]
    assert at_once.model.reversals == {}
    assert found.model.parameters["j1.coulomb"] == pytest.approx(5.0, rel=0.01)


@pytest.mark.parametrize(
    ("law", "hidden"),
    [
        ("coulomb", {"yaw": [Viscous(0.3)]}),  # a wide reversal looks like it
        ("viscous,coulomb", {"pitch": [PreslidingHysteresis(0.1, 0.05)]}),
        ("viscous,coulomb", {"pitch": [LoadFriction(0.05)]}),
    ],
)
def test_what_the_law_lacks_is_no_slow_reversal(law, hidden):
    q, torque = make_arm_log(ARM, hidden, return_arrays=True)
    found = reversals_of(
        records_of(RigidBodyLags(ARM, 1.0 / DT, law=law), q, torque, None), (Viscous(), LoadFriction())
    )
    joint = next(iter(hidden))
    assert found.get(joint, (0.0, 0.0)) == (pytest.approx(0.0, abs=0.03), pytest.approx(0.0, abs=0.003))


def test_a_curve_of_the_speed_is_no_slow_reversal():
    arm = dataclasses.replace(drawn_arm(3, 7, slides=0.0, branch=0.0, gravity=(0, 0, -9.81)), effects=())
    q, torque = smooth_log(arm)
    v = motion(q[:, 1], RATE, 100.0).velocity
    torque[:, 1] += 8.0 * np.sign(v) * np.sqrt(np.abs(v))  # grows ever more slowly
    torque += 0.01 * torque.std(axis=0) * np.random.default_rng(0).standard_normal(q.shape)
    assert reversals_of(records_of(RigidBodyLags(arm, RATE), q, torque)) == {}


def test_friction_that_reverses_after_the_velocity_is_no_reversal_of_a_solver():
    arm = dataclasses.replace(drawn_arm(3, 7, slides=0.0, branch=0.0, gravity=(0, 0, -9.81)), effects=())
    q, torque = smooth_log(arm)
    moved = motion(q[:, 1], RATE, 100.0)
    torque[:, 1] += 8.0 * np.tanh((moved.velocity - 0.01 * moved.acceleration) / 0.2)
    torque += 0.01 * torque.std(axis=0) * np.random.default_rng(0).standard_normal(q.shape)
    assert reversals_of(records_of(RigidBodyLags(arm, RATE), q, torque)) == {}


def test_nothing_is_nominal_where_the_file_names_no_mass(log):
    bare = dataclasses.replace(ARM, inertial=None)
    assert identify_arm(*(x[:5000] for x in log), dt=DT, robot=bare).nominal == {}


def test_weights_of_an_arm_and_the_arm_of_weights_are_inverse():
    lags = RigidBodyLags(ARM).fit(np.zeros((9, 2)))
    weights = lags.weights_of(ARM)
    again = lags.interpret(weights, 1e-8 * np.eye(len(weights)))
    np.testing.assert_allclose(lags.weights_of(again), weights, atol=1e-3)
    assert isinstance(again.effects[0][1], Coulomb)
    assert again.effects[0][1].torque == pytest.approx(0.3, rel=1e-3)


def test_what_is_nothing_but_rounding_is_zero():
    table = Arm.from_dh([(0.0, np.pi / 2, 0.25, 0.0), (0.0, 0.0, 0.0, 0.0)])
    table = table.with_body("joint2", 5.0, (0.0, 0.0, 0.0), 0.08 * np.eye(3))  # Ixx - Iyy is a number
    numbers = nominal_numbers(RigidBodyLags(table).fit(np.zeros((9, 2))))
    assert numbers["joint2.Izz"] == pytest.approx(0.08)
    assert [k for k, x in numbers.items() if 0.0 < abs(x) < 1e-9] == []


def test_experiments_are_filtered_on_their_own(log):
    other, drive = make_arm_log(duration=6.0, random_state=8, return_arrays=True)
    groups = np.repeat([0, 1], [len(log[0]), len(other)])
    found = identify_arm(np.vstack([log[0], other]), np.vstack([log[1], drive]), dt=DT, robot=ARM, groups=groups)
    assert max(found.missing.values()) < 0.02  # the jump between them is no motion


def test_an_arm_of_many_joints():
    arm = drawn_arm(12, 3, slides=0.0, branch=0.0, gravity=(0, 0, -9.81))
    arm = arm.with_effects({joint: (Viscous(0.5), Coulomb(0.5)) for joint in arm.joints})
    found = identify_arm(*smooth_log(arm, seconds=6.0), dt=1.0 / RATE, robot=arm)
    assert list(found.missing) == list(arm.joints)
    assert max(found.missing.values()) < 1e-3


def test_a_log_of_fewer_rows_than_numbers_is_refused_with_both():
    q, torque = make_arm_log(return_arrays=True)
    with pytest.raises(ValueError, match=r"0\.08 s gives \d+ rows for \d+ numbers"):
        identify_arm(q[:40], torque[:40], dt=0.002, robot=default_arm())


@pytest.mark.parametrize("grows", [0.0, 0.2])
def test_friction_that_surely_grows_only_while_it_is_taken_to_jump_is_taken_back(grows):
    arm = dataclasses.replace(drawn_arm(3, 7, slides=0.0, branch=0.0, gravity=(0, 0, -9.81)), effects=())
    q, torque = smooth_log(arm)
    v = np.column_stack([motion(x, RATE, 100.0).velocity for x in q.T])
    sign = np.tanh(v / 0.15)
    u = torque + (5.0 + grows * np.abs(torque)) * sign
    u += 0.01 * u.std(axis=0) * np.random.default_rng(0).standard_normal(u.shape)
    effects = {j: (InputOffset(), *((LoadFriction(),) if j == "j1" else ())) for j in arm.joints}
    lags = RigidBodyLags(arm, RATE, effects=effects, reversals=dict.fromkeys(arm.joints, (0.15, 0.0)))
    assert unsure(records_of(lags, q, u), effects) == ([] if grows else ["j1"])


def test_numbers_that_act_on_no_drive_of_the_record_are_told():
    q, torque = make_arm_log(duration=12.0, return_arrays=True)
    q[:, 0] = q[0, 0]
    with pytest.warns(UserWarning, match="yaw does not move"):
        resting = identify_arm(q, torque, dt=0.002, robot=default_arm())
    assert {"yaw.viscous", "yaw.coulomb", "yaw.input_offset"} <= set(resting.untold)
    assert not any(name.startswith("pitch.") and name.split(".")[1] in ("mx", "viscous") for name in resting.untold)
    table = numbers_table(document(resting, stated=True)).splitlines()
    assert next(line for line in table if line.startswith("yaw.coulomb")).split()[1:3] == ["-", "-"]
