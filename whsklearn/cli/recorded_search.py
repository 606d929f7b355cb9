"""Searches that report their results as they are computed, so that an interruption loses no finished candidate."""

from __future__ import annotations

import copyreg
from collections.abc import Callable, Iterator
from typing import Any

import sklearn
from joblib import effective_n_jobs


class Contiguous:
    """Folds of which a contiguous share is used, at the border between training and test.

    scikit-learn's successive halving draws samples at random (``drawn``), and a dynamic model cannot be fitted to
    scattered samples.

    >>> from types import SimpleNamespace
    >>> from sklearn.model_selection import TimeSeriesSplit
    >>> halves = Contiguous(SimpleNamespace(base_cv=TimeSeriesSplit(2), fraction=0.5))
    >>> [(train.tolist(), test.tolist()) for train, test in halves.split(range(12))]
    [([2, 3], [4, 5]), ([4, 5, 6, 7], [8, 9])]
    """

    def __init__(self, drawn: Any):
        self.folds, self.share = drawn.base_cv, drawn.fraction

    def split(self, X: Any, y: Any = None, **kwargs: Any) -> Iterator[tuple[Any, Any]]:
        """The last training samples and the first test samples."""
        for train, test in self.folds.split(X, y, **kwargs):
            yield train[-max(1, int(self.share * len(train))) :], test[: max(1, int(self.share * len(test)))]

    def get_n_splits(self, *args: Any, **kwargs: Any) -> int:
        """The number of folds."""
        return int(self.folds.get_n_splits(*args, **kwargs))


def recorded(search_class: type) -> type:
    """A subclass that calls ``on_results`` with the results so far, after every few candidates.

    scikit-learn documents ``_run_search`` as the method in which a subclass decides what is evaluated and when
    (`sklearn.model_selection.BaseSearchCV`); candidates, folds and results are its own.

    >>> from sklearn.linear_model import Ridge
    >>> from sklearn.model_selection import GridSearchCV
    >>> search = recorded(GridSearchCV)(Ridge(), {"alpha": [0.1, 1.0, 10.0]}, cv=2, n_jobs=1)
    >>> search.on_results = lambda results: print(len(results["params"]))
    >>> _ = search.fit([[0.0], [1.0], [2.0], [3.0]], [0.0, 1.0, 2.0, 3.0])
    2
    3
    """

    class _Recorded(search_class):  # type: ignore[misc, valid-type]
        on_results: Callable[[dict[str, Any]], None] | None = None

        def _run_search(self, evaluate_candidates: Any, callback_ctx: Any = None) -> None:
            def in_chunks(candidates: Any, cv: Any = None, more_results: Any = None, callback_ctx: Any = None) -> Any:  # noqa: ARG001 - scikit-learn passes it
                candidates, cv = list(candidates), Contiguous(cv) if hasattr(cv, "fraction") else cv
                # Halving passes columns of its own, one iteration at a time; these are not split.
                size = len(candidates) if more_results else max(1, 2 * effective_n_jobs(self.n_jobs))
                results = None
                for start in range(0, len(candidates), size):
                    results = evaluate_candidates(candidates[start : start + size], cv=cv, more_results=more_results)
                    if self.on_results is not None:
                        self.on_results(results)
                return results

            # Since 1.9 scikit-learn passes a context for its progress callbacks to methods that accept one.
            super()._run_search(in_chunks, **({} if callback_ctx is None else {"callback_ctx": callback_ctx}))

        def __reduce__(self) -> Any:
            # scikit-learn sends the search to its workers, where it is a plain search and records nothing.
            state = {k: v for k, v in self.__dict__.items() if k != "on_results"}
            state["_sklearn_version"] = sklearn.__version__  # as in the pickle of any estimator
            return copyreg._reconstructor, (search_class, object, None), state  # type: ignore[attr-defined]

    _Recorded.__name__ = _Recorded.__qualname__ = search_class.__name__
    return _Recorded
