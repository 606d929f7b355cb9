"""The drive between its samples."""

from __future__ import annotations

import numpy as np
import pytest

from whsklearn.filtering.between_samples import fine_drive


def test_a_held_drive_stays_until_the_next_sample():
    assert fine_drive(np.array([1.0, 3.0]), 3).tolist() == [[1.0] * 3, [3.0] * 3]


def test_a_smooth_drive_is_that_of_a_band_limited_signal():
    """A sine of nine samples a period, away from the ends."""
    at = np.arange(90)[:, None] + (np.arange(4) + 0.5) / 4
    fine = fine_drive(np.sin(2 * np.pi * np.arange(90) / 9), 4, "cubic")
    np.testing.assert_allclose(fine[20:70], np.sin(2 * np.pi * at / 9)[20:70], atol=1e-3)


@pytest.mark.parametrize("cut", [30, 45])
def test_segments_know_nothing_of_each_other(cut):
    u = np.random.default_rng(0).standard_normal(90)
    both = fine_drive(u, 2, "cubic", np.array([0, cut, 90]))
    np.testing.assert_allclose(both[:cut], fine_drive(u[:cut], 2, "cubic"), atol=1e-12)
    np.testing.assert_allclose(both[cut:], fine_drive(u[cut:], 2, "cubic"), atol=1e-12)
