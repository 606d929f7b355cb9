"""What was learnt, by its names."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from sklearn.base import clone
from sklearn.exceptions import NotFittedError

from tests.estimators.fitted_models import MODELS
from whsklearn import RLSRegressor


@pytest.mark.parametrize("name", list(MODELS))
def test_parameters_and_theta_are_one_model(fitted, name):
    """The paper's products undone are the named parameters."""
    model = fitted[name]
    named, theta = model.parameters_, model.theta_
    law = [k for k in named if k not in "abcd"]
    g = named[law[0]] if name != "polynomial" else named["x1"]
    np.testing.assert_allclose(theta[: len(named["a"])], g * named["a"], rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(theta[len(theta) - len(named["d"]) :], named["d"])
    assert named["a"][0] == named["c"][0] == 1.0
    assert {k: np.shape(v) for k, v in model.parameter_standard_errors_.items()} == {
        k: np.shape(v) for k, v in named.items()
    }
    assert model.covariance_.shape == (theta.size, theta.size)


def test_names_of_given_rows():
    frame = pd.DataFrame(np.random.default_rng(0).standard_normal((30, 2)), columns=["mass", "drag"])
    model = RLSRegressor().fit(frame, frame @ [1.0, 2.0])
    assert model.parameters_ == pytest.approx({"mass": 1.0, "drag": 2.0}, rel=1e-4)
    assert list(model.parameter_standard_errors_) == ["mass", "drag"]
    assert list(RLSRegressor().fit(frame.to_numpy(), np.ones(30)).parameters_) == ["x0", "x1"]


@pytest.mark.parametrize("attribute", ["theta_", "covariance_", "standard_errors_", "parameters_"])
def test_nothing_before_fit(attribute, record):
    model = clone(MODELS["RMILS"])
    with pytest.raises(NotFittedError):
        getattr(model, attribute)
    for call in (model.predict, model.get_state, lambda X: model.predict_ahead(X, record[1])):
        with pytest.raises(NotFittedError):
            call(record[0]) if call != model.get_state else call()
