"""The reference that a nonlinear model has to beat: the best linear ARX or output-error model."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from sklearn.base import BaseEstimator, RegressorMixin

from whsklearn.cli.comparison import Outcome
from whsklearn.cli.job import wrapped
from whsklearn.recursion.batch.best_linear import IOData, Ratio, least_squares_arx, output_error, stabilised

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray


class BestLinear(RegressorMixin, BaseEstimator):
    """The ARX or OE model, of orders up to `max_order`, with the smallest free-run error on the last part of the
    record.

    The orders are chosen on held-out samples, the chosen model is then fitted to the whole record.
    """

    def __init__(self, max_order: int = 4, holdout: float = 0.3):
        self.max_order = max_order
        self.holdout = holdout

    def fit(self, X: ArrayLike, y: ArrayLike) -> BestLinear:
        """Choose kind and orders, then fit."""
        data = record(X, y)
        cut = int(data.y.size * (1 - self.holdout))
        scored = []
        for order in range(1, self.max_order + 1):
            for kind in ("ARX", "OE"):
                error = float(np.mean((fit_linear(data.head(cut), kind, order).run(data) - data.y)[cut:] ** 2))
                scored.append((error if np.isfinite(error) else np.inf, kind, order))
        _, self.kind_, order = min(scored)
        self.model_ = fit_linear(data, self.kind_, order)
        return self

    def predict(self, X: ArrayLike) -> NDArray[np.float64]:
        """The free run from the input alone."""
        return self.model_.run(record(X, np.zeros(len(np.asarray(X)))))

    def predict_ahead(self, X: ArrayLike, y: ArrayLike, horizon: int = 1) -> NDArray[np.float64]:
        """Prediction `horizon` steps ahead: an ARX model propagates the last errors, an OE model runs freely."""
        from scipy.signal import lfilter

        y, free = np.asarray(y, dtype=float).ravel(), self.predict(X)
        if self.kind_ == "OE":
            return free
        innovation = lfilter(self.model_.a, [1.0], y - free)
        response = lfilter([1.0], self.model_.a, np.r_[1.0, np.zeros(horizon - 1)])
        return y - lfilter(response, [1.0], innovation)


def record(X: ArrayLike, y: ArrayLike) -> IOData:
    """The first column of X, a sample late, and y."""
    u, y = np.asarray(X, dtype=float)[:, 0], np.asarray(y, dtype=float).ravel()
    late = np.concatenate([[0.0], u[:-1]])[None, :]
    return IOData(late, y, np.array([0, u.size]), np.ones(u.size, dtype=bool))


def fit_linear(data: IOData, kind: str, order: int) -> Ratio:
    """An ARX model made stable, or the output-error model (OE) that a descent from it finds."""
    known = data._replace(counts=np.arange(data.y.size) >= order)  # before, there is no past to regress on
    arx = least_squares_arx(known, order, order - 1)
    arx = Ratio(arx.b, stabilised(arx.a))
    return arx if kind == "ARX" else output_error(data, arx, iterations=60)


def verdict(outcomes: Sequence[Outcome]) -> str:
    """A sentence on whether the nonlinear model is better than a linear one on this record."""
    linear = next((o for o in outcomes if o.candidate.reading == "linear" and not o.failure), None)
    others = [o for o in outcomes if o.candidate.reading != "linear" and not o.failure]
    if linear is None or not others:
        return "Too little could be fitted to compare with a linear model."
    best = min(others, key=lambda o: o.indices["nmse"])
    ratio = best.indices["nmse"] / linear.indices["nmse"]
    name = f"{best.candidate.name} ({best.candidate.reading})"
    if ratio < 1:
        return f"{name} leaves {ratio:.2g} of the best linear model's mean squared error in free run."
    return wrapped(
        f"Warning: in free run {name} has {ratio:.2g} times the mean squared error of the best linear model. These "
        "estimators minimise the one-step error, with these orders and this law; whether the record is that of a "
        "Wiener-Hammerstein system, of a linear one or of an axis, `whsklearn identify` tells."
    )
