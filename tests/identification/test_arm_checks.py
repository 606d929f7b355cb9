"""What looks wrong in an arm's log: the order of its columns, their units, gains and signs."""

from __future__ import annotations

import dataclasses
import re
from functools import cache

import numpy as np
import pytest

from tests.lags.test_rigid_body import RATE, smooth_log
from tests.systems.drawn_arms import drawn_arm
from whsklearn.datasets import default_arm, make_arm_log
from whsklearn.effects import CableSpring, Cogging, Coulomb, EndStop, Viscous
from whsklearn.filtering import motion
from whsklearn.identification import arm_checks
from whsklearn.identification.arm_checks import in_another_order, in_another_scale, suspicions
from whsklearn.identification.joint_least_squares import fitted
from whsklearn.lags import RigidBodyLags
from whsklearn.lags.arm_rows import records_of
from whsklearn.systems.arm import Arm

DT = 0.002
ARM = default_arm()
SIX = drawn_arm(6, 3, slides=0.0, branch=0.0, gravity=(0, 0, -9.81))
SIX = SIX.with_effects({joint: (Viscous(0.5), Coulomb(0.5)) for joint in SIX.joints})
BARE = dataclasses.replace(SIX, inertial=None)


@cache
def sound():
    """The positions and drives of an arm as it should be."""
    return make_arm_log(duration=20.0, return_arrays=True)


@cache
def of_six_joints():
    """The positions and drives of six joints."""
    return smooth_log(SIX)


def told(q, torque, robot=ARM):
    rows = records_of(RigidBodyLags(robot, 1 / DT), q, torque)
    return [*suspicions(rows), *in_another_scale(rows)]


def test_joints_that_all_move_along_one_line_are_told():
    phase = np.linspace(0.0, 20.0, 4000)
    one = np.column_stack([np.sin(phase), 0.3 - 0.5 * np.sin(phase)])
    bare, drive = dataclasses.replace(ARM, inertial=None), np.random.default_rng(0).standard_normal(one.shape)
    assert ["one line" in text for text in told(one, drive, bare)] == [True]
    assert not told(np.column_stack([np.sin(phase), np.sin(phase + 0.3)]), drive, bare)


@pytest.mark.parametrize(
    ("angles", "drives", "said"),
    [
        (np.rad2deg(1.0), 1.0, "The travel of yaw, pitch exceeds two turns"),
        (1.0, 1e3, "currents in mA"),
    ],
)
def test_what_looks_wrong_is_told_in_a_sentence(angles, drives, said):
    q, torque = sound()
    assert any(said in text for text in told(angles * q, drives * torque))


def test_a_log_as_it_should_be_raises_no_suspicion():
    assert told(*sound()) == []
    assert order_told(*sound()) == []


def order_told(q, torque):
    return in_another_order(records_of(RigidBodyLags(ARM, 1 / DT), q, torque))


def test_joints_in_another_order_are_told_by_what_is_left_of_their_drives():
    told = "if the {} given for yaw, pitch are those of pitch, yaw, in this order"
    q, torque = sound()
    assert told.format("drives") in order_told(q, torque[:, ::-1])[0]
    assert told.format("positions") in order_told(q[:, ::-1], torque)[0]
    assert told.format("columns") in order_told(q[:, ::-1], torque[:, ::-1])[0]
    assert told.format("columns") in order_told(q[:, ::-1], 1e5 * torque[:, ::-1])[0]  # in counts


def test_a_spring_at_a_vertical_joint_is_no_other_order_of_the_joints():
    """It looks like the weight of the next link, whose own columns explain its drive where it is."""
    q, u = make_arm_log(ARM, effects={"yaw": [CableSpring(10.0)]}, return_arrays=True)
    assert order_told(q, u) == []


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


def test_drives_that_are_mostly_friction_keep_the_order_with_which_the_search_judged(monkeypatch):
    order, ordered = [0, 2, 1, 3, 4, 5], arm_checks._ordered

    def confused(*rows):  # wrists whose drives hardly depend on the position look alike
        drives, left = ordered(*rows)
        return drives[[0, 1, 2, 4, 5, 3]], left

    monkeypatch.setattr(arm_checks, "_ordered", confused)
    moved, asked = of_six_joints()
    said = in_another_order(records_of(RigidBodyLags(SIX, RATE), moved[:, order], asked[:, order]))
    assert "if the columns given for j1, j2 are those of j2, j1, in this order" in said[0]


def test_the_search_for_an_order_ends_after_so_many_numbers(monkeypatch):
    arm, asked, columns = drawn_arm(7, 3, slides=0.0, branch=0.0, gravity=(0, 0, -9.81)), [], RigidBodyLags.columns
    q, u = smooth_log(arm, seconds=6.0)
    rows = records_of(RigidBodyLags(arm, RATE), q, u + u.std(axis=0) * np.sin(np.arange(len(u)) / 40)[:, None])
    monkeypatch.setattr(arm_checks, "TRIED", 10 * len(rows.lags.base_.names))
    monkeypatch.setattr(RigidBodyLags, "columns", lambda *args: asked.append(args) or columns(*args))
    in_another_order(rows)
    assert 5 < len(asked) < 20


@pytest.mark.parametrize("order", [[0, 1], [1, 0]])
def test_what_is_left_of_a_drive_is_a_share_of_the_same_power_in_any_order(order):
    """Of joints that move one after the other, the drive of one is large while the other moves."""
    rng, first = np.random.default_rng(0), np.arange(200) < 100
    drive = rng.standard_normal((200, 2)) * np.where(first[:, None], [1.0, 3.0], [20.0, 2.0])
    nothing, keep = np.zeros((200, 2, 1)), np.column_stack([first, ~first])
    left = arm_checks._left(nothing, drive[:, order], keep) * drive[:, order].var(axis=0)
    np.testing.assert_allclose(left, [np.mean(drive[first, order[0]] ** 2), np.mean(drive[~first, order[1]] ** 2)])


@pytest.mark.parametrize("joint", ARM.joints)
def test_a_large_effect_at_one_joint_is_no_other_order(joint):
    q, torque = make_arm_log(effects={joint: [CableSpring(1.0), Cogging(0.5, 3.0)]}, duration=12.0, return_arrays=True)
    assert order_told(q, torque) == []


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


def of_six(robot, *factors, q=None, u=None):
    """What is told if the drives of joints are multiplied by factors, given as (joint, factor)."""
    moved, asked = of_six_joints()
    q, u = moved if q is None else q, asked if u is None else u
    u = u + 0.01 * u.std(axis=0) * np.random.default_rng(0).standard_normal(u.shape)
    for joint, factor in factors:
        u[:, joint] *= factor
    return in_another_scale(records_of(RigidBodyLags(robot, RATE), q, u))


@pytest.mark.parametrize("robot", [SIX, BARE])
@pytest.mark.parametrize(("joint", "factor"), [(1, 2.0), (1, -1.0), (2, 0.5), (0, 1e3)])
def test_a_wrong_gain_is_told_by_what_it_leaves_at_the_neighbours_whatever_the_masses(robot, joint, factor):
    (said,) = of_six(robot, (joint, factor))
    assert said.startswith(f"The drives fit far better if that of j{joint} is divided by ")
    value, error = map(float, re.search(r"by (\S+) \+- ([^;\s]+)", said).groups())
    assert abs(value - factor) < 4.0 * error < 0.2 * abs(factor)


def test_two_wrong_gains_are_told_one_after_the_other():
    said = " ".join(of_six(BARE, (0, 3.0), (2, 0.5)))
    factors = {joint: float(x) for joint, x in re.findall(r"that of (j\d) is divided by (\S+)", said)}
    assert factors == {"j0": pytest.approx(3.0, rel=0.05), "j2": pytest.approx(0.5, rel=0.05)}


def test_one_gain_that_is_wrong_for_all_is_told_by_the_masses_given():
    (said,) = of_six(SIX, *((j, 2.0) for j in range(6)))
    assert "times what the masses given require" in said
    assert len(re.findall(r"j\d is (2|2\.0\d*|1\.99\d*) \+- ", said)) >= 4
    assert of_six(BARE, *((j, 2.0) for j in range(6))) == []


def test_a_load_or_masses_that_are_wrong_are_no_wrong_gain():
    for mass in (3.0, 8.0):
        loaded = SIX.with_body("j5", mass, (0.0, 0.0, 0.4))
        assert of_six(SIX, u=smooth_log(loaded)[1]) == []
    share = np.exp(0.3 * np.random.default_rng(1).standard_normal((6, 1)))
    assert of_six(dataclasses.replace(SIX, inertial=SIX.inertial * share)) == []


def test_a_stop_at_a_joint_is_no_wrong_gain_of_the_next():
    q, torque = make_arm_log(effects={"yaw": [EndStop(50.0, 0.3)]}, duration=12.0, random_state=8, return_arrays=True)
    assert told(q, torque) == []


def test_an_effect_that_the_model_lacks_is_no_wrong_gain():
    assert told(*make_arm_log(effects={"pitch": [Cogging(0.1, order=7.0)]}, return_arrays=True)) == []


CRANE = """<mujoco><worldbody><body><joint name="swing" axis="0 0 1" damping="1.5" frictionloss="2"/>
<geom type="cylinder" size=".08 .12" mass="6"/><body pos=".05 0 .12">
<joint name="luff" axis="0 1 0" damping="1.1" frictionloss="1.4"/><geom type="capsule" fromto="0 0 0 .45 0 0"
size=".035" mass="3.2"/><body pos=".45 0 0"><joint name="crowd" axis="0 1 0" damping=".5" frictionloss=".6"/>
<geom type="capsule" fromto="0 0 0 .3 0 -.05" size=".025" mass="1.3"/></body></body></body></worldbody></mujoco>"""


def test_masses_that_explain_a_drive_refute_another_gain_of_it(tmp_path):
    """Half of what a spring at an elbow needs is explained by a shoulder of a third of the drive."""
    (tmp_path / "crane.xml").write_text(CRANE)
    robot, t = Arm.from_file(tmp_path / "crane.xml"), np.arange(6000) / RATE
    rng, waves = np.random.default_rng(3), [(0.7, 0.13), (0.45, 0.31), (0.28, 0.57), (0.16, 0.94), (0.08, 1.6)]
    path = [
        sum(s * a * np.sin(2 * np.pi * f * (1 + 0.1 * j) * t + rng.uniform(0, 6.28)) for a, f in waves)
        for j, s in enumerate((0.8, 0.45, 0.6))
    ]
    settings = {
        "reference": np.column_stack(path) + np.array([0.0, -0.5, 0.8]),
        "random_state": 3,
        "return_arrays": True,
    }
    q, u = make_arm_log(robot, {"crowd": [CableSpring(8.0, 0.6)]}, **settings)
    assert in_another_scale(records_of(RigidBodyLags(robot, RATE), q, u)) == []
    u[:, 1] *= 0.3  # and one that is wrong is told beside it
    assert "luff" in in_another_scale(records_of(RigidBodyLags(robot, RATE), q, u))[0]


@pytest.mark.parametrize("joint", ARM.joints)
def test_a_multiple_of_the_drive_that_another_record_asks_for_is_a_gain_and_grown_friction_is_none(joint):
    def seen(arm=ARM, factor=1.0, **settings):
        q, u = make_arm_log(arm, duration=12.0, return_arrays=True, **settings)
        u[:, ARM.index(joint)] *= factor
        return records_of(RigidBodyLags(ARM, 1 / DT, law="viscous,coulomb"), q, u)

    before = seen()
    known = fitted(before.phi, before.target, before.keep, before.weights)[0]
    assert in_another_scale(seen(random_state=1), known=known) == []
    assert in_another_scale(seen(ARM.with_effects({joint: Viscous(0.2)}), random_state=1), known=known) == []
    (said,) = in_another_scale(seen(factor=1.2, random_state=1), known=known)
    assert f"The drive of {joint} is 1.20 times what the model given requires" in said


def test_friction_that_drives_tells_a_wrong_sign_where_nothing_else_does():
    arm = drawn_arm(1, 3, slides=0.0, branch=0.0).with_effects({"j0": (Viscous(2.0), Coulomb(5.0))})
    q, u = smooth_log(arm)
    bare = dataclasses.replace(arm, inertial=None)
    assert of_six(bare, q=q, u=u) == []
    assert "friction drives j0 where it should brake" in of_six(bare, q=q, u=-u)[0]
