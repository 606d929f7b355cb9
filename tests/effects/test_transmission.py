"""What splits the inertia: springs, gaps and what they ring at."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from whsklearn.effects import Backlash, FlexibleCoupling
from whsklearn.effects.transmission import contact_damping, contact_stiffness, coupling_torque, play, resonance


@given(st.floats(1, 200), st.floats(1e-4, 1))
def test_the_contact_rings_at_its_frequency(frequency, reduced):
    k = contact_stiffness(frequency, reduced)
    assert math.sqrt(k / reduced) / (2 * math.pi) == pytest.approx(frequency)
    assert contact_damping(1.0, k, reduced) == pytest.approx(2 * math.sqrt(k * reduced))


@given(st.floats(-0.05, 0.05), st.floats(-1, 1), st.floats(1e-4, 0.02))
def test_a_gap_only_pushes(twist, slip, gap):
    torque = coupling_torque(twist, slip, 0.0, 0.0, 100.0, 1.0, gap, 0.0, 0.0)
    if abs(twist) <= gap / 2:
        assert torque == 0.0
    else:
        assert torque * twist >= 0.0


@given(st.floats(-0.05, 0.05), st.floats(-1, 1))
def test_without_step_and_gap_it_is_spring_and_damper(twist, slip):
    assert coupling_torque(twist, slip, 0.0, 0.0, 100.0, 2.0, 0.0, 0.0, 0.0) == pytest.approx(100 * twist + 2 * slip)


@given(st.floats(1e-3, 0.5), st.floats(-2, 2), st.floats(-2, 2))
def test_the_far_side_of_a_play_stays_within_it(gap, reading, x):
    after = play(gap, reading, x)
    assert abs(after - x) <= max(gap / 2, 0.0) * (1 + 1e-9) + 1e-12
    assert play(gap, after, x) == pytest.approx(after)  # it is at rest there
    if abs(x - reading) < gap / 2:
        assert after == reading


@given(st.floats(1, 50), st.floats(0.01, 0.9))
def test_a_sampled_resonance_has_its_poles(frequency, ratio):
    first, second, b1, b2 = resonance(frequency, ratio, 1e-3)
    assert math.sqrt(b2) == pytest.approx(math.exp(-2 * math.pi * ratio * frequency * 1e-3))
    assert b1**2 <= 4 * b2  # a conjugate pair
    assert (first + second) / (1 + b1 + b2) == pytest.approx(1.0)  # static gain


def test_under_a_held_input_the_sampled_resonance_is_the_differential_equation():
    w, z, dt = 2 * math.pi * 20.0, 0.1, 1e-3
    first, second, b1, b2 = resonance(20.0, z, dt)
    y = [0.0, first]  # a step at t = 0
    for _ in range(200):
        y.append(first + second - b1 * y[-1] - b2 * y[-2])
    t = dt * np.arange(len(y))
    damped = w * math.sqrt(1 - z * z)
    exact = 1 - np.exp(-z * w * t) * (np.cos(damped * t) + z * w / damped * np.sin(damped * t))
    np.testing.assert_allclose(y, exact, atol=1e-9)


@pytest.mark.parametrize("cls", [Backlash, FlexibleCoupling])
@pytest.mark.parametrize("share", [0.0, 1.0])
def test_a_share_of_all_or_nothing_is_refused(cls, share):
    with pytest.raises(ValueError, match="load_share"):
        cls(load_share=share)
