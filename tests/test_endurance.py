"""The short form of benchmarks/endurance.py: P stays sound and the estimate recovers."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "benchmarks"))
endurance = pytest.importorskip("endurance")


@pytest.mark.parametrize("case", list(endurance.CASES))
def test_recursive_least_squares_stays_sound(case):
    make, forgetting = endurance.CASES[case]
    model = endurance.RLSRegressor(P0=1e15 if "condition" in case else 1e6, forgetting=forgetting)
    row = endurance.watch(case, "RLSRegressor", model, make(np.random.default_rng(0), 100_000))
    assert row.sound
    assert row.digits > 3
    assert row.largest_variance < 1e10


@pytest.mark.parametrize("noise", [0.0, 0.01])
def test_an_axis_comes_back_from_rest(noise):
    row = endurance.axis_at_rest(100_000, noise)
    assert row.sound
    assert row.digits > (0.5 if noise else 1.5)  # what a long rest with noise spoils comes back sample by sample
