"""Splits of a record that let no future into the past.

The default KFold of a grid search trains on samples that surround the test fold, and glues
what came before it to what came after.  For a record in time use `time_series_split`; for
several records scikit-learn's `LeaveOneGroupOut`: an estimator that is given ``groups`` restarts at each.
"""

from __future__ import annotations

from typing import Any

from sklearn.model_selection import TimeSeriesSplit


def memory_length(estimator: Any) -> int:
    """Samples before t that the regressors at t of an ``estimator`` reach back to: max lag + p - 1.

    Works through a `Pipeline` (its last step) and a search (its estimator).  0 for an estimator without lags.

    Examples
    --------
    >>> from sklearn.linear_model import Ridge
    >>> from whsklearn.validation import memory_length
    >>> memory_length(Ridge())
    0
    """
    while hasattr(estimator, "steps") or (hasattr(estimator, "estimator") and not hasattr(estimator, "lags")):
        estimator = estimator.steps[-1][1] if hasattr(estimator, "steps") else estimator.estimator
    lags = getattr(estimator, "lags", None)
    if lags is None:
        return max(int(getattr(estimator, "p", 1)) - 1, 0)
    return _max_lag(lags) + max(int(getattr(estimator, "p", 1)), 1) - 1


def time_series_split(estimator: Any, n_splits: int = 5) -> TimeSeriesSplit:
    """`TimeSeriesSplit` with a gap as long as the estimator's memory.

    ``estimator``: the one to be validated; `memory_length` of it is the gap, so that no sample of a test fold shares a
    regressor with training. ``n_splits``: number of folds.

    Notes
    -----
    For a grid over lags or p, give the estimator with the largest of them.

    Examples
    --------
    >>> from sklearn.linear_model import Ridge
    >>> from whsklearn.validation import time_series_split
    >>> time_series_split(Ridge(), n_splits=3)
    TimeSeriesSplit(gap=0, max_train_size=None, n_splits=3, test_size=None)
    """
    return TimeSeriesSplit(n_splits=n_splits, gap=memory_length(estimator))


def _max_lag(lags: Any) -> int:
    """The lag transformer's own figure, or the largest lag of (5) from its orders."""
    for name in ("max_lag", "max_lag_"):
        if hasattr(lags, name):
            return int(getattr(lags, name))
    orders = {name: int(getattr(lags, name, 0)) for name in ("n_a", "n_b", "n_c", "n_d")}
    return max(orders["n_a"] + 1, orders["n_b"] + 1, 2, orders["n_c"], orders["n_d"])
