"""Closure is a share of the gap, and never flatters."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from whsklearn.gap.proof import closure

positive = st.floats(1e-6, 1e3)


@given(positive, positive, positive)
def test_it_lies_between_minus_one_and_one(before, after, floor):
    assert -1.0 <= closure(before, after, floor) <= 1.0


@given(positive, positive, positive)
def test_units_do_not_matter(before, after, floor):
    np.testing.assert_allclose(closure(before, after, floor), closure(8 * before, 8 * after, 8 * floor), atol=1e-9)


@given(positive, positive, positive, positive)
def test_a_smaller_error_never_closes_less(before, one, other, floor):
    small, large = sorted((one, other))
    assert closure(before, small, floor) >= closure(before, large, floor) - 1e-9


def test_the_ends():
    assert closure(2.0, 1.0, 1.0) == 1.0
    assert closure(2.0, 2.0, 1.0) == 0.0
    assert closure(1.0, 0.5, 1.0) == 0.0  # no gap, nothing to close


def test_a_model_that_diverges_is_no_yardstick():
    assert closure(1e6, 4.0, 0.0, spread=5.0) < 0.25
    assert closure(1e6, 7.0, 0.0, spread=5.0) == 0.0
