"""The page of recorded runs."""

from __future__ import annotations

import json

from whsklearn.cli.ui import _announce
from whsklearn.tracking import experiments, open_tracker
from whsklearn.tracking.store import VIEW, page_of


def test_page_opens_on_runs_not_on_traces():
    address = page_of("http://127.0.0.1:5000", "3")
    assert address.startswith("http://127.0.0.1:5000/#/experiments/3/runs?workflowType=machine_learning")


def test_every_experiment_has_an_address_with_its_own_columns(mlflow_root, capsys):
    import mlflow

    for name in ("tune", "close_gap", "of another program"):
        with open_tracker(name).run("one"):
            pass
    client, tag = mlflow.MlflowClient(), f"mlflow.sharedViewState.{VIEW}"
    client.delete_experiment_tag(client.get_experiment_by_name("close_gap").experiment_id, tag)
    found = experiments()
    assert [name for name, _ in found] == ["of another program", "close_gap", "tune"]
    _announce("http://127.0.0.1:5000", found, browser=False)
    said = capsys.readouterr().out
    for name, experiment_id in found:
        view = json.loads(client.get_experiment(experiment_id).tags[tag])
        assert view["selectedColumns"]
        assert f"/experiments/{experiment_id}/runs" in next(line for line in said.splitlines() if f"  {name} " in line)
    assert "viewStateShareKey" in said


def test_without_runs_the_page_itself_is_named(capsys):
    _announce("http://127.0.0.1:5000", [], browser=False)
    assert "no runs yet" in capsys.readouterr().out
