"""The comparison: what it prints, what it records, and what it says to a log it cannot read."""

from __future__ import annotations

import numpy as np
from click.testing import CliRunner

from whsklearn.cli import comparison
from whsklearn.cli.simulated_example import main


def run(*arguments):
    return CliRunner().invoke(main, [str(a) for a in arguments])


def test_comparison_is_printed_and_recorded(mlflow_root, monkeypatch):
    import mlflow

    monkeypatch.setattr(comparison, "MOST_OF_A_PATH", 4)  # each point of a path is a fit of a tenth of a second
    monkeypatch.setattr(comparison, "WARM_UP", 60)  # with all samples, every model would be fitted twice
    done = run("--samples", 300, "--seed", 1)
    assert done.exit_code == 0, done.output
    assert (
        max(len(line) for line in done.stdout.splitlines() if "mlruns" not in line) <= 100
    )  # a path is as long as it is
    assert "RMILS with the full gradient is the default of the library" in done.stdout.replace("\n", " ")
    client = mlflow.MlflowClient()
    found = client.search_runs([e.experiment_id for e in client.search_experiments()])
    children = {r.info.run_name: r for r in found if "mlflow.parentRunId" in r.data.tags}
    (parent,) = (r for r in found if "mlflow.parentRunId" not in r.data.tags)
    assert len(children) == 8
    assert {"nmse", "mu_e", "rmse", "delta"} <= set(children["RMILS (full)"].data.metrics)
    assert parent.data.metrics["nmse"] == min(r.data.metrics["nmse"] for r in children.values())
    assert len(client.get_metric_history(children["RMILS (full)"].info.run_id, "path/b1")) == 4
    files = {f.path for f in client.list_artifacts(parent.info.run_id)}
    assert {"table.txt", "convergence_full.png", "validation.png"} <= files
    (model,) = client.search_logged_models(
        [parent.info.experiment_id], f"source_run_id = '{children['RMILS (full)'].info.run_id}'"
    )
    loaded = mlflow.sklearn.load_model(model.model_uri)
    X = np.random.default_rng(0).normal(size=(50, 1))
    before = loaded.predict(X)
    assert np.isfinite(loaded.partial_fit(X, before).predict(X)).all()


def test_wrong_orders_are_told_in_one_sentence():
    done = run("--no-track", "--orders", "2,2")
    assert done.exit_code == 2
    assert done.output.rstrip().endswith(
        "Invalid value for '--orders': '2,2'; expected four whole numbers n_a,n_b,n_c,n_d such as 2,2,2,2."
    )


def test_server_that_is_down_is_told(monkeypatch):
    monkeypatch.setenv("MLFLOW_TRACKING_URI", "http://127.0.0.1:9")
    done = run("--samples", 100)
    assert done.exit_code == 1
    assert "does not answer" in done.output
