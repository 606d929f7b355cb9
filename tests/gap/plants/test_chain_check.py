"""Records of input and output that cannot be used."""

from __future__ import annotations

import numpy as np
import pytest

from whsklearn.gap.plants.chain_check import check_chain
from whsklearn.gap.plants.chain_evidence import FEWEST

RNG = np.random.default_rng(0)
U, Y = RNG.normal(size=(2, 2000))


def codes(u, y):
    return [p.code for p in check_chain(np.asarray(u), np.asarray(y))]


def with_spikes(y):
    out = y.copy()
    out[[5, 700]] = 1e4
    return out


@pytest.mark.parametrize(
    ("u", "y", "code"),
    [
        (U, np.where(np.arange(2000) == 7, np.nan, Y), "data-not-finite"),
        (U[: FEWEST - 1], Y[: FEWEST - 1], "data-too-short"),
        (np.ones(2000), Y, "data-no-drive"),
        (np.repeat(U[:20], 100), Y, "data-no-drive"),
        (U, np.zeros(2000), "data-not-moving"),
        (U, np.clip(np.cumsum(0.1 * U), -1.0, 1.0), "data-clipped-position"),
        (U, with_spikes(Y), "data-spikes"),
    ],
)
def test_what_cannot_be_used_is_told_and_is_fatal(u, y, code):
    problems = check_chain(u, y)
    assert [p.code for p in problems] == [code]
    assert all(p.fatal for p in problems)


def test_sound_and_coarse_readings_pass():
    assert codes(U, Y) == []
    assert codes(U, np.sign(Y)) == []  # few levels: each is an extreme by rounding
    assert codes(U[:FEWEST], Y[:FEWEST]) == []
