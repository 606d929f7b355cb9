"""Many recursions at once agree with each one on its own, whatever the number of threads."""

from __future__ import annotations

import numpy as np
import pytest

from whsklearn import RLSRegressor
from whsklearn.recursion.rows.batched import least_squares_of_many
from whsklearn.recursion.rows.covariance import covariance
from whsklearn.recursion.rows.lanes import LANES


@pytest.fixture(scope="module")
def fleet():
    rng = np.random.default_rng(0)
    X = rng.normal(size=(7, 200, 4))
    theta = rng.normal(size=(7, 4))
    return X, np.einsum("ijk,ik->ij", X, theta) + 0.1 * rng.normal(size=(7, 200))


@pytest.mark.parametrize("forgetting", [1.0, 0.97])
def test_each_axis_is_weighted_least_squares_with_a_prior(fleet, forgetting):
    X, y = fleet
    theta, P = least_squares_of_many(X, y, P0=100.0, forgetting=forgetting)
    weight = forgetting ** np.arange(200)[::-1]
    for axis in range(7):
        information = (X[axis] * weight[:, None]).T @ X[axis] + forgetting**200 / 100.0 * np.eye(4)
        np.testing.assert_allclose(theta[axis], np.linalg.solve(information, X[axis].T @ (weight * y[axis])), rtol=1e-9)
        np.testing.assert_allclose(P[axis], np.linalg.inv(information), rtol=1e-9, atol=1e-14)


def test_threads_make_no_difference(fleet):
    for one, several in zip(*(least_squares_of_many(*fleet, n_jobs=n) for n in (1, 3)), strict=True):
        np.testing.assert_array_equal(one, several)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"X": np.zeros((7, 200))}, "shape"),
        ({"y": np.zeros((7, 199))}, "shape"),
        ({"y": np.full((7, 200), np.nan)}, "NaN"),
        ({"P0": 0.0}, "P0"),
        ({"forgetting": 1.5}, "forgetting"),
        ({"n_jobs": -1}, "n_jobs is -1, expected a whole number of 1 or more"),
    ],
)
def test_bad_input_is_refused(fleet, change, said):
    with pytest.raises(ValueError, match=said):
        least_squares_of_many(**({"X": fleet[0], "y": fleet[1]} | change))


@pytest.mark.parametrize("n_axes", [1, LANES - 1, LANES + 2])
def test_axes_abreast_are_those_by_themselves_to_the_bit(n_axes):
    rng = np.random.default_rng(1)
    X, y = rng.standard_normal((n_axes, 30, 4)), rng.standard_normal((n_axes, 30))
    theta, P = least_squares_of_many(X, y, forgetting=0.98, n_jobs=2)
    for axis in (0, n_axes - 1):
        model = RLSRegressor(P0=1e6, forgetting=0.98).fit(X[axis], y[axis])
        np.testing.assert_array_equal(theta[axis], model.theta_)
        np.testing.assert_allclose(P[axis], covariance(model.state_["ud"]), rtol=1e-12)
