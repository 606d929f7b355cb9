"""From a record to a Wiener-Hammerstein chain: divide the best linear model and refine by successive halving.

Sjoberg and Schoukens 2012, Initializing Wiener-Hammerstein models based on partitioning of the best
linear approximation, Automatica 48; the halving is from Jamieson and Talwalkar 2016.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.stats import chi2

from whsklearn.effects import FrictionLaw
from whsklearn.effects.knots import spline_terms, static_terms
from whsklearn.recursion.batch.best_linear import IOData, Ratio, best_linear
from whsklearn.recursion.batch.block_split import Orders, divisions, padded
from whsklearn.recursion.batch.missing_dynamics import improved
from whsklearn.recursion.batch.simulation_error import Fitted, FittedChain, refine, run, solve_law

if TYPE_CHECKING:
    from numpy.typing import NDArray

# --- choose between several fitted chains on held-out data ----------------------------------------------------------
SIMPLER = 1.03  # a simpler model has at most 3 % more error on held-out data than the best
BATCHES, DEVIATIONS = 60, 2.0  # and its error exceeds the best by at most two standard errors of the difference
CHANCE = 1e-3  # probability that useless parameters gain so much on the data of the fit


def squared_error(chain: FittedChain, data: IOData) -> float:
    """Sum of squared free-run errors over the samples that count."""
    error = (data.y - run(chain, data).y) * data.scale
    total = float(error @ error)
    return total if np.isfinite(total) else np.inf


def simplest(candidates: list[Fitted], later: IOData) -> Fitted:
    """The first chain that cannot be distinguished from the best one on held-out data.

    The best one counts as different if its held-out error is lower by 3 % or by two standard errors.  Any lower error
    is enough if its additional parameters gain more on the data of the fit than chance would (likelihood ratio).

    ``candidates``: fits to the same data, the simplest first. ``later``: the record, in which only the samples that the
    fits have not seen count.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        squares = [((later.y - run(f.chain, later).y) * later.scale)[later.counts] ** 2 for f in candidates]
        # over batches, because the error of a free run is not white
        sums = np.array([[part.sum() for part in np.array_split(s, min(BATCHES, s.size))] for s in squares])
    sums[~np.isfinite(sums)] = np.inf
    k = int(np.argmin(sums.sum(axis=1)))
    best = candidates[k]
    noise = best.cost / max(float(np.count_nonzero(best.error)) - best.n_parameters, 1.0)
    for fitted, of in zip(candidates[:k], sums, strict=False):
        if not np.isfinite(of).all():
            continue
        worse, further = of - sums[k], best.n_parameters - fitted.n_parameters
        told = worse.sum() > min(DEVIATIONS * np.sqrt(len(worse)) * np.std(worse), (SIMPLER**2 - 1.0) * sums[k].sum())
        if further > 0:
            told |= (fitted.cost - best.cost) / noise > chi2.isf(CHANCE, further)
        if not told:
            return fitted
    return best


SKIP = 300  # samples at the start of an experiment that do not count; a tenth of the experiment if that is less
LINEAR, SHORT, LONG = 10_000, 5_000, 10_000  # samples for the linear model, the rungs of the halving, and its last rung
KEPT = 8  # divisions of each order that are refined
RUNGS = ((6, SHORT, 12), (14, SHORT, 3), (40, LONG, 1))  # iterations, samples, and how many candidates continue
FINE_KNOTS, FINE_FROM = 20, 3_000  # number of knots of a finer law, and the number of samples from which it is used
HOLDOUT = 0.25


class SearchedOrders(NamedTuple):
    """Orders of the linear model, and the least (or, if ``exact``, the only) orders of the blocks.

    ``linear`` holds pairs (poles, zeros).  If ``exact``, they are tried in turn until two have a division that fits,
    because a conjugate pair cannot be divided between two blocks of order one.
    """

    linear: tuple[tuple[int, int], ...]
    blocks: Orders
    exact: bool = False


def square(n: int) -> Orders:
    """n zeros and n poles in both blocks."""
    return Orders(n, n, n, n)


# Padding to 3 poles lets a 2 + 3 division of a linear model of the wrong order still reach 3 + 3.  All 8 segments of
# the benchmark converge with it, 5 without it.  Systems of lower order do not need the surplus, so those are tried too.
UNKNOWN = tuple(
    SearchedOrders(tuple((n, n) for n in orders), square(least))
    for orders, least in (((2,), 1), ((3, 4), 2), ((4, 5, 6, 7), 3))
)


def record(
    u: NDArray[np.float64], y: NDArray[np.float64], restart: NDArray[np.bool_],
    weights: NDArray[np.float64] | None = None,
) -> IOData:  # fmt: skip
    """A record for the fit, from u (n, m) and y (n,): starts of experiments, and which samples count and how much."""
    bounds = np.append(np.flatnonzero(restart), y.size).astype(np.int64)
    counts = np.ones(y.size, dtype=bool)
    for start, length in zip(bounds[:-1], np.diff(bounds), strict=True):
        counts[start : start + min(SKIP, length // 10)] = False
    if weights is not None:
        counts &= weights > 0.0
    root = None if weights is None else np.sqrt(weights)
    return IOData(np.ascontiguousarray(u.T), np.ascontiguousarray(y), bounds, counts, root)


def search(data: IOData, law: FrictionLaw, structures: tuple[SearchedOrders, ...] = UNKNOWN) -> Fitted:
    """The chain with the least free-run error; held-out data decide between structures.

    ``data``: the record.
    ``law``: a law in x; its knots are placed again.
    ``structures``: simplest first. If there are several, the blocks may grow beyond them, and a polynomial replaces the
        law if held-out data cannot distinguish the two.
    """
    if len(structures) == 1:
        return finish(halving(data, law, structures[0]).chain, data)
    early = data.head(int((1 - HOLDOUT) * data.y.size))
    later = data._replace(counts=data.counts & (np.arange(data.y.size) >= early.y.size))
    found = [halving(early, law, s) for s in structures]
    best, short = min(found, key=lambda f: squared_error(f.chain, later)), early.head(LONG)
    chosen = simplest([*found, improved(best, short)], later)
    plain = FrictionLaw(static_terms("polynomial") or ())
    chosen = simplest([refine(chosen.chain._replace(law=plain, weights=plain.weights), short, 30), chosen], later)
    return finish(chosen.chain, data)


def halving(data: IOData, law: FrictionLaw, structure: SearchedOrders) -> Fitted:
    """The best of many divisions, by longer and longer refinements of fewer and fewer, the last on `LONG` samples."""
    pool = starts(data, law, structure)
    for iterations, samples, kept in RUNGS:
        pool = best_in_turn([refine(f.chain, data.head(samples), iterations) for f in pool], kept)
    return min(pool, key=lambda f: f.cost)


def best_in_turn(pool: list[Fitted], kept: int) -> list[Fitted]:
    """The best of each way to divide the poles, then the second best of each, and so on.

    After a few iterations, divisions with more poles in one block are ahead but rarely end best.  On one of 8 segments
    of the benchmark none of the first 8 by cost ends at the noise floor, although 12 of all 30 do.
    """
    ways: dict[tuple[int, int], list[Fitted]] = {}
    for f in sorted(pool, key=lambda f: f.cost):
        ways.setdefault((f.chain.a1.size, f.chain.a2.size), []).append(f)
    ranked = [(rank, f.cost, f) for way in ways.values() for rank, f in enumerate(way)]
    return [f for _, _, f in sorted(ranked, key=lambda r: r[:2])[:kept]]


def starts(data: IOData, law: FrictionLaw, structure: SearchedOrders) -> list[Fitted]:
    """The best divisions of the best linear model of each order, each with its best weights of the law."""
    short, out = data.head(SHORT), []
    centred = data.head(LINEAR)
    centred = centred._replace(y=centred.y - centred.y[centred.counts].mean())
    tried = 0
    for poles, zeros in structure.linear:
        ratio = best_linear(centred, poles, zeros)
        ways = divisions(ratio, structure.blocks if structure.exact else square(poles))
        found = []
        for first, second in ways:
            first, second = _at_least(first, second, structure)
            chain = FittedChain(first.b[None, :], first.a, second.b, second.a, law, law.weights)
            found.append(refine(chain, short, 0))
        out += sorted(found, key=lambda f: f.cost)[:KEPT]
        tried += bool(found)
        if structure.exact and tried == 2:
            break
    return out


def finish(chain: FittedChain, data: IOData) -> Fitted:
    """Refine on all samples, with a finer law if there are many."""
    fitted = refine(chain, data.head(2 * LONG), 20)
    if data.y.size >= FINE_FROM and chain.law.labels[2:3] == ("natural_spline1",):
        finer = FrictionLaw(spline_terms(np.linspace(-1.0, 1.0, FINE_KNOTS)))
        better = refine(fitted.chain._replace(law=finer, weights=finer.weights), data.head(2 * LONG), 30)
        fitted = better if better.cost < fitted.cost else fitted
    if data.y.size > 2 * LONG:
        fitted = refine(fitted.chain, data, 30)
    return solve_law(fitted.chain, data)


def _at_least(first: Ratio, second: Ratio, structure: SearchedOrders) -> tuple[Ratio, Ratio]:
    """Both blocks padded to the orders that the structure requires."""
    o = structure.blocks
    if structure.exact:
        return padded(first, o.zeros_1, o.poles_1), padded(second, o.zeros_2, o.poles_2)
    n, m = max(o.poles_1, first.a.size - 1), max(o.poles_2, second.a.size - 1)
    return padded(first, n, n), padded(second, m, m)
