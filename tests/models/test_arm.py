"""An identified arm in its file, and robots in whatever form they come."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from tests.systems.drawn_arms import drawn_arm
from whsklearn.effects import Backlash, Cogging, LoadSideViscous, LuGre, Viscous, as_law
from whsklearn.models import ArmModel, AxisModel, as_arm, load_model, save_model

ARM = drawn_arm(3, 0).with_effects({"j1": (LuGre(0.2), Cogging(0.1, 6.0)), "j0-j2": [Viscous(0.3)]})
ARM = dataclasses.replace(ARM, sum_armature={"j0-j2": 0.1})


def test_a_file_gives_the_same_arm_again(tmp_path):
    model = ArmModel(
        ARM, {"j1.mx": 0.5, "j1.coulomb": 0.2}, dt=0.002, logged="position", standard_errors={"j1.mx": 0.1}
    )
    save_model(model, tmp_path / "arm.json")
    again = load_model(tmp_path / "arm.json")
    motion = ARM.drawn_motion(5)
    np.testing.assert_array_equal(again.arm.inverse_dynamics(*motion), ARM.inverse_dynamics(*motion))
    assert (again.arm.effects, again.arm.sums, again.arm.sum_armature) == (ARM.effects, ARM.sums, ARM.sum_armature)
    assert (again.parameters, again.dt, again.standard_errors) == (model.parameters, 0.002, {"j1.mx": 0.1})
    assert again.parameter_units == {"j1.mx": "kg m", "j1.coulomb": "Nm"}
    assert as_arm(tmp_path / "arm.json").joints == ARM.joints


def test_a_play_at_a_joint_is_in_the_file_and_moves_as_before(tmp_path):
    arm = dataclasses.replace(ARM, armature=[0.1, 0.2, 0.1])
    loose = arm.with_effects({"j1": [Backlash(0.02, 0.4, load_coulomb=0.1), LoadSideViscous(0.1)]})
    save_model(ArmModel(loose, dt=0.002, logged="position"), tmp_path / "arm.json")
    drive = np.sin(np.arange(400)[:, None] / 40 * np.arange(1, 4))
    again, rigid = load_model(tmp_path / "arm.json"), ArmModel(arm, dt=0.002, logged="position")
    assert again.arm.effects == loose.effects
    np.testing.assert_array_equal(again.simulate(drive), ArmModel(loose, dt=0.002, logged="position").simulate(drive))
    assert np.abs(again.simulate(drive) - rigid.simulate(drive)).max() > 1e-3


def test_it_simulates_from_where_it_stands():
    drive = np.zeros((200, 3))
    there = ArmModel(ARM, dt=0.001, logged="position").simulate(drive, start=[0.1, 0.2, 0.3])
    np.testing.assert_allclose(there[0], [0.1, 0.2, 0.3])
    assert there.shape == (200, 3)


def test_robots_that_are_none_are_told(tmp_path):
    save_model(AxisModel(0.05, as_law("viscous"), dt=0.001, logged="position"), tmp_path / "axis.json")
    for robot, said in (
        (tmp_path / "axis.json", "expected an arm"), ("no.urdf", "There is no robot file"), (3, "expected an Arm"),
    ):  # fmt: skip
        with pytest.raises(ValueError, match=said):
            as_arm(robot)


def test_numbers_of_a_joint_that_slides_have_units_of_a_line():
    slides = drawn_arm(2, 0, slides=1.0)
    units = [slides.unit_of(f"j0.{number}") for number in ("m", "armature", "viscous", "coulomb", "of_my_own")]
    assert units == ["kg", "kg", "N s/m", "N", ""]
