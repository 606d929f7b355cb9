"""Blocks end at reversals, drift is slower than the motion, and only one path is one path."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tests.compare.linear import TRUTH, rows
from whsklearn.compare.rows import blocks_between, difference, drifting, reversals_of


def test_blocks_are_contiguous_and_end_at_reversals():
    turns = np.sort(np.random.default_rng(0).choice(np.arange(20, 980), 30, replace=False))
    block = blocks_between(turns, 1000)
    edges = np.flatnonzero(np.diff(block)) + 1
    assert set(edges) <= set(turns)
    assert 5 <= block.max() + 1 <= 10
    assert set(np.diff(block)) <= {0, 1}


def test_slow_noise_around_standstill_is_no_reversal():
    speed = np.concatenate([np.full(10, 1.0), 1e-4 * np.array([1, -1, 1, -1]), np.full(10, 1.0), np.full(10, -1.0)])
    assert reversals_of(speed, 1e-3).tolist() == [24]


def test_no_drift_is_as_fast_as_the_motion():
    t = np.linspace(0.0, 10.0, 500)
    columns = np.ones((500, 1))
    counts = [drifting(columns, ("input_offset",), t, hz)[0].shape[1] for hz in (0.0, 0.1, 0.2, 1.0)]
    assert counts == [0, 1, 2, 4]
    assert drifting(columns, ("inertia",), t, 1.0)[0].shape == (500, 0)


def test_a_path_that_begins_later_is_the_same_path():
    a, whole = rows(seed=1, n=2800), rows(seed=1, n=3000)
    cut = slice(100, 2900)
    later = replace(
        whole, columns=whole.columns[cut], target=whole.target[cut], at=np.arange(2800), time=whole.time[:2800],
        path=whole.path[cut], block=whole.block[cut], nuisances=whole.nuisances[cut],
    )  # fmt: skip
    apart = difference(a, later, TRUTH)
    assert apart is not None
    assert apart.target.size > 2600
    # the same record, moved: nothing is left but interpolation
    assert np.sqrt(np.mean(apart.target**2)) < 1e-6 * later.scale + 2.0 * np.std(whole.target - whole.columns @ TRUTH)
    assert difference(a, rows(seed=2), TRUTH) is None
