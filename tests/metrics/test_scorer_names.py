"""Our scorers are known by name everywhere, and none of scikit-learn's is replaced."""

from __future__ import annotations

import pytest
from sklearn.metrics import get_scorer, get_scorer_names

from whsklearn.metrics import SCORER_NAMES
from whsklearn.metrics.scorer_names import register_scorers


@pytest.mark.parametrize("name", SCORER_NAMES)
def test_a_name_is_a_scorer(name):
    assert callable(get_scorer(name))
    assert name in get_scorer_names()


def test_a_name_that_is_taken_stays():
    before = get_scorer("r2")
    register_scorers({"r2": get_scorer(next(iter(SCORER_NAMES)))})
    assert get_scorer("r2")._score_func is before._score_func
