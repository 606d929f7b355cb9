"""Least squares: physical signs kept, an inertia beside a slow force."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import nnls

from whsklearn.gap.plants import inverse_dynamics as ols

RNG = np.random.default_rng(0)
N = 600
COLUMNS = RNG.normal(size=(N, 4)) @ np.diag([1.0, 1e-4, 1e3, 1.0])
TARGET = COLUMNS @ [1.0, 2e4, -1e-3, 0.5] + 0.1 * RNG.normal(size=N)


def test_sizes_are_those_of_least_squares_in_the_columns_own_units():
    c, free = ols.solve(COLUMNS, TARGET, np.zeros(4, dtype=bool))
    np.testing.assert_allclose(c, np.linalg.lstsq(COLUMNS, TARGET, rcond=None)[0], rtol=1e-3)
    assert free.all()


def test_physical_signs_are_kept_as_by_nonnegative_least_squares():
    c, free = ols.solve(COLUMNS, TARGET, np.ones(4, dtype=bool))
    scale = np.sqrt(np.mean(COLUMNS**2, axis=0))
    np.testing.assert_allclose(c * scale, nnls(COLUMNS / scale, TARGET)[0], atol=1e-3)
    assert free.tolist() == [True, True, False, True]


@pytest.mark.parametrize("power", [1, 2, 3, 4])
def test_a_slope_by_five_points_is_exact_to_the_fourth_power(power):
    t = 0.1 * np.arange(50)
    assert ols.slope(t**power, 0.1)[2:-2] == pytest.approx((power * t ** (power - 1))[2:-2], rel=1e-9)


def test_differences_find_an_inertia_beside_a_slow_force_that_is_missing():
    """The force is what least squares takes for an inertia of the other sign: both are sines of one frequency."""
    t = np.arange(4000) * 0.01
    acceleration = -np.sin(t) - 9.0 * 0.05 * np.sin(7.0 * t)
    drive = 2.0 * acceleration + 5.0 * np.sin(t) + np.sin(0.3 * t)
    columns = np.column_stack([acceleration, np.sign(np.cos(t))])
    white = np.linalg.lstsq(columns, drive, rcond=None)[0][0]
    assert white < 0.0
    assert abs(ols.of_differences(columns, drive)[0] - 2.0) < abs(white - 2.0) / 2.0
