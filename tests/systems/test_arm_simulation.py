"""What a simulation of an arm is given, and what it refuses."""

from __future__ import annotations

import numpy as np
import pytest

from tests.systems.drawn_arms import drawn_arm
from whsklearn.systems import PIDController

ARM = drawn_arm(2, 0, slides=0.0)


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
