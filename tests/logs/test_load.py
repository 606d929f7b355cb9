from __future__ import annotations

import json

import numpy as np
import pandas as pd
import pytest

from tests.logs.rig import NAMES, RATE
from tests.logs.rig import columns as table
from whsklearn import InverseDynamicsLags, RLSRegressor
from whsklearn.datasets import load_turntable, make_servo_log
from whsklearn.gap.plants.from_log import taken_from
from whsklearn.logs import ColumnError, LogError, LogWarning, check_log, load_log, slips_in
from whsklearn.logs.units import inertia_unit


def test_a_clean_log_comes_back_as_it_is(write):
    columns = table(2000)
    log = load_log(write(columns), **NAMES)
    assert log.report.ok
    assert log.report.codes == ()
    assert np.allclose(log.X[:, 0], columns["torque_nm"], rtol=0, atol=1e-12)
    assert np.allclose(log.y, columns["position_rad"], rtol=0, atol=1e-12)
    assert log.sample_rate == pytest.approx(RATE)
    assert log.units == {"time": "s", "drive": "Nm", "position": "rad"}
    assert log.report.quantum is None


def test_parquet_semicolons_and_the_other_names(write):
    pytest.importorskip("pyarrow")
    columns = table(300)
    a = load_log(write(columns, "axis.parquet"), time="time_s", input="torque_nm", output="position_rad")
    b = load_log(write(columns, "german.csv", sep=";", decimal=","), **NAMES)
    X, y = load_log(write(columns), **NAMES, return_X_y=True)
    assert np.allclose(a.X, b.X)
    assert np.allclose(a.X, X)
    assert np.allclose(a.y, y)


def test_units_may_be_stated_and_milliseconds_become_seconds(write):
    columns = table(300)
    file = write({"clock_ms": columns["time_s"] * 1e3, "u": columns["torque_nm"], "y": columns["position_rad"]})
    log = load_log(file, time="clock_ms", input="u", output="y", units={"drive": "V"})
    assert log.units == {"time": "s", "drive": "V", "position": "as logged"}
    assert log.sample_rate == pytest.approx(RATE)


def test_an_odrive_logs_turns_and_amperes_unless_another_unit_is_stated(write):
    columns = table(300)
    names = {"time": "time_s", "drive": "axis0.motor.Iq_measured", "position": "axis0.encoder.pos_estimate"}
    whole = zip(names.values(), ("time_s", "torque_nm", "position_rad"), strict=True)
    file = write({name: columns[of] for name, of in whole})
    log = load_log(file, **names)
    assert log.units == {"time": "s", "drive": "A", "position": "turns"}
    assert "LOG019" in log.report.codes
    assert load_log(file, **names, units={"position": "counts/8192"}).units["position"] == "counts/8192"


def test_counts_without_the_counts_of_a_turn_are_told(write):
    columns = table(300)
    whole = {"time_s": columns["time_s"], "u_nm": columns["torque_nm"]}
    file = write(whole | {"encoder_counts": np.round(columns["position_rad"] * 4096 / (2 * np.pi))})
    names = {"time": "time_s", "drive": "u_nm", "position": "encoder_counts"}
    (told,) = (f.explanation for f in load_log(file, **names).report.findings if f.code == "LOG019")
    assert "states the counts of a turn and gives rad" in told
    assert "LOG019" not in load_log(file, **names, units={"position": "counts/4096"}).report.codes


def test_missing_values_are_refused_with_the_row_and_dropped_on_request(write):
    columns = table(2000)
    columns["torque_nm"][[40, 41]] = np.nan
    file = write(columns)
    with pytest.raises(ValueError, match=r"'torque_nm' has no value at row 40 \(no number; 2 such rows"):
        load_log(file, **NAMES, resample=False)
    with pytest.warns(LogWarning):
        log = load_log(file, **NAMES)
    assert "LOG010" in log.report.codes
    assert len(log.y) == 2000


def test_a_column_without_any_number_is_told(write):
    columns = {**table(50), "torque_nm": np.full(50, np.inf)}
    with pytest.raises(ValueError, match=r"Only 0 rows have a number .*'torque_nm' has none in 50 of 50 rows"):
        load_log(write(columns), **NAMES)


def test_columns_that_are_missing_or_no_numbers_are_told(write):
    columns = table(50)
    with pytest.raises(ValueError, match=r"no column 'tau' for drive; it has: time_s, torque_nm, position_rad"):
        load_log(write(columns), time="time_s", drive="tau", position="position_rad")
    words = {**columns, "torque_nm": [*map(str, columns["torque_nm"][:-1]), "off"]}
    with pytest.raises(ValueError, match=r"'torque_nm' of axis.csv is not numeric: row 49 holds 'off'"):
        load_log(write(words), **NAMES)
    with pytest.raises(ValueError, match="neither of input and drive"):
        load_log(write(columns), time="time_s", position="position_rad")
    with pytest.raises(ValueError, match="both of output and position"):
        load_log(write(columns), time="time_s", drive="torque_nm", position="position_rad", output="position_rad")
    with pytest.raises(FileNotFoundError, match="no file"):
        load_log("nowhere.csv", **NAMES)


def test_files_that_are_no_log_are_told(tmp_path):
    (tmp_path / "empty.csv").write_text("")
    with pytest.raises(ValueError, match="is empty"):
        load_log(tmp_path / "empty.csv", **NAMES)
    (tmp_path / "short.csv").write_text("time_s,torque_nm,position_rad\n0,1,2\n")
    with pytest.raises(ValueError, match="has 1 rows"):
        load_log(tmp_path / "short.csv", **NAMES)
    (tmp_path / "ragged.csv").write_text("time_s,torque_nm,position_rad\n0,1,2\n1,2,3,4,5\n")
    with pytest.raises(ValueError, match="line 3 has 5 cells where 3 were expected"):
        load_log(tmp_path / "ragged.csv", **NAMES)
    (tmp_path / "still.csv").write_text("time_s,torque_nm,position_rad\n" + "0,1,2\n" * 9)
    with pytest.raises(ValueError, match="time stamp is repeated"):
        load_log(tmp_path / "still.csv", **NAMES, resample=False)
    with pytest.raises(ValueError, match=r"9 time stamps over 0 s only 1 increase.* --rate HZ"):
        load_log(tmp_path / "still.csv", **NAMES)


def test_clipping_is_found_and_turning_points_are_not():
    c = table(2000)
    clean = check_log(c["time_s"], {"drive": c["torque_nm"], "position": c["position_rad"]})
    clipped = check_log(c["time_s"], {"drive": np.clip(c["torque_nm"], -0.7, 0.7), "position": c["position_rad"]})
    encoder = np.round(c["position_rad"] / 1e-3) * 1e-3  # flat at its turning points by the lattice alone
    lattice = check_log(c["time_s"], {"drive": c["torque_nm"], "position": encoder})
    assert "LOG005" in clipped.codes
    assert "LOG005" not in clean.codes
    assert "LOG005" not in lattice.codes


@pytest.mark.parametrize("quantum", [2 * np.pi / 800, 1e-4, 2 * np.pi / 2**20])
def test_the_lattice_of_the_position_is_measured(quantum):
    c = table(8000)
    position = np.round(np.cos(0.1 * c["time_s"]) / quantum) * quantum
    report = check_log(c["time_s"], {"drive": c["torque_nm"], "position": position})
    assert report.quantum == pytest.approx(quantum, rel=1e-6)
    assert "LOG007" in report.codes
    assert report.ok


def test_repeated_rows_are_found_and_a_rest_is_not():
    c = table(2000)
    held = np.arange(2000) // 2 * 2
    twice = check_log(c["time_s"], {"drive": c["torque_nm"][held], "position": c["position_rad"][held]})
    rest = np.minimum(np.arange(2000), 1500)
    idle = check_log(c["time_s"], {"drive": c["torque_nm"][rest], "position": c["position_rad"][rest]})
    assert "LOG006" in twice.codes
    assert "LOG006" not in idle.codes


@pytest.mark.parametrize(("polls", "told"), [(1, False), (2, True)])
def test_rows_that_are_equal_by_chance_do_not_tell_of_polling(polls, told):
    """An axis that rests a third of the time, behind a coarse encoder and a current in steps of its noise."""
    t = np.arange(6000) / 200.0
    path = np.interp(t, np.arange(31), np.repeat([0.0, 0.3, -0.4, 0.5, 0.1, -0.2, 0.4, -0.1], 4)[:31])
    position = np.round(path / 2e-4) * 2e-4
    current = np.round((np.gradient(path, t) + 0.004 * np.random.default_rng(0).standard_normal(t.size)) / 4e-3) * 4e-3
    held = np.arange(t.size) // polls * polls
    codes = check_log(t, {"drive": current[held], "position": position[held]}).codes
    assert ("LOG006" in codes) is told


def test_what_the_library_simulates_is_a_clean_log():
    for frame in (load_turntable(), make_servo_log(reference="staircase", duration=10.0, resolution=1e-4)):
        signals = {"drive": frame["torque_nm"].to_numpy(), "position": frame["position_rad"].to_numpy()}
        report = check_log(frame["time_s"].to_numpy(), signals)
        assert report.ok, str(report)


def test_a_drive_of_zeros_and_an_axis_that_stands_still_are_told():
    c = table(2000)
    zero = np.zeros(2000)
    assert "LOG008" in check_log(c["time_s"], {"drive": zero, "position": c["position_rad"]}).codes
    assert "LOG009" in check_log(c["time_s"], {"drive": c["torque_nm"], "position": zero + 3}).codes
    only = check_log(c["time_s"], {"drive": c["torque_nm"]})
    assert set(only.not_applicable) == {"LOG007", "LOG009"}


def test_a_report_reads_as_text_html_and_json():
    c = table(2000)
    report = check_log(c["time_s"], {"drive": np.zeros(2000), "position": c["position_rad"]})
    assert "LOG008 error: The drive is zero throughout." in str(report)
    assert "<li>LOG008" in report._repr_html_()
    assert json.loads(json.dumps(report.to_dict()))["findings"][0]["title"] == "The drive is zero throughout"
    assert str(check_log(c["time_s"], {"drive": c["torque_nm"], "position": c["position_rad"]})) == "Nothing to remark."


def test_a_log_is_what_either_kind_of_model_takes(tmp_path):
    frame = make_servo_log([], duration=12.0, random_state=0)
    frame.to_csv(tmp_path / "axis.csv", index=False)
    log = load_log(tmp_path / "axis.csv", time="time_s", drive="torque_nm", position="position_rad")
    np.testing.assert_array_equal(log.position, log.y[:, None])
    np.testing.assert_array_equal(log.drive, log.X[:, 0])
    axis = RLSRegressor(InverseDynamicsLags(sample_rate=log.sample_rate)).fit(log.position, log.drive)
    assert axis.parameters_["inertia"] == pytest.approx(0.05, rel=0.05)
    with pytest.warns(UserWarning, match="check that X is the position and y the drive"):
        RLSRegressor(InverseDynamicsLags(sample_rate=log.sample_rate)).fit(log.X, log.y)


def test_signals_with_rows_of_their_own_are_brought_to_those_of_the_position(write):
    columns = table(300)
    n = columns["time_s"].size
    rows = {"time_s": np.ravel(np.column_stack([columns["time_s"], columns["time_s"] + 1e-3]))}
    for name, place in (("torque_nm", 1), ("position_rad", 0)):
        rows[name] = np.full(2 * n, np.nan)
        rows[name][place::2] = columns[name]
    log = load_log(write(rows), **NAMES)
    assert log.sample_rate == pytest.approx(RATE)
    np.testing.assert_allclose(log.y, columns["position_rad"][1:], atol=1e-12)
    wanted = np.interp(columns["time_s"][1:], columns["time_s"] + 1e-3, columns["torque_nm"])
    np.testing.assert_allclose(log.X[:, 0], wanted, atol=1e-9)
    assert any("interpolated linearly at the stamps of 'position_rad'" in n for n in log.notes)


def test_a_velocity_in_rpm_is_integrated_to_turns(write):
    t = np.arange(2000) / RATE
    speed = 60.0 * np.cos(2 * np.pi * t)  # turns per minute
    file = write({"time_s": t, "torque_nm": np.sin(9 * t), "speed_rpm": speed})
    with pytest.warns(LogWarning, match="Only the velocity is logged"):
        log = load_log(file, time="time_s", drive="torque_nm", velocity="speed_rpm")
    assert log.units["position"] == "turns"
    assert log.y == pytest.approx(np.sin(2 * np.pi * t) / (2 * np.pi), rel=1e-4)  # trapezia: (2 pi / RATE)^2 / 12
    assert [s.option for s in slips_in(log) if "velocity" in s.sentence] == []


def test_a_speed_that_was_counted_adds_up_to_the_count(write):
    """By trapezia it was the mean of two counts: an encoder's step looked a quarter as large, and friction lagged."""
    t = np.arange(3000) / RATE
    count = np.floor(880 * np.sin(2 * np.pi * t))
    speed = np.round(np.diff(count, prepend=0.0) * 60.0 / 880 * RATE, 2)
    file = write({"time_s": t, "torque_nm": np.sin(9 * t), "speed_rpm": speed})
    with pytest.warns(LogWarning, match="Only the velocity is logged"):
        log = load_log(file, time="time_s", drive="torque_nm", velocity="speed_rpm")
    assert log.y * 880 == pytest.approx(count, abs=0.02)


def test_a_velocity_is_not_integrated_over_samples(write):
    file = write({"time_s": np.arange(500) / RATE, "torque_nm": np.ones(500), "speed_rpm": np.arange(500.0)})
    with pytest.raises(LogError, match="name the time column or give sample_rate"):
        load_log(file, drive="torque_nm", velocity="speed_rpm")


def test_a_log_without_time_says_so_and_one_with_a_rate_does_not(write):
    file, roles = write(table(500)), {k: v for k, v in NAMES.items() if k != "time"}
    log, timed = load_log(file, **roles), load_log(file, sample_rate=RATE, **roles)
    assert (log.units["time"], timed.units["time"]) == ("samples", "s")
    assert log.report.codes.count("LOG025") == 1
    assert "LOG025" not in timed.report.codes


def test_a_role_that_is_none_is_named(write):
    with pytest.raises(TypeError, match="unexpected argument 'torque'; columns are time, drive, position"):
        load_log(write(table(300)), torque="torque_nm", position="position_rad")


def test_columns_that_are_not_named_are_found_by_their_names_and_none_is_taken_for_another(write):
    log = load_log(write(table(200)))
    assert log.columns == {"time": "time_s", "drive": "torque_nm", "position": "position_rad"}
    assert log.sample_rate == pytest.approx(RATE)
    axis = table(200)
    axis["speed_rpm"] = axis.pop("position_rad")
    with pytest.warns(LogWarning, match="Only the velocity"):
        assert load_log(write(axis)).columns["velocity"] == "speed_rpm"
    axis["temperature"] = axis.pop("torque_nm")
    with pytest.raises(ColumnError, match=r"clearly the drive; it has: time_s, speed_rpm, temperature"):
        load_log(write(axis))


@pytest.mark.parametrize("drive", ["Torque [p.u.]", "Torque"])
def test_a_stated_unit_that_is_not_known_is_quoted_and_never_taken_for_another(tmp_path, drive):
    logged = table(300)
    units = ["s;p.u.;rad"] if drive == "Torque" else []
    rows = [";".join(f"{v:.9f}" for v in row) for row in zip(*logged.values(), strict=True)]
    (tmp_path / "axis.csv").write_text("\n".join([f"t;{drive};angle", *units, *rows, ""]))
    log = load_log(tmp_path / "axis.csv", time="t", drive=drive, position="angle")
    assert log.units["drive"] == "p.u."
    assert any("states the unit 'p.u.', which is not known: results are in it, not in SI" in n for n in log.notes)
    record = taken_from(log, "servo")[0]
    assert record.units[0] == "p.u."
    assert "kg" not in inertia_unit(*record.units)


@pytest.mark.parametrize(
    ("name", "unit"), [("torque (joint 1)", "as logged"), ("torque [raw]", "as logged"), ("Strom", "A")]
)
def test_a_word_in_brackets_may_tell_which_signal_it_is_and_a_current_is_in_amperes(tmp_path, name, unit):
    logged = table(300)
    pd.DataFrame({"t_s": logged["time_s"], name: logged["torque_nm"], "q_rad": logged["position_rad"]}).to_csv(
        tmp_path / "axis.csv", index=False
    )
    log = load_log(tmp_path / "axis.csv", time="t_s", drive=name, position="q_rad")
    assert log.units["drive"] == unit
    assert not any("is not known: results" in n for n in log.notes)
    assert any("taken to be in A" in n for n in log.notes) == (unit == "A")


def test_a_unit_that_contradicts_the_name_of_its_column_is_used_and_told(tmp_path):
    pd.DataFrame(table(300)).to_csv(tmp_path / "axis.csv", index=False)
    log = load_log(tmp_path / "axis.csv", **NAMES, units={"position": "deg", "drive": "Nm"})
    told = [n for n in log.notes if "was given for" in n]
    assert log.units["position"] == "deg"
    assert len(told) == 1
    assert told[0].startswith("How the file was read.")  # the unit is known
    assert "Column 'position_rad' states rad, and deg was given for position: that is used." in told[0]


def test_contradicted_units_are_told_in_the_order_of_the_roles_in_every_run(tmp_path):
    logged = table(300)
    extra = {"goal_rad": logged["position_rad"], "speed_rad_s": logged["torque_nm"]}
    pd.DataFrame({**logged, **extra}).to_csv(tmp_path / "axis.csv", index=False)
    roles = {"time": "ms", "drive": "mNm", "position": "deg", "reference": "deg", "velocity": "rpm"}
    columns = {**NAMES, "reference": "goal_rad", "velocity": "speed_rad_s"}
    log = load_log(tmp_path / "axis.csv", **columns, units=roles)
    told = [n.partition(" was given for ")[2].partition(":")[0] for n in log.notes if "was given for" in n]
    assert told == list(roles)
