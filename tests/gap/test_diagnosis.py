"""Numbers leave the diagnosis under the units of the log."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

from whsklearn.effects import Backlash, Cogging, EncoderEccentricity, EndStop, Stribeck, Viscous
from whsklearn.gap import Diagnosis, NamedEffect, Place
from whsklearn.gap.diagnosis import Curve, curve_in, in_units, place_in, rows_in
from whsklearn.gap.pictures import pictures_in
from whsklearn.gap.plants.arm_terms import JointInertia


@pytest.mark.parametrize(
    ("label", "units", "expected"),
    [
        ("torque_nm", ("N", "m"), "torque_n"),
        ("velocity_rad_per_s", ("N", "m"), "velocity_m_per_s"),
        ("coefficient_nm_s2_per_rad2", ("A", "m"), "coefficient_a_s2_per_m2"),
        ("phase_rad", ("N", "m"), "phase_rad"),  # a phase is an angle on any axis
        ("torque_nm", ("Nm", "rad"), "torque_nm"),
        ("inertia_kg_m2", ("N", "m"), "inertia_kg"),
        ("inertia_kg_m2", ("Nm", "rad"), "inertia_kg_m2"),
    ],
)
def test_labels_follow_the_units_of_the_log(label, units, expected):
    assert in_units(label, units) == expected


def test_an_effect_is_written_with_its_errors_under_the_same_names():
    named = NamedEffect(Stribeck(0.2, 0.1, 2.0), {"torque_nm": 0.01}, 100.0, 0.95, units=("N", "m"))
    written = named.as_dict()
    assert written["standard_errors"] == {"torque_n": 0.01}
    assert set(written["standard_errors"]) <= set(written["parameters"])


def test_a_diagnosis_is_plain_json():
    named = NamedEffect(Cogging(0.1, 12.0), {"amplitude_nm": 0.01}, 812.0, 0.97)
    text = json.dumps(Diagnosis("named", "Found.", effects=[named]).as_dict(), allow_nan=False, default=float)
    assert json.loads(text)["effects"][0]["name"] == "cogging"


def test_numbers_of_a_linear_axis_are_in_newtons_and_metres():
    from whsklearn.effects import Cogging, QuadraticDrag
    from whsklearn.gap.diagnosis import NamedEffect

    units = ("N", "m")
    drag = NamedEffect(QuadraticDrag(2.0), {"coefficient_nm_s2_per_rad2": 0.1}, 50.0, 1.0, units=units)
    assert drag.parameters == {"coefficient_n_s2_per_m2": 2.0}
    assert drag.errors == {"coefficient_n_s2_per_m2": 0.1}
    assert NamedEffect(Cogging(0.3, 12.0), {}, 50.0, 1.0, units=units).parameters == {
        "amplitude_n": 0.3, "order": 12.0, "phase_rad": 0.0
    }  # fmt: skip


OWN = {"Nm": "mNm", "rad": "deg"}
DEG = 180 / math.pi
ONES = np.ones(3)


@pytest.mark.parametrize(
    ("effect", "label", "value"),
    [
        (Cogging(0.03, 12.0, 0.5), "amplitude_mnm", 30.0),
        (Cogging(0.03, 12.0, 0.5), "phase_rad", 0.5),  # of the wave, not of the axis
        (Cogging(0.03, 12.0, 0.5), "order", 12.0),
        (Viscous(0.12), "coefficient_mnm_s_per_deg", 120.0 / DEG),
        (EncoderEccentricity(1e-3), "amplitude_deg", 1e-3 * DEG),
        (Backlash(0.01), "gap_deg", 0.01 * DEG),
    ],
)
def test_a_number_is_told_in_the_unit_that_its_name_says(effect, label, value):
    named = NamedEffect(effect, {}, 50.0, 1.0, units=("mNm", "deg"))
    assert named.parameters[label] == pytest.approx(value, rel=1e-12)


@pytest.mark.parametrize(("motion", "place"), [("mm", "position"), ("deg", "angle")])
def test_the_place_of_a_stop_is_an_angle_only_where_the_axis_turns(motion, place):
    told = NamedEffect(EndStop(10.0, angle=0.02), {}, 50.0, 1.0, units=("N", motion)).told
    assert [unit for name, _, _, unit in told if name == place] == [motion]


def test_a_standard_error_and_a_map_go_with_the_number():
    named = NamedEffect(Cogging(0.03, 12.0), {"amplitude_nm": 1e-3}, 50.0, 1.0, units=("mNm", "deg"))
    named.orders = [NamedEffect(Cogging(0.01, 24.0), {}, 50.0, 1.0, units=("mNm", "deg"))]
    assert named.errors == {"amplitude_mnm": pytest.approx(1.0)}
    assert max(named.map_over_turn()["value"]) == pytest.approx(40.0, rel=1e-6)
    assert named.amplitude_unit == "mNm"


@pytest.mark.parametrize(("units", "unit"), [(("N", "m"), "kg"), (("Nm", "rad"), "kg m²")])
def test_the_inertia_of_a_motor_is_a_mass_where_its_joint_slides(units, unit):
    assert NamedEffect(JointInertia(0.8), {}, 50.0, 1.0, units=units, joint="slider").told == [
        ("inertia", 0.8, None, unit)
    ]


@pytest.mark.parametrize(("unit", "factor", "told"), [("rad", DEG, "deg"), ("rad/s", DEG, "deg/s"), ("s", 1.0, "s")])
def test_a_place_moves_with_its_signal_and_its_means_with_the_gap(unit, factor, told):
    place = place_in(Place("signal", 1.0, 2.0, 0.5, 0.1, 0.01, unit, ONES, ONES, ONES), "Nm", OWN)
    assert (place.low, place.high, place.unit) == (pytest.approx(factor), pytest.approx(2 * factor), told)
    assert place.centres == pytest.approx(factor * ONES)
    assert place.means == pytest.approx(1000.0 * ONES)


@pytest.mark.parametrize(("signal", "factor"), [("velocity", DEG), ("position", DEG), ("drive", 1000.0)])
def test_a_learned_curve_moves_along_both_axes(signal, factor):
    curve = curve_in(Curve((signal,), ONES, ONES, 0.1 * ONES), ("Nm", "rad"), OWN)
    assert curve.x == pytest.approx(factor * ONES)
    assert (curve.y[0], curve.band[0]) == (pytest.approx(1000.0), pytest.approx(100.0))


@pytest.mark.parametrize(("gap", "factor"), [("Nm", 1000.0), ("rad", DEG)])
def test_pictures_are_drawn_in_the_units_that_their_axes_say(gap, factor):
    series = {
        "measured": ONES, "runs": {"before": ONES, "after": ONES}, "gap_before": ONES, "gap_after": ONES, "floor": 1.0,
        "spectrum": (ONES, ONES), "order_spectrum": (ONES, ONES), "axes": {"drive": (ONES, "Nm")},
        "units": ("Nm", "rad"),
    }  # fmt: skip
    p = pictures_in(series, gap, OWN)
    assert p["units"] == ("mNm", "deg")
    assert (p["measured"][0], p["runs"]["after"][0]) == (pytest.approx(DEG), pytest.approx(DEG))
    assert p["gap_unit"] == OWN[gap]
    assert p["gap_before"][0] == p["spectrum"][1][0] == p["floor"] == pytest.approx(factor)
    assert p["axes"]["drive"] == (pytest.approx(1000.0 * ONES), "mNm")
    assert pictures_in(series, gap, {})["measured"] is not None  # and with nothing to bring over it stays


def test_rows_leave_what_is_not_there():
    rows = rows_in([{"a": 1.0, "b": None, "c": 5.0}], "Nm", OWN, "a", "b")
    assert rows == [{"a": pytest.approx(1000.0), "b": None, "c": 5.0}]
