"""Columns that name themselves are found, and doubtful ones are asked for."""

from __future__ import annotations

import numpy as np
import pytest

from whsklearn.logs.errors import ColumnError
from whsklearn.logs.roles import by_number, guess
from whsklearn.logs.source import Column, Source
from whsklearn.logs.units import unit_of


def source(*names):
    return Source("axis.csv", list(names), lambda wanted: {})


def test_usual_names_in_two_languages_and_two_spellings():
    s = source("timestamp", "goal_position", "position", "motorCurrent", "speed")
    assert [guess(s, r) for r in ("time", "position", "drive", "reference")] == [
        "timestamp", "position", "motorCurrent", "goal_position"
    ]  # fmt: skip
    for time in ("Zeit [s]", "Zeitstempel"):
        german = source(time, "Drehmoment [Nm]", "Winkel [deg]")
        assert [guess(german, r) for r in ("time", "drive", "position")] == german.names


def test_two_of_a_kind_are_asked_for_and_none_is_none():
    with pytest.raises(ColumnError, match="several columns for position: position_1, position_2; name one"):
        guess(source("t", "position_1", "position_2"), "position")
    assert guess(source("a", "b"), "drive") is None


def test_of_two_of_a_kind_the_one_that_never_changes_is_not_meant():
    values = {"effort/data": [0.1, np.nan, -0.2], "effort/offset": [0.0, np.nan, 0.0], "joint/effort": [0.0, 0.0, 0.0]}
    table = Source("a.csv", list(values), lambda wanted: {w: Column(np.array(values[w])) for w in wanted})
    assert guess(table, "drive") == "effort/data"
    still = Source("a.csv", list(values)[::2], lambda wanted: {w: Column(np.zeros(3)) for w in wanted})
    with pytest.raises(ColumnError, match="several columns for drive"):
        guess(still, "drive")


def test_a_duty_cycle_drives_where_nothing_else_is_logged_though_it_is_commanded():
    assert guess(source("t", "speed_rpm", "Commanded_PWM"), "drive") == "Commanded_PWM"
    assert guess(source("t", "PWM", "Voltaje (V)", "angle"), "drive") == "Voltaje (V)"
    assert guess(source("t", "pwm_limit", "angle"), "drive") is None


def test_a_torque_that_is_only_commanded_is_the_drive():
    assert guess(source("time_s", "torque_cmd_Nm", "roll_rad"), "drive") == "torque_cmd_Nm"
    assert guess(source("t", "iq_setpoint", "vel_setpoint", "pos_estimate"), "drive") == "iq_setpoint"
    assert guess(source("t", "PWM", "target_force [N]", "x [mm]"), "drive") == "target_force [N]"
    assert guess(source("t", "torque_cmd_nm", "torque_nm", "q_rad"), "drive") == "torque_nm"
    assert guess(source("t", "torque_limit_cmd", "position_cmd_V", "velocity_cmd [A]", "q_rad"), "drive") is None


def test_a_unit_tells_where_no_word_does_and_outweighs_one_letter():
    s = source("t_ms", "phi_deg", "soll_deg", "M1_mNm")
    assert [guess(s, r) for r in ("time", "drive", "position", "reference")] == [
        "t_ms",
        "M1_mNm",
        "phi_deg",
        "soll_deg",
    ]
    assert guess(source("t", "i_q", "lage"), "drive") == "i_q"
    assert guess(source("t", "current_counts", "x [mm]"), "drive") == "current_counts"
    assert guess(source("t", "q [A]", "x [mm]"), "position") == "x [mm]"
    assert guess(source("t", "position_V", "torque_nm"), "position") == "position_V"
    with pytest.raises(ColumnError, match="several columns for drive: ia_A, ib_A"):
        guess(source("t", "ia_A", "ib_A", "phi"), "drive")


def test_ticks_of_an_encoder_are_no_time_and_limits_and_set_values_are_not_measured():
    s = source("current_a", "encoder_ticks")
    assert [guess(s, r) for r in ("time", "drive", "position")] == [None, *s.names]
    assert guess(source("ticks", "torque_nm", "position"), "time") == "ticks"
    twincat = source("Timestamp", "Axis1.ActPos", "Axis1.SetPos", "Axis1.ActTorque", "Axis1.TorqueLimit")
    assert [guess(twincat, r) for r in ("position", "drive", "reference")] == [
        "Axis1.ActPos", "Axis1.ActTorque", "Axis1.SetPos"
    ]  # fmt: skip
    assert guess(source("Zeit", "M_soll", "M_ist"), "position") is None  # M is not in metres


def test_a_position_with_a_dot_is_a_velocity():
    s = source("t_ms", "theta", "theta_dot", "theta_ddot", "torque_nm")
    assert [guess(s, r) for r in ("position", "velocity", "drive")] == ["theta", "theta_dot", "torque_nm"]
    assert guess(source("t", "tau", "qdot"), "position") is None


def test_a_log_of_a_speed_loop_has_a_velocity():
    s = source("time", "vel_rad_s", "current_A")
    assert guess(s, "position") is None
    assert guess(s, "velocity") == "vel_rad_s"
    assert guess(source("time", "x_counts_per_s", "current_A"), "velocity") == "x_counts_per_s"


@pytest.mark.parametrize(
    ("names", "drive", "position"),
    [
        (["t", "Motorstrom [A]", "DC bus voltage [V]", "q_rad"], "Motorstrom [A]", "q_rad"),
        (["t", "friction torque [Nm]", "Antriebsmoment [Nm]", "q_rad"], "Antriebsmoment [Nm]", "q_rad"),
        (["t", "torque_ff [Nm]", "Istmoment [Nm]", "q_rad"], "Istmoment [Nm]", "q_rad"),
        (["t", "gravity_torque_nm", "disturbance_torque_nm", "motor_nm", "q_rad"], "motor_nm", "q_rad"),
        (["t", "digital input", "CPU load [%]", "M_nm", "q_rad"], "M_nm", "q_rad"),
        (["t", "position sensor voltage [V]", "M_nm", "phi_rad"], "M_nm", "phi_rad"),
        (["t", "torque enable", "iq_A", "q_rad"], "iq_A", "q_rad"),
        (["t", "M_nm", "encoder temperature [C]", "Istlage [rad]"], "M_nm", "Istlage [rad]"),
        (["t", "M_nm", "position valid", "Lage_ist_rad"], "M_nm", "Lage_ist_rad"),
        (["t", "M_nm", "analog output", "Istwinkel [rad]"], "M_nm", "Istwinkel [rad]"),
        (["t", "Drehmomentsollwert", "Drehmomentistwert", "Lagesollwert", "Lageistwert"], *"24"),
        (["t", "couple_nm", "consigne de position [rad]", "phi [rad]"], "couple_nm", "phi [rad]"),
        (["t", "M_nm", "Schleppabstand [rad]", "Lageistwert [rad]"], "M_nm", "Lageistwert [rad]"),
        (["t", "M_nm", "Lagesollwert [rad]"], "M_nm", None),
        (["t", "disturbance torque [Nm]", "i", "q_rad"], None, "q_rad"),
        (["t", "torque_constant_Nm_per_A", "torque_rate_nm_per_s", "tau_nm", "q_rad"], "tau_nm", "q_rad"),
        (["t", "torque_max", "torque_min", "M_nm", "position deviation [rad]", "phi_rad"], "M_nm", "phi_rad"),
        (["t", "M_nm", "position_offset_rad", "phi_rad"], "M_nm", "phi_rad"),
        (["t", "M_nm", "Angle [arc min]"], "M_nm", "Angle [arc min]"),
        (["t", "M_nm", "angle (setpoint)", "phi_rad"], "M_nm", "phi_rad"),
        (["t", "M_nm", "Drehwinkel", "Winkelbeschleunigung", "Winkelgeschwindigkeit"], "M_nm", "Drehwinkel"),
    ],
)
def test_what_is_called_like_a_role_and_is_another_thing_is_not_taken(names, drive, position):
    wanted = [names[int(w)] if w and w.isdigit() else w for w in (drive, position)]
    assert [guess(source(*names), role) for role in ("drive", "position")] == wanted


def test_columns_by_number_want_two_to_four():

    assert by_number("0,1,2,3")["reference"] == "3"
    with pytest.raises(ValueError, match="expected two"):
        by_number("1")


def test_accents_are_letters_and_other_languages_are_known():
    french = Source("a.csv", ["temps (s)", "couple (Nm)", "angle (degrés)"], lambda columns: {})
    assert [guess(french, r) for r in ("time", "drive", "position")] == french.names
    italian = Source("a.csv", ["tempo", "coppia", "velocità"], lambda columns: {})
    assert [guess(italian, r) for r in ("time", "drive", "velocity")] == italian.names


@pytest.mark.parametrize(
    ("names", "units"),
    [
        (["时间(秒)", "电机转矩(牛·米)", "关节角度(度)"], ["s", "Nm", "deg"]),
        (["时间（毫秒）", "电机电流（安）", "位置（弧度）"], ["ms", "A", "rad"]),
        (["時間", "トルク", "角度"], ["as logged"] * 3),
        (["시간", "토크", "위치"], ["as logged"] * 3),
        (["Время, с", "Момент, Н·м", "Угол, град"], ["s", "Nm", "deg"]),
        (["timeMs", "motorTorqueMNm", "jointPosDeg"], ["ms", "mNm", "deg"]),
    ],
)
def test_names_of_other_alphabets(names, units):
    source = Source("a.csv", names, lambda columns: {})
    assert [guess(source, role) for role in ("time", "drive", "position")] == names
    assert [unit_of(n) for n in names] == units


@pytest.mark.parametrize("name", ["位置指令", "目标角度", "角速度", "заданный угол"])
def test_what_is_set_is_not_measured_in_other_alphabets(name):
    assert guess(Source("a.csv", [name, "角度"], lambda columns: {}), "position") == "角度"
