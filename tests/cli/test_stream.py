"""The stream: same records and state however rows arrive, through stops, kills, bad rows and changes."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import numpy as np
import pytest
from click.testing import CliRunner

from tests.streaming.recorded_stream import QUICK, ROOT, carried, records, stream, write
from whsklearn.checks import state_difference
from whsklearn.cli.stream import main as stream_command


def test_estimates_and_predictions_come_at_their_rows(undisturbed, rows):
    estimates = records(undisturbed / "out.jsonl", "estimate")
    assert [r["row"] for r in estimates] == [500, 1000, 1500, 2000, 2500]
    assert estimates[-1]["time"] == pytest.approx(24.99)
    assert estimates[-1]["parameters"]["coulomb"] == pytest.approx(0.7, abs=0.05)
    assert estimates[-1]["innovation_rmse"] < 0.15
    predictions = records(undisturbed / "out.jsonl", "prediction")
    assert [r["row"] for r in predictions] == list(range(1, 2601))
    assert predictions[0]["y_hat"] is None
    errors = np.array([r["y"] - r["y_hat"] for r in predictions[1500:]])
    assert np.sqrt(np.mean(errors**2)) < 0.15
    assert records(undisturbed / "out.jsonl", "bad_row") == []


def test_json_lines_on_stdin_are_the_same_stream(tmp_path, undisturbed, rows):
    lines = [json.dumps(dict(zip("tuy", map(float, row.split(",")), strict=True))) for row in rows]
    kept = tmp_path / "kept.whs"
    process = subprocess.run(
        [sys.executable, "-m", "pipelines.stream", "-", *QUICK, "--checkpoint", str(kept)],
        input="\n".join(lines), cwd=ROOT, capture_output=True, text=True, check=True,
    )  # fmt: skip
    estimates = [json.loads(line) for line in process.stdout.splitlines()]
    assert estimates == records(undisturbed / "out.jsonl", "estimate")
    assert state_difference(carried(kept), carried(undisturbed / "log.csv.whs")) == 0.0


def test_the_run_is_recorded(mlflow_root, rows):
    import mlflow

    log = write(mlflow_root / "log.csv", rows[:1100])
    args = [a for a in QUICK if a != "--no-track"]
    done = stream(log, "--out", mlflow_root / "out.jsonl", *args)
    assert done.exit_code == 0, done.output
    client = mlflow.MlflowClient(os.environ["MLFLOW_TRACKING_URI"])
    (run,) = client.search_runs([client.get_experiment_by_name("stream").experiment_id])
    path = client.get_metric_history(run.info.run_id, "path/coulomb")
    assert [(m.step, m.value) for m in path] == [
        (r["row"], r["parameters"]["coulomb"]) for r in records(mlflow_root / "out.jsonl", "estimate")
    ]


@pytest.mark.parametrize(
    ("change", "said", "status"),
    [
        (["--input", "torque"], "The header has no column 'torque'", 2),
        (["--law", "nonsense"], "Unknown effect 'nonsense'", 1),
        (["--p", "0"], "p is 0", 1),
    ],
)
def test_impossible_requests_are_one_sentence(tmp_path, rows, change, said, status):
    log = write(tmp_path / "log.csv", rows[:50])
    done = stream(log, "--no-track", *change)
    assert done.exit_code == status
    assert said in done.stderr
    assert "Traceback" not in done.stderr


def test_a_log_none_of_whose_lines_is_a_row_cannot_be_used_and_says_so_in_few_lines(tmp_path):
    log = write(tmp_path / "log.csv", [f"{0.01 * i},off,{i}\n" for i in range(1200)])
    done = stream(log, "--no-track", "--out", tmp_path / "out.jsonl")
    assert done.exit_code == 3, done.output
    assert "None of the 1200 lines" in done.stderr
    assert done.stderr.count("skipped") == 12  # the first ten, the hundredth, the thousandth
    assert "the 1000th bad row" in done.stderr
    assert len(records(tmp_path / "out.jsonl", "bad_row")) == 1200


def test_rows_sent_again_and_again_are_said_a_few_times(tmp_path, rows):
    log = write(tmp_path / "log.csv", [row for row in rows[:150] for _ in range(2)])
    done = stream(log, "--no-track", "--time", "t", "--out", tmp_path / "out.jsonl")
    assert done.exit_code == 0, done.output
    assert done.stderr.count("was sent before") == 11
    assert sum(r["cause"] == "repeated_rows" for r in records(tmp_path / "out.jsonl", "alarm")) == 150


def test_a_start_with_a_wrong_column_does_not_bind_the_next_one(tmp_path):
    log = tmp_path / "log.csv"
    log.write_text("torque_nm,speed\n" + "".join(f"{i % 7},{2 * (i % 7)}\n" for i in range(300)))
    run = [str(log), "--no-track", "--estimator", "rls", "--output", "speed"]
    assert CliRunner().invoke(stream_command, [*run, "--input", "torque"]).exit_code == 2
    done = CliRunner().invoke(stream_command, [*run, "--input", "torque_nm"])
    assert done.exit_code == 0, done.output


def test_json_lines_in_a_file_are_sent_to_stdin(tmp_path):
    log = tmp_path / "log.jsonl"
    log.write_text('{"u": 1.0, "y": 2.0}\n')
    done = CliRunner().invoke(stream_command, [str(log), "--no-track"])
    assert done.exit_code == 3
    assert "whsklearn stream - <" in done.output
