"""Filters over rows are scipy's, at rest where an experiment begins."""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter

from whsklearn.recursion.batch.linear_filter import delayed_rows, filter_rows

ROWS = np.random.default_rng(0).normal(size=(2, 50))
BOUNDS = np.array([0, 20, 50])


def test_each_experiment_is_filtered_from_rest():
    b, a = np.array([0.0, 1.0, 0.3]), np.array([1.0, -0.8, 0.2, 0.05])
    out = filter_rows(b, a, ROWS, BOUNDS)
    expected = np.hstack([lfilter(b, a, ROWS[:, :20]), lfilter(b, a, ROWS[:, 20:])])
    np.testing.assert_allclose(out, expected, atol=1e-12)


def test_delays_do_not_reach_over_the_border_of_an_experiment():
    out = delayed_rows(ROWS[0], 3, BOUNDS)
    np.testing.assert_array_equal(out[0], ROWS[0])
    np.testing.assert_array_equal(out[2, [0, 1, 20, 21]], 0.0)
    np.testing.assert_array_equal(out[2, 22:], ROWS[0, 20:-2])
