"""Simulated logs of an arm: what is hidden is there, at its joint, and everything comes from the seed."""

from __future__ import annotations

import numpy as np
import pandas as pd

from whsklearn.datasets import default_arm, make_arm_log
from whsklearn.effects import Coulomb
from whsklearn.systems import PIDController


def test_the_same_seed_gives_the_same_log():
    one, same, other = (make_arm_log(duration=1.0, random_state=s) for s in (3, 3, 4))
    pd.testing.assert_frame_equal(one, same)
    assert not one.equals(other)


def test_a_hidden_effect_is_paid_for_at_its_joint():
    reference = 0.5 * np.sin(np.arange(1000)[:, None] / 500 * [3.0, 4.0])
    settings = {"reference": reference, "noise": 0.0}
    plain = make_arm_log(**settings)
    braked = make_arm_log(effects={"pitch": Coulomb(0.5)}, **settings)
    extra = (braked - plain)[["yaw_torque_nm", "pitch_torque_nm"]].iloc[200:].abs().mean()
    assert extra["pitch_torque_nm"] > 0.4
    assert extra["yaw_torque_nm"] < 0.1


def test_it_follows_its_reference_with_any_controller():
    controller = {"yaw": PIDController(300.0, 0.0, 9.0), "pitch": PIDController(300.0, 0.0, 9.0)}
    for given in (None, controller):
        log = make_arm_log(duration=4.0, controller=given)
        assert (log["pitch_reference_rad"] - log["pitch_position_rad"]).abs().max() < 0.02


def test_the_example_arm_has_gravity_at_its_pitch_alone():
    rest = np.zeros((1, 2))
    held = default_arm().inverse_dynamics(rest, rest, rest)[0]
    assert abs(held[0]) < 1e-12
    assert abs(held[1]) > 0.5
