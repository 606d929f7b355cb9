"""Searches: candidates recorded as they finish, on this machine's processes and on a Dask cluster."""

from __future__ import annotations

import pytest
from click.testing import CliRunner

from whsklearn.cli.tune import main


def run(*arguments):
    return CliRunner().invoke(main, [str(a) for a in arguments])


def test_every_candidate_is_a_run_and_the_best_a_champion(mlflow_root):
    import mlflow

    done = run("--samples", 200, "--p", "1,2", "--folds", 2, "--jobs", 1)
    assert done.exit_code == 0, done.output
    assert max(map(len, done.stdout.splitlines())) <= 100
    client = mlflow.MlflowClient()
    found = client.search_runs([e.experiment_id for e in client.search_experiments()])
    children = [r for r in found if "mlflow.parentRunId" in r.data.tags]
    (parent,) = (r for r in found if "mlflow.parentRunId" not in r.data.tags)
    assert {r.data.params["p"] for r in children} == {"1", "2"}
    assert all(len(client.get_metric_history(r.info.run_id, "fold/nmse")) == 2 for r in children)
    assert parent.data.metrics["nmse"] == pytest.approx(min(r.data.metrics["nmse"] for r in children))
    model = mlflow.sklearn.load_model("models:/tuned@champion")
    assert model.p == int(parent.data.tags["best_p"])


@pytest.mark.parametrize("kind", ["halving", "random"])
def test_other_searches_score_all_that_they_try(kind):
    done = run(
        "--samples", 320, "--folds", 2, "--p", "1,2", "--jobs", 1, "--no-track", "--search", kind, "--candidates", 2
    )
    assert done.exit_code == 0, done.output  # a failed score is a warning, and a warning an error
    assert "nan" not in done.stdout


@pytest.mark.filterwarnings("ignore::ResourceWarning")  # distributed leaves sockets to the collector
def test_dask_cluster_searches_the_same():
    pytest.importorskip("distributed", reason="needs the extra dask")
    done = run("--samples", 200, "--p", "1,2", "--folds", 2, "--backend", "dask", "--no-track")
    assert done.exit_code == 0, done.output
    assert "2 workers" in done.stderr
    assert "The best 2" in done.stdout


def test_scheduler_that_is_down_is_told():
    pytest.importorskip("distributed", reason="needs the extra dask")
    done = run("--samples", 200, "--backend", "dask", "--scheduler", "tcp://127.0.0.1:9", "--no-track")
    assert done.exit_code == 1
    assert "does not answer" in done.output


@pytest.mark.parametrize(("option", "value"), [("--p", "1,x"), ("--forgetting", ""), ("--orders", "2")])
def test_unreadable_grid_is_told(option, value):
    done = run("--no-track", option, value)
    assert done.exit_code == 1
    assert f"{option} is" in done.output
