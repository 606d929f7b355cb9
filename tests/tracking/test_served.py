"""A model file as MLflow serves it."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from whsklearn.models import LinearModel, save_model
from whsklearn.tracking.served import Served


@pytest.fixture
def served(tmp_path):
    units = {"input": "Nm", "output": "rad", "time": "s"}
    model = LinearModel([0.0, 0.5], [1.0, -0.5], units=units)
    save_model(model, tmp_path / "model.json")
    return Served(str(tmp_path / "model.json")), model


def test_it_is_the_free_run_in_the_unit_that_the_column_says(served):
    served, model = served
    u = np.random.default_rng(0).normal(size=50)
    expected = model.simulate(u)
    np.testing.assert_allclose(served.predict(u[:, None]), expected)
    np.testing.assert_allclose(served.predict(pd.DataFrame({"torque_nm": u})), expected)
    np.testing.assert_allclose(served.predict(pd.DataFrame({"torque_mnm": 1e3 * u})), expected)
    np.testing.assert_allclose(served.predict(pd.DataFrame({"u": u})), expected)


def test_several_columns_and_another_unit_are_refused(served):
    served, _ = served
    with pytest.raises(ValueError, match="expected one column"):
        served.predict(np.zeros((5, 2)))
    with pytest.raises(ValueError, match="'current_a' is in A, which cannot be converted to Nm"):
        served.predict(pd.DataFrame({"current_a": np.zeros(5)}))
