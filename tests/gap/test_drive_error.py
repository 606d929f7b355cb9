"""What is not known of a torque constant widens the intervals that depend on it, and no others."""

from __future__ import annotations

import numpy as np
import pytest

from whsklearn.effects import Cogging
from whsklearn.gap import Diagnosis, NamedEffect
from whsklearn.gap.drive_error import with_drive_error


def found():
    effect = NamedEffect(Cogging(0.05, 12.0), {"amplitude_nm": 0.003, "order": 0.01, "phase_rad": 0.2}, 90.0, 1.0, 1.0)
    effect.orders = [NamedEffect(Cogging(0.02, 24.0), {"amplitude_nm": 0.001}, 50.0, 1.0, 1.0)]
    rows = [
        {"name": "inertia", "before": 0.04, "after": 0.05, "before_error": None, "after_error": 0.001, "unit": "kg m²"},
        {"name": "age", "before": 2.0, "after": 2.0, "before_error": 0.1, "after_error": 0.1, "unit": ""},
    ]
    return Diagnosis("named", "", effects=[effect], base_parameters=rows)


def test_torques_and_inertia_are_widened_orders_and_phases_are_not():
    d = found()
    with_drive_error(d, 0.1)
    errors = d.effects[0].standard_errors
    assert errors["amplitude_nm"] == pytest.approx(np.hypot(0.003, 0.005))
    assert (errors["order"], errors["phase_rad"]) == (0.01, 0.2)
    assert d.effects[0].orders[0].standard_errors["amplitude_nm"] == pytest.approx(np.hypot(0.001, 0.002))
    assert d.base_parameters[0]["after_error"] == pytest.approx(np.hypot(0.001, 0.005))
    assert d.base_parameters[0]["before_error"] == pytest.approx(0.004)
    assert d.base_parameters[1]["after_error"] == 0.1
    assert "known to 10 %" in d.notes[0]


def test_without_an_uncertainty_nothing_changes():
    d = found()
    with_drive_error(d, 0.0)
    assert d == found()
