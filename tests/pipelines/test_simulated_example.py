"""The comparison: what it prints, what it records, and what it says to a log it cannot read."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from click.testing import CliRunner

from pipelines._linear import BestLinear, fit_arx
from pipelines.simulated_example import main
from whsklearn.metrics import nmse


def run(*arguments):
    return CliRunner().invoke(main, [str(a) for a in arguments])


def test_comparison_is_printed_and_recorded(mlflow_root):
    import mlflow

    done = run("--samples", 300, "--seed", 1)
    assert done.exit_code == 0, done.output
    assert max(map(len, done.stdout.splitlines())) <= 100
    client = mlflow.MlflowClient()
    found = client.search_runs([e.experiment_id for e in client.search_experiments()])
    children = {r.info.run_name: r for r in found if "mlflow.parentRunId" in r.data.tags}
    (parent,) = (r for r in found if "mlflow.parentRunId" not in r.data.tags)
    assert len(children) == 8
    assert {"nmse", "mu_e", "rmse", "delta"} <= set(children["RMILS (full)"].data.metrics)
    assert parent.data.metrics["nmse"] == min(r.data.metrics["nmse"] for r in children.values())
    assert len(client.get_metric_history(children["RMILS (full)"].info.run_id, "path/b1")) == 30
    files = {f.path for f in client.list_artifacts(parent.info.run_id)}
    assert {"table.txt", "convergence_full.png", "validation.png"} <= files
    (model,) = client.search_logged_models(
        [parent.info.experiment_id], f"source_run_id = '{children['RMILS (full)'].info.run_id}'"
    )
    loaded = mlflow.sklearn.load_model(model.model_uri)
    X = np.random.default_rng(0).normal(size=(50, 1))
    before = loaded.predict(X)
    assert np.isfinite(loaded.partial_fit(X, before).predict(X)).all()


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["--input", "torque", "--output", "speed"], "has no column 'torque'"),
        (["--input", "u", "--output", "word"], "no finite numbers, the first in data row 1"),
        (["--input", "u", "--output", "still"], "never changes"),
        (["--input", "u"], "--log needs --input and --output"),
        (["--input", "u", "--output", "y", "--orders", "2,2"], "expected four whole numbers"),
    ],
)
def test_bad_log_is_told_in_one_sentence(tmp_path, arguments, told):
    u = np.random.default_rng(0).normal(size=80)
    pd.DataFrame({"u": u, "y": u, "word": "x", "still": 1.0}).to_csv(tmp_path / "log.csv", index=False)
    done = run("--no-track", "--log", tmp_path / "log.csv", *arguments)
    assert done.exit_code == 1
    assert told in done.output
    assert len([line for line in done.output.splitlines() if line.strip()]) == 1


def test_server_that_is_down_is_told(monkeypatch):
    monkeypatch.setenv("MLFLOW_TRACKING_URI", "http://127.0.0.1:9")
    done = run("--samples", 100)
    assert done.exit_code == 1
    assert "does not answer" in done.output


def test_measured_robot_beats_the_linear_model_or_says_so(data_dir):
    parts = [data_dir / "kr300" / f"kr300_axis1_{k}.csv" for k in "AB"]
    columns = ["--input", "motor_torque_Nm", "--output", "load_velocity_deg_s", "--time", "time_s"]
    done = run("--no-track", "--log", parts[0], "--test", parts[1], *columns)
    assert done.exit_code == 0, done.output
    better, worse = "of the best linear model's mean squared error", "Warning: in free run"
    assert (better in done.stdout) != (worse in done.stdout)
    assert "could not be fitted" not in done.stdout
    assert not {"nan", "inf"} & set(done.stdout.split())


def test_linear_yardstick_finds_a_linear_system():
    from scipy.signal import lfilter

    rng = np.random.default_rng(0)
    X = rng.normal(size=(800, 1))
    clean = lfilter([0, 1.0, 0.5], [1.0, -1.2, 0.5], X[:, 0])
    y = clean + 0.3 * clean.std() * rng.normal(size=800)  # output noise: least squares of ARX is biased
    assert nmse(clean, BestLinear().fit(X, y).predict(X)) < 0.005 < nmse(clean, fit_arx(X, y, 2, 2).predict(X))
