"""A line of past samples, newest first."""

from __future__ import annotations

import numpy as np

from whsklearn.recursion.rows.delay_line import push


def test_it_holds_the_last_samples_newest_first():
    past = np.zeros(3)
    for value in (1.0, 2.0, 3.0, 4.0):
        push(past, np.array([value]))
    np.testing.assert_array_equal(past, [4.0, 3.0, 2.0])


def test_several_inputs_stay_together():
    past = np.zeros(4)
    push(past, np.array([1.0, 10.0]))
    push(past, np.array([2.0, 20.0]))
    np.testing.assert_array_equal(past, [2.0, 20.0, 1.0, 10.0])
