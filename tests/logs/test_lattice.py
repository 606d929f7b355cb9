"""The grid of the readings is found where there is one, to the digits that a file keeps, and is not invented."""

from __future__ import annotations

import numpy as np
import pytest

from whsklearn.logs.lattice import lattice

RNG = np.random.default_rng(0)
PATH = np.sin(2 * np.arange(20_000) / 1000) + 0.3 * np.sin(7 * np.arange(20_000) / 1000)


@pytest.mark.parametrize("lines", [1000, 8192])
def test_the_step_of_an_encoder_is_found(lines):
    step = 2 * np.pi / lines
    assert lattice(step * np.round(PATH / step)) == pytest.approx(step, rel=1e-9)


def test_digits_cut_off_in_a_file_do_not_spoil_the_step():
    step = 2 * np.pi / 1000
    assert lattice(np.round(step * np.round(PATH / step), 5)) == pytest.approx(step, rel=1e-5)


def test_no_grid_is_invented():
    assert lattice(PATH + 1e-4 * RNG.normal(size=PATH.size)) == 0.0
    assert lattice(np.cumsum(RNG.standard_normal(5000))) == 0.0
    assert lattice(np.zeros(100)) == 0.0
