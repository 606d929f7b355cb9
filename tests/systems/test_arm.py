"""An arm as an object: names, effects, bodies, and what it refuses."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from tests.systems.drawn_arms import drawn_arm, drawn_body
from whsklearn import Arm, ServoAxis
from whsklearn.effects import Backlash, ChainPlay, Cogging, Coulomb, LoadSideViscous, Viscous
from whsklearn.systems import PIDController
from whsklearn.systems.arm_files import body_numbers

ARM = drawn_arm(2, 0, slides=0.0)


def test_a_payload_is_four_numbers_and_an_inertia_at_its_link():
    arm = drawn_arm(4, 1)
    mass, centre, inertia = drawn_body(np.random.default_rng(0))
    loaded = arm.with_body("j3", mass, centre, inertia)
    motion = arm.drawn_motion(20)
    extra = loaded.inverse_dynamics(*motion) - arm.inverse_dynamics(*motion)
    expected = arm.regressor(*motion)[:, :, 30:] @ body_numbers(mass, centre, inertia)
    np.testing.assert_allclose(extra, expected, atol=1e-9)
    assert np.abs(extra).max() > 0.1


def test_one_joint_pays_for_what_a_servo_axis_pays_for():
    axis = ServoAxis(0.05, [Viscous(0.1), Coulomb(0.2)], [Cogging(0.1, 6.0, 0.4)])
    arm = Arm(["axis"], [-1], [False], [np.eye(3)], [[0, 0, 0]], [[0, 0, 1]], [[0.0] * 9 + [0.02]], armature=[0.03])
    arm = arm.with_effects({"axis": (*axis.law.terms, *axis.effects)})
    q, v, a = arm.drawn_motion(40)
    from sklearn.utils import Bunch

    signals = Bunch(time=np.arange(40.0), position=q[:, 0], velocity=v[:, 0], acceleration=a[:, 0], drive=v[:, 0])
    columns, _ = axis.columns(signals)
    weights = [0.05, 0.1, 0.2, *axis.effects[0].coefficients]
    np.testing.assert_allclose(arm.inverse_dynamics(q, v, a)[:, 0], columns @ weights, atol=1e-12)


def test_friction_is_paid_for_unless_it_is_left_out():
    arm = drawn_arm(2, 0).with_effects({"j1": Coulomb(0.7)})
    q, v, a = arm.drawn_motion(10)
    paid = arm.inverse_dynamics(q, v, a) - arm.inverse_dynamics(q, v, a, effects=False)
    np.testing.assert_allclose(paid, np.column_stack([0 * v[:, 0], 0.7 * np.sign(v[:, 1])]), atol=1e-12)


def test_a_play_is_closed_in_inverse_dynamics_and_friction_behind_it_is_paid_for():
    arm = dataclasses.replace(drawn_arm(2, 0), armature=[0.1, 0.2])
    motion, rigid = arm.drawn_motion(10), arm.with_effects({"j1": [Coulomb(0.7), Viscous(0.2)]})
    loose = arm.with_effects({"j1": [Backlash(0.1, load_coulomb=0.7), LoadSideViscous(0.2)]})
    np.testing.assert_allclose(loose.inverse_dynamics(*motion), rigid.inverse_dynamics(*motion), atol=1e-12)


def test_the_motors_inertia_adds_to_the_mass_matrix():
    arm = drawn_arm(3, 0)
    geared = dataclasses.replace(arm, armature=[0.1, 0.2, 0.3])
    q = arm.drawn_motion(2)[0]
    np.testing.assert_allclose(geared.mass_matrix(q) - arm.mass_matrix(q), np.tile(np.diag([0.1, 0.2, 0.3]), (2, 1, 1)))


@pytest.mark.parametrize(
    ("fields", "said"),
    [
        ({"joints": ("a", "a")}, "no name twice"),
        ({"parents": [0, -1]}, "sort the joints"),
        ({"axes": np.ones((2, 3))}, "not of unit length"),
        ({"places": np.zeros((3, 3))}, "expected \\(2, 3\\)"),
        ({"gravity": [0, 0, np.nan]}, "finite numbers"),
        ({"effects": {"nobody": Coulomb(0.1)}}, "'nobody' is neither a joint nor a sum"),
        ({"effects": [[Backlash(0.1)], []]}, "'j0' has no motor of its own: expected a joint with an armature"),
        ({"effects": {"j0+j1": Backlash(0.1)}, "sum_armature": {"j0+j1": 0.1}}, "'j0\\+j1' has no motor of its own"),
        ({"effects": [[ChainPlay(0.1)], []]}, "acts in a chain of blocks"),
        ({"effects": [["coulomb"], []]}, "is not an effect"),
    ],
)
def test_what_is_no_arm_is_refused(fields, said):
    with pytest.raises(ValueError, match=said):
        dataclasses.replace(drawn_arm(2, 0), **fields)


# --- simulation -----------------------------------------------------------------------------------------------
def test_noise_comes_from_its_seed_and_is_on_the_encoder_alone():
    drive = np.zeros((50, 2))
    one, same, other = (ARM.simulate_drive(drive, noise=1e-3, random_state=s) for s in (1, 1, 2))
    np.testing.assert_array_equal(one.position, same.position)
    assert not np.array_equal(one.position, other.position)
    np.testing.assert_array_equal(one.true_position, other.true_position)


def test_each_joint_may_have_its_own_controller():
    reference = np.tile([0.0, 0.2], (200, 1))
    soft = {"j0": PIDController(kp=1.0), "j1": PIDController(kp=1.0)}
    stiff = {**soft, "j1": PIDController(kp=500.0, ki=0.0, kd=20.0)}
    errors = [np.abs(ARM.simulate(reference, controller=c).true_position[-1, 1] - 0.2) for c in (soft, stiff)]
    assert errors[1] < errors[0]
    with pytest.raises(ValueError, match="controller has none for 'j1'"):
        ARM.simulate(reference, controller={"j0": PIDController()})


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"drive": np.zeros((5, 3))}, r"expected \(5, 2\)"),
        ({"drive": np.full((5, 2), np.nan)}, "NaN"),
    ],
)
def test_signals_that_cannot_be_are_refused(given, said):
    with pytest.raises(ValueError, match=said):
        ARM.simulate_drive(**given)
