"""A fleet: every axis has its row, whatever fails or dies on the way, and the odd ones are named."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path

import pandas as pd
import pytest
from click.testing import CliRunner
from sklearn.base import BaseEstimator, RegressorMixin

from tests.cli.fleet_folder import MODEL, source
from whsklearn.cli.fleet import main, run_here, run_on_cluster, to_table
from whsklearn.cli.fleet_axis import axes_of, identify_axes, outliers

pytest.importorskip("pyarrow", reason="needs the extra parquet")
QUICK = ["--no-track", "--estimator", "rls", "--in-process", "--workers", "1", "--time", "t"]


def test_the_job_writes_one_row_an_axis_and_names_the_odd_ones(fleet, tmp_path):
    out = tmp_path / "fleet.parquet"
    done = CliRunner().invoke(main, [str(fleet), "--out", str(out), *QUICK])
    assert done.exit_code == 0, done.output
    table = pd.read_parquet(out)
    assert list(table["axis"]) == axes_of(fleet, "axis")
    good = table[table["axis"] != "broken"]
    assert (good["failure"] == "").all()
    assert (good["rows"] == 600).all()
    assert good["nmse"].max() < 0.05
    assert good.set_index("axis").loc["ax05", "coulomb"] == pytest.approx(1.4, abs=0.25)
    assert "cannot be read" in table.set_index("axis").loc["broken", "failure"]
    assert {"broken", "ax05"} <= set(outliers(table)["axis"])
    assert "broken" in done.output


def test_the_fleet_is_recorded_with_a_child_for_each_outlier(fleet, mlflow_root):
    import mlflow

    args = [a for a in QUICK if a != "--no-track"]
    done = CliRunner().invoke(main, [str(fleet), "--out", str(mlflow_root / "fleet.parquet"), *args])
    assert done.exit_code == 0, done.output
    client = mlflow.MlflowClient(os.environ["MLFLOW_TRACKING_URI"])
    runs = client.search_runs([client.get_experiment_by_name("fleet").experiment_id])
    (parent,) = [r for r in runs if "mlflow.parentRunId" not in r.data.tags]
    children = {r.info.run_name for r in runs if r is not parent}
    assert {"axis ax05", "axis broken"} <= children
    assert parent.data.metrics["failed"] == 1.0
    assert parent.data.metrics["outliers"] == len(children)


def test_processes_and_one_process_give_the_same(fleet):
    names = axes_of(fleet, "axis")[:4]
    alone = to_table(identify_axes(MODEL, names, source(fleet), 0.25), names)
    batches = [names[:1], names[1:]]
    shared = to_table([r for rows in run_here(MODEL, batches, source(fleet), 0.25, 2) for r in rows], names)
    pd.testing.assert_frame_equal(alone.drop(columns="seconds"), shared.drop(columns="seconds"))


class DiesOnce(RegressorMixin, BaseEstimator):
    """Kills its own worker process the first time that it is fitted anywhere."""

    def __init__(self, mark=""):
        self.mark = mark

    def fit(self, X, y):
        try:
            Path(self.mark).touch(exist_ok=False)
        except FileExistsError:
            time.sleep(0.1)
        else:
            os.kill(os.getpid(), signal.SIGKILL)
        self.parameters_ = {"gain": float(X[:, 0] @ y / (X[:, 0] @ X[:, 0]))}
        return self

    def predict(self, X):
        return self.parameters_["gain"] * X[:, 0]


@pytest.mark.filterwarnings("ignore::ResourceWarning", "ignore::pytest.PytestUnraisableExceptionWarning")
def test_a_worker_that_is_killed_loses_no_axis(fleet, tmp_path):
    pytest.importorskip("distributed", reason="needs the extra dask")
    names = [n for n in axes_of(fleet, "axis") if n != "broken"]
    batches = [names[i : i + 2] for i in range(0, len(names), 2)]
    model = DiesOnce(str(tmp_path / "died"))
    rows = [r for done in run_on_cluster(model, batches, source(fleet), 0.25, None, 2) for r in done]
    assert (tmp_path / "died").exists()
    table = to_table(rows, names)
    assert list(table["axis"]) == names
    assert (table["failure"] == "").all()


def test_a_lost_axis_does_not_go_unnoticed():
    with pytest.raises(ValueError, match="1 axes came back without a result, the first b"):
        to_table([{"axis": "a", "rows": 1, "failure": "", "seconds": 0.1}], ["a", "b"])


def test_a_folder_without_axes_is_refused(tmp_path):
    done = CliRunner().invoke(main, [str(tmp_path), *QUICK])
    assert done.exit_code == 1
    assert "holds no folder axis=NAME" in done.stderr
