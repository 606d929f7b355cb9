"""A model is saved and loaded, and goes on as it was."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

from tests.estimators.fitted_models import MODELS
from whsklearn import RMILSRegressor
from whsklearn.checks import state_difference


@pytest.mark.parametrize("name", list(MODELS))
def test_saved_and_loaded_it_is_the_same_model(fitted, record, name, tmp_path):
    model = fitted[name]
    model.save(tmp_path / "model.whs")
    loaded = type(model).load(tmp_path / "model.whs")
    assert state_difference(model.get_state(), loaded.get_state()) == 0.0
    np.testing.assert_array_equal(loaded.predict(record[0]), model.predict(record[0]))
    np.testing.assert_array_equal(loaded.theta_, model.theta_)
    again = pickle.loads(pickle.dumps(model))
    np.testing.assert_array_equal(again.predict(record[0]), model.predict(record[0]))


def test_a_file_of_another_estimator_is_refused(fitted, tmp_path):
    fitted["PEM"].save(tmp_path / "model.whs")
    with pytest.raises(ValueError, match="state of a PEMRegressor"):
        RMILSRegressor.load(tmp_path / "model.whs")


@pytest.mark.parametrize("count", [2**63, -1, 4.5, "many", None])
@pytest.mark.parametrize("name", list(MODELS))
def test_a_count_of_samples_that_is_none_is_refused_and_changes_nothing(fitted, record, name, count):
    model = fitted[name]
    before = model.predict(record[0])
    state = model.get_state()
    state["state"]["seen"] = count
    with pytest.raises(ValueError, match="count"):
        model.set_state(state)
    np.testing.assert_array_equal(model.predict(record[0]), before)
