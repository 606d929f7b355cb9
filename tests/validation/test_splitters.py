"""Splits let nothing of the test fold into training."""

from __future__ import annotations

import numpy as np
import pytest
from sklearn.base import BaseEstimator, RegressorMixin
from sklearn.linear_model import Ridge
from sklearn.model_selection import GridSearchCV
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from whsklearn.validation import memory_length, time_series_split


class Lags(BaseEstimator):
    def __init__(self, n_a=2, n_b=2, n_c=2, n_d=2):
        self.n_a, self.n_b, self.n_c, self.n_d = n_a, n_b, n_c, n_d


class Model(RegressorMixin, BaseEstimator):
    def __init__(self, lags=None, p=1):
        self.lags, self.p = lags, p


@pytest.mark.parametrize(
    ("orders", "p", "length"),
    [((2, 2, 2, 2), 1, 3), ((2, 2, 2, 2), 4, 6), ((5, 2, 2, 2), 4, 9), ((1, 0, 1, 9), 1, 9), ((1, 0, 1, 0), 1, 2)],
)
def test_memory_is_the_largest_lag_and_the_window(orders, p, length):
    model = Model(Lags(*orders), p=p)
    assert memory_length(model) == length
    assert memory_length(make_pipeline(StandardScaler(), model)) == length
    assert memory_length(GridSearchCV(make_pipeline(model), {})) == length


def test_a_model_without_lags_has_only_its_window():
    assert memory_length(Ridge()) == 0
    assert memory_length(Model(None, p=4)) == 3


def test_training_ends_before_the_memory_of_the_test_begins():
    model = Model(Lags(4, 2, 2, 2), p=3)
    for train, test in time_series_split(model, n_splits=4).split(np.zeros((200, 1))):
        assert test.min() - train.max() > memory_length(model)
        assert np.array_equal(train, np.arange(train.size))
