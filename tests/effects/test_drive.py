"""What happens between the command and the shaft."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from whsklearn.effects import DeadZone, InputDelay, InputOffset, Saturation, TorqueRipple
from whsklearn.effects.equations import delayed, lagged

drives = st.floats(-10, 10)


@given(drives, st.floats(0.01, 3))
def test_dead_zone_and_limit_leave_the_drive_its_sign(u, size):
    for effect in (DeadZone(size), Saturation(size)):
        left = u - effect.value(drive=u)
        assert left * u >= -1e-12
        assert abs(left) <= abs(u) + 1e-12


@given(drives, st.floats(0.01, 3))
def test_a_limit_holds_and_a_dead_zone_gives_nothing_inside(u, size):
    assert abs(u - Saturation(size).value(drive=u)) <= size + 1e-12
    left = abs(u - DeadZone(size).value(drive=u))
    assert left == pytest.approx(max(abs(u) - size, 0.0), abs=1e-12)


def test_ripple_is_in_proportion_to_the_drive():
    e = TorqueRipple(0.1, order=6.0, phase=0.4)
    np.testing.assert_allclose(
        e.value(position=0.7, drive=[1.0, -2.0]), e.value(position=0.7, drive=1.0) * np.r_[1, -2]
    )


def test_an_offset_knows_no_signal():
    assert InputOffset(0.1).value(velocity=[-3.0, 0.0], drive=[1.0, 2.0]) == pytest.approx([0.1, 0.1])


@given(st.floats(-5, 5), st.floats(-5, 5), st.floats(1e-4, 0.1), st.floats(1e-4, 0.1))
def test_a_lag_is_exact_in_any_number_of_steps(u, state, constant, h):
    _, once = lagged(u, state, constant, h)
    _, half = lagged(u, state, constant, h / 2)
    _, twice = lagged(u, half, constant, h / 2)
    assert once == pytest.approx(twice, abs=1e-9)
    assert once == pytest.approx(u + (state - u) * math.exp(-h / constant), abs=1e-9)


@given(st.floats(0, 100))
def test_a_delay_is_whole_samples_and_a_rest(age):
    whole, rest = delayed(age)
    assert whole + rest == pytest.approx(age)
    assert 0.0 <= rest < 1.0


def test_the_column_of_a_delay_is_its_first_order():
    t = np.arange(200) / 1000
    u = np.sin(20 * t)
    exact = u - np.sin(20 * (t - 1e-4))
    np.testing.assert_allclose(InputDelay(1e-4).value(time=t, drive=u)[5:-5], exact[5:-5], atol=5e-6)
