"""MLflow's page of an experiment."""

from __future__ import annotations

import json

import pytest

from whsklearn.tracking.page import VIEW, view_of


@pytest.mark.parametrize("experiment", ["close_gap", "compare", "tune", "identify", "fleet", "stream", "another"])
def test_columns_are_spelled_as_mlflow_reads_them(experiment):
    view = view_of(experiment)
    for column in (view["orderByKey"], *view["selectedColumns"]):
        kind, _, name = column.partition(".")
        assert kind in ("tags", "metrics", "params", "attributes")
        assert name.strip("`") == (name if kind == "attributes" else name[1:-1]) != ""


def test_every_experiment_has_its_columns_among_the_saved_views_of_mlflow(tracker):
    """Named views are in MLflow's menu from 3.15 on; what earlier versions read of the tag stands beside."""
    tags = tracker.client.get_experiment(tracker.experiment_id).tags
    view = json.loads(tags[f"mlflow.sharedViewState.{VIEW}"])
    assert isinstance(view["name"], str)
    assert isinstance(view["createdAt"], int)
    state = json.loads(view["state"])
    assert state == {k: view[k] for k in state} == view_of(tracker.experiment)
