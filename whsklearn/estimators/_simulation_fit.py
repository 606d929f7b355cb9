"""Conversion between the chain of a simulation-error fit and the natural parameters of a `WienerHammersteinLags`."""

from __future__ import annotations

from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from whsklearn.effects import FrictionLaw, Hinge, NaturalSpline, Power, StaticEffect, as_law
from whsklearn.effects.base import Array, Bools, Integers
from whsklearn.estimators import _model as wh
from whsklearn.lags.wiener_hammerstein import WienerHammersteinLags
from whsklearn.recursion.batch import simulation_search as ss
from whsklearn.recursion.batch.best_linear import IOData, sandwich
from whsklearn.recursion.batch.simulation_error import Fitted, FittedChain, refine, sensitivities


def scale_free(law: FrictionLaw) -> bool:
    """Whether the law of any multiple of x is of the same kind, so that the scale of x is arbitrary."""
    return all(isinstance(t, (Power, Hinge, NaturalSpline)) for t in law.terms)


def law_of(lags: WienerHammersteinLags | None) -> FrictionLaw:
    """The static block that is fitted."""
    return as_law("cubic_spline" if lags is None else lags.law)


@threadpool_limits.wrap(limits=1, user_api="blas")  # two threads take twice the CPU and sum in another order
def from_record(
    lags: WienerHammersteinLags | None,
    u: Array,
    y: Array,
    restart: Bools,
    starts: list[Array],
    weights: Array | None = None,
) -> tuple[dict[str, Any], float]:
    """The state of a fit to a record, and its (weighted) sum of squares.

    ``lags``: orders and law; None searches for orders, with a cubic spline or a polynomial.
    ``u``, ``y``, ``restart`` (n, m), (n,), (n,): the record.
    ``starts``: natural vectors to start from; without any, the best linear model is divided into blocks.
    ``weights`` (n,): weights of the squared errors.
    """
    law = law_of(lags)
    delays = (0, 0) if lags is None else tuple(int(d) for d in lags.delays)
    data = ss.record(u, y, restart, weights, sum(delays))
    if starts and lags is not None:
        dims, free = lags.dims(u.shape[1]), scale_free(law)

        def moves(fitted: Fitted, _: IOData) -> list[FittedChain]:
            natural = natural_of(monic(fitted.chain) if free else fitted.chain)[0]
            return [to_chain(t, dims, u.shape[1], law) for t in ss.neighbours(natural, dims)]

        begun = ss.halving([to_chain(t, dims, u.shape[1], law) for t in starts], data, free=free)
        fitted = ss.improved(refine(begun.chain, data, ss.REFINED, free=free), data, moves, free=free)
    else:
        fitted = ss.search(data, law, ss.UNKNOWN if lags is None else ss.of_orders(lags.dims()))
    return described(fitted, data, delays, normed=scale_free(law))


def described(fitted: Fitted, data: IOData, delays: tuple[int, ...], *, normed: bool) -> tuple[dict[str, Any], float]:
    """A fitted chain as a state, in natural parameters, a[0] = c[0] = 1, with its sum of squares."""
    chain = monic(fitted.chain) if normed else fitted.chain
    orders = {"n_a": chain.b1.shape[1], "n_b": chain.a1.size - 1, "n_c": chain.b2.size, "n_d": chain.a2.size - 1}
    natural, at = natural_of(chain)
    count = int(data.counts.sum())
    covariance = sandwich(sensitivities(chain, data)[1][at] * data.scale, fitted.error)
    covariance *= count / max(count - natural.size, 1)
    lags = {**orders, "law": chain.law.reweighted(chain.weights), "delays": tuple(delays)}
    noise = fitted.cost / max(count - natural.size, 1)
    return {"theta": natural, "covariance": covariance, "lags": lags, "noise": noise}, fitted.cost


def natural_of(chain: FittedChain) -> tuple[Array, Integers]:
    """The natural vector of a monic chain, and the position of each of its sensitivities."""
    m, na = chain.b1.shape
    nb, nc, nd = chain.a1.size - 1, chain.b2.size, chain.a2.size - 1
    cuts = np.cumsum([m * na, nb, nc, nd, chain.weights.size])
    b1, a1, b2, a2, w = np.split(np.arange(cuts[-1]), cuts[:-1])
    at = np.concatenate([b1.reshape(m, na).T.ravel()[1:], a1, w, b2[1:], a2])
    return np.concatenate([chain.linear_part, chain.weights])[at], at


def to_chain(natural: Array, dims: Integers, n_inputs: int, law: FrictionLaw) -> FittedChain:
    """The chain of a natural vector; poles outside the unit circle are moved inside."""
    na, nb, nc, _, nw = (int(i) for i in dims)
    a, b, w, c, d = np.split(natural, np.cumsum([na - 1, nb, nw, nc - 1]))
    one = np.ones(1)
    b1 = np.ascontiguousarray(np.concatenate([one, a]).reshape(-1, n_inputs).T)
    a1, a2 = (np.concatenate([one, wh.inside(v)]) for v in (b, d))
    return FittedChain(b1, a1, np.concatenate([one, c]), a2, law, w.copy())


def monic(chain: FittedChain) -> FittedChain:
    """The same chain with b1[0] = b2[0] = 1: x is in the paper's unit, and all gain is in the law."""
    first, second = _away_from_zero(chain.b1), _away_from_zero(chain.b2)
    law, weights = rescaled(chain.law, chain.weights, first)
    b1, b2 = chain.b1 / first, chain.b2 / second
    b1[0, 0] = b2[0] = 1.0
    return chain._replace(b1=b1, b2=b2, law=law, weights=weights * second)


def rescaled(law: FrictionLaw, weights: Array, factor: float) -> tuple[FrictionLaw, Array]:
    """Terms and weights of law(factor x), for a factor of either sign."""
    terms: list[StaticEffect] = []
    splines = [t for t in law.terms if isinstance(t, NaturalSpline)]
    knots = np.array([t.knot for t in splines] + ([splines[0].last_but_one, splines[0].last] if splines else []))
    knots = np.sort(knots / factor)
    k = 0
    for t in law.terms:
        if isinstance(t, NaturalSpline):
            terms.append(NaturalSpline(1.0, float(knots[k]), float(knots[-2]), float(knots[-1])))
            k += 1
        else:
            terms.append(Hinge(1.0, t.knot / factor) if isinstance(t, Hinge) else t)
    new = FrictionLaw(terms)
    kinks = np.concatenate([knots, [t.knot for t in new.terms if isinstance(t, Hinge)], [0.0]])
    wide = np.ptp(kinks) or 2.0 / abs(factor)
    grid = np.linspace(kinks.min() - 0.2 * wide, kinks.max() + 0.2 * wide, 16 * len(law) + 1)
    columns = new.regressors(grid, 0.0)
    size = np.maximum(np.abs(columns).max(axis=0), 1e-300)
    values = law.regressors(factor * grid, 0.0) @ weights
    return new, np.linalg.lstsq(columns / size, values, rcond=None)[0] / size


def _away_from_zero(numerator: Array) -> float:
    """The leading coefficient; one that vanishes is replaced by the smallest one that keeps the division finite."""
    first, least = float(numerator.flat[0]), 1e-9 * float(np.abs(numerator).max())
    return first if abs(first) > least else (np.copysign(least, first) or 1.0)
