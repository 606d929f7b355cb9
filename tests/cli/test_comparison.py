"""The comparison of estimators: one that fails leaves the others alone, and the words fit the figures."""

from __future__ import annotations

import numpy as np
import pytest
from sklearn.base import BaseEstimator
from sklearn.linear_model import LinearRegression

from whsklearn.cli.comparison import ComparedModel, ComparedRecord, Outcome, by_name, compare, results_table, verdict
from whsklearn.metrics import nmse
from whsklearn.tracking import open_tracker


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


@pytest.mark.parametrize(("ours", "said"), [(0.01, "leaves 0.1 of the best"), (0.3, "Warning: in free run")])
def test_the_verdict_holds_the_best_against_a_linear_model(ours, said):
    pairs = (("line", "linear", 0.1), ("a", "full", ours), ("b", "full", 2.0))
    outcomes = [Outcome(ComparedModel(n, None, r), indices={"nmse": value}) for n, r, value in pairs]
    assert said in verdict(outcomes)
    assert "Too little" in verdict(outcomes[:1])
