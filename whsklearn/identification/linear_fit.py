"""Linear candidates: ARX and output error, with a delay of one sample at least."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from whsklearn.models import LinearModel
from whsklearn.recursion.best_linear import IOData, Ratio, best_linear, least_squares_arx, stabilised
from whsklearn.recursion.linear_filter import delayed_rows, filter_rows
from whsklearn.recursion.simulation_search import SKIP

if TYPE_CHECKING:
    from whsklearn.identification.view import View


def fit_arx(log: View, order: int) -> LinearModel:
    """Least error one step ahead; poles beyond the unit circle mirrored into it."""
    data = _data(log)
    ratio = least_squares_arx(data, order, order - 1)
    return _model(log, data, Ratio(ratio.b, stabilised(ratio.a)), "prediction")


def fit_output_error(log: View, order: int) -> LinearModel:
    """Least error in free run."""
    data = _data(log)
    return _model(log, data, best_linear(data, order, order - 1), "simulation")


def _data(log: View) -> IOData:
    """Input a sample late: with u(t) itself a linear model of a closed loop would invert the controller."""
    n = log.target.size
    u = np.append(0.0, log.u[:-1])[None, :]
    return IOData(u, log.target - log.target.mean(), np.array([0, n]), np.arange(n) >= min(SKIP, n // 10))


def _model(log: View, data: IOData, ratio: Ratio, criterion: str) -> LinearModel:
    free = ratio.run(data)
    offset = float(np.mean((log.target - free)[data.counts]))
    error = (log.target - free - offset) * data.counts
    inner = filter_rows(np.ones(1), ratio.a, np.vstack([data.u[:1], free]), data.bounds)
    known = -delayed_rows(free if criterion == "simulation" else data.y, ratio.a.size, data.bounds)[1:]
    by_a = filter_rows(np.ones(1), ratio.a, known, data.bounds) if criterion == "simulation" else known
    by_b = delayed_rows(inner[0] if criterion == "simulation" else data.u[0], ratio.b.size, data.bounds)
    rows = np.vstack([by_b, by_a, np.ones(free.size)]) * data.counts
    if criterion == "prediction":
        error = filter_rows(ratio.a, np.ones(1), error[None, :], data.bounds)[0] * data.counts
    scale = np.maximum(np.linalg.norm(rows, axis=1), 1e-150)
    inverse = np.linalg.pinv((rows @ rows.T) / np.outer(scale, scale), rcond=1e-13, hermitian=True)
    edges = np.linspace(0, error.size, 61).astype(int)[:-1]
    scores = np.add.reduceat(rows / scale[:, None] * error, edges, axis=1)  # the error is not white
    errors = np.sqrt(np.maximum(np.diag(inverse @ (scores @ scores.T) @ inverse), 0.0)) / scale
    n_b, n_a = ratio.b.size, ratio.a.size - 1
    names = [*(f"b{i + 1}" for i in range(n_b)), *(f"f{i + 1}" for i in range(n_a)), "offset"]
    return LinearModel(
        (0.0, *ratio.b.tolist()),
        tuple(ratio.a.tolist()),
        offset,
        criterion,
        dt=log.dt,
        logged=log.logged,
        standard_errors=dict(zip(names, errors.tolist(), strict=True)),
    )
