"""An arm identified from its log: numbers within their intervals, errors per joint, and what looks wrong."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from tests.lags.test_rigid_body import RATE, smooth_log
from tests.systems.drawn_arms import drawn_arm
from whsklearn.cli.arm import document, numbers_table
from whsklearn.datasets import default_arm, make_arm_log
from whsklearn.effects import CableSpring, Cogging, Coulomb, InputOffset, LoadFriction, PreslidingHysteresis, Viscous
from whsklearn.filtering import motion
from whsklearn.identification import arm_fit, identify_arm
from whsklearn.identification.arm_fit import block_covariance, in_another_order, reversals_of, suspicions, unsure
from whsklearn.lags import RigidBodyLags
from whsklearn.lags.arm_rows import records_of

DT = 0.002
ARM = default_arm()
Q, TORQUE = make_arm_log(duration=20.0, return_arrays=True)


@pytest.fixture(scope="module")
def found():
    return identify_arm(Q, TORQUE, dt=DT, robot=ARM)


def test_numbers_are_those_of_the_arm(found):
    truth, errors = found.nominal, found.model.standard_errors
    assert set(truth) == set(found.model.parameters)
    away = [(v - truth[k]) / max(errors[k], 0.01 * abs(truth[k])) for k, v in found.model.parameters.items()]
    assert np.sqrt(np.mean(np.square(away))) < 2.5


def test_coupled_it_misses_little_and_one_axis_at_a_time_much(found):
    assert list(found.missing) == ["yaw", "pitch"]
    assert max(found.missing.values()) < 0.02
    assert min(found.alone.values()) > 3.0 * max(found.missing.values())


def test_the_model_is_physical_and_gives_the_drives(found):
    arm = found.model.arm
    assert (arm.inertial[:, 0] > 0).all()
    assert [e.name for e in arm.effects[0]] == ["viscous", "coulomb", "input_offset"]
    phi, target, keep = found.lags.joint_rows(Q, TORQUE)
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


def test_intervals_hold_the_spread_of_numbers_whose_errors_last():
    rng = np.random.default_rng(0)
    x = rng.standard_normal((2000, 2))
    x[:, 1] = np.repeat(rng.standard_normal(40), 50)  # slow, as the errors are
    found, wide = [], []
    for _ in range(40):
        error = np.repeat(rng.standard_normal(40), 50)
        theta = np.linalg.lstsq(x, error, rcond=None)[0]
        left = error - x @ theta
        white = left @ left / 1998 * np.linalg.inv(x.T @ x)
        found.append(theta)
        wide.append(np.sqrt(np.diag(block_covariance(x, left, np.arange(2000) // 100, white))))
        assert np.all(wide[-1] >= 0.999 * np.sqrt(np.diag(white)))
    assert np.std(found, axis=0)[1] > 5.0 * np.sqrt(white[1, 1])  # as white they would be far too sure
    np.testing.assert_allclose(np.mean(wide, axis=0), np.std(found, axis=0), rtol=0.4)


def test_joints_that_all_move_along_one_line_are_told():
    phase = np.linspace(0.0, 20.0, 4000)
    one = np.column_stack([np.sin(phase), 0.3 - 0.5 * np.sin(phase)])
    assert ["one line" in text for text in suspicions(ARM, one, np.ones_like(one))] == [True]
    assert not suspicions(ARM, np.column_stack([np.sin(phase), np.sin(phase + 0.3)]), np.ones_like(one))


def test_nothing_is_nominal_where_the_file_names_no_mass(found):
    bare = dataclasses.replace(ARM, inertial=None)
    assert identify_arm(Q[:5000], TORQUE[:5000], dt=DT, robot=bare).nominal == {}


def test_weights_of_an_arm_and_the_arm_of_weights_are_inverse():
    lags = RigidBodyLags(ARM).fit(np.zeros((9, 2)))
    weights = lags.weights_of(ARM)
    again = lags.interpret(weights, 1e-8 * np.eye(len(weights)))
    np.testing.assert_allclose(lags.weights_of(again), weights, atol=1e-3)
    assert isinstance(again.effects[0][1], Coulomb)
    assert again.effects[0][1].torque == pytest.approx(0.3, rel=1e-3)


@pytest.mark.parametrize(
    ("q", "torque", "said"),
    [
        (np.rad2deg(Q), TORQUE, "The travel of yaw, pitch exceeds two turns"),
        (Q, 1e3 * TORQUE, "currents in mA"),
    ],
)
def test_what_looks_wrong_is_told_in_a_sentence(q, torque, said):
    assert any(said in text for text in suspicions(ARM, q, torque))


def test_experiments_are_filtered_on_their_own():
    other, drive = make_arm_log(duration=6.0, random_state=8, return_arrays=True)
    groups = np.repeat([0, 1], [len(Q), len(other)])
    found = identify_arm(np.vstack([Q, other]), np.vstack([TORQUE, drive]), dt=DT, robot=ARM, groups=groups)
    assert max(found.missing.values()) < 0.02  # the jump between them is no motion


def test_a_log_as_it_should_be_raises_no_suspicion():
    assert suspicions(ARM, Q, TORQUE) == []
    assert order_told(Q, TORQUE) == []


def order_told(q, torque):
    return in_another_order(records_of(RigidBodyLags(ARM, 1 / DT), q, torque))


def test_joints_in_another_order_are_told_by_what_is_left_of_their_drives():
    told = "if the {} given for yaw, pitch are those of pitch, yaw, in this order"
    assert told.format("drives") in order_told(Q, TORQUE[:, ::-1])[0]
    assert told.format("positions") in order_told(Q[:, ::-1], TORQUE)[0]
    assert told.format("columns") in order_told(Q[:, ::-1], TORQUE[:, ::-1])[0]
    assert told.format("columns") in order_told(Q[:, ::-1], 1e5 * TORQUE[:, ::-1])[0]  # in counts


@pytest.mark.parametrize("what", ["columns", "positions"])
@pytest.mark.parametrize("order", [[2, 3, 4, 5, 0, 1], [1, 2, 0, 3, 4, 5], [3, 0, 5, 1, 2, 4]])
def test_any_order_of_six_joints_is_told(order, what):
    arm = drawn_arm(6, 3, slides=0.0, branch=0.0, gravity=(0, 0, -9.81))
    q, u = smooth_log(arm, seconds=20.0)
    u += 0.02 * u.std(axis=0) * np.random.default_rng(0).standard_normal(u.shape)
    lags, moved = RigidBodyLags(arm, RATE), [k for k in range(6) if order[k] != k]
    said = in_another_order(records_of(lags, q[:, order], u[:, order] if what == "columns" else u))
    given, owner = (", ".join(f"j{k}" for k in which) for which in (moved, [order[k] for k in moved]))
    assert f"if the {what} given for {given} are those of {owner}, in this order" in said[0]


@pytest.mark.parametrize("seed", [3, 5])
def test_two_exchanged_joints_are_told_beside_a_third_whose_drive_is_half_noise(seed):
    arm = drawn_arm(3, seed, slides=0.0, branch=0.0, gravity=(0, 0, -9.81))
    size = smooth_log(arm, seconds=6.0)[1].std(axis=0)
    arm = arm.with_effects({j: (Viscous(float(x)),) for j, x in zip(arm.joints, size, strict=True)})
    q, u = smooth_log(arm, seconds=6.0)
    noise = np.convolve(np.random.default_rng(0).standard_normal(len(u)), np.ones(40) / 40**0.5, "same")
    u[:, 2] += u[:, 2].std() * noise
    lags = RigidBodyLags(arm, RATE)
    for order, told in (([0, 1, 2], 0), ([1, 0, 2], 1)):
        assert len(in_another_order(records_of(lags, q[:, order], u[:, order]))) == told


def test_orders_of_many_joints_are_compared_at_some_instants_only(monkeypatch):
    arm = drawn_arm(7, 3, slides=0.0, branch=0.0, gravity=(0, 0, -9.81))
    q, u = smooth_log(arm, seconds=6.0)
    noisy = u + 0.3 * u.std(axis=0) * np.random.default_rng(0).standard_normal(u.shape).cumsum(axis=0) / len(u) ** 0.5
    lags, rows = RigidBodyLags(arm, RATE), RigidBodyLags.joint_rows
    other = np.array([0, 4, 2, 3, 1, 5, 6])
    asked = []
    monkeypatch.setattr(RigidBodyLags, "joint_rows", lambda *args: asked.append(args) or rows(*args))
    assert in_another_order(records_of(lags, q, noisy)) == []
    assert len(asked) <= 1  # of 21 exchanges, the one that leaves least at some instants is tried on all rows
    said = in_another_order(records_of(lags, q[:, other], u[:, other]))[0]
    assert "the columns given for j1, j4 are those of j4, j1" in said


@pytest.mark.parametrize(("seed", "pair", "sure"), [(7, [1, 2], False), (4, [4, 5], False), (7, [4, 5], True)])
def test_where_joints_move_along_one_line_no_wrong_order_is_told_as_sure(seed, pair, sure):
    arm = drawn_arm(6, seed, slides=0.0, branch=0.0, gravity=(0, 0, -9.81))
    arm = arm.with_effects({j: (Viscous(0.5), Coulomb(0.5)) for j in arm.joints})
    t, rng = np.arange(20 * RATE)[:, None] / RATE, np.random.default_rng(seed)
    size = rng.uniform(0.2, 0.6, 6) * rng.choice([-1, 1], 6)
    q = size * np.sin(2 * np.pi * (0.1 * t + 0.02 * t**2)) + 0.005 * np.sin(t * rng.uniform(1, 3, 6))
    moved = [motion(x, RATE, 50.0) for x in q.T]
    u = arm.inverse_dynamics(q, np.column_stack([m[1] for m in moved]), np.column_stack([m[2] for m in moved]))
    u += 0.02 * u.std(axis=0) * rng.standard_normal(u.shape)
    order = np.arange(6)
    order[pair] = pair[::-1]
    said = in_another_order(records_of(RigidBodyLags(arm, RATE), q[:, order], u[:, order]))[0]
    given, owner = (", ".join(f"j{k}" for k in which) for which in (pair, pair[::-1]))
    assert ("others fit about as well" in said) != sure
    assert not sure or f"if the columns given for {given} are those of {owner}, in this order" in said


def test_the_search_for_an_order_ends_after_so_many_numbers(monkeypatch):
    arm, asked, columns = drawn_arm(7, 3, slides=0.0, branch=0.0, gravity=(0, 0, -9.81)), [], RigidBodyLags.columns
    q, u = smooth_log(arm, seconds=6.0)
    rows = records_of(RigidBodyLags(arm, RATE), q, u + u.std(axis=0) * np.sin(np.arange(len(u)) / 40)[:, None])
    monkeypatch.setattr(arm_fit, "TRIED", 10 * len(rows.lags.base_.names))
    monkeypatch.setattr(RigidBodyLags, "columns", lambda *args: asked.append(args) or columns(*args))
    in_another_order(rows)
    assert 5 < len(asked) < 20


@pytest.mark.parametrize("joint", ARM.joints)
def test_a_large_effect_at_one_joint_is_no_other_order(joint):
    q, torque = make_arm_log(effects={joint: [CableSpring(1.0), Cogging(0.5, 3.0)]}, duration=12.0, return_arrays=True)
    assert order_told(q, torque) == []


@pytest.mark.parametrize("n", [7, 20])
def test_arms_of_many_joints(n):
    arm = drawn_arm(n, 3, slides=0.0, branch=0.0, gravity=(0, 0, -9.81))
    arm = arm.with_effects({joint: (Viscous(0.5), Coulomb(0.5)) for joint in arm.joints})
    found = identify_arm(*smooth_log(arm, seconds=8.0), dt=1.0 / RATE, robot=arm)
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


@pytest.mark.parametrize(("seed", "pair", "unit"), [(3, [2, 0], 2.2), (7, [0, 1], 1.9)])
def test_an_exchange_is_told_where_one_drive_is_in_a_unit_of_its_own(seed, pair, unit):
    arm = drawn_arm(3, seed, slides=0.0, branch=0.0, gravity=(0, 0, -9.81))
    q, u = smooth_log(arm, seconds=6.0)
    u[:, pair[0]] /= unit  # so no order is right for the numbers that the joints share, and one joint gains little
    lags, order = RigidBodyLags(arm, RATE), np.arange(3)
    assert in_another_order(records_of(lags, q, u)) == []
    order[pair] = pair[::-1]
    said = in_another_order(records_of(lags, q[:, order], u[:, order]))[0]
    low, high = sorted(pair)
    assert f"the columns given for j{low}, j{high} are those of j{high}, j{low}" in said


def test_numbers_that_act_on_no_drive_of_the_record_are_told():
    q, torque = make_arm_log(duration=12.0, return_arrays=True)
    q[:, 0] = q[0, 0]
    with pytest.warns(UserWarning, match="yaw does not move"):
        resting = identify_arm(q, torque, dt=0.002, robot=default_arm())
    assert {"yaw.viscous", "yaw.coulomb", "yaw.input_offset"} <= set(resting.untold)
    assert not any(name.startswith("pitch.") and name.split(".")[1] in ("mx", "viscous") for name in resting.untold)
    table = numbers_table(document(resting, stated=True)).splitlines()
    assert next(line for line in table if line.startswith("yaw.coulomb")).split()[1:3] == ["-", "-"]
