"""Numbers leave the diagnosis under the units of the log."""

from __future__ import annotations

import json

import pytest

from whsklearn.effects import Cogging, Stribeck
from whsklearn.gap import Diagnosis, NamedEffect
from whsklearn.gap.diagnosis import in_units


@pytest.mark.parametrize(
    ("label", "units", "expected"),
    [
        ("torque_nm", ("N", "m"), "torque_n"),
        ("velocity_rad_per_s", ("N", "m"), "velocity_m_per_s"),
        ("coefficient_nm_s2_per_rad2", ("A", "m"), "coefficient_a_s2_per_m2"),
        ("phase_rad", ("N", "m"), "phase_rad"),  # a phase is an angle on any axis
        ("torque_nm", ("Nm", "rad"), "torque_nm"),
    ],
)
def test_labels_follow_the_units_of_the_log(label, units, expected):
    assert in_units(label, units) == expected


def test_an_effect_is_written_with_its_errors_under_the_same_names():
    named = NamedEffect(Stribeck(0.2, 0.1, 2.0), {"torque_nm": 0.01}, 100.0, 0.9, 0.95, units=("N", "m"))
    written = named.as_dict()
    assert written["standard_errors"] == {"torque_n": 0.01}
    assert set(written["standard_errors"]) <= set(written["parameters"])


def test_a_diagnosis_is_plain_json():
    named = NamedEffect(Cogging(0.1, 12.0), {"amplitude_nm": 0.01}, 812.0, 1.0, 0.97)
    text = json.dumps(Diagnosis("named", "Found.", effects=[named]).as_dict(), allow_nan=False, default=float)
    assert json.loads(text)["effects"][0]["name"] == "cogging"


def test_numbers_of_a_linear_axis_are_in_newtons_and_metres():
    from whsklearn.effects import Cogging, QuadraticDrag
    from whsklearn.gap.diagnosis import NamedEffect

    units = ("N", "m")
    drag = NamedEffect(QuadraticDrag(2.0), {"coefficient_nm_s2_per_rad2": 0.1}, 50.0, 0.9, 1.0, units=units)
    assert drag.parameters == {"coefficient_n_s2_per_m2": 2.0}
    assert drag.errors == {"coefficient_n_s2_per_m2": 0.1}
    assert NamedEffect(Cogging(0.3, 12.0), {}, 50.0, 0.9, 1.0, units=units).parameters == {
        "amplitude_n": 0.3, "order": 12.0, "phase_rad": 0.0
    }  # fmt: skip
