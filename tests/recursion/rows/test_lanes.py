"""Eight numbers at once give the bits that each gives alone, compiled and uncompiled."""

from __future__ import annotations

import numpy as np
import pytest

from whsklearn._numba import njit
from whsklearn.recursion.rows.lanes import LANES, gather, put, take


@njit(cache=False, error_model="numpy")
def _formula(flat, table, stride, out):
    a, b, c = take(flat, 0), take(flat, 1), gather(table, 3, stride)
    put(out, 1, -a / b + c * a - b)


@pytest.mark.parametrize("stride", [0, 1, 5])
def test_a_formula_of_eight_numbers_is_that_of_each(stride):
    rng = np.random.default_rng(0)
    flat, table, out = rng.standard_normal(2 * LANES), rng.standard_normal(40), np.zeros(3 * LANES)
    a, b, c = flat[:LANES], flat[LANES:], table[3 + stride * np.arange(LANES)]
    _formula(flat, table, stride, out)
    np.testing.assert_array_equal(out[LANES : 2 * LANES], -a / b + c * a - b)
    assert not out[:LANES].any()
    assert not out[2 * LANES :].any()


def test_uncompiled_they_are_arrays():
    flat, table, out = np.arange(2.0 * LANES) + 1.0, np.arange(40.0), np.zeros(3 * LANES)
    again = out.copy()
    _formula(flat, table, 2, out)
    _formula.py_func(flat, table, 2, again)
    np.testing.assert_array_equal(out, again)


def test_an_eight_that_was_taken_does_not_follow_its_array():
    @njit(cache=False)
    def kept(array, out):
        before = take(array, 0)
        array[:] = 0.0
        put(out, 0, before)

    for run in (kept, kept.py_func):
        out = np.zeros(LANES)
        run(np.arange(1.0 * LANES), out)
        np.testing.assert_array_equal(out, np.arange(1.0 * LANES))
