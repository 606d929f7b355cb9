"""Sizes that follow from a reading's settings."""

from __future__ import annotations

import numpy as np
import pytest

from whsklearn.effects.law import reduced_law
from whsklearn.recursion.memory.settings import FIRST_RERUN, Settings

LAW = reduced_law()


def reading(dims, memory=1024, n_inputs=1):
    dims = np.array([*dims, len(LAW)], dtype=np.int64)
    settings = {"p": 4, "p0": 1.0, "forgetting": 1.0, "n_starts": 2, "frozen": False, "seed": 0}
    return Settings(dims, LAW.codes, LAW.shapes, memory=memory, n_inputs=n_inputs, **settings)


@pytest.mark.parametrize(("dims", "size"), [((2, 2, 2, 2), 9), ((1, 0, 1, 0), 3), ((4, 1, 3, 5), 3 + 1 + 3 + 2 + 5)])
def test_one_gain_of_each_block_is_the_laws(dims, size):
    assert reading(dims).size == size


@pytest.mark.parametrize(
    ("dims", "n_inputs", "history"), [((6, 2, 2, 3), 1, 6), ((6, 2, 2, 3), 2, 3), ((1, 0, 1, 0), 1, 1)]
)
def test_a_window_needs_the_lags_of_one_input_and_of_the_output(dims, n_inputs, history):
    assert reading(dims, n_inputs=n_inputs).history == history


def test_the_first_re_run_waits_for_four_samples_a_parameter_and_fits_in_the_memory():
    assert reading((1, 0, 1, 0)).first_rerun == FIRST_RERUN
    assert reading((9, 9, 9, 9)).first_rerun == 4 * reading((9, 9, 9, 9)).size
    assert reading((9, 9, 9, 9), memory=50).first_rerun == 50


@pytest.mark.parametrize("memory", [1, 7, 1024])
def test_a_page_is_turned_half_a_page_after_it_is_full(memory):
    end = reading((2, 2, 2, 2), memory=memory).page_end
    assert end > memory
    assert end == memory + max(memory // 2, 1)
