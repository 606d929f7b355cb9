"""An effect is drawn as it acts along the run."""

from __future__ import annotations

import numpy as np
import pytest

from whsklearn import ServoAxis
from whsklearn.effects import Coulomb, FlexibleCoupling, FrictionLaw, InputDelay, InputOffset, OutputOffset, Viscous
from whsklearn.plot import EffectDisplay

DRIVE = np.sin(np.arange(2000) / 100)


def drawn(effect):
    axis = ServoAxis(0.05, FrictionLaw([Viscous(0.1)])).with_effect(effect)
    return EffectDisplay.from_run(effect, axis.simulate_drive(DRIVE, noise=False))


def test_friction_over_velocity_is_its_equation():
    shown = drawn(Coulomb(0.2))
    assert shown.xlabel == "velocity, rad/s"
    np.testing.assert_allclose(shown.values, 0.2 * np.sign(shown.x), atol=1e-12)


def test_a_constant_keeps_zero_in_sight():
    low, high = drawn(InputOffset(-0.1)).axes_[0].get_ylim()
    assert low < -0.1 < 0.0 <= high


def test_a_sensor_is_drawn_in_radians_and_a_twist_over_time():
    assert drawn(OutputOffset(0.01)).ylabel == "position, rad"
    assert drawn(FlexibleCoupling(1e-3)).ylabel == "twist, mrad"


def test_a_late_drive_is_drawn_beside_the_command():
    shown = drawn(InputDelay(0.005))
    assert shown.values[5:] == pytest.approx(shown.before[:-5])
