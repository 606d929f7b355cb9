"""The linear yardstick beside the estimators."""

from __future__ import annotations

import numpy as np
import pytest

from pipelines._linear import BestLinear, fit_linear, record, verdict
from whsklearn.cli.comparison import ComparedModel, Outcome
from whsklearn.metrics import nmse


def test_linear_yardstick_finds_a_linear_system():
    from scipy.signal import lfilter

    rng = np.random.default_rng(0)
    X = rng.normal(size=(800, 1))
    clean = lfilter([0, 1.0, 0.5], [1.0, -1.2, 0.5], X[:, 0])
    y = clean + 0.3 * clean.std() * rng.normal(size=800)  # output noise: least squares of ARX is biased
    assert (
        nmse(clean, BestLinear().fit(X, y).predict(X))
        < 0.005
        < nmse(clean, fit_linear(record(X, y), "ARX", 2).run(record(X, y)))
    )


@pytest.mark.parametrize(("ours", "said"), [(0.01, "leaves 0.1 of the best"), (0.3, "Warning: in free run")])
def test_the_verdict_holds_the_best_against_a_linear_model(ours, said):
    pairs = (("line", "linear", 0.1), ("a", "full", ours), ("b", "full", 2.0))
    outcomes = [Outcome(ComparedModel(n, None, r), indices={"nmse": value}) for n, r, value in pairs]
    assert said in verdict(outcomes)
    assert "Too little" in verdict(outcomes[:1])
