"""The command: the answer on the terminal, both files, the runs, clear errors."""

from __future__ import annotations

import json

import numpy as np
import pandas as pd
import pytest
from click.testing import CliRunner

from whsklearn.cli.compare import main
from whsklearn.compare.report import with_error
from whsklearn.datasets import make_servo_log
from whsklearn.effects import Cogging


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("logs")
    for k, size in enumerate((0.2, 0.2, 0.4)):
        log = make_servo_log([Cogging(size, 12.0)], duration=15.0, random_state=k)
        log.to_csv(folder / f"day{k}.csv", index=False)
    return folder


def run(*arguments):
    return CliRunner().invoke(main, [str(a) for a in arguments])


def test_what_moved_is_said_and_written(logs, tmp_path):
    result = run(logs / "day0.csv", logs / "day2.csv", "--out", tmp_path, "--no-track")
    assert result.exit_code == 0, result.output
    data = json.loads((tmp_path / "compare.json").read_text(encoding="utf-8"))
    assert data["verdict"] == "moved"
    assert data["changes"][0]["name"] == "cogging"
    low, high = data["changes"][0]["interval"]
    assert low < 0.2 < high
    assert "Cogging rose" in result.output
    page = (tmp_path / "compare.html").read_text(encoding="utf-8")
    assert "day2.csv: " in page
    assert "drive from &#39;torque_nm&#39; in Nm" in page
    for row in data["numbers"]:  # with the digits of the page
        line = next(x for x in result.output.splitlines() if x.startswith(row["name"].replace("_", " ")))
        assert line.split("  ")[-1].strip() == row["unit"]
        assert with_error(row["values"][0], row["standard_errors"][0]).partition(" ")[0] in line.split() or row["part"]


def test_three_records_tell_since_when(logs, tmp_path, mlflow_root):
    result = run(*(logs / f"day{k}.csv" for k in range(3)), "--out", tmp_path)
    assert result.exit_code == 0, result.output
    data = json.loads((tmp_path / "compare.json").read_text(encoding="utf-8"))
    assert data["changes"][0]["between"] == ["day1.csv", "day2.csv"]
    from mlflow import MlflowClient

    client = MlflowClient()
    experiment = client.get_experiment_by_name("compare")
    runs = client.search_runs([experiment.experiment_id])
    parent = next(r for r in runs if "mlflow.parentRunId" not in r.data.tags)
    assert parent.data.tags["verdict"] == "moved"
    assert {"p_value", "change"} <= set(parent.data.metrics)
    assert len(runs) == 4
    assert all("inertia" in r.data.metrics for r in runs if r is not parent)


def test_one_log_is_a_wrong_use(logs, tmp_path):
    result = run(logs / "day0.csv", "--out", tmp_path, "--no-track")
    assert result.exit_code == 2
    assert "at least two" in result.output


def test_a_short_log_cannot_be_used(logs, tmp_path):
    short = tmp_path / "short.csv"
    short.write_text("\n".join((logs / "day0.csv").read_text().splitlines()[:200]), encoding="utf-8")
    result = run(logs / "day0.csv", short, "--out", tmp_path / "r", "--no-track")
    assert result.exit_code == 3
    assert "short.csv" in result.output


def test_the_same_log_twice_is_refused(logs, tmp_path):
    (tmp_path / "copy.csv").write_bytes((logs / "day0.csv").read_bytes())
    result = run(logs / "day0.csv", tmp_path / "copy.csv", "--out", tmp_path / "out", "--no-track")
    assert result.exit_code != 0
    assert "would count twice" in " ".join(result.output.split()) + str(result.exception)


def test_the_zero_of_an_integral_is_no_phase_that_can_be_compared(logs, tmp_path):
    for k, late in ((0, 0), (1, 700)):  # the same cogging; the logs begin at different angles
        log = pd.read_csv(logs / f"day{k}.csv").iloc[late:]
        speed = np.gradient(log["position_rad"].to_numpy(), log["time_s"].to_numpy())
        log = log.drop(columns="position_rad").assign(speed_rad_s=speed)
        log.to_csv(tmp_path / f"speed{k}.csv", index=False)
    result = run(tmp_path / "speed0.csv", tmp_path / "speed1.csv", "--out", tmp_path, "--no-track")
    assert result.exit_code == 0, result.output
    found = json.loads((tmp_path / "compare.json").read_text(encoding="utf-8"))
    assert found["changes"] == []
    assert "cogging was fitted to each record" in result.output


def without_units(path, to):
    """The same log with columns whose names state no unit."""
    names = {"torque_nm": "torque", "position_rad": "position"}
    pd.read_csv(path).rename(columns=names).to_csv(to, index=False)
    return to


def test_a_unit_that_one_log_does_not_state_is_si_as_the_note_says(logs, tmp_path):
    bare = [without_units(logs / f"day{k}.csv", tmp_path / f"bare{k}.csv") for k in range(2)]
    result = run(logs / "day0.csv", bare[1], "--out", tmp_path, "--no-track")
    assert result.exit_code == 0, result.output
    assert json.loads((tmp_path / "compare.json").read_text(encoding="utf-8"))["verdict"] == "nothing"
    both = run(*bare, "--out", tmp_path, "--no-track")
    assert both.output.count("The unit of the drive is not stated and is taken to be SI") == 1, both.output
