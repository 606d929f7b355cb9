"""A search as runs."""

from __future__ import annotations

import numpy as np
import pytest
from sklearn.linear_model import Ridge
from sklearn.model_selection import GridSearchCV, TimeSeriesSplit

from tests.tracking.recorded import runs
from whsklearn import tracking


def test_search_gets_a_child_for_each_candidate(tracker):
    X = np.random.default_rng(0).normal(size=(60, 3))
    scoring = {"neg_nmse": "neg_mean_squared_error", "r2": "r2"}
    search = GridSearchCV(Ridge(), {"alpha": [0.1, 1, 10]}, scoring=scoring, refit="neg_nmse", cv=TimeSeriesSplit(4))
    search.fit(X, X @ [1.0, 2.0, 3.0])
    with tracker.run("search") as parent:
        tracking.log_candidates(parent, search.cv_results_)
    children = [r for r in runs(tracker).values() if "mlflow.parentRunId" in r.data.tags]
    assert {r.data.params["alpha"] for r in children} == {"0.1", "1", "10"}
    for run in children:
        folds = tracker.client.get_metric_history(run.info.run_id, "fold/nmse")
        assert [m.step for m in folds] == [0, 1, 2, 3]
        assert np.mean([m.value for m in folds]) == pytest.approx(run.data.metrics["nmse"])
        assert run.data.metrics["nmse"] > 0  # scikit-learn's sign is turned back
        assert run.data.metrics["r2"] > 0


def test_only_candidates_not_yet_recorded_are_logged(tracker):
    results = {"params": [{"p": 1}, {"p": 2}], "mean_test_score": [1, 2], "std_test_score": [0, 0]}
    results |= {"split0_test_score": [1, 2], "mean_fit_time": [0.1, 0.1]}
    with tracker.run("search") as parent:
        tracking.log_candidates(parent, results, first=1)
    assert set(runs(tracker)) == {"search", "p=2"}
