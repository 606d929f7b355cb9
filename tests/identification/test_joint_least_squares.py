"""Least squares of coupled joints: standard errors that hold what they say."""

from __future__ import annotations

import numpy as np

from whsklearn.identification.joint_least_squares import block_covariance


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
