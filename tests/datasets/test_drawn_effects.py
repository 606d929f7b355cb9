"""Drawn effects have the size that was asked for."""

from __future__ import annotations

import numpy as np
import pytest

from whsklearn.datasets import draw_effect, reference_signal
from whsklearn.datasets.servo import default_axis

AXIS = default_axis()
PATH = reference_signal("rich", 10.0, AXIS.sample_rate, random_state=0)


@pytest.mark.parametrize("name", ["coulomb", "cogging", "cable_spring", "load_friction", "disturbance_tone"])
@pytest.mark.parametrize("share", [0.02, 0.2])
def test_the_size_is_a_share_of_the_rms_drive(name, share):
    effect = draw_effect(name, AXIS, PATH, share, random_state=1)
    base = AXIS.simulate(PATH, noise=False)
    torque = effect.value(
        time=base.time, position=base.true_position, velocity=base.velocity, drive=base.torque,
        acceleration=np.gradient(base.velocity, base.time),
    )  # fmt: skip
    assert np.sqrt(np.mean(torque**2)) == pytest.approx(share * np.std(base.drive), rel=0.3)


def test_the_same_seed_draws_the_same_effect():
    first, second = (draw_effect("cogging", AXIS, PATH, 0.05, random_state=7) for _ in range(2))
    assert first == second
    assert draw_effect("cogging", AXIS, PATH, 0.05, random_state=8) != first
