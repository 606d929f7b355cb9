"""Linear candidates: ARX and output error, with a delay of at least one sample; of output error it is found."""

from __future__ import annotations

import functools
import itertools
from dataclasses import replace

import numpy as np

from whsklearn.identification.drive_lead import EXPLAINED
from whsklearn.identification.view import View, one_later, since_start
from whsklearn.models import LinearModel
from whsklearn.recursion.batch.best_linear import (
    IOData,
    Ratio,
    best_linear,
    delayed_rows,
    filter_rows,
    least_squares_arx,
    sandwich,
    stabilised,
    steiglitz_mcbride,
)
from whsklearn.recursion.batch.simulation_search import SKIP

ENOUGH = 20_000  # samples in which a dead time is sought; of the 300,000 of a long log the search would take minutes


def fit_arx(log: View, order: int) -> LinearModel:
    """Smallest one-step error; poles outside the unit circle are mirrored into it."""
    log = log.as_response
    data = input_output(log)
    ratio = least_squares_arx(data, order, order - 1)
    return _model(log, data, Ratio(ratio.b, stabilised(ratio.a)), "prediction")


def fit_output_error(log: View, order: int) -> LinearModel:
    """Smallest free-run error, with the constant of the output fitted; with a dead time if that removes half of it."""
    log = log.as_response
    plain = _output_error(log, order)
    dead = dead_time(log, order)
    later = _output_error(_later(log, dead), order) if dead else plain
    share = _cost(later, _later(log, dead)) / max(_cost(plain, log), 1e-300)
    return later.delayed(dead) if dead and share < EXPLAINED else plain


def dead_time(log: View, order: int) -> int:
    """Samples by which the output follows the input later than a pole can tell: a transport, a dead time.

    Of the delays 0, 1, 2, 3, 5, 8, ... the one with the smallest free-run error after Steiglitz-McBride, then by halved
    steps about it.
    """
    log = log.part(0, min(log.u.size, ENOUGH))

    @functools.cache
    def left(delay: int) -> float:
        data = input_output(_later(log, delay))
        arx = least_squares_arx(data, order, order - 1)
        with np.errstate(all="ignore"):
            ratio = steiglitz_mcbride(data, Ratio(arx.b, stabilised(arx.a)))
            error = (data.y - Ratio(ratio.b, stabilised(ratio.a)).run(data))[data.counts]
        return float(np.var(error)) if np.isfinite(error).all() else np.inf

    most = int(np.diff(log.bounds).max()) // 20
    tried = [0, 1]
    while tried[-1] + tried[-2] <= most:
        tried.append(tried[-1] + tried[-2])
    best = min(tried, key=left)
    step = max(best // 4, 1)
    while step:
        near = min((d for d in (best - step, best + step) if 0 <= d <= most), key=left, default=best)
        if left(near) < left(best):
            best = near
        else:
            step //= 2
    return best


def _later(log: View, samples: int) -> View:
    """The record with its input later by a number of samples; zero before, as the model is at rest there."""
    parts = [log.u[a:b] for a, b in itertools.pairwise(log.bounds.tolist())]
    return replace(log, u=np.concatenate([np.r_[np.zeros(min(samples, p.size)), p][: p.size] for p in parts]))


def _cost(model: LinearModel, log: View) -> float:
    """Variance of the free run's error."""
    data = input_output(log)
    ratio = Ratio(np.array(model.numerator[1:]), np.array(model.denominator))
    return float(np.var((log.target - ratio.run(data))[data.counts]))


def _output_error(log: View, order: int) -> LinearModel:
    """`fit_output_error` with a delay of one sample."""
    data = input_output(log)
    return _model(log, data, best_linear(data, order, order - 1), "simulation")


def input_output(log: View) -> IOData:
    """The input delayed by one sample, as with u(t) a linear model in closed loop would invert the controller, and an
    output with a constant of its own.
    """
    bounds = log.bounds
    skip = np.repeat(np.minimum(SKIP, np.diff(bounds) // 10), np.diff(bounds))
    u = one_later(log.u, bounds)[None, :]
    return IOData(u, log.target - log.target.mean(), bounds, since_start(bounds) >= skip, level=True)


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
    errors = np.sqrt(np.maximum(np.diag(sandwich(rows, error)), 0.0))
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
