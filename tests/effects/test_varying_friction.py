"""Friction that varies with load, place and time is Coulomb's at each of them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from whsklearn.effects import Coulomb, FrictionDrift, LoadFriction, PositionFriction
from whsklearn.effects.equations import position_friction, smooth_sign


@given(st.floats(-5, 5), st.floats(0.01, 3))
def test_at_a_constant_load_it_is_coulomb_friction(drive, v):
    expected = Coulomb(0.1 * abs(drive)).value(velocity=v) if drive else 0.0
    assert LoadFriction(0.1).value(velocity=v, drive=drive) == pytest.approx(expected)


def test_over_a_whole_turn_its_mean_is_none():
    q = np.linspace(0, 2 * np.pi, 1000, endpoint=False)
    assert np.mean(PositionFriction(0.1, order=3.0, phase=0.4).value(position=q, velocity=1.0)) == pytest.approx(0.0)
    forth, back = (PositionFriction(0.1, order=3.0).value(position=q, velocity=v) for v in (1.0, -1.0))
    np.testing.assert_allclose(forth, -back)  # cogging would not change its sign


@given(st.floats(-3, 3), st.floats(-2, 2))
def test_derivatives_of_friction_over_the_angle(x, dx):
    def value(x, dx):
        return position_friction(0.3, -0.2, 2.0, x, *smooth_sign(dx, 3.0))

    h = 1e-6
    _, by_x, by_dx = value(x, dx)
    assert by_x == pytest.approx((value(x + h, dx)[0] - value(x - h, dx)[0]) / (2 * h), abs=1e-6)
    assert by_dx == pytest.approx((value(x, dx + h)[0] - value(x, dx - h)[0]) / (2 * h), abs=1e-6)


def test_a_drift_starts_at_nothing_and_settles():
    t = np.array([0.0, 20.0, 2000.0])
    values = FrictionDrift(-0.1, time_constant=20.0).value(time=t, velocity=1.0)
    np.testing.assert_allclose(values, [0.0, -0.1 * (1 - np.exp(-1)), -0.1], atol=1e-12)
