"""A linear model is its difference equation."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from whsklearn.models import LinearModel

U = np.random.default_rng(0).normal(size=200)


def test_it_runs_the_difference_equation_and_adds_its_offset():
    model = LinearModel([0.0, 0.5, 0.1], [1.0, -0.7], offset=2.0)
    y = model.simulate(U)
    t = np.arange(2, 200)
    left = (y - 2.0)[t] - 0.7 * (y - 2.0)[t - 1]
    np.testing.assert_allclose(left, 0.5 * U[t - 1] + 0.1 * U[t - 2], atol=1e-12)


def test_a_position_is_the_integral_of_the_fitted_velocity():
    kwargs = {"numerator": [1.0], "denominator": [1.0, -0.5], "dt": 0.01}
    velocity, position = LinearModel(**kwargs, logged="velocity"), LinearModel(**kwargs, logged="position")
    np.testing.assert_allclose(np.diff(position.simulate(U)) / 0.01, velocity.simulate(U)[1:], atol=1e-9)
    np.testing.assert_allclose(velocity.simulate(U), lfilter([1.0], [1.0, -0.5], U))


def test_kind_follows_the_criterion_and_numbers_have_names():
    model = LinearModel([0.0, 1.0], [1.0, -0.5], criterion="prediction")
    assert (model.kind, LinearModel([1.0], [1.0]).kind) == ("arx", "output_error")
    assert model.parameters == {"b0": 0.0, "b1": 1.0, "f1": -0.5, "offset": 0.0}


@pytest.mark.parametrize(
    "wrong", [{"denominator": [2.0, 1.0]}, {"criterion": "best"}, {"dt": 0.0}, {"logged": "speed"}]
)
def test_what_cannot_be_is_refused(wrong):
    with pytest.raises(ValueError, match="expected"):
        LinearModel(**{"numerator": [1.0], "denominator": [1.0], **wrong})


def test_an_input_that_is_not_finite_is_refused():
    with pytest.raises(ValueError, match="NaN"):
        LinearModel([1.0], [1.0]).simulate([0.0, np.nan])
