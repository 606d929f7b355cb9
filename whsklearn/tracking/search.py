"""A search as runs: the parameters of an estimator, and a child run for each candidate."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from whsklearn.tracking.runs import Run


def estimator_params(estimator: Any) -> dict[str, Any]:
    """The parameters of an estimator; nested ones are named by path, objects are given by class.

    Parameters
    ----------
    estimator : estimator
        Of scikit-learn.

    Examples
    --------
    >>> from whsklearn import RLSRegressor, WienerHammersteinLags
    >>> from whsklearn.tracking import estimator_params
    >>> params = estimator_params(RLSRegressor(WienerHammersteinLags(n_a=3)))
    >>> params["lags__n_a"], params["lags"]
    (3, 'WienerHammersteinLags')
    """
    return {k: type(v).__name__ if hasattr(v, "get_params") else v for k, v in estimator.get_params(deep=True).items()}


def log_candidates(
    parent: Run,
    results: Mapping[str, Any],
    first: int = 0,
    tags: Mapping[str, str] | None = None,
    varied: Sequence[str] = (),
) -> None:
    """Record a search: a child for each candidate of ``cv_results_`` from `first` on.

    A child is named by the parameters that are `varied`, in that order; by all of them if none is given.

    A score ``neg_nmse`` becomes the metric ``nmse``, its mean over the folds, beside ``nmse_std`` and the
    stepped ``fold/nmse``; a score without ``neg_`` keeps its sign and its name.

    Parameters
    ----------
    parent : Run
    results : mapping
        ``cv_results_`` of a search.
    first : int, default=0
        Candidate to begin with.
    tags : mapping of str to str, optional
        Of every child.
    varied : sequence of str
        Names of parameters.

    Examples
    --------
    >>> from whsklearn.tracking import log_candidates, open_tracker
    >>> from sklearn.linear_model import Ridge
    >>> from sklearn.model_selection import GridSearchCV
    >>> search = GridSearchCV(Ridge(), {"alpha": [0.1, 1.0]}, cv=2).fit([[0.0], [1.0], [2.0], [3.0]], [0, 1, 2, 3])
    >>> with open_tracker("axis", enabled=False).run("grid") as parent:
    ...     log_candidates(parent, search.cv_results_)  # a child for each candidate
    """
    scores = [k.removeprefix("mean_test_") for k in results if k.startswith("mean_test_")]
    for i in range(first, len(results["params"])):
        params = results["params"][i]
        shown = {k: params[k] for k in varied if k in params} or params
        name = ", ".join(
            f"{k.split('__')[-1]}={v:g}" if isinstance(v, float) else f"{k.split('__')[-1]}={v}"
            for k, v in shown.items()
        )
        with parent.child(name[:250], tags=tags) as run:
            run.log_params(results["params"][i])
            for score in scores:
                sign, metric = (-1.0, score[4:]) if score.startswith("neg_") else (1.0, score)
                n_folds = sum(bool(re.fullmatch(rf"split\d+_test_{score}", k)) for k in results)
                run.log_paths({f"fold/{metric}": [sign * results[f"split{n}_test_{score}"][i] for n in range(n_folds)]})
                mean, std = results[f"mean_test_{score}"][i], results[f"std_test_{score}"][i]
                run.log_metrics({metric: sign * mean, f"{metric}_std": std})
            run.log_metrics({"fit_seconds": results["mean_fit_time"][i]})
