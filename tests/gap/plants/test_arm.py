"""The gap of an arm: what is hidden at a joint is named there, and nothing else."""

from __future__ import annotations

import dataclasses
import json
import re
from types import SimpleNamespace

import numpy as np
import pytest

from tests.lags.test_rigid_body import RATE, smooth_log
from tests.systems.drawn_arms import drawn_arm
from whsklearn.datasets import default_arm, make_arm_log
from whsklearn.effects import (
    CableSpring,
    Cogging,
    ContactStop,
    Coulomb,
    DeadZone,
    FlexibleCoupling,
    HardeningSpring,
    LoadFriction,
    PreslidingHysteresis,
    Saturation,
    Stribeck,
    Viscous,
)
from whsklearn.gap import GapFinder
from whsklearn.gap.plants.arm import ArmPlant, ArmRecord, arm_plant, record_of
from whsklearn.gap.plants.arm_families import families
from whsklearn.gap.plants.arm_terms import JointTerm, Load, candidates, present
from whsklearn.gap.standard_errors import p_of_zero
from whsklearn.identification import identify_arm
from whsklearn.models import load_model, save_model
from whsklearn.systems.arm import Arm

pytestmark = pytest.mark.usefixtures("library_effects")

ARM = default_arm()


def record(effects=None, robot=ARM, duration=10.0, **settings):
    q, u = make_arm_log(robot, effects, duration=duration, return_arrays=True, **settings)
    return ArmRecord(np.arange(len(q)) / 500.0, q, u)


def lacking(joint, name):
    """The arm without one effect of its law."""
    rows = [
        tuple(e for e in row if (j, e.name) != (joint, name)) for j, row in zip(ARM.joints, ARM.effects, strict=True)
    ]
    return dataclasses.replace(ARM, effects=rows)


def with_play(gap, hertz=60.0, seconds=20.0):
    """A rod that hangs from a motor of half its inertia; ``gap`` lies between them, behind it a third of the friction.

    The motor's path is given, so that the contact alone moves the rod.
    """
    t, steps = np.arange(0.0, seconds, 0.002), 20
    fine = np.arange(len(t) * steps) * 0.002 / steps
    waves = [(0.5, 2.1, 0.3), (0.3, 4.3, 1.1), (0.1, 9.7, 2.0)]
    path, rate, gain = (sum(a * w**k * np.sin(w * fine + p + k * np.pi / 2) for a, w, p in waves) for k in range(3))
    inertia, motor, dry = 1 / 3, 1 / 6, 0.3
    reduced = inertia * motor / (inertia + motor)
    k, c = reduced * (2 * np.pi * hertz) ** 2, 0.8 * reduced * 2 * np.pi * hertz
    q, v, push = path[0] - gap / 2, rate[0], np.zeros(fine.size)
    for i in range(fine.size):
        twist, h = path[i] - q, 0.002 / steps
        over = np.sign(twist) * max(abs(twist) - gap / 2, 0.0)
        force = k * over + c * (rate[i] - v)
        push[i] = force if force * over > 0.0 else 0.0
        v += h * (push[i] - 4.905 * np.sin(q)) / inertia
        v = np.sign(v) * max(abs(v) - h * dry / inertia, 0.0)
        q += h * v
    drive = push + motor * gain + 2 * dry * np.sign(rate)
    noise = np.random.default_rng(0).normal(0.0, 1e-5, t.size)
    return t, (path[::steps] + noise)[:, None], drive.reshape(-1, steps).mean(axis=1)[:, None]


@pytest.mark.slow
def test_a_play_between_a_motor_and_its_link_is_named_with_its_width():
    rod = [1.0, 0, 0, -0.5, 1 / 3, 0, 1 / 3, 0, 0, 0]
    arm = Arm(["hinge"], [-1], [False], [np.eye(3)], [[0, 0, 0]], [[0, 1, 0]], inertial=[rod])
    t, q, u = with_play(0.0)
    known = identify_arm(q, u, dt=0.002, robot=arm).model
    assert names(GapFinder(known).fit((t, q, u))) == []
    finder = GapFinder(known).fit(with_play(0.012))
    assert (names(finder), finder.verdict_) == (["backlash at hinge"], "named")
    found = finder.effects_[0].parameters
    assert found["gap_rad"] == pytest.approx(0.012, rel=0.1)
    assert found["load_share"] == pytest.approx(2 / 3, rel=0.02)
    assert found["load_coulomb_nm"] == pytest.approx(0.3, rel=0.1)
    repaired = finder.model_.arm
    assert [e.name for e in repaired.effects[0]].count("backlash") == 1
    assert repaired.armature[0] == pytest.approx(1 / 6, rel=0.05)
    assert repaired.mass_matrix([[0.0]])[0, 0, 0] == pytest.approx(1 / 2, rel=0.02)
    before, after = (max(h[k] for h in finder.diagnosis_.horizons) for k in ("before", "after"))
    assert after < 0.25 * before, "the repaired arm itself runs free, with its play"
    assert GapFinder(finder.model_).fit((t, *with_play(0.012)[1:])).verdict_ == "no_gap", "the play is known now"


def names(finder):
    return [e.label for e in finder.effects_]


@pytest.fixture(scope="module")
def empty():
    """The arm identified from a log in which nothing is hidden."""
    return identify_arm(*make_arm_log(return_arrays=True), dt=0.002, robot=ARM)


@pytest.mark.parametrize(
    ("joint", "effect", "seconds"),
    [
        ("pitch", Cogging(0.1, order=7.0), 12.0),
        ("pitch", LoadFriction(0.08), 12.0),
        ("yaw", Stribeck(0.2, 0.2), 20.0),
        ("yaw", CableSpring(1.0), 12.0),
    ],
)
def test_an_effect_is_named_at_its_joint(joint, effect, seconds):
    found = GapFinder(ARM).fit(record({joint: [effect]}, duration=seconds))
    assert found.verdict_ == "named"
    assert names(found) == [f"{effect.name} at {joint}"]
    assert found.effects_[0].effect.magnitude == pytest.approx(effect.magnitude, rel=0.1)
    assert found.diagnosis_.closure > 0.95


@pytest.mark.parametrize("joint", ARM.joints)
@pytest.mark.parametrize("name", ["viscous", "coulomb"])
def test_friction_that_the_base_law_lacks_is_named(joint, name):
    found = GapFinder(lacking(joint, name)).fit(record())
    assert names(found) == [f"{name} at {joint}"]


def test_gravity_is_named_where_the_file_has_none():
    found = GapFinder(dataclasses.replace(ARM, gravity=(0.0, 0.0, 0.0))).fit(record())
    assert names(found) == ["gravity"]
    missing = next(r["missing"] for r in found.diagnosis_.joints if r["name"] == "pitch")
    assert missing["before"] > 10 * missing["after"]


@pytest.mark.slow
def test_an_arm_of_seven_joints():
    arm = drawn_arm(7, 3, slides=0.0, branch=0.0, gravity=(0, 0, -9.81))
    arm = arm.with_effects({joint: (Viscous(0.5), Coulomb(0.5)) for joint in arm.joints})
    size = 0.1 * float(np.std(smooth_log(arm, seconds=12.0)[1][:, 4]))
    q, u = smooth_log(arm.with_effects({"j4": Cogging(size, 9.0)}), seconds=12.0)
    rng = np.random.default_rng(0)
    q, u = q + 1e-6 * rng.standard_normal(q.shape), u + 0.01 * u.std(axis=0) * rng.standard_normal(u.shape)
    found = GapFinder(arm).fit(ArmRecord(np.arange(len(q)) / RATE, q, u))
    assert found.verdict_ == "named"
    assert names(found) == ["cogging at j4"]


@pytest.mark.slow
def test_friction_that_all_joints_lack_is_named_at_each():
    arm = drawn_arm(4, 3, slides=0.0, branch=0.0, gravity=(0, 0, -9.81))
    arm = arm.with_effects({joint: Viscous(0.5) for joint in arm.joints})
    q, u = smooth_log(arm.with_effects({joint: Coulomb(2.0) for joint in arm.joints}), seconds=12.0)
    rng = np.random.default_rng(0)
    q, u = q + 1e-6 * rng.standard_normal(q.shape), u + 0.01 * u.std(axis=0) * rng.standard_normal(u.shape)
    found = GapFinder(arm).fit(ArmRecord(np.arange(len(q)) / RATE, q, u))
    assert found.verdict_ == "named"
    assert sorted(names(found)) == [f"coulomb at {joint}" for joint in arm.joints]
    assert [e.effect.torque for e in found.effects_] == pytest.approx([2.0] * 4, rel=0.1)


def test_a_strong_slow_effect_does_not_hide_in_null_records_of_its_own_colour():
    law = {f"j{k}": (Viscous(0.5), Coulomb(0.5)) for k in range(3)}
    arm = drawn_arm(3, 5, slides=0.0, branch=0.0, gravity=(0, 0, -9.81)).with_effects(law)
    q, u = smooth_log(arm, seconds=8.0)
    v = np.gradient(q, 1.0 / RATE, axis=0)
    u[:, 1:] += u[:, 2].std() / v.std() * (v[:, 1:2] + v[:, 2:])  # a gear turned by both joints
    rng = np.random.default_rng(0)
    q, u = q + 1e-6 * rng.standard_normal(q.shape), u + 0.01 * u.std(axis=0) * rng.standard_normal(u.shape)
    plant = arm_plant(arm, ArmRecord(np.arange(len(q)) / RATE, q, u), law=None, tolerance=0.004)
    plant.check()
    first = next(k for k in plant.looks(plant.base(rng), rng) if k.name)
    assert first.name == "viscous at j1+j2"
    assert first.p_value < 1e-20
    # to be compared with other families it keeps the null records that all share
    family = next(f for f in families(plant.view, [first.start.kind]))
    np.testing.assert_allclose(first.null, plant.tangent.look(family).null)


def test_two_joints_have_a_name_each():
    found = GapFinder(ARM).fit(record({"yaw": [CableSpring(0.5, 0.15)], "pitch": [Cogging(0.1, order=7.0)]}))
    assert set(names(found)) == {"cable_spring at yaw", "cogging at pitch"}
    (spring,) = (e.effect for e in found.effects_ if e.name == "cable_spring")
    assert spring.centre == pytest.approx(0.15, abs=2e-3)  # an offset in its place had been left in the base
    assert not any(e.aliases for e in found.effects_)


@pytest.mark.parametrize("seed", range(2))
def test_nothing_is_named_where_nothing_is_missing(seed):
    found = GapFinder(ARM).fit(record(random_state=seed))
    assert found.verdict_ == "no_gap"


def test_a_load_is_named_against_the_numbers_without_it(empty):
    loaded = record(robot=ARM.with_body("pitch", 0.3, (0.15, 0.0, 0.02)), random_state=3)
    found = GapFinder(empty.model, max_effects=1).fit(loaded)
    assert names(found)[0] == "payload at pitch"
    assert found.effects_[0].effect.mass == pytest.approx(0.3, rel=0.15)
    told = re.match(r"Of the rms drive of (\w+)", found.diagnosis_.sentence)[1]
    assert found.diagnosis_.pictures["output"] == f"position of {told}"
    assert GapFinder(empty.model).fit(record(random_state=3)).verdict_ == "no_gap"


def test_the_place_of_a_heavy_load_is_not_bent_by_ages_that_stand_for_it(empty):
    """Without the load the ages of the drives go to their limits, and from there its place came out 20 errors off."""
    place = (0.3, -0.15, 0.1)
    finder = GapFinder(empty.model, max_effects=1)
    found = finder.fit(record(robot=ARM.with_body("pitch", 3.0, place), random_state=3)).effects_[0]
    for (label, value), true in zip(found.parameters.items(), (3.0, *place), strict=True):
        assert abs(value - true) < 4.0 * found.errors[label]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("known", "robot", "effects"),
    [
        (False, ARM, {"yaw": [DeadZone(0.1)]}),  # no column
        (True, ARM, {"yaw": [Coulomb(0.06), Cogging(0.08, order=12.0)]}),  # more of what is there; a law with a shape
        (True, ARM.with_body("pitch", 0.5, (0.1, 0.0, 0.05)), {}),  # numbers of the links
    ],
)
def test_a_repaired_arm_is_the_model_of_the_next_record(empty, known, robot, effects, tmp_path):
    repaired = GapFinder(empty.model if known else ARM).fit(record(effects, robot, duration=20.0)).model_
    save_model(repaired, tmp_path / "repaired.json")
    again = load_model(tmp_path / "repaired.json")
    assert GapFinder(again).fit(record(effects, robot, duration=20.0, random_state=5)).verdict_ == "no_gap"
    beside = effects | {"pitch": [Cogging(0.06, order=9.0)]}
    found = GapFinder(again).fit(record(beside, robot, duration=20.0, random_state=6))
    assert (found.verdict_, names(found)) == ("named", ["cogging at pitch"])


def test_the_numbers_of_a_repaired_arm_hold_what_was_found_within_their_errors(empty):
    robot = ARM.with_body("pitch", 0.5, (0.1, 0.0, 0.05))
    repaired = GapFinder(empty.model, max_effects=1).fit(record(robot=robot, random_state=4)).model_
    true = dict(zip(empty.lags.base_.names, empty.lags.weights_of(robot), strict=True))
    before = dict(zip(empty.lags.base_.names, empty.lags.weights_of(ARM), strict=True))
    z = {k: (repaired.numbers[k] - true[k]) / repaired.standard_errors[k] for k in true}
    assert max(map(abs, z.values())) < 4.0
    moved = [k for k in true if abs(true[k] - before[k]) > 10.0 * repaired.standard_errors[k]]
    assert moved, "the load is in the numbers of the links"


def test_a_known_coupling_is_refused_in_a_sentence():
    sprung = dataclasses.replace(ARM, armature=(0.05, 0.01)).with_effects({"yaw": [FlexibleCoupling(20.0)]})
    with pytest.raises(ValueError, match="flexible_coupling at yaw, beside which nothing can be looked for"):
        GapFinder(sprung).fit(record(duration=4.0))


def test_friction_that_has_become_less_than_it_was_is_named_by_itself(empty):
    found = GapFinder(empty.model, max_effects=1).fit(record({"pitch": [Viscous(-0.05)]}, random_state=3))
    assert names(found) == ["viscous at pitch"]
    assert found.effects_[0].effect.magnitude == pytest.approx(-0.05, rel=0.2)
    unsure = dataclasses.replace(empty.model, covariance=1e6 * empty.model.covariance)  # a change of 0.05 +- 0.07
    assert not names(GapFinder(unsure).fit(record({"pitch": [Viscous(-0.05)]}, random_state=3)))


def test_a_law_with_a_shape_must_explain_more_than_one_without(empty):
    plant = arm_plant(empty.model, record({"pitch": [Coulomb(0.1)]}, random_state=3), law=None, tolerance=0.004)
    plant.check()
    rng = np.random.default_rng(0)
    model = plant.base(rng)
    starts = {k.name: k.start for k in plant.looks(model, rng)}
    soft = dataclasses.replace(starts["presliding_hysteresis at pitch"], q=(0.0, 0.004))
    dry, soft = (plant.view.fit(model.with_term(term)) for term in (starts["coulomb at pitch"], soft))
    assert (
        plant.size(plant.errors(dry), plant.errors(soft)) < 0.04
    )  # of the drive of the joint, of which 0.1 Nm is 20 %
    assert plant.objection(model, dry) == ""
    assert plant.objection(model, soft) == "coulomb explains as much with fewer numbers"


def test_a_model_that_is_no_better_tells_a_shape_only_if_it_is_a_good_part_of_the_effect(empty):
    r, said = record({"pitch": [PreslidingHysteresis(0.1, 0.02)]}, duration=20.0, random_state=3), {}
    for share in (0.0, 1.0):
        noise = share * r.drive.std(axis=0) * np.random.default_rng(1).standard_normal(r.drive.shape)
        plant = arm_plant(empty.model, dataclasses.replace(r, drive=r.drive + noise), law=None, tolerance=0.004)
        plant.check()
        model = plant.base(np.random.default_rng(0))
        looks = {k.name: k for k in plant.looks(model, np.random.default_rng(0))}
        dry, soft = (plant.refine(model, looks[f"{n} at pitch"]) for n in ("coulomb", "presliding_hysteresis"))
        beyond, most = (plant.size(*map(plant.errors, pair)) for pair in ((dry, soft), (model, dry)))
        assert 0.3 < beyond / most < 0.5  # between a tenth and a quarter of the power
        said[share] = plant.objection(model, soft)
    assert said == {0.0: "", 1.0: "coulomb explains as much with fewer numbers"}


@pytest.mark.parametrize(("amplitude", "objected"), [(0.001, True), (0.02, False)])
def test_a_second_name_explains_more_than_may_stay_without_one(amplitude, objected):
    """Beside a wave of 0.1 Nm, of which friction takes a part, 0.001 Nm are below 4 % of what the joint lacked."""
    plant = arm_plant(
        ARM, record({"pitch": [Cogging(0.1, order=7.0), Cogging(amplitude, order=16.0)]}), law=None, tolerance=0.001
    )
    plant.check()
    model = plant.base(np.random.default_rng(0))
    plant.looks(model, np.random.default_rng(0))  # the floor is that of the model's own records
    kinds = list(candidates(plant.view.arm, present({}, ()), frozen=False, weight=0))
    kind = next(k for k in kinds if k.name == "cogging at pitch")
    large = plant.view.fit(model.with_term(JointTerm(kind, (0.0, 0.0, 7.0))))
    both = plant.view.fit(large.with_term(JointTerm(kind, (0.0, 0.0, 16.0))))
    wrong = plant.view.fit(model.with_term(JointTerm(kind, (0.0, 0.0, 18.5))))
    assert ("may stay without a name" in plant.objection(large, both)) is objected
    assert plant.complete(plant.errors(model), large) is objected
    assert plant.complete(plant.errors(model), both)
    assert not plant.complete(plant.errors(model), wrong)


def test_a_name_must_lower_the_error_on_blocks_that_were_not_fitted():
    r = record({"pitch": [Cogging(0.1, order=7.0)]}, duration=20.0)
    noise = 0.2 * r.drive.std(axis=0) * np.random.default_rng(1).standard_normal(r.drive.shape)
    plant = arm_plant(ARM, dataclasses.replace(r, drive=r.drive + noise), law=None, tolerance=0.004)
    plant.check()
    model = plant.base(np.random.default_rng(0))
    kinds = list(candidates(plant.view.arm, present({}, ()), frozen=False, weight=0))
    kind = next(k for k in kinds if k.name == "cogging at pitch")
    true, chance = (plant.view.fit(model.with_term(JointTerm(kind, (0.0, 0.0, order)))) for order in (7.0, 18.5))
    assert plant.objection(model, true) == ""
    assert "not fitted" in plant.objection(model, chance)


@pytest.mark.parametrize(("share", "objected"), [(1.0, False), (0.5, False), (0.0, True)])
def test_a_mass_is_felt_at_every_joint_that_carries_it(empty, share, objected):
    """The drive of the first joint has a share of the pull of what hangs at the second."""
    heavy = ARM.with_body("pitch", 0.3, (0.08, 0.02, 0.1))
    r = record(robot=heavy, random_state=3)
    plant = arm_plant(ARM, r, law=None, tolerance=0.004)
    plant.check()
    pull = np.subtract(*(a.inverse_dynamics(*plant.view.moved, effects=False) for a in (heavy, ARM)))
    less = dataclasses.replace(r, drive=r.drive - pull * [1.0 - share, 0.0])
    plant = arm_plant(empty.model, less, law=None, tolerance=0.004)
    plant.check()
    model = plant.base(np.random.default_rng(0))
    look = next(k for k in plant.looks(model, np.random.default_rng(0)) if k.name == "payload at pitch")
    assert ("makes the error of yaw larger" in plant.objection(model, plant.refine(model, look))) is objected


@pytest.mark.parametrize("seed", range(3))
def test_a_centre_that_an_offset_stands_for_makes_no_other_effect_uncertain(seed):
    r = record({"yaw": [CableSpring(0.5)], "pitch": [Cogging(0.1, order=7.0)]}, random_state=seed)
    plant = arm_plant(ARM, r, law=None, tolerance=0.004)
    plant.check()
    model = plant.base(np.random.default_rng(0))
    kinds = {k.name: k for k in candidates(plant.view.arm, present({}, ()), frozen=False, weight=0)}
    terms = ("cogging at pitch", (0.0, 0.0, 7.0)), ("cable_spring at yaw", (0.0, -1.26))
    model = plant.view.fit(model.with_terms(tuple(JointTerm(kinds[name], q) for name, q in terms)))
    fit = plant.linearised(model)
    assert [p_of_zero(fit, i) < 1e-20 for i in (0, 1)] == [True, True]


@pytest.mark.slow
def test_a_name_is_certain_only_if_no_more_is_left_than_the_arm_left_before(empty):
    r = record({"pitch": [Coulomb(0.1)]}, duration=20.0, random_state=3)
    noise = np.random.default_rng(1).standard_normal(r.drive.shape)
    noisy = dataclasses.replace(r, drive=r.drive + 0.2 * r.drive.std(axis=0) * noise)
    found = GapFinder(empty.model).fit(noisy)
    assert (found.verdict_, names(found)[0]) == ("partial", "coulomb at pitch")
    loud = {joint: 0.1 * size for joint, size in zip(ARM.joints, r.drive.std(axis=0), strict=True)}
    found = GapFinder(dataclasses.replace(empty.model, unexplained=loud)).fit(noisy)
    assert (found.verdict_, names(found)) == ("named", ["coulomb at pitch"])
    # a tenth as loud in a record whose drives varied a tenth as much is the same share of them
    loud, varied = ({j: 0.1 * size for j, size in of.items()} for of in (loud, empty.model.varied))
    found = GapFinder(dataclasses.replace(empty.model, unexplained=loud, varied=varied)).fit(noisy)
    assert (found.verdict_, names(found)) == ("named", ["coulomb at pitch"])
    assert GapFinder(dataclasses.replace(empty.model, unexplained=loud)).fit(noisy).verdict_ == "partial"


def test_what_is_missing_at_a_joint_pulls_at_no_other(empty):
    found = GapFinder(empty.model).fit(
        record({"pitch": [ContactStop(20.0, 0.3, relaxation=0.02)]}, duration=20.0, random_state=3)
    )
    assert names(found) == ["end_stop at pitch"]
    yaw, pitch = (row["missing"] for row in found.diagnosis_.joints)
    assert pitch["before"] > 10 * pitch["after"]
    assert yaw["before"] == pytest.approx(yaw["after"], rel=0.5)


def test_an_inertia_is_no_load_on_the_axis_of_the_next_joint(empty):
    found = GapFinder(empty.model).fit(
        record(
            robot=dataclasses.replace(ARM, armature=ARM.armature + np.array([0.02, 0.0])), duration=12.0, random_state=3
        )
    )
    assert (found.verdict_, names(found)) == ("named", ["joint_inertia at yaw"])
    assert "payload at pitch" not in [k.name for k in found.found_.steps[0].looks]


def test_the_proof_is_judged_at_the_joint_of_the_name_and_a_delayed_own_record_is_delayed():
    r = record(duration=12.0)
    early = np.vstack([r.drive[10:], r.drive[-10:]])  # acts ten samples after it was logged
    plant = arm_plant(ARM, dataclasses.replace(r, drive=early), law=None, tolerance=0.004)
    plant.check()
    base = plant.base(np.random.default_rng(0))
    kinds = list(candidates(plant.view.arm, present({}, ()), frozen=False, weight=0))
    late = plant.view.fit(
        base.with_term(JointTerm(next(k for k in kinds if k.name == "input_delay at pitch"), (0.02,)))
    )
    held = plant.measured()[1].reshape(-1, 2)
    judged = plant.measured(base, late)[1].reshape(-1, 2)
    assert held.any(axis=0).tolist() == [True, True]
    assert judged.any(axis=0).tolist() == [False, True]
    np.testing.assert_array_equal(judged[:, 1], held[:, 1])
    own = plant.made(late, np.random.default_rng(0))
    error = own.record.position.ravel() - own.simulate(late, 0.2)
    other = own.record.position.ravel() - own.simulate(base, 0.2)
    assert error[judged.ravel()].std() < 0.5 * other[judged.ravel()].std()


@pytest.mark.slow
@pytest.mark.parametrize("name", ["input_delay", "actuator_lag"])
def test_a_delay_and_a_lag_are_told_apart(name, empty):
    r, a = record(random_state=5, duration=20.0), np.exp(-0.002 / 0.02)
    drive = np.array(r.drive)
    wanted = np.roll(drive, -10, axis=0) if name == "input_delay" else (drive - a * np.roll(drive, 1, axis=0)) / (1 - a)
    drive[:, 1] = wanted[:, 1]
    cut = slice(20, -20)
    found = GapFinder(empty.model).fit((r.time[cut], r.position[cut], drive[cut]))
    assert (found.verdict_, names(found)) == ("named", [f"{name} at pitch"])


def trajectories(*pieces, hole=1.0):
    """Records of one log: time (s), positions and drives of all, with holes between them."""
    ends = np.cumsum([0.0] + [p.time[-1] + hole for p in pieces])
    time = np.concatenate([p.time + begin for p, begin in zip(pieces, ends, strict=False)])
    return time, *(np.vstack([getattr(p, k) for p in pieces]) for k in ("position", "drive"))


def test_nothing_is_named_in_a_log_of_several_trajectories_in_which_nothing_is_missing():
    log = trajectories(*(record(duration=5.0, random_state=k) for k in (1, 2, 3)))
    found = GapFinder(ARM).fit(log)
    assert found.plant_.record.starts == (2500, 5000)
    assert found.verdict_ == "no_gap"


def test_a_log_is_used_beyond_its_longest_piece():
    seen = [record({"pitch": [Cogging(0.2, order=7.0)]}, duration=5.0, random_state=k) for k in (4, 5, 6, 7)]
    one, all_four = (GapFinder(ARM, max_effects=1).fit(log) for log in (seen[0], trajectories(*seen)))
    assert names(one) == names(all_four) == ["cogging at pitch"]
    assert all_four.effects_[0].effect.magnitude == pytest.approx(0.2, rel=0.02)
    assert all_four.plant_.view.n_rows > 3.5 * one.plant_.view.n_rows


def test_a_memory_begins_anew_at_each_piece():
    one = record(duration=5.0, random_state=1)
    # without dry friction, how it reverses is not found twice from different records
    plants = [arm_plant(ARM, log, law="viscous", tolerance=0.004) for log in (one, trajectories(one, one))]
    lengths = []
    for plant in plants:
        plant.check()
        view, model = plant.view, plant.base(np.random.default_rng(0))
        kinds = list(candidates(view.arm, present({"pitch": ("coulomb",)}, ()), frozen=False, weight=0))
        for name, size in (("presliding_hysteresis", 1.0), ("actuator_lag", 0.05), ("input_delay", 0.05)):
            kind = next(k for k in kinds if k.name == f"{name} at pitch")
            lengths.append(view.columns_at(kind, (size,)))
        lengths.append(plant.simulate(model, 0.5).reshape(-1, 2))
    for alone, twice in zip(lengths[:4], lengths[4:], strict=True):
        np.testing.assert_allclose(twice[: len(alone)], alone, atol=0.02 * np.std(alone))
        np.testing.assert_allclose(twice[len(alone) :], alone, atol=0.02 * np.std(alone))


def test_the_report_tells_every_joint(tmp_path):
    pytest.importorskip("matplotlib")
    found = GapFinder(ARM, max_effects=1).fit(record({"pitch": [Cogging(0.1, order=7.0)]}, duration=12.0))
    page = found.report(tmp_path).read_text()
    written = json.loads((tmp_path / "gap.json").read_text())
    assert written["effects"][0]["joint"] == "pitch"
    rows = {r["name"]: r for r in written["joints"]}
    assert rows["pitch"]["names"] == ["cogging at pitch"]
    missing = rows["pitch"]["missing"]
    assert missing["before"] > 5 * missing["after"]
    same = record({"pitch": [Cogging(0.1, order=7.0)]}, duration=12.0)
    fitted = identify_arm(same.position, same.drive, dt=0.002, robot=ARM)
    assert missing["before"] == pytest.approx(fitted.missing["pitch"], rel=0.2)  # of held-out blocks, as identify's
    assert "Joint yaw" in page
    assert (tmp_path / "repaired.json").exists()


@pytest.mark.slow
def test_a_wrong_gain_is_the_first_thing_to_repair():
    arm = drawn_arm(3, 5, slides=0.0, branch=0.0, gravity=(0, 0, -9.81)).with_effects(
        {joint: (Viscous(0.5), Coulomb(0.5)) for joint in ("j0", "j1", "j2")}
    )
    r = record({"j2": [Cogging(1.0, order=7.0)]}, arm, duration=12.0)
    found = GapFinder(arm).fit(dataclasses.replace(r, drive=r.drive * [1.0, 2.0, 1.0]))
    assert any("j1" in p.explanation and not p.fatal for p in found.diagnosis_.problems)
    assert found.verdict_ in ("partial", "unknown")
    assert re.match("Repair the log first: .*j1", found.diagnosis_.next_experiment)


@pytest.mark.slow
def test_no_name_is_certain_beside_a_wrong_gain():
    arm = drawn_arm(3, 3, slides=0.0, branch=0.0, gravity=(0, 0, -9.81)).with_effects(
        {joint: (Viscous(0.5), Coulomb(0.5)) for joint in ("j0", "j1", "j2")}
    )
    r = record(
        {"j2": [Cogging(1.5 * float(record(None, arm, duration=6.0).drive[:, 2].std()), 7.0)]}, arm, duration=12.0
    )
    right, found = (GapFinder(arm).fit(dataclasses.replace(r, drive=r.drive * [k, 1.0, 1.0])) for k in (1.0, 1.7))
    assert right.plant_.enough(right.found_.model)
    assert not found.plant_.enough(found.found_.model)
    assert "drive of j0 is 1.7 +- 0.001 times" in found.diagnosis_.problems[0].explanation
    assert found.verdict_ == "partial"  # one of its names is at j0, where nothing is missing
    assert names(found)[0] == "cogging at j2"


def test_a_centre_that_an_offset_stands_for_stays_where_it_is():
    arm = drawn_arm(3, 5103, slides=0.0, branch=0.0, gravity=(0, 0, -9.81))
    arm = arm.with_effects({j: (Viscous(0.5), Coulomb(0.5)) for j in arm.joints})
    plant = arm_plant(arm, record({"j1": [CableSpring(6.3)]}, arm, duration=12.0), law=None, tolerance=0.004)
    plant.check()
    model = plant.base(np.random.default_rng(0))
    look = next(k for k in plant.looks(model, np.random.default_rng(0)) if k.name == "cable_spring at j1")
    grown = plant.refine(model, look)
    assert grown.terms[-1].shape == pytest.approx(look.start.shape, rel=1e-9)
    assert plant.objection(model, grown) == ""


def test_a_joint_that_does_not_move_is_told():
    r = record(duration=12.0)
    still = dataclasses.replace(r, position=r.position * [1.0, 0.0])
    plant = arm_plant(ARM, still, law=None, tolerance=0.004)
    assert any("does not move" in p.explanation for p in plant.check())


def test_degrees_and_other_orders_are_told():
    r = record(duration=12.0)
    degrees = arm_plant(ARM, dataclasses.replace(r, position=np.rad2deg(r.position)), law=None, tolerance=0.004).check()
    assert [(p.code, p.fatal) for p in degrees] == [("data-units", True)]
    crossed = arm_plant(ARM, dataclasses.replace(r, drive=r.drive[:, ::-1]), law=None, tolerance=0.004).check()
    assert any("order" in p.explanation for p in crossed)


def test_a_model_of_another_law_is_refused():
    empty = identify_arm(*make_arm_log(return_arrays=True), dt=0.002, robot=ARM, law="viscous")
    with pytest.raises(ValueError, match=r"no number .*coulomb"):
        GapFinder(empty.model, law="viscous,coulomb").fit(record(duration=12.0))


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda t, q, u: (t, q), "of yaw, pitch, in that order"),
        (lambda t, q, u: (t, q[:, :1], u), r"shapes \(\d+,\), \(\d+, 1\)"),
        (lambda t, q, u: (t[::-1], q, u), "does not increase"),
        (lambda t, q, u: (t, np.where(q > 0.5, np.nan, q), u), "missing values"),
    ],
)
def test_a_log_that_is_none_is_refused_in_a_sentence(change, told):
    r = record(duration=2.0)
    with pytest.raises(ValueError, match=told):
        GapFinder(ARM).fit(change(r.time, r.position, r.drive))


def test_the_frame_of_an_arm_log_is_one():
    frame = make_arm_log(duration=2.0)
    taken, given = record_of(frame, ARM), record(duration=2.0)
    np.testing.assert_array_equal(taken.position, given.position)
    np.testing.assert_array_equal(taken.drive, given.drive)
    with pytest.raises(ValueError, match="without yaw_torque_nm; rename"):
        record_of(frame.drop(columns="yaw_torque_nm"), ARM)


def test_beside_known_numbers_a_fitted_effect_explains_what_its_look_did(empty):
    # without it the known numbers bend, and what is left then shows little of it
    heavier = dataclasses.replace(ARM, armature=ARM.armature + np.array([0.0, 0.004]))
    vague = dataclasses.replace(empty.model, covariance=4.0 * empty.model.covariance)
    plant = arm_plant(vague, record(robot=heavier), law=None, tolerance=0.004)
    plant.check()
    model = plant.base(np.random.default_rng(0))
    look = next(k for k in plant.looks(model, np.random.default_rng(0)) if k.name == "joint_inertia at pitch")
    grown = plant.refine(model, look)
    gain, size = plant.explained(model, grown, look)
    assert size == pytest.approx(look.size, rel=0.01)
    assert gain > look.gain  # which is of all joints together
    assert plant.size(plant.errors(model), plant.errors(grown)) < 0.97 * look.size


def test_beside_a_found_effect_what_the_arms_own_record_leaves_has_no_name(empty):
    heavier = dataclasses.replace(ARM, armature=ARM.armature + np.array([0.0, 0.02]))
    plant = arm_plant(empty.model, record({"pitch": [Coulomb(0.2)]}, robot=heavier), law=None, tolerance=0.004)
    plant.check()
    model = plant.base(np.random.default_rng(0))
    for name in ("joint_inertia at pitch", "coulomb at pitch"):
        look = next(k for k in plant.looks(model, np.random.default_rng(0)) if k.name == name)
        before, model = model, plant.refine(model, look)
    assert plant.objection(before, model) == ""
    plant.known = plant.known._replace(unexplained={"yaw": 0.0, "pitch": 2.0 * plant.view.drive_rms[1]})
    assert "the arm's own record may leave" in plant.objection(before, model)
    found = [k.p_value for k in plant.looks(before, np.random.default_rng(0)) if k.place == {"pitch"}]
    assert set(found) == {1.0}  # nor does it keep a name at another joint from being enough


def test_an_effect_says_at_a_joint_as_on_an_axis_that_it_cannot_be_there(empty):
    plant = arm_plant(empty.model, record(), law=None, tolerance=0.004)
    plant.check()
    model = plant.base(np.random.default_rng(0))
    base = dict(zip(plant.lags.base_.names, model.numbers, strict=True))
    kinds = {
        k.name: k for k in candidates(plant.view.arm, present({"pitch": ("viscous",)}, ()), frozen=False, weight=0)
    }
    driven = JointTerm(kinds["asymmetric_viscous at pitch"], (base["pitch.viscous"] + 100.0,))
    assert "driven by its own friction" in plant.objection(model, model.with_term(driven))


def test_an_effect_of_one_number_is_not_refused_for_a_friction_of_one(empty):
    r = record()
    late = ArmRecord(r.time, r.position, np.vstack([r.drive[4:], np.repeat(r.drive[-1:], 4, axis=0)]))
    plant = arm_plant(empty.model, late, law=None, tolerance=0.5)  # above what friction leaves of the delay
    plant.check()
    model = plant.base(np.random.default_rng(0))
    look = next(k for k in plant.looks(model, np.random.default_rng(0)) if k.name == "input_delay at pitch")
    assert plant.objection(model, plant.refine(model, look)) == ""


def test_a_joint_counts_by_its_own_variance_and_an_error_of_the_model_may_favour_a_name():
    plant = arm_plant(ARM, record({"pitch": [CableSpring(1.0)]}), law=None, tolerance=0.004)
    plant.check()
    rng = np.random.default_rng(0)
    model = plant.base(rng)
    look = next(k for k in plant.looks(model, rng) if k.name == "cable_spring at pitch")
    errors = plant.errors(model).reshape(-1, 2)
    counts = plant.own.counts
    for loud in (1.0, 100.0):  # of the other joint
        before, after = ((errors * [loud, share]).ravel() for share in (1.0, 0.5))
        assert plant._likelihood(after) - plant._likelihood(before) == pytest.approx(counts[1] * np.log(4.0))

    grown = plant.refine(model, look)
    taken, other = plant.errors(grown), plant.errors(model) * 0.5
    names = [SimpleNamespace(model=grown, errors=e) for e in (taken, other)]
    sizes = []
    for floor in (1e-6, 1.0):  # what the arm left before: nothing, and more than the two differ by
        plant.own = plant.own._replace(floor=np.full(2, floor))
        sizes.append(np.mean(plant.leads(*names, errors.ravel(), np.random.default_rng(0))))
    assert sizes[0] < 0.0 < sizes[1]


def objection_to(name, log, robot=ARM, also=()):
    """The objection to the best candidate of this name; `also` are found before."""
    plant = arm_plant(robot, log, law=None, tolerance=0.004)
    plant.check()
    rng = np.random.default_rng(0)
    model = plant.base(rng)
    for wanted in (*also, name):
        look = next(k for k in plant.looks(model, rng) if k.name == wanted)
        before, model = model, plant.refine(model, look)
    return plant.objection(before, model)


@pytest.mark.parametrize(
    ("at", "hidden", "unknown", "cancelled"),
    [
        ("pitch", HardeningSpring(3.0), 0.02, True),
        ("pitch", HardeningSpring(3.0), 0.0, False),
        ("yaw", CableSpring(1.0), 0.02, False),
    ],
)
def test_a_torque_that_other_terms_cancel_is_refused(at, hidden, unknown, cancelled):
    """Gravity cancels nearly all of a spring; the rest tells nothing beside as large a share of an unknown force."""
    log = record({at: [hidden]}, amplitude=0.4)
    wave = np.sqrt(2.0) * np.sin(7.0 * log.time)[:, None]
    said = objection_to(
        f"cable_spring at {at}", dataclasses.replace(log, drive=log.drive + unknown * log.drive.std(0) * wave)
    )
    assert ("other terms cancel it" in said) == cancelled


def test_an_effect_judges_by_all_that_is_at_its_joint(monkeypatch):
    seen = []
    monkeypatch.setattr(Cogging, "implausible", lambda effect, beside: seen.append(beside) or "")
    robot = dataclasses.replace(drawn_arm(2, 0, slides=0.0), slides=[False, True], effects=[(Viscous(0.5),)] * 2)
    hidden = {j: [Cogging(0.5, order=9.0), Coulomb(0.5)] for j in robot.joints}
    log = record(hidden, robot, duration=12.0, resolution=1e-4)
    for joint, turns in zip(robot.joints, (True, False), strict=True):
        objection_to(f"cogging at {joint}", log, robot, also=[f"coulomb at {joint}"])
        assert seen[-1].turns == turns
        assert seen[-1].step == pytest.approx(1e-4)
        assert seen[-1].dt == pytest.approx(0.002)
        for law in ("viscous", "coulomb"):
            assert seen[-1].size(law) == pytest.approx(0.5, rel=0.2)


def test_an_effect_at_a_slide_is_told_in_newtons_and_runs_of_mixed_joints_in_shares_of_their_motion():
    arm = drawn_arm(2, 0, slides=0.0)
    arm = dataclasses.replace(arm, slides=[False, True], effects=[(Viscous(0.5), Coulomb(0.5))] * 2)
    q, u = smooth_log(arm.with_effects({"j1": Cogging(0.5, 9.0)}), seconds=8.0)
    q = q + 1e-6 * np.random.default_rng(0).standard_normal(q.shape)
    found = GapFinder(arm).fit(ArmRecord(np.arange(len(q)) / RATE, q, u))
    assert names(found) == ["cogging at j1"]
    assert "amplitude_n" in found.effects_[0].parameters
    assert found.diagnosis_.sentence.startswith("Of the rms drive of j1, the missing drive is")
    plant, model, shown = found.plant_, found.found_.model, found.diagnosis_.pictures
    far = np.std(q, axis=0) * [1000.0, 1.0]  # the same arm, were a radian a thousandth: a share of the motion stays
    np.testing.assert_allclose(plant.per * [1000.0, 1.0], far, rtol=0.01)
    runs = plant.simulate(model, 0.1).reshape(q.shape) * plant.per
    np.testing.assert_allclose(runs, q, atol=0.2 * np.std(q, axis=0).min())
    assert shown["output"] == "position of j1 (m)"
    assert [shown["joints"][j][-1] for j in arm.joints] == ["Nm", "N"]
    assert any("slide and others turn" in note for note in found.diagnosis_.notes)


def test_how_dry_friction_reverses_is_part_of_the_model_of_a_robot_file():
    q, u = smooth_log(lacking("pitch", "coulomb"), noise=0.002)
    v, a = (np.gradient(q[:, 1], 1.0 / RATE), np.gradient(np.gradient(q[:, 1], 1.0 / RATE), 1.0 / RATE))
    u[:, 1] += 0.3 * np.tanh((v + 0.01 * a) / 0.1)
    found = GapFinder(ARM).fit(ArmRecord(np.arange(len(q)) / RATE, q, u))
    assert found.model_.reversals["pitch"] == (pytest.approx(0.1, rel=0.1), pytest.approx(0.01, abs=0.002))
    assert found.verdict_ == "no_gap"


def test_a_change_of_the_speed_over_which_friction_reverses_is_no_evidence_for_a_name():
    arm = lacking("pitch", "coulomb")
    q, u = smooth_log(arm, noise=0.002)
    u[:, 1] += 0.3 * np.tanh(np.gradient(q[:, 1], 1.0 / RATE) / 0.2)
    known = identify_arm(q, u, dt=1.0 / RATE, robot=ARM).model
    assert known.reversals["pitch"][0] == pytest.approx(0.2, rel=0.1)
    plant = arm_plant(known, (np.arange(len(q)) / RATE, q, u), law=None, tolerance=0.004)
    plant.check()
    view, model = plant.view, plant.base(np.random.default_rng(0))
    plant.n_effective = 500.0
    tangent = plant._tangent(model, np.zeros((0, view.keep.size)))
    change = view.widths[:, list(known.reversals).index("pitch")] * view.flat_weight()
    assert np.linalg.norm(change) > 0.0
    assert np.linalg.norm(change - tangent.plane @ (tangent.plane.T @ change)) < 1e-6 * np.linalg.norm(change)


@pytest.mark.parametrize(
    ("elsewhere", "refused"),
    [(0.0, True), (0.2, True), (0.5, False), (-0.5, True)],
    ids=["push", "most", "half", "worse"],
)
def test_what_only_the_contact_with_a_stop_shows_is_no_further_effect(elsewhere, refused):
    """``elsewhere``: of the power that a term takes off the residual, the part outside the contact."""
    push = np.where(np.arange(200) < 40, 5.0, 1e-6)  # behind a filter no row is without any
    contact = push > 1.0
    gone = np.where(contact, (1.0 - elsewhere) / contact.sum(), elsewhere / (~contact).sum())
    before = np.sqrt(np.column_stack([np.full(200, 1.0), np.full(200, 3.0)]))
    after = np.sqrt(before**2 - np.column_stack([gone, np.zeros(200)]))
    stop, other = (
        SimpleNamespace(joint="lift", kind=SimpleNamespace(cls=cls, name=cls.__name__))
        for cls in (ContactStop, Stribeck)
    )
    model = SimpleNamespace(terms=(stop,), left=before)
    view = SimpleNamespace(
        arm=SimpleNamespace(joints=("lift", "turn")), drive_rms=np.ones(2), fit=lambda m: m, left=lambda m: m.left,
        contribution=lambda t: np.column_stack([push, np.zeros(200)]),
    )  # fmt: skip
    plant = SimpleNamespace(view=view, tolerance=0.004)
    grown = SimpleNamespace(terms=(stop, other), left=after)
    assert bool(ArmPlant._against_its_stop(plant, model, grown)) == refused
    turned = SimpleNamespace(terms=(stop, SimpleNamespace(joint="turn", kind=other.kind)), left=after)
    assert ArmPlant._against_its_stop(plant, model, turned) == "", "a joint without a stop"
    load = SimpleNamespace(joint="lift", kind=SimpleNamespace(cls=Load))
    carried = SimpleNamespace(terms=(stop, load), left=after)
    assert ArmPlant._against_its_stop(plant, model, carried) == "", "a mass, which the other joint carries, too"


@pytest.mark.parametrize("wound", [1.0, 20.0])
def test_a_limit_is_found_far_below_what_a_controller_asks_for(wound):
    """``wound``: multiple of what is asked for beyond the limit; it changes nothing of what the motor gives."""
    limit = 2.5  # the drive asked for reaches 46 and 870 Nm
    r = record({"pitch": [Saturation(limit)]}, duration=8.0)
    gives = np.clip(r.drive, -limit, limit)
    asked = np.column_stack([r.drive[:, 0], (gives + wound * (r.drive - gives))[:, 1]])
    plant = arm_plant(ARM, dataclasses.replace(r, drive=asked), law=None, tolerance=0.004)
    assert plant.check() == []
    rng = np.random.default_rng(0)
    base = plant.base(rng)
    look = next(k for k in plant.looks(base, rng) if k.name == "saturation at pitch")
    model = plant.settled(plant.refine(base, look))
    assert model.terms[-1].q == pytest.approx((limit,), rel=0.005)
    assert plant._at_rest(model.terms[-1]) == ""


def test_a_limit_below_all_that_is_asked_for_explains_no_wave():
    """A weight or an offset keeps the drive at one sign; such a limit lets a constant through, which tells nothing."""
    r = record({"pitch": [Cogging(0.1, order=7.0)]})
    asked = r.drive + np.array([0.0, 2.0 * np.abs(r.drive[:, 1]).max()])
    plant = arm_plant(ARM, dataclasses.replace(r, drive=asked), law=None, tolerance=0.004)
    assert plant.check() == []
    rng = np.random.default_rng(0)
    base = plant.base(rng)
    looks = {k.name: k for k in plant.looks(base, rng)}
    assert looks["saturation at pitch"].gain < 0.5 * looks["cogging at pitch"].gain
    with_limit = plant.refine(base, looks["saturation at pitch"])
    assert plant.rms(plant.errors(with_limit)) > 0.7 * plant.rms(plant.errors(base))


def test_what_a_controller_asks_for_against_a_stop_is_no_limit_of_the_drive():
    r = record(duration=4.0)
    end = np.quantile(r.position[:, 1], 0.8)
    path, asked = r.position.copy(), r.drive.copy()
    path[:, 1] = np.minimum(path[:, 1], end)
    asked[:, 1] += 50.0 * (r.position[:, 1] - path[:, 1])  # what winds up while the joint rests at its end
    plant = arm_plant(ARM, dataclasses.replace(r, position=path, drive=asked), law=None, tolerance=0.004)
    assert plant.check() == []
    kind = next(k for k in candidates(ARM, {}, frozen=False, weight=0) if k.name == "saturation at pitch")
    assert "as a stop does" in plant._at_rest(JointTerm(kind, (3.0,)))
