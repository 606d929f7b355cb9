"""What follows the motion has a share above zero; noise and what the simulator's own numbers can do have none."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from tests.gap.plants.example_simulator import DRIVE, TIME
from whsklearn.gap import ServoRecord
from whsklearn.gap import evidence as rules
from whsklearn.gap.plants.simulator_look import motion
from whsklearn.gap.plants.simulator_nameless import explainable

PATH = 0.5 * np.sin(2.0 * TIME) + 0.2 * np.sin(5.3 * TIME)
MOTION = motion(ServoRecord(TIME, DRIVE, PATH))


def share(error):
    plant = SimpleNamespace(motion=MOTION, gap=lambda m: error, train=np.arange(TIME.size) * 10 // TIME.size % 5 < 3)
    return explainable(plant, None)


def driven(torque):
    """The error of a free mass that a torque pushes: integrated twice."""
    step = TIME[1] - TIME[0]
    return np.cumsum(np.cumsum(torque - torque.mean())) * step**2


def test_a_torque_by_position_follows_the_motion():
    assert share(driven(np.exp(-0.5 * ((PATH - 0.2) / 0.1) ** 2))) > 0.3


@pytest.mark.parametrize("seed", range(3))
def test_noise_does_not(seed):
    assert share(1e-3 * np.random.default_rng(seed).standard_normal(TIME.size)) < rules.FOLLOWS


def test_what_an_inertia_can_do_is_the_simulators_own():
    assert share(driven(0.1 * MOTION.signals.acceleration)) < 0.05
