"""The comparison of estimators: one that fails leaves the others alone, and the words fit the figures."""

from __future__ import annotations

import contextlib

import numpy as np
import pytest
from sklearn.base import BaseEstimator
from sklearn.linear_model import LinearRegression

from whsklearn import WienerHammersteinLags
from whsklearn.cli.comparison import ComparedModel, ComparedRecord, by_name, candidates, compare, results_table
from whsklearn.metrics import nmse
from whsklearn.tracking import TrackingError, open_tracker


class Refuses(BaseEstimator):
    """An estimator that no record suits."""

    def fit(self, X, y):
        raise ValueError("too short\nand more")


@pytest.fixture(scope="module")
def record():
    rng = np.random.default_rng(0)
    X = rng.normal(size=(50, 1))
    return ComparedRecord("made up", X, X[:, 0] + 0.1 * rng.normal(size=50))


def outcomes_of(candidates, record):
    with open_tracker("x", enabled=False).run("comparison") as run:
        return compare(candidates, record, [record], parent=run, skip=10)


def test_one_that_fails_is_told_and_leaves_the_others_alone(record):
    good = ComparedModel("line", LinearRegression(), "linear", stream=False)
    outcomes = outcomes_of([ComparedModel("sick", Refuses(), stream=False), good], record)
    assert [o.failure for o in outcomes] == ["too short", ""]
    y_hat = LinearRegression().fit(record.X, record.y).predict(record.X)
    assert outcomes[1].indices["nmse"] == pytest.approx(nmse(record.y, y_hat, skip=10))
    assert list(by_name(outcomes)) == ["line, linear"]
    text = results_table(outcomes, "title")
    assert "sick (-) could not be fitted: too short" in text
    with pytest.raises(ValueError, match="No candidate could be fitted to made up"):
        outcomes_of([ComparedModel("sick", Refuses(), stream=False)], record)


class LosesItsServer:
    """A parent run whose server dies after the first child."""

    def __init__(self):
        self.asked = 0

    @contextlib.contextmanager
    def child(self, name, tags=None):
        self.asked += 1
        if self.asked > 1:
            raise TrackingError("The record cannot be written.")
        with open_tracker("x", enabled=False).run(name) as run:
            yield run


def test_a_lost_record_is_told_after_the_table_of_all_candidates(record, capsys):
    names = ["first", "second", "third"]
    candidates = [ComparedModel(name, LinearRegression(), "linear", stream=False) for name in names]
    parent = LosesItsServer()
    with pytest.raises(TrackingError):
        compare(candidates, record, [record], parent=parent, skip=10)
    assert parent.asked == 2  # each further call would wait for the server once more
    table = capsys.readouterr().out
    assert all(line.split()[-2] != "-" for line in table.splitlines() if line.startswith(tuple(names)))
    assert all(name in table for name in names)


# --- what is compared ------------------------------------------------------------------------------------------
LAGS = WienerHammersteinLags(3, 1, 2, 1)


def test_each_is_there_once_with_the_orders_window_and_seed_asked_for():
    found = candidates(LAGS, p=7, seed=5, evolution=True)
    assert len({(c.name, c.reading) for c in found}) == len(found) == 9
    for c in found:
        settings = c.model.get_params()
        assert settings["lags__n_a"] == 3
        assert settings.get("random_state", 5) == 5
        assert settings.get("p", 7) == 7


def test_only_what_learns_sample_by_sample_has_a_path_to_draw():
    found = candidates(LAGS, evolution=True)
    assert {c.name for c in found if not c.stream} == {"PEM", "differential evolution"}
    assert all(hasattr(c.model, "partial_fit") for c in found if c.stream)


@pytest.mark.parametrize("p0", [1e6, 3.0])
def test_the_published_readings_start_as_the_article_says_unless_told(p0):
    given = {} if p0 == 1e6 else {"published": {"P0": p0}}
    published = [c.model for c in candidates(LAGS, **given) if c.reading == "pseudolinear" and c.name != "gradient"]
    assert [(m.P0, m.theta0, m.gradient) for m in published] == [(p0, 0.01, "pseudolinear")] * 3
