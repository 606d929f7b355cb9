"""Output, simulation and their difference."""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
import pytest

from whsklearn.metrics import nmse
from whsklearn.plot import TrackingDisplay


def test_tracking_error_panel_is_the_difference(model, record):
    X, y = record
    shown = TrackingDisplay.from_estimator(model, X, y, time=np.arange(600) / 100)
    (line,) = [li for li in shown.axes_[1].lines if len(li.get_xdata()) == 600]
    np.testing.assert_allclose(line.get_ydata(), y - model.predict(X))
    assert shown.axes_[1].get_xlabel() == "time in s"


def test_tracking_legend_judges_the_samples_that_the_tables_judge():
    y = np.r_[np.ones(50) * 9.0, np.sin(np.arange(200))]
    y_hat = np.r_[np.zeros(50), 0.9 * np.sin(np.arange(200))]
    label = TrackingDisplay(y, {"m": y_hat}, skip=50).plot().axes_[0].get_legend_handles_labels()[1][1]
    assert label == f"m, NMSE {nmse(y, y_hat, skip=50):.2g}" == "m, NMSE 0.01"


def test_too_few_axes_are_refused(model, record):
    _, ax = plt.subplots()
    with pytest.raises(ValueError, match="got 1 axes, expected 2"):
        TrackingDisplay.from_estimator(model, *record, axes=ax)
