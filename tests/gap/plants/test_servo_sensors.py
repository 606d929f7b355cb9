"""A sensor that loses the sign, mended before any model is fitted."""

from __future__ import annotations

import numpy as np
import pytest

from whsklearn.gap.plants.servo_sensors import unfold


def test_folded_reading_is_unfolded_and_a_straight_one_left_alone():
    t = np.arange(8000) * 1e-3
    q = 2 * np.sin(2 * t)
    straight = unfold(np.abs(q), 1e-3)
    assert straight is not None
    assert min(np.abs(straight - q).max(), np.abs(straight + q).max()) < 0.02
    assert unfold(q, 1e-3) is None
    assert unfold(1 + np.cos(2 * t), 1e-3) is None  # touches zero at rest


@pytest.mark.parametrize("rate", [50, 100, 250, 1000, 4000])
def test_a_reading_folded_between_samples_is_unfolded_at_any_rate(rate):
    """At 100 Hz no sample lay within 2 % of the span at most of the crossings, and the path came back in pieces."""
    t = np.arange(8 * rate) / rate
    q = np.sin(4 * np.pi * t + 0.3) + 0.4 * np.sin(1.24 * np.pi * t)
    straight = unfold(np.abs(q), 1 / rate)
    assert straight is not None
    off = np.abs(straight - np.sign(q[0]) * q)
    assert off[:-1].max() == 0.0, "one sample after a crossing is too few to show it; all others are on their side"


def test_an_axis_that_is_lifted_from_rest_at_zero_is_not_folded():
    jitter = 0.0015 * np.random.default_rng(0).integers(-3, 1, 40)  # counts of an encoder of 12 bits
    t = np.arange(600) * 5e-3
    q = np.concatenate([jitter, 0.7 * np.sin(t) ** 2, jitter, 0.5 * np.sin(t) ** 2])
    assert unfold(q, 5e-3) is None
    assert unfold(np.concatenate([np.abs(np.sin(t[:30]) - 0.01), 1.0 + t]), 5e-3) is None  # all but its start is beyond
