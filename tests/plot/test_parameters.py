"""Parameters by name, and their paths."""

from __future__ import annotations

import pytest

from tests.plot.first_order import FirstOrder
from whsklearn.plot import flat_parameters, parameter_paths


def test_parameters_are_named_in_the_order_of_the_chain():
    given = {"d": [0.15, 0.4], "viscous": 0.05, "c": [1, 0.2], "coulomb": 0.7, "b": [1.0, 0.5], "a": [1, 2.2]}
    assert list(flat_parameters(given)) == ["a2", "b1", "b2", "viscous", "coulomb", "c2", "d1", "d2"]


def test_paths_end_at_the_fit_of_the_whole_record(record):
    steps, paths = parameter_paths(FirstOrder(), *record, every=64)
    assert steps[-1] == 600
    # blocks hide the products across their borders from this simple learner, so the end is near, not equal
    assert paths["d1"][-1] == pytest.approx(FirstOrder().fit(*record).parameters_["d"][0], abs=0.02)
    assert all(len(p) == len(steps) for p in paths.values())


def test_paths_leave_the_estimator_alone(record):
    model = FirstOrder()
    parameter_paths(model, *record)
    assert not hasattr(model, "parameters_")
