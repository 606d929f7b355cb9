"""Chains: the Wiener-Hammerstein candidate, and the linear system behind a sensor that loses the sign."""

from __future__ import annotations

import itertools
import warnings
from typing import Any

import numpy as np

from whsklearn.effects import FrictionLaw, Hinge, Power, as_law
from whsklearn.effects.base import Array
from whsklearn.estimators import PEMRegressor
from whsklearn.identification.linear_fit import input_output
from whsklearn.identification.view import View
from whsklearn.models import ChainModel
from whsklearn.recursion.batch.best_linear import Ratio, best_linear
from whsklearn.recursion.batch.simulation_error import FittedChain, refine
from whsklearn.recursion.batch.simulation_search import REFINED


def fit_chain(log: View) -> ChainModel:
    """Orders and law as the fit finds them."""
    log = log.as_response
    groups = np.repeat(np.arange(log.bounds.size - 1), np.diff(log.bounds)) if log.starts else None
    with warnings.catch_warnings():  # of a weak fit, which the comparison judges
        warnings.simplefilter("ignore", UserWarning)
        model = PEMRegressor(criterion="simulation").fit(log.u[:, None], log.target, groups=groups)
    return chain_model(model, dt=log.dt, logged=log.logged)


def chain_model(model: Any, **shared: Any) -> ChainModel:
    """A fitted Wiener-Hammerstein estimator of one input as a `ChainModel`."""
    p, e, lags = model.parameters_, model.parameter_standard_errors_, model.structure_
    first, second = (np.zeros(d) for d in lags.delays)
    law = as_law(lags.law)
    law = law.reweighted([p[label] for label in law.labels])
    errors = {label: e[label] for label in law.labels}
    for block, delay, up, down in (("1", first.size, "a", "b"), ("2", second.size, "c", "d")):
        errors |= {f"b{block}_{i + delay}": s for i, s in enumerate(e[up]) if s > 0}
        errors |= {f"f{block}_{i + 1}": s for i, s in enumerate(e[down])}
    return ChainModel(
        (*first, *p["a"]),
        (1.0, *p["b"]),
        law,
        (*second, *p["c"]),
        (1.0, *p["d"]),
        standard_errors={k: float(v) for k, v in errors.items()},
        **shared,
    )


# --- a linear system behind a sensor that loses the sign: y = |x| ---------------------------------------------------
# The initial signs are those of a lag and a resonance in series: time constants in samples (none: no lag), radians per
# sample, damping ratios. A wrong resonance has wrong signs half of the time, so its grid is finer than half its width.
LAGS = (0.0, 2.0, 5.0, 12.0, 30.0)
RESONANCES = tuple(np.geomspace(0.05, 1.5, 24).tolist())
DAMPINGS = (0.1, 0.3, 0.8)
STARTS = 6  # number of starts, those whose absolute value correlates best with the output
ITERATIONS = 15  # alternations of signs and parameters; they settle within five if they settle at all
BELOW = 0.1  # of its deviation: a speed logged without its sign is below zero only by noise


def loses_sign(log: View) -> bool:
    """Whether the output may be an absolute value: it does not go below zero, but the input does."""
    y = log.target
    return bool(y.min() > -BELOW * np.std(y) and log.u.min() < 0.0 < log.u.max() and log.logged == "output")


def fit_rectified(log: View, order: int) -> ChainModel:
    """Output error of |x| by iteration: x is fitted to y with the signs of the previous x.

    If no sign changes, the sum of squares of |x| - y equals that of x - sign(x) y, so a fit that keeps its signs is a
    minimum of it (phase retrieval by alternating projections, Fienup 1982).

    Raises ValueError if the output goes below zero.
    """
    best = _best_signs(log, order)
    law = FrictionLaw([Power(-1.0, 1.0), Hinge(2.0, 0.0)])  # |x| = 2 max(x, 0) - x
    return ChainModel((0.0, *best.b), tuple(best.a), law, (1.0,), (1.0,), dt=log.dt, logged=log.logged)


def fit_folded(log: View, order: int) -> ChainModel:
    """The same by the free run, for a sensor with two gains (one per direction), an offset and a lag, and an x with a
    mean.

    A pulse counter averages, and at a low voltage at which the drive does not move, x has the sign of its offset.

    Raises ValueError: as `fit_rectified`.
    """
    best, data = _best_signs(log, order), input_output(log)
    data = data._replace(y=log.target, u=np.vstack([data.u, np.ones(log.u.size)]))
    law = FrictionLaw([Power(0.01, 0.0), Power(-1.0, 1.0), Hinge(2.0, 0.0)])
    lag = np.array([1.0, 0.0])
    b1 = np.vstack([best.b, np.zeros(best.b.size)])
    chain = refine(FittedChain(b1, best.a, lag, lag, law, law.weights), data, REFINED, free=False).chain
    mean = float(np.sum(chain.b1[1]) / np.sum(chain.a1))
    level, slope, other = chain.weights.tolist()
    folded = FrictionLaw([Power(level + slope * mean, 0.0), Power(slope, 1.0), Hinge(other, -mean)])
    return ChainModel(
        (0.0, *chain.b1[0]), tuple(chain.a1), folded, tuple(chain.b2), tuple(chain.a2), dt=log.dt, logged=log.logged
    )


def _best_signs(log: View, order: int) -> Ratio:
    """x as the ratio with the smallest residual in the output."""
    if not loses_sign(log):
        raise ValueError("The output goes below zero, or the input does not: no sign is lost.")
    return min((_from_signs(log, order, signs) for signs in _starts(log)), key=lambda found: found[1])[0]


def _from_signs(log: View, order: int, signs: Array) -> tuple[Ratio, float]:
    """The best model of the iteration, and the mean square residual of |x|."""
    best, least = None, np.inf
    data = input_output(log)
    for _ in range(ITERATIONS):
        signs = np.where(signs < 0.0, -1.0, 1.0)
        ratio = best_linear(data._replace(y=signs * log.target, level=False), order, order - 1)
        x = ratio.run(data)
        left = float(np.mean((np.abs(x) - log.target)[data.counts] ** 2))
        if left < least:
            best, least = ratio, left
        if np.array_equal(x < 0.0, signs < 0.0):
            break
        signs = x
    assert best is not None
    return best, least


def _starts(log: View) -> list[Array]:
    """Signs (n,) of the lags and resonances whose absolute value is most like the output."""
    from scipy.signal import lfilter

    found = []
    y = log.target - log.target.mean()
    for lag, w, zeta in itertools.product(LAGS, RESONANCES, DAMPINGS):
        radius = np.exp(-zeta * w)
        poles = [1.0, -2.0 * radius * np.cos(w * np.sqrt(1.0 - zeta**2)), radius**2]
        a = np.convolve(poles, [1.0, -np.exp(-1.0 / lag)]) if lag else poles
        x = np.concatenate([lfilter([0.0, 1.0], a, log.u[i:j]) for i, j in itertools.pairwise(log.bounds)])
        size = np.abs(x) - np.abs(x).mean()
        found.append((float(size @ y) / max(float(np.linalg.norm(size)), 1e-300), np.sign(x)))
    found.sort(key=lambda pair: -pair[0])
    return [signs for _, signs in found[:STARTS]]
