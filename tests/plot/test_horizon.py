"""Error against horizon rises to the free run."""

from __future__ import annotations

import pytest

from whsklearn.plot import HorizonDisplay


def test_horizon_curve_rises_to_the_free_run(model, record):
    shown = HorizonDisplay.from_estimator(model, *record, horizons=[1, 2, 5, 40])
    error = shown.errors["FirstOrder"]
    assert error[0] < error[1] < error[2]
    assert error[-1] == pytest.approx(shown.free_run["FirstOrder"], rel=0.02)
