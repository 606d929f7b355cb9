"""The yardstick that a nonlinear model has to beat: the best linear ARX or output-error model."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from sklearn.base import BaseEstimator, RegressorMixin

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

_EDGE = 0.9999  # poles stay inside this circle


@dataclass
class LinearModel:
    """y(t) = B(q) / F(q) u(t), run freely from rest."""

    b: NDArray[np.float64]
    f: NDArray[np.float64]
    kind: str

    def predict(self, X: ArrayLike) -> NDArray[np.float64]:
        """The free run from the input alone."""
        from scipy.signal import lfilter

        return lfilter(self.b, self.f, np.asarray(X, dtype=float)[:, 0])


class BestLinear(RegressorMixin, BaseEstimator):
    """The ARX or OE model, of orders up to `max_order`, with the least free-run error on the record's last part.

    The orders are chosen on held-out samples, the chosen model is then fitted to the whole record.
    """

    def __init__(self, max_order: int = 4, holdout: float = 0.3):
        self.max_order = max_order
        self.holdout = holdout

    def fit(self, X: ArrayLike, y: ArrayLike) -> BestLinear:
        """Choose kind and orders, then fit."""
        X, y = np.asarray(X, dtype=float), np.asarray(y, dtype=float).ravel()
        cut = int(len(y) * (1 - self.holdout))
        scored = []
        for order in range(1, self.max_order + 1):
            arx = fit_arx(X[:cut], y[:cut], order, order)
            scored += [(_holdout_error(m, X, y, cut), m.kind, order) for m in (arx, fit_oe(X[:cut], y[:cut], arx))]
        _, kind, order = min(scored)
        arx = fit_arx(X, y, order, order)
        self.model_ = arx if kind == "ARX" else fit_oe(X, y, arx)
        self.order_ = order
        return self

    def predict(self, X: ArrayLike) -> NDArray[np.float64]:
        """The free run from the input alone."""
        return self.model_.predict(X)

    def predict_ahead(self, X: ArrayLike, y: ArrayLike, horizon: int = 1) -> NDArray[np.float64]:
        """Prediction `horizon` steps ahead: an ARX model carries the last errors on, an OE model runs freely."""
        from scipy.signal import lfilter

        y, free = np.asarray(y, dtype=float).ravel(), self.predict(X)
        if self.model_.kind == "OE":
            return free
        innovation = lfilter(self.model_.f, [1.0], y - free)
        response = lfilter([1.0], self.model_.f, np.r_[1.0, np.zeros(horizon - 1)])
        return y - lfilter(response, [1.0], innovation)


def fit_arx(X: ArrayLike, y: ArrayLike, n_b: int, n_f: int) -> LinearModel:
    """Least squares of y(t) on y(t-1) ... y(t-n_f) and u(t-1) ... u(t-n_b), made stable."""
    u, y = np.asarray(X, dtype=float)[:, 0], np.asarray(y, dtype=float).ravel()
    start = max(n_b, n_f)
    columns = [-y[start - k : len(y) - k] for k in range(1, n_f + 1)]
    columns += [u[start - k : len(u) - k] for k in range(1, n_b + 1)]
    theta = np.linalg.lstsq(np.column_stack(columns), y[start:], rcond=None)[0]
    return LinearModel(np.r_[0.0, theta[n_f:]], _stable(np.r_[1.0, theta[:n_f]]), "ARX")


def fit_oe(X: ArrayLike, y: ArrayLike, start: LinearModel) -> LinearModel:
    """Least squares of the free run itself, from an ARX model on (Ljung 1999, section 10.2)."""
    from scipy.optimize import least_squares
    from scipy.signal import lfilter

    u, y = np.asarray(X, dtype=float)[:, 0], np.asarray(y, dtype=float).ravel()
    n_b, n_f = start.b.size - 1, start.f.size - 1

    def split(theta: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        return np.r_[0.0, theta[:n_b]], _stable(np.r_[1.0, theta[n_b:]])

    def error(theta: NDArray[np.float64]) -> NDArray[np.float64]:
        return lfilter(*split(theta), u) - y

    def gradient(theta: NDArray[np.float64]) -> NDArray[np.float64]:
        b, f = split(theta)
        by_b, by_f = lfilter([1.0], f, u), -lfilter([1.0], f, lfilter(b, f, u))
        shifted = [_delay(by_b, k) for k in range(1, n_b + 1)] + [_delay(by_f, k) for k in range(1, n_f + 1)]
        return np.column_stack(shifted)

    first = np.r_[start.b[1:], start.f[1:]]
    result = least_squares(error, first, jac=gradient, method="trf", x_scale="jac", max_nfev=60)
    b, f = split(result.x)
    return LinearModel(b, f, "OE")


def _holdout_error(model: LinearModel, X: NDArray[np.float64], y: NDArray[np.float64], cut: int) -> float:
    error = float(np.mean((model.predict(X) - y)[cut:] ** 2))
    return error if np.isfinite(error) else np.inf


def _stable(f: NDArray[np.float64]) -> NDArray[np.float64]:
    """Mirror poles into the unit circle, and pull those on it inside."""
    roots = np.roots(f)
    size = np.abs(roots)
    if not size.size or size.max() < _EDGE:
        return f
    roots = np.where(size > 1, 1 / np.conj(roots), roots)
    size = np.maximum(np.abs(roots), 1e-12)
    return np.real(np.poly(np.where(size > _EDGE, roots / size * _EDGE, roots)))


def _delay(v: NDArray[np.float64], k: int) -> NDArray[np.float64]:
    return np.r_[np.zeros(k), v[: v.size - k]]
