"""A load is found at its link with its mass, none where there is none, and a known one gives the drives' gains."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

from tests.systems.drawn_arms import drawn_arm
from whsklearn.datasets import default_arm, make_arm_log
from whsklearn.effects import Coulomb, LoadFriction, Viscous
from whsklearn.identification import find_payload, gains_from_load, identify_arm
from whsklearn.lags import RigidBodyLags
from whsklearn.systems.arm_files import body_numbers

FRICTION = {f"j{k}": (Viscous(0.3), Coulomb(0.4)) for k in range(3)}
ARM = drawn_arm(3, 7, slides=0.0, branch=0.0, gravity=(0, 0, -9.81)).with_effects(FRICTION)
CENTRE = (0.1, 0.05, 0.2)


def log(arm, seed):
    return make_arm_log(arm, return_arrays=True, random_state=seed)


@pytest.fixture(scope="module")
def empty():
    return identify_arm(*log(ARM, 0), dt=0.002, robot=ARM)


@pytest.mark.parametrize("mass", [0.5, 2.8])
def test_a_load_is_found_at_the_last_link_with_its_mass_and_centre(empty, mass):
    best, *others = find_payload(empty, *log(ARM.with_body("j2", mass, CENTRE), 1))
    assert best.joint == "j2"
    assert abs(best.mass - mass) < 3 * best.mass_error < 0.15
    np.testing.assert_allclose(best.centre, CENTRE, atol=0.03)
    assert best.left < 0.5 * min(p.left for p in others)


def test_a_record_without_a_load_has_none(empty):
    best = find_payload(empty, *log(ARM, 2))[0]
    assert abs(best.mass) < max(3 * best.mass_error, 0.05)
    assert best.left > 0.5


def test_friction_that_grows_with_the_torque_is_kept_and_is_no_mass():
    arm = ARM.with_effects({**FRICTION, "j1": (*FRICTION["j1"], LoadFriction(0.1))})
    empty = identify_arm(*log(arm, 5), dt=0.002, robot=ARM.with_effects({}))
    assert [n for n in empty.model.numbers if "load_friction" in n] == ["j1.load_friction"]
    assert empty.model.numbers["j1.load_friction"] == pytest.approx(0.1, rel=0.1)
    best = find_payload(empty, *log(arm.with_body("j2", 2.8, CENTRE), 6))[0]
    assert abs(best.mass - 2.8) < 3 * best.mass_error < 0.15


@pytest.mark.parametrize("gains", [(1.0, 1.0, 1.1), (1.0, 0.9, 1.0), (1.0, 0.9, 1.1)])
def test_joints_that_disagree_widen_the_interval(empty, gains):
    q, torque = log(ARM.with_body("j2", 2.8, CENTRE), 1)
    agree, apart = (find_payload(empty, q, torque * g)[0] for g in (1.0, np.array(gains)))
    assert apart.mass_error > 50.0 * agree.mass_error  # a drive reads a tenth too much or too little
    assert abs(apart.mass - 2.8) < 3 * apart.mass_error


def test_a_load_on_the_last_axis_is_at_the_last_link_and_its_mass_needs_a_lever():
    arm = default_arm()  # pitch intersects no axis that sees a mass: only moments and inertias tell it
    empty = identify_arm(*log(arm, 0), dt=0.002, robot=arm)
    best = find_payload(empty, *log(arm.with_body("pitch", 0.3, (0.15, 0.0, 0.02)), 3))[0]
    assert best.joint == "pitch"
    assert abs(best.mass - 0.3) < 3 * best.mass_error < 0.02
    np.testing.assert_allclose(best.centre, (0.15, 0.0, 0.02), atol=0.005)


def test_the_interval_holds_the_gains(empty):
    loaded = log(ARM.with_body("j2", 2.8, CENTRE), 1)
    sure, unsure = (find_payload(empty, *loaded, gain_error=g)[0] for g in (0.0, 0.1))
    assert unsure.mass == sure.mass
    assert unsure.mass_error == pytest.approx(np.hypot(sure.mass_error, 0.1 * sure.mass), rel=1e-6)


def test_a_known_load_tells_the_gain_of_every_joint_that_it_moves():
    gains = np.array([12.0, 10.0, 8.0])
    pair = [log(ARM, 0), log(ARM.with_body("j2", 2.8, CENTRE), 1)]
    numbers = body_numbers(2.8, CENTRE, np.zeros((3, 3)))
    logged = [(q, torque / gains) for q, torque in pair]
    found = gains_from_load(RigidBodyLags(ARM, 500.0), *logged, joint="j2", numbers=numbers)
    for (gain, error), truth in zip(found.values(), gains, strict=True):
        assert gain == pytest.approx(truth, rel=0.02)
        assert 0 < error < 0.05 * truth


def told_of(place, pair):
    numbers = body_numbers(2.8, place, np.zeros((3, 3)))
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always", UserWarning)
        gains_from_load(RigidBodyLags(ARM, 500.0), *pair, joint="j2", numbers=numbers)
    return [str(w.message) for w in said]


def test_a_known_load_that_is_given_at_another_place_is_told():
    pair = [log(ARM, 0), log(ARM.with_body("j2", 2.8, CENTRE), 1)]
    assert told_of(CENTRE, pair) == []
    (text,) = told_of((0.1, 0.05, 0.15), pair)
    assert "(0.10, 0.05, 0.20) m of j2" in text
    assert "(0.10, 0.05, 0.15)" in text


def test_friction_of_which_the_fit_knows_nothing_widens_the_interval_of_a_gain():
    """White errors would make the interval a third as wide, and five gains would be 2.7 of them off on average."""
    arm = ARM.with_effects({**FRICTION, "j1": (*FRICTION["j1"], LoadFriction(0.1))})
    numbers = body_numbers(2.8, CENTRE, np.zeros((3, 3)))

    def found(robot, seed):
        pair = [log(robot, seed), log(robot.with_body("j2", 2.8, CENTRE), seed + 1)]
        return gains_from_load(RigidBodyLags(ARM, 500.0), *pair, joint="j2", numbers=numbers)

    hidden = [found(arm, seed) for seed in range(0, 10, 2)]
    assert hidden[0]["j1"][1] > 3.0 * found(ARM, 0)["j1"][1]
    off = [[(gain - 1.0) / error for gain, error in one.values()] for one in hidden]
    assert np.sqrt(np.mean(np.square(off), axis=0)).max() < 2.0  # 99.9 % of five normal deviates
