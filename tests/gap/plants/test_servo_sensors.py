"""A sensor that loses the sign, mended before any model is fitted."""

from __future__ import annotations

import numpy as np

from whsklearn.gap.plants.servo_sensors import unfold


def test_folded_reading_is_unfolded_and_a_straight_one_left_alone():
    t = np.arange(8000) * 1e-3
    q = 2 * np.sin(2 * t)
    straight = unfold(np.abs(q), 1e-3)
    assert straight is not None
    assert min(np.abs(straight - q).max(), np.abs(straight + q).max()) < 0.02
    assert unfold(q, 1e-3) is None
    assert unfold(1 + np.cos(2 * t), 1e-3) is None  # touches zero at rest
