"""A search that hands its candidates over as they finish, and is otherwise scikit-learn's own."""

from __future__ import annotations

import pickle
from types import SimpleNamespace

import numpy as np
import pytest
from sklearn.linear_model import Ridge
from sklearn.model_selection import GridSearchCV, TimeSeriesSplit

from whsklearn.cli.recorded_search import Contiguous, recorded


@pytest.mark.parametrize("jobs", [None, 2])
def test_interrupted_search_has_handed_over_what_was_finished(jobs):
    class Enough(Exception):
        pass

    def stop(results):
        seen.append(len(results["params"]))
        if len(seen) == 2:
            raise Enough

    seen: list[int] = []
    X = np.random.default_rng(0).normal(size=(40, 2))
    search = recorded(GridSearchCV)(Ridge(), {"alpha": list(range(1, 12))}, n_jobs=jobs)
    search.on_results = stop
    with pytest.raises(Enough):
        search.fit(X, X[:, 0])
    assert 0 < seen[0] < seen[1] < 11


def test_recorded_search_finds_what_a_plain_one_finds():
    X = np.random.default_rng(0).normal(size=(60, 3))
    y = X @ [1.0, 2.0, 3.0] + X[:, 0] ** 2
    grid = {"alpha": [0.01, 1.0, 10.0, 100.0, 1000.0]}
    ours, plain = (s(Ridge(), grid).fit(X, y) for s in (recorded(GridSearchCV), GridSearchCV))
    np.testing.assert_array_equal(ours.cv_results_["mean_test_score"], plain.cv_results_["mean_test_score"])
    assert ours.best_params_ == plain.best_params_


def test_search_travels_as_a_plain_one():
    search = recorded(GridSearchCV)(Ridge(), {"alpha": [1.0]})
    search.on_results = lambda results: None
    assert type(pickle.loads(pickle.dumps(search))) is GridSearchCV


def test_a_share_of_a_fold_is_in_one_piece():
    drawn = SimpleNamespace(base_cv=TimeSeriesSplit(3), fraction=0.25)
    X = np.zeros((400, 1))
    for (train, test), (whole, rest) in zip(Contiguous(drawn).split(X), TimeSeriesSplit(3).split(X), strict=True):
        assert (np.diff(train) == 1).all()
        assert (train[-1], test[0]) == (whole[-1], rest[0])
        assert (len(train), len(test)) == (len(whole) // 4, len(rest) // 4)
    assert Contiguous(drawn).get_n_splits() == 3
