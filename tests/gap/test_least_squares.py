"""The minimum is found, bounds hold, and a gain is that of a projection."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import nnls

from whsklearn.gap import least_squares as ols
from whsklearn.gap.least_squares import carried_along, gain_of, jacobian, least_squares

WIDE = (np.full(2, -10.0), np.full(2, 10.0))


def rosenbrock(x):
    return np.array([10 * (x[1] - x[0] ** 2), 1 - x[0]])


def test_it_reaches_the_bottom_of_a_curved_valley():
    fit = least_squares(rosenbrock, np.array([-1.2, 1.0]), np.full(2, 1e-6), WIDE, max_iterations=200, tolerance=0.0)
    np.testing.assert_allclose(fit.x, [1.0, 1.0], atol=1e-4)
    assert fit.cost == pytest.approx(0.0, abs=1e-8)


def test_a_bound_holds_and_the_rest_is_least_there():
    low, high = np.array([-10.0, -10.0]), np.array([0.5, 10.0])
    fit = least_squares(rosenbrock, np.zeros(2), np.full(2, 1e-6), (low, high), max_iterations=200, tolerance=0.0)
    np.testing.assert_allclose(fit.x, [0.5, 0.25], atol=1e-4)


def test_differences_are_the_derivatives_and_turn_back_at_a_bound():
    x = np.array([0.7, 0.3])
    exact = np.array([[-20 * x[0], 10.0], [-1.0, 0.0]])
    for high in (np.full(2, 10.0), x):
        found = jacobian(rosenbrock, x, rosenbrock(x), np.full(2, 1e-7), high)
        np.testing.assert_allclose(found, exact, atol=1e-5)


def test_the_gain_of_columns_is_what_the_larger_fit_explains_more():
    rng = np.random.default_rng(0)
    base, columns, r = rng.normal(size=(50, 2)), rng.normal(size=(50, 3)), rng.normal(size=50)

    def left(design):
        return np.linalg.lstsq(design, r, rcond=None)[1][0]

    gain, _ = gain_of(r, base, columns)
    assert gain == pytest.approx(left(base) - left(np.hstack([base, columns])), rel=1e-9)
    assert gain_of(r, base, base[:, :1])[0] == pytest.approx(0.0, abs=1e-9)


def test_bounds_hold_and_the_minimum_is_found():
    target = np.array([1.0, 5.0])
    fit = least_squares(
        lambda x: np.concatenate([x - target, 0.1 * x]),
        np.zeros(2),
        np.full(2, 1e-4),
        (np.full(2, -3.0), np.full(2, 3.0)),
    )
    assert fit.x == pytest.approx([1 / 1.01, 3.0], abs=1e-3)


def counted(target):
    """A mildly bent residual of eight numbers, and a list that grows by one with every call."""
    calls = []
    mix = np.random.default_rng(3).normal(size=(40, 8))

    def residual(x):
        calls.append(0)
        z = mix @ (x - target)
        return z + 0.02 * z**2

    return residual, calls


def test_derivatives_carried_along_save_evaluations_and_reach_the_same_minimum():
    target = np.linspace(-1.0, 1.0, 8)
    arguments = np.zeros(8), np.full(8, 1e-6), (np.full(8, -5.0), np.full(8, 5.0))
    residual, calls = counted(target)
    fit = least_squares(residual, *arguments, tolerance=1e-9)
    carried = len(calls)
    residual, calls = counted(target)
    x, steps, bounds = arguments
    anew = least_squares(
        residual,
        x,
        steps,
        bounds,
        tolerance=1e-9,
        slopes=lambda x: jacobian(residual, x, residual(x), steps, bounds[1]),
    )
    np.testing.assert_allclose(fit.x, target, atol=1e-5)
    np.testing.assert_allclose(anew.x, target, atol=1e-5)
    assert carried < 0.7 * len(calls)


def test_derivatives_carried_along_know_the_last_move_and_nothing_new_across_it():
    rng = np.random.default_rng(1)
    jac, move, change = rng.normal(size=(30, 4)), rng.normal(size=4), rng.normal(size=30)
    along = carried_along(jac, move, change)
    np.testing.assert_allclose(along @ move, change)
    weighted = np.sum(jac**2, axis=0) * move
    across = rng.normal(size=4)
    across -= weighted * (across @ weighted) / (weighted @ weighted)
    np.testing.assert_allclose(along @ across, jac @ across)


def test_a_start_far_outside_the_straight_part_is_left_with_short_steps():
    """At x = 100 the Gauss-Newton step of arctan(x) is 15,600; only one below 200 takes anything off."""
    fit = least_squares(np.arctan, np.array([100.0]), np.array([1e-4]), (np.array([-1e6]), np.array([1e6])))
    assert abs(fit.x[0]) < 1e-3


# --- linear, with signs ---

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
