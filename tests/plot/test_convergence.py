"""Parameter paths and the error of the paper."""

from __future__ import annotations

import numpy as np

from tests.plot.first_order import FirstOrder
from whsklearn.plot import ConvergenceDisplay


def test_convergence_shows_the_error_of_the_paper():
    paths = {"b1": np.array([0.0, 3.0]), "c2": np.array([0.0, 4.0])}
    shown = ConvergenceDisplay({"m": ([1, 2], paths)}, truth={"b1": 3.0, "c2": 4.0})
    np.testing.assert_allclose(shown.errors()["m"], [1.0, 0.0])


def test_convergence_without_truth_has_no_error_panel(record):
    shown = ConvergenceDisplay.from_estimator(FirstOrder(), *record)
    assert len(shown.axes_) == 3
    assert shown.errors() == {}


def test_wild_first_estimates_do_not_set_the_scale():
    path = np.r_[np.full(10, 1e9), np.linspace(0, 1, 990)]
    shown = ConvergenceDisplay({"m": (np.arange(1000), {"d1": path})}, truth={"d1": 1.0}).plot()
    assert shown.axes_[2].get_ylim()[1] < 3
