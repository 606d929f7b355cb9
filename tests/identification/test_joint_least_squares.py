"""Least squares of coupled joints: standard errors that hold what they say."""

from __future__ import annotations

import numpy as np
import pytest

from whsklearn.identification.joint_least_squares import block_covariance, halves, held_out


def test_intervals_hold_the_spread_of_numbers_whose_errors_last():
    rng = np.random.default_rng(0)
    x = rng.standard_normal((2000, 2))
    x[:, 1] = np.repeat(rng.standard_normal(40), 50)  # slow, as the errors are
    found, wide = [], []
    for _ in range(40):
        error = np.repeat(rng.standard_normal(40), 50)
        theta = np.linalg.lstsq(x, error, rcond=None)[0]
        left = error - x @ theta
        white = left @ left / 1998 * np.linalg.inv(x.T @ x)
        found.append(theta)
        wide.append(np.sqrt(np.diag(block_covariance(x, left, np.arange(2000) // 100, white))))
        assert np.all(wide[-1] >= 0.999 * np.sqrt(np.diag(white)))
    assert np.std(found, axis=0)[1] > 5.0 * np.sqrt(white[1, 1])  # as white they would be far too sure
    np.testing.assert_allclose(np.mean(wide, axis=0), np.std(found, axis=0), rtol=0.4)


def test_joints_that_move_in_turn_are_held_out_over_their_own_motion():
    """The second joint moves in one tenth of the record only; of either, noise of 1 % of the drive is left."""
    rng = np.random.default_rng(0)
    n, noise = 4000, 0.01
    phi = np.zeros((n, 2, 4))
    phi[:, 0, :2], phi[:, 1, 2:] = rng.standard_normal((2, n, 2))
    keep = np.zeros((n, 2), dtype=bool)
    keep[:3600, 0] = keep[3600:, 1] = True
    target = phi @ np.array([1.0, 2.0, 3.0, -1.0]) * (1.0 + noise * rng.standard_normal((n, 1)))
    assert held_out(phi, target, keep, np.ones(2)) == pytest.approx([noise, noise], rel=0.2)


def test_halves_share_the_motion_of_every_joint():
    keep = np.random.default_rng(0).random((3000, 3)) < np.array([0.9, 0.2, 0.0])
    first, second = halves(keep)
    np.testing.assert_array_equal(first ^ second, keep)
    np.testing.assert_allclose(first.sum(axis=0), second.sum(axis=0), atol=2)
