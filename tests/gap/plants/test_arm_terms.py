"""What an arm may be missing: the names, joints and numbers of its candidates."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from whsklearn.datasets import default_arm
from whsklearn.effects import Backlash, CableSpring, Coulomb
from whsklearn.gap.plants.arm_terms import AtJoint, JointInertia, JointTerm, Load, Weight, candidates, parts_of, present

pytestmark = pytest.mark.usefixtures("library_effects")

ARM = default_arm()
LAW = {joint: {"viscous", "coulomb"} for joint in ARM.joints}


def names(there=LAW, *, frozen=False, weight=0, arm=ARM):
    return [k.name for k in candidates(arm, there, frozen=frozen, weight=weight)]


def test_a_candidate_is_named_by_effect_and_joint():
    found = names()
    assert {
        "cogging at yaw",
        "backlash at pitch",
        "cogging at pitch",
        "load_friction at pitch",
        "viscous at yaw+pitch",
    } <= set(found)
    assert not any(n.startswith(("gravity_imbalance", "encoder_eccentricity", "flexible_coupling")) for n in found)


def test_what_the_law_has_is_no_candidate_and_comes_back_where_numbers_are_frozen():
    assert not {"coulomb at yaw", "viscous at pitch"} & set(names())
    assert "coulomb at yaw" in names({"pitch": {"viscous", "coulomb"}})
    assert {"coulomb at yaw", "joint_inertia at pitch", "payload at pitch"} <= set(names(frozen=True))


def test_friction_of_another_record_may_have_become_less_and_new_friction_may_not():
    frozen = {k.name: k for k in candidates(ARM, LAW | {"pitch": {"viscous"}}, frozen=True, weight=0)}
    assert not frozen["coulomb at yaw"].grows
    assert frozen["coulomb at yaw"].positive
    assert frozen["coulomb at pitch"].grows


def test_a_hand_carries_one_load_and_gravity_is_asked_where_there_is_none():
    assert "payload at pitch" not in names(LAW | {"pitch": {"viscous", "coulomb", "payload"}}, frozen=True)
    assert "gravity" in names(weight=2)
    assert "gravity" not in names()


def test_friction_along_two_joints_needs_the_friction_of_each():
    assert "coulomb at yaw+pitch" not in names({"yaw": {"coulomb"}})


@pytest.mark.parametrize("sliding", ["yaw", "pitch"])
def test_a_sliding_joint_and_a_turning_one_share_no_friction(sliding):
    slides = np.array([j == sliding for j in ARM.joints])
    assert not any("+" in n for n in names(arm=dataclasses.replace(ARM, slides=slides)))


def test_an_effect_that_needs_a_turn_is_not_asked_for_at_a_slide(monkeypatch):
    monkeypatch.setattr(CableSpring, "rotary", True)
    there = names(arm=dataclasses.replace(ARM, slides=[False, True]))
    assert "cable_spring at yaw" in there
    assert "cable_spring at pitch" not in there


def test_rows_are_those_of_the_joint_that_pays():
    own = AtJoint(JointInertia, "pitch", (0.0, 1.0))
    both = AtJoint(JointInertia, "yaw+pitch", (1.0, 1.0))
    load = AtJoint(Load, "pitch", (0.0, 1.0))
    assert (own.index, own.rows) == (1, slice(1, None, 2))
    assert both.index is load.index is None
    assert both.rows == load.rows == slice(None)
    assert (own.n_numbers, load.n_numbers) == (1, 4)
    assert own.positive
    assert load.positive


def test_a_term_gives_its_effect_back():
    load = JointTerm(AtJoint(Load, "pitch", (0.0, 1.0)), (0.8, 0.1, 0.0, 0.05))
    assert load.effect == Load(0.8, 0.1, 0.0, 0.05)
    assert (load.joint, load.shape) == ("pitch", (0.1, 0.0, 0.05))
    assert JointTerm(AtJoint(Weight, "", (1.0, 1.0), width=2), (1.0, 2.0)).effect.labelled() == {}


def test_what_is_there_is_the_law_and_the_terms():
    kind = next(k for k in candidates(ARM, {}, frozen=False, weight=0) if k.name == "coulomb at yaw")
    there = present({"yaw": ("viscous",)}, [JointTerm(kind, (0.3,))])
    assert there == {"yaw": {"viscous", "coulomb"}}
    assert kind.effect((0.3,)) == Coulomb(0.3)


def test_the_load_behind_a_known_play_is_all_that_is_not_the_motor():
    arm = dataclasses.replace(default_arm(), armature=(0.02, 0.01)).with_effects({"yaw": [Backlash(0.01)]})
    bare, (play,) = parts_of(arm)
    whole = arm.mass_matrix(np.zeros((1, 2)))[0, 0, 0]
    assert play.effect.load_share == pytest.approx(1.0 - 0.02 / whole)
    assert all(e.name != "backlash" for e in bare.effects[0])
