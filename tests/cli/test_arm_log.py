"""Columns, gains and units of an arm's joints, as the command line states them."""

from __future__ import annotations

import numpy as np
import pytest

from whsklearn.cli.arm_log import (
    columns_of,
    common_rows,
    gains_of,
    guessed_columns,
    joint_columns,
    note_friction,
    to_si,
)
from whsklearn.effects import Coulomb, Viscous
from whsklearn.logs.errors import ColumnError
from whsklearn.systems import Arm

JOINTS = ["shoulder", "elbow", "wrist"]
STYLES = {
    "by name": ["{j} pos", "{j} current"],
    "by number from zero": ["actual_q_{k}", "actual_current_{k}"],
    "by number from one": ["q{n}", "tau{n}"],
    "in German": ["winkel_{j}", "strom_{j}"],
    "by unit": ["{j}_deg", "{j}_mA"],
}


@pytest.mark.parametrize("style", list(STYLES))
def test_columns_are_found_in_any_order_and_beside_those_that_are_neither(style):
    pairs = {j: tuple(s.format(j=j, k=k, n=k + 1) for s in STYLES[style]) for k, j in enumerate(JOINTS)}
    others = " pos error", "_rpm", "_V"
    names = ["time", *(c for pair in pairs.values() for c in pair), *(f"{j}{end}" for j in JOINTS for end in others)]
    for seed in range(5):
        shuffled = list(np.random.default_rng(seed).permutation(names))
        assert guessed_columns(JOINTS, shuffled) == pairs


def test_a_measured_current_goes_before_a_torque_that_is_only_asked_for():
    asked = [f"{j} {kind}" for j in JOINTS for kind in ("pos", "target torque", "current")]
    assert [drive for _, drive in guessed_columns(JOINTS, asked).values()] == [f"{j} current" for j in JOINTS]


@pytest.mark.parametrize("names", [["time", "speed"], ["shoulder pos", "shoulder angle", "elbow pos", "wrist pos"]])
def test_joints_without_one_column_of_each_kind_are_to_be_named(names):
    with pytest.raises(ValueError, match="--joints"):
        guessed_columns(JOINTS, names)


def test_a_unit_tells_the_column_of_a_joint_beside_others_that_a_word_tells():
    names = ["t", "hip_pos_rad", "lift_pos_mm", "hip_tq_Nm", "lift_force_N"]
    found = guessed_columns(["hip", "lift"], names)
    assert found == {"hip": ("hip_pos_rad", "hip_tq_Nm"), "lift": ("lift_pos_mm", "lift_force_N")}
    for beside in ("hip_gravity_Nm", "hip_current_A"):  # two that may be it; a word, but one of another kind
        with pytest.raises(ColumnError, match="of hip"):
            guessed_columns(["hip", "lift"], [*names, beside])


@pytest.mark.parametrize("units", [("_rad", "_m", "_Nm", "_N"), (" [deg]", " [mm]", " [mNm]", " [N]")])
def test_numbered_columns_have_the_units_of_joints_that_slide_and_turn(units):
    turn, slide, torque, force = units
    names = ["time_s", f"q1{turn}", f"q2{slide}", f"q3{turn}", f"tau1{torque}", f"tau2{force}", f"tau3{torque}"]
    found = guessed_columns(["base", "reach", "wrist"], names)
    assert list(found.values()) == list(zip(names[1:4], names[4:], strict=True))


@pytest.mark.parametrize("text", ["hip:q1", "hip:", ":q1,i1", "hip:q1,i1;hip:q2,i2", "hip:q1,i1;knee:q1,i2"])
def test_a_joint_is_named_once_with_two_columns_of_its_own(text):
    with pytest.raises(ValueError, match="--joints"):
        joint_columns(text)


def test_joints_are_named_and_their_columns_found():
    assert joint_columns("hip; knee:q1,i1;") == {"hip": (), "knee": ("q1", "i1")}
    arm = Arm.from_dh([(0.3, 0, 0, 0)] * 2, gravity=(0, 0, 0), joints=("hip", "knee"))
    names = ["t", "hip_pos", "hip_tau", "q1", "i1", "knee_pos", "knee_tau"]
    assert columns_of({"joints": "knee:q1,i1;hip"}, arm, names) == {"knee": ("q1", "i1"), "hip": ("hip_pos", "hip_tau")}
    with pytest.raises(ValueError, match="does not name 'hip'"):
        columns_of({"joints": "knee:q1,i1"}, arm, names)


def test_numbered_columns_of_more_joints_than_are_named_are_not_given_to_the_first():
    numbered = [f"{kind}_{k}" for k in range(3) for kind in ("q", "tau")]
    assert list(guessed_columns(["hip", "knee"], numbered).values()) == [("q_0", "tau_0"), ("q_1", "tau_1")]
    with pytest.raises(ValueError, match="--joints"):
        guessed_columns(["hip", "knee"], numbered, exactly=True)


def test_gains_turn_a_current_into_a_torque_whatever_its_prefix():
    gains = gains_of("hip:11.0+-0.2; knee:9.0\u00b10.1")
    assert gains == {"hip": (11.0, 0.2), "knee": (9.0, 0.1)}
    (_, by_ampere), (_, by_milliampere) = (to_si("hip", False, "rad", unit, gains) for unit in ("A", "mA"))
    assert by_ampere == pytest.approx(1e3 * by_milliampere) == pytest.approx(11.0)
    with pytest.raises(ValueError, match="--gains"):
        to_si("ankle", False, "rad", "A", gains)
    with pytest.raises(ValueError, match="--gains"):
        gains_of("hip:strong")


def test_an_encoder_that_drops_out_alone_costs_its_own_instants_and_no_more():
    times = [np.delete(0.002 * np.arange(100), slice(20, 25)), 0.002 * np.arange(100) + 1e-9]
    one, other = common_rows(times)
    assert len(one) == len(other) == 95
    np.testing.assert_allclose(times[0][one], times[1][other], atol=1e-8)
    with pytest.raises(ValueError, match=r"different instants \(one has"):
        common_rows([times[0], times[1] + 0.001])


@pytest.mark.parametrize(
    ("law", "effects", "told"),
    [(None, (Viscous(0.003),), True), ("viscous", (Viscous(0.003),), False),
     (None, (Viscous(0.1), Coulomb(0.1)), False),
     (None, (), False)],
)  # fmt: skip
def test_a_file_with_damping_alone_is_told_to_have_no_dry_friction(law, effects, told, capsys):
    arm = Arm.from_dh([(0.3, 0, 0, 0)], joints=("hip",)).with_effects({"hip": effects} if effects else {})
    note_friction({"law": law}, arm)
    assert ("--law viscous,coulomb" in " ".join("".join(capsys.readouterr()).split())) is told


@pytest.mark.parametrize("units", [("m", "Nm"), ("deg", "N")])
def test_a_unit_that_a_sliding_joint_cannot_have_is_told_with_the_joint(units):
    with pytest.raises(ColumnError, match="lift slides in the robot's file, so"):
        to_si("lift", True, *units, {})
