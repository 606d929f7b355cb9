"""What stands between the axis and its log."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from whsklearn.effects import EncoderEccentricity, OutputDrift, OutputOffset, SensorRectification
from whsklearn.effects.equations import quantized

angles = st.floats(-10, 10)


@given(angles, st.floats(1e-4, 0.5))
def test_rounding_is_to_the_lattice_and_by_half_a_step_at_most(q, step):
    read = quantized(step, q)
    assert abs(read - q) <= 0.5 * step * (1 + 1e-9)
    assert quantized(step, read) == pytest.approx(read, abs=1e-12)  # what is on the lattice stays
    assert quantized(0.0, q) == q


@given(angles, st.floats(0, 1))
def test_a_lost_sign_leaves_positive_readings_alone(q, fraction):
    read = q + SensorRectification(fraction).value(position=q)
    assert read == pytest.approx((1 - fraction) * q + fraction * abs(q), abs=1e-12)
    if q >= 0:
        assert read == pytest.approx(q)


@given(angles)
def test_an_eccentric_disc_is_right_again_after_a_turn(q):
    e = EncoderEccentricity(1e-3, order=2.0, phase=0.5)
    assert e.value(position=q + 2 * np.pi) == pytest.approx(e.value(position=q), abs=1e-12)
    assert abs(e.value(position=q)) <= 1e-3 * (1 + 1e-12)  # cosine and sine weights are rounded


def test_offset_and_drift():
    np.testing.assert_allclose(OutputOffset(0.01).value(position=[0.0, 5.0]), 0.01)
    np.testing.assert_allclose(OutputDrift(0.001).value(time=[0.0, 10.0]), [0.0, 0.01])
