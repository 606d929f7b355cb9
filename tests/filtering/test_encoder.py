"""Noise of an encoder and the cut-off that it allows."""

from __future__ import annotations

import numpy as np
import pytest

from whsklearn.filtering.encoder import KEPT, encoder_noise, motion_cutoff
from whsklearn.filtering.records import motion

RATE = 2000.0


def position(frequencies=(0.5, 1.3, 3.7), seconds=20.0):
    t = np.arange(int(seconds * RATE)) / RATE
    return sum(np.sin(2 * np.pi * f * t + f) / (1 + f) for f in frequencies)


def on_counts(q, counts):
    step = 2 * np.pi / counts
    return step * np.round(q / step)


@pytest.mark.parametrize("counts", [1000, 4096, 20_000])
def test_the_noise_of_an_encoder_is_that_of_rounding(counts):
    step = 2 * np.pi / counts
    assert encoder_noise(on_counts(position(), counts), RATE) == pytest.approx(step / np.sqrt(12), rel=0.3)


def test_a_finer_encoder_allows_a_higher_cutoff():
    cutoffs = [motion_cutoff(on_counts(position(), counts), RATE) for counts in (1000, 4096, 20_000, 200_000)]
    assert cutoffs == sorted(cutoffs)
    assert cutoffs[0] < cutoffs[-1] < motion_cutoff(position(), RATE)


@pytest.mark.parametrize("counts", [1000, 4096, 20_000])
def test_the_motion_passes(counts):
    q = on_counts(position(), counts)
    inner = slice(4000, -4000)
    kept = np.var(motion(q, RATE, motion_cutoff(q, RATE)).acceleration[inner])
    assert kept > 0.9 * KEPT * np.var(motion(position(), RATE, 100.0).acceleration[inner])


def test_the_unit_makes_no_difference():
    q = on_counts(position(), 4096)
    assert motion_cutoff(1e3 * q, RATE) == motion_cutoff(q, RATE)
    assert encoder_noise(1e3 * q, RATE) == pytest.approx(1e3 * encoder_noise(q, RATE))
