"""Torques of a place are gradients of an energy: what they take forth they give back."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from whsklearn.effects import CableSpring, Cogging, EndStop, GravityImbalance, HardeningSpring, Scales

Q = np.linspace(-3, 3, 4001)


@pytest.mark.parametrize(
    "effect",
    [Cogging(0.05, 12.0, 0.3), GravityImbalance(0.3, 0.2), CableSpring(0.4, 0.1), HardeningSpring(0.2), EndStop(9.0)],
)
def test_no_power_is_lost_forth_and_back(effect):
    forth, back = effect.value(position=Q, velocity=1.0), effect.value(position=Q, velocity=-1.0)
    np.testing.assert_array_equal(forth, back)  # the work forth is given back


@given(st.floats(-3, 3), st.integers(1, 40))
def test_cogging_repeats_with_its_order(q, order):
    e = Cogging(0.05, float(order), 0.3)
    assert e.value(position=q + 2 * np.pi / order) == pytest.approx(e.value(position=q), abs=1e-9)


@given(st.floats(-3, 3))
def test_gravity_is_cogging_of_order_one(q):
    expected = Cogging(0.3, 1.5, 0.2).resized(0.3).value(position=q / 1.5)
    assert GravityImbalance(0.3, 0.2).value(position=q) == pytest.approx(expected, abs=1e-12)


def test_springs_pull_back_to_their_centre_and_harden():
    assert CableSpring(0.4, 1.0).value(position=[0.0, 1.0, 2.0]) == pytest.approx([-0.4, 0.0, 0.4])
    soft, hard = (abs(HardeningSpring(0.2, 0.5).value(position=0.5 + d)) for d in (1.0, 2.0))
    assert hard == pytest.approx(8 * soft)


def test_a_stop_is_nothing_inside_and_stiff_behind():
    inside, outside = np.abs(Q) <= 1.0, np.abs(Q) > 1.0
    values = EndStop(9.0, angle=1.0).value(position=Q)
    np.testing.assert_array_equal(values[inside], 0.0)
    np.testing.assert_allclose(values[outside], 9.0 * (Q - np.sign(Q))[outside])


@pytest.mark.parametrize("rest", np.linspace(-1.0, 1.0, 9))
def test_some_start_shows_a_spring_at_rest_anywhere_in_the_travel(rest):
    scales = Scales(reach=0.9, centre=0.8)
    q = scales.centre + scales.reach * np.sin(np.linspace(0.0, 20.0, 2000))
    wanted = q - (scales.centre + rest * scales.reach)
    shares = [
        (wanted @ (q - c)) ** 2 / ((wanted @ wanted) * ((q - c) @ (q - c))) for (c,) in CableSpring.starts(scales)
    ]
    assert max(shares) > 0.9
