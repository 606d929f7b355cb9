"""The sign, sharp and smooth, and the waves over an angle."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from whsklearn.effects.equations import clipped, smooth_sign, tanh, wave


@given(st.floats(-50, 50))
def test_tanh_is_that_of_the_c_library_to_a_few_units(z):
    assert tanh(z) == pytest.approx(math.tanh(z), rel=1e-15, abs=1e-300)


@given(st.floats(-3, 3), st.floats(0.1, 50))
def test_the_slope_is_the_derivative(dx, kappa):
    _, slope = smooth_sign(dx, kappa)
    h = 1e-6 / kappa
    numeric = (smooth_sign(dx + h, kappa)[0] - smooth_sign(dx - h, kappa)[0]) / (2 * h)
    assert slope == pytest.approx(numeric, abs=1e-4 * kappa)


@given(st.floats(-10, 10), st.floats(0.1, 50))
def test_it_is_odd_and_below_one(dx, kappa):
    value, _ = smooth_sign(dx, kappa)
    assert smooth_sign(-dx, kappa)[0] == -value
    assert abs(value) <= 1.0


@pytest.mark.parametrize(("dx", "sign"), [(-2.0, -1.0), (0.0, 0.0), (1e-300, 1.0)])
def test_sharp_means_sharp(dx, sign):
    assert smooth_sign(dx, math.inf) == (sign, 0.0)


def test_a_negative_kappa_has_the_value_of_the_sign_and_the_slope_of_the_tanh():
    value, slope = smooth_sign(0.1, -5.0)
    assert (value, slope) == (1.0, smooth_sign(0.1, 5.0)[1])


@given(st.floats(0, 5), st.floats(-3, 3), st.floats(-10, 10))
def test_a_wave_is_amplitude_and_phase(amplitude, phase, q):
    cosine, sine = amplitude * math.cos(phase), -amplitude * math.sin(phase)
    assert wave(cosine, sine, q) == pytest.approx(amplitude * math.cos(q + phase), abs=1e-12)


def test_clipping():
    assert [clipped(v, 2.0) for v in (-3.0, 0.5, 3.0)] == [-2.0, 0.5, 2.0]
    assert np.isfinite(clipped(1.0, math.inf))
