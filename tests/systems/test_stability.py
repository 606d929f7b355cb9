"""Schur-Cohn against the roots themselves."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from whsklearn.systems.stability import is_stable


@settings(max_examples=200)
@given(st.lists(st.floats(-3, 3), max_size=6), st.sampled_from([0.5, 0.95, 1.0]))
def test_it_is_about_the_roots(b, radius):
    b = np.array(b)
    largest = np.abs(np.roots(np.r_[1.0, b])).max(initial=0.0)
    if abs(largest - radius) > 1e-6:  # on the border rounding decides
        assert is_stable(b, radius) == (largest < radius)


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_what_is_no_number_is_not_stable(bad):
    assert not is_stable(np.array([0.1, bad]), 1.0)


def test_it_does_not_change_its_argument():
    b = np.array([0.5, -0.3, 0.1])
    is_stable(b, 0.9)
    assert b.tolist() == [0.5, -0.3, 0.1]
