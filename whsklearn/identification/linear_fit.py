"""Linear candidates: ARX and output error, with a delay of at least one sample."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from whsklearn.identification.view import one_later, since_start
from whsklearn.models import LinearModel
from whsklearn.recursion.batch.best_linear import (
    IOData,
    Ratio,
    best_linear,
    delayed_rows,
    filter_rows,
    least_squares_arx,
    stabilised,
)
from whsklearn.recursion.batch.simulation_search import SKIP

OFFSETS = 20  # maximum number of fits, each with the constant from the one before
SETTLED = 1e-4  # share of the variance that the next one must remove

if TYPE_CHECKING:
    from whsklearn.identification.view import View


def fit_arx(log: View, order: int) -> LinearModel:
    """Smallest one-step error; poles outside the unit circle are mirrored into it."""
    log = log.as_response
    data = input_output(log)
    level = data.u.mean(axis=1, keepdims=True)  # both with their means removed: least squares with a constant
    ratio = least_squares_arx(data._replace(u=data.u - level), order, order - 1)
    return _model(log, data, Ratio(ratio.b, stabilised(ratio.a)), "prediction")


def fit_output_error(log: View, order: int) -> LinearModel:
    """Smallest free-run error, with the constant of the output fitted."""
    log = log.as_response
    data = input_output(log)
    offset, best, least = float(log.target.mean()), None, np.inf
    for _ in range(OFFSETS):
        ratio = best_linear(data._replace(y=log.target - offset), order, order - 1)
        left = (log.target - ratio.run(data))[data.counts]
        if not np.var(left) < (1.0 - SETTLED) * least:
            break
        best, least, offset = ratio, float(np.var(left)), float(left.mean())
    assert best is not None
    return _model(log, data, best, "simulation")


def input_output(log: View) -> IOData:
    """The input delayed by one sample: with u(t) a linear model in closed loop would invert the controller."""
    bounds = log.bounds
    skip = np.repeat(np.minimum(SKIP, np.diff(bounds) // 10), np.diff(bounds))
    u = one_later(log.u, bounds)[None, :]
    return IOData(u, log.target - log.target.mean(), bounds, since_start(bounds) >= skip)


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
