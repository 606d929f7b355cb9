"""The command line of the gap workflow: contract of the files, the sentence, clear errors."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import numpy as np
import pandas as pd
import pytest
from click.testing import CliRunner

from benchmarks.blind_logs.servo import make_case
from whsklearn.cli.gap import main
from whsklearn.datasets import make_servo_log
from whsklearn.effects import Cogging, Saturation


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    case = make_case("named", 12, effects=("gravity_imbalance",), size=0.08, seconds=12.0, rate=500.0)
    path = tmp_path_factory.mktemp("log") / "axis.csv"
    case.frame.to_csv(path, index=False)
    return path


def run(*arguments):
    return CliRunner().invoke(main, [str(a) for a in arguments])


def test_names_the_hidden_effect_and_writes_both_files(log, tmp_path):
    second = make_case("named", 13, effects=("gravity_imbalance",), size=0.08, seconds=6.0, rate=500.0)
    second.frame.to_csv(tmp_path / "second.csv", index=False)
    result = run(
        log, "--model", "servo", "--time", "time_s", "--reference", "reference_rad", "--drive", "torque_nm",
        "--position", "position_rad", "--report", tmp_path / "report", "--no-track", "--test", tmp_path / "second.csv",
    )  # fmt: skip
    assert result.exit_code == 0, result.output
    data = json.loads((tmp_path / "report" / "gap.json").read_text(encoding="utf-8"))
    assert (data["verdict"], data["effects"][0]["name"]) == ("named", "gravity_imbalance")
    assert "gravity imbalance" in result.output
    assert result.output.index("named: ") < result.output.index("On second.csv, which was not used for the fit")
    assert len(data["test"]) == 3
    assert (tmp_path / "report" / "gap.html").stat().st_size > 10_000


def test_short_log_is_a_data_problem(log, tmp_path):
    short = tmp_path / "short.csv"
    short.write_text("\n".join(log.read_text().splitlines()[:100]), encoding="utf-8")
    result = run(short, "--report", tmp_path, "--no-track")
    assert result.exit_code == 3, result.output
    assert json.loads((tmp_path / "gap.json").read_text(encoding="utf-8"))["verdict"] == "data_problem"


def test_a_record_that_holes_cut_to_pieces_is_told_by_its_holes(log, tmp_path):
    head, *rows = log.read_text().splitlines()
    kept = [r for i, r in enumerate(rows) if i % 100 > 7]
    (tmp_path / "holes.csv").write_text("\n".join([head, *kept]) + "\n")
    result = run(tmp_path / "holes.csv", "--report", tmp_path / "r", "--no-track")
    assert result.exit_code == 3
    assert f"{len(rows) // 100 - 1} holes cut its" in result.output.replace("\n", " ")
    assert "Record too short" not in result.output


def test_every_long_segment_of_a_log_counts(log, tmp_path):
    head, *rows = log.read_text().splitlines()
    n = len(rows)
    kept = [*rows[: n // 4], *rows[n // 4 + 60 : n // 2], *rows[n // 2 + 900 : n // 2 + 1000], *rows[n // 2 + 1500 :]]
    (tmp_path / "holes.csv").write_text("\n".join([head, *kept]) + "\n")
    result = run(tmp_path / "holes.csv", "--report", tmp_path / "r", "--no-track")
    assert result.exit_code == 0, result.output
    assert "1 of 4 segments are shorter than 2 s" in result.output.replace("\n", " ")
    data = json.loads((tmp_path / "r" / "gap.json").read_text(encoding="utf-8"))
    assert (data["verdict"], data["effects"][0]["name"]) == ("named", "gravity_imbalance")
    used = len(kept) - 100
    page = (tmp_path / "r" / "gap.html").read_text(encoding="utf-8")
    assert f"{used} of {len(kept)}, in 3 of 4 segments" in page


@pytest.mark.parametrize(
    ("arguments", "status", "message"),
    [
        (["--drive", "volts"], 2, "no column 'volts'"),
        (["--columns", "0,1,2,3,4"], 2, "expected two"),
        (["--columns", "1,2"], 2, "names no time; add --rate"),
        (["--unit", "position"], 2, "expected ROLE=UNIT"),
        (["--unit", "position=counts/0"], 2, "The unit of position is 'counts/0'; expected one of"),
        (["--unit", "time=ticks/0"], 2, "The unit of time is 'ticks/0'"),
        (["--rate", "nan"], 2, "nan is not a finite number"),
        (["--torque-constant", "nan"], 2, "The torque constant is 'nan'; expected Nm per ampere"),
        (["--tolerance", "-1"], 2, "not in the range x>=0"),
        (["--orders", "2,2,2,2"], 2, "--orders and --direct are of a chain; add --model wiener-hammerstein"),
        (["--joint", "elbow"], 2, "--joint and --actuator are of a --simulator; the joints of a --robot are --joints"),
        (["--law", "sticky"], 2, "'sticky'"),
        (["--law", "cogging"], 2, "cannot be part of the base law"),
    ],
)
def test_errors_are_one_sentence(log, tmp_path, arguments, status, message):
    result = run(log, *arguments, "--report", tmp_path / "r", "--no-track")
    assert result.exit_code == status
    assert message in result.output
    assert "Traceback" not in result.output


def test_a_log_that_cannot_be_read_is_a_data_problem_with_a_report(tmp_path):
    path = tmp_path / "empty.csv"
    path.write_text("", encoding="utf-8")
    done = run(path, "--no-track", "--out", tmp_path / "r")
    assert done.exit_code == 3
    assert "empty.csv is empty" in done.output
    data = json.loads((tmp_path / "r" / "gap.json").read_text(encoding="utf-8"))
    assert data["verdict"] == "data_problem"
    assert "is empty" in data["next_experiment"]
    assert (tmp_path / "r" / "gap.html").read_text(encoding="utf-8").count("is empty") == 1


def test_a_report_folder_that_cannot_be_written_is_told_before_the_work(log, tmp_path):
    (tmp_path / "taken").write_text("a file")
    done = run(log, "--no-track", "--report", tmp_path / "taken" / "gap")
    assert done.exit_code == 1
    assert "Cannot write to" in done.output


def test_an_effective_current_is_asked_about_and_a_unit_that_no_axis_has_is_a_wrong_option(log, tmp_path):
    # as Kollmorgen's Workbench names its columns
    head = "Time (ms),IL.CMD (Arms),IL.FB (Arms),PL.FB (deg),VL.FB (rpm)\n"
    rows = "".join(f"{k},{k % 7},{k % 5},{k % 9},{k % 3}\n" for k in range(200))
    (tmp_path / "akd.csv").write_text(head + rows)
    asked = run(tmp_path / "akd.csv", "--no-track", "--report", tmp_path / "r")
    assert asked.exit_code == 2
    assert "'IL.FB (Arms)' is a current, not a torque. For results in Nm add --torque-constant" in asked.output
    wrong = run(log, "--unit", "position=banana", "--no-track", "--report", tmp_path / "r")
    assert wrong.exit_code == 2
    assert "The unit of position is 'banana'; expected one of rad, deg" in wrong.output


def test_a_drive_that_was_inverted_wrongly_is_told_to_be_left(log, tmp_path):
    done = run(log, "--invert-drive", "--max-effects", "1", "--no-track", "--report", tmp_path / "r")
    assert "is the sign of the drive inverted? If so, leave out --invert-drive." in " ".join(done.output.split())


def test_a_log_without_a_clock_or_with_one_that_overflows_is_told_of_the_rate(log, tmp_path):
    rows = [line.split(",") for line in log.read_text().splitlines()]
    (tmp_path / "none.csv").write_text("\n".join(",".join(r[1:]) for r in rows))
    asked = run(tmp_path / "none.csv", "--no-track", "--report", tmp_path / "r")
    assert asked.exit_code == 2
    assert "no column that is clearly the time" in asked.output
    assert "or the samples per second with --rate" in " ".join(asked.output.split())
    counted = [["time_ms", *rows[0][1:]], *([str(k % 1000), *r[1:]] for k, r in enumerate(rows[1:]))]
    (tmp_path / "short.csv").write_text("\n".join(",".join(r) for r in counted))
    done = run(tmp_path / "short.csv", "--no-track", "--report", tmp_path / "r")
    assert done.exit_code == 3
    assert "if it is a counter that overflows, give --rate HZ in place of --time." in " ".join(done.output.split())


def test_columns_that_name_themselves_are_taken_and_said(log, tmp_path):
    text = log.read_text().splitlines()
    text[0] = text[0].replace("torque_nm", "motor_current_a").replace("position_rad", "joint_angle")
    (tmp_path / "other.csv").write_text("\n".join(text[:200]))
    asked = run(tmp_path / "other.csv", "--no-track", "--report", tmp_path / "r")
    assert asked.exit_code == 2
    assert "is a current, not a torque. For results in Nm add --torque-constant" in asked.output
    done = run(tmp_path / "other.csv", "--torque-constant", "0.1+-0.01", "--no-track", "--report", tmp_path / "r")
    assert "'motor_current_a' is taken for the drive" in done.output
    assert "'joint_angle' is taken for the position" in done.output
    assert done.exit_code == 3  # 200 samples are too few


def test_a_path_with_an_umlaut_keeps_its_report_where_the_locale_has_none(log, tmp_path):
    """LC_ALL=POSIX, and neither Python's coercion nor its UTF-8 mode, as some services force it."""
    folder = tmp_path / "Prüfstand"
    folder.mkdir()
    (folder / "Größe.csv").write_text("\n".join(log.read_text().splitlines()[:100]), encoding="utf-8")
    locale = {"LC_ALL": "POSIX", "PYTHONCOERCECLOCALE": "0", "PYTHONUTF8": "0"}
    command = [sys.executable, "-m", "whsklearn", "gap", "Prüfstand/Größe.csv", "--report", "Prüfstand", "--no-track"]
    done = subprocess.run(command, cwd=tmp_path, env={**os.environ, **locale}, capture_output=True)
    assert done.returncode == 3, done.stderr
    assert json.loads((folder / "gap.json").read_text(encoding="utf-8"))["verdict"] == "data_problem"
    assert "Größe.csv" in (folder / "gap.html").read_text(encoding="utf-8")


@pytest.mark.parametrize("what", ["copy", "part", "other units"])
def test_a_test_on_what_was_fitted_is_refused_and_writes_nothing(log, tmp_path, what):
    frame = pd.read_csv(log)
    if what == "part":
        frame = frame.iloc[500:3500]
    if what == "other units":
        frame = pd.DataFrame({
            "time_ms": 1e3 * frame["time_s"], "torque_mnm": 1e3 * frame["torque_nm"],
            "position_deg": np.rad2deg(frame["position_rad"]),
        })  # fmt: skip
    frame.to_csv(tmp_path / "another_name.csv", index=False)
    result = run(log, "--test", tmp_path / "another_name.csv", "--report", tmp_path / "r", "--no-track")
    assert result.exit_code != 0
    assert "another_name.csv from" in result.output
    assert "would use data of the fit" in " ".join(result.output.split())
    assert "Traceback" not in result.output
    assert not list((tmp_path / "r").glob("*"))


@pytest.mark.slow
def test_two_logs_are_one_diagnosis_and_one_log_twice_is_none(tmp_path):
    for k in (0, 1):
        frame = make_servo_log([Cogging(0.1, 12.0)], duration=10.0, sample_rate=250.0, random_state=k)
        frame.assign(torque_nm=frame["torque_nm"] + 0.1 * k).to_csv(tmp_path / f"{k}.csv", index=False)
    logs = [tmp_path / "0.csv", tmp_path / "1.csv"]
    result = run(*logs, "--report", tmp_path / "report", "--no-track")
    assert result.exit_code == 0, result.output
    data = json.loads((tmp_path / "report" / "gap.json").read_text(encoding="utf-8"))
    assert data["effects"][0]["name"] in ("cogging", "input_offset")
    assert "1.csv is used too" in (tmp_path / "report" / "gap.html").read_text(encoding="utf-8")
    assert run(logs[0], logs[0], "--report", tmp_path, "--no-track").exit_code == 3
    assert run(*logs, "--model", "wiener-hammerstein", "--report", tmp_path, "--no-track").exit_code == 2


def test_logs_of_two_rates_cannot_be_used_together(log, tmp_path):
    pd.read_csv(log)[1::2].to_csv(tmp_path / "half.csv", index=False)
    done = run(log, tmp_path / "half.csv", "--report", tmp_path / "r", "--no-track")
    assert done.exit_code == 3
    assert "The records have 500 and 250 samples a second; resample them to one rate." in " ".join(done.output.split())


def test_a_clipped_drive_is_told_where_something_is_missing(tmp_path):
    log = make_servo_log(duration=7.0, sample_rate=250.0, random_state=0)
    limit = 0.6 * np.abs(log.torque_nm).max()
    log.assign(torque_nm=log.torque_nm.clip(-limit, limit)).to_csv(tmp_path / "log.csv", index=False)
    done = run(tmp_path / "log.csv", "--max-effects", "1", "--report", tmp_path / "r", "--no-track")
    assert done.exit_code == 0, done.output
    assert "log.csv: drive stays at its extreme values in" in done.stdout


def test_a_clipped_drive_is_no_defect_where_its_limit_is_named(tmp_path):
    """A clipped position still is one: see test_records."""
    log = make_servo_log([Saturation(1.0)], duration=7.0, sample_rate=250.0, random_state=0)
    log.assign(torque_nm=log.torque_nm.clip(-1.2, 1.2)).to_csv(tmp_path / "log.csv", index=False)
    done = run(tmp_path / "log.csv", "--report", tmp_path / "r", "--no-track")
    assert "saturation (limit" in " ".join(done.stdout.split())
    assert "extreme values" not in done.stdout
