"""From a record to a Wiener-Hammerstein chain: divide the best linear model and refine by successive halving.

Sjoberg and Schoukens 2012, Initializing Wiener-Hammerstein models based on partitioning of the best
linear approximation, Automatica 48; the halving is from Jamieson and Talwalkar 2016.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import orth
from scipy.stats import chi2

from whsklearn.effects import FrictionLaw
from whsklearn.effects.base import Array, Bools, Integers
from whsklearn.effects.law import spline_terms, static_terms
from whsklearn.recursion.batch.best_linear import BATCHES, IOData, Ratio, best_linear, delayed_rows, filter_rows
from whsklearn.recursion.batch.simulation_error import Fitted, FittedChain, refine, run, sensitivities, solve_law
from whsklearn.recursion.memory.starts import exchanged

Roots = list[NDArray[np.complex128]]  # groups that stay together

# A linear model of the whole chain does not show which of its poles and zeros are before the law and which are
# behind it (Schoukens, Tiels 2017, Automatica 85, sec. 5).  A search that has put one on the wrong side finds no
# downhill path to the other.
MOST = 512  # divisions tried at most; order 8 with real roots only would have 65,536


class Orders(NamedTuple):
    """Largest numbers of zeros and poles of each block."""

    zeros_1: int
    poles_1: int
    zeros_2: int
    poles_2: int


def divisions(ratio: Ratio, orders: Orders) -> Iterator[tuple[Ratio, Ratio]]:
    """All pairs of blocks whose product has the zeros and poles of the ratio; conjugate pairs stay together.

    Where the orders leave no room for a pair, its roots are real and nearly equal, and noise made a pair of them: one
    zero in each block.  Each of the two is then their real part.  A block with more zeros than poles is skipped, except
    for one zero without a pole.
    """
    zeros, poles = _groups(np.roots(ratio.b)), _groups(np.roots(ratio.a))
    for some_zeros, some_poles in ((zeros, poles), (_apart(zeros), poles), (_apart(zeros), _apart(poles))):
        found = list(itertools.islice(_divided(some_zeros, some_poles, orders), MOST))
        if found:
            yield from found
            return


def _divided(zeros: Roots, poles: Roots, orders: Orders) -> Iterator[tuple[Ratio, Ratio]]:
    """The divisions of these groups of roots."""
    for p in itertools.product((False, True), repeat=len(poles)):
        first, second = _chosen(poles, p, True), _chosen(poles, p, False)
        if first.size > orders.poles_1 or second.size > orders.poles_2:
            continue
        for z in itertools.product((False, True), repeat=len(zeros)):
            up, down = _chosen(zeros, z, True), _chosen(zeros, z, False)
            if up.size <= min(orders.zeros_1, max(first.size, 1)) and down.size <= min(
                orders.zeros_2, max(second.size, 1)
            ):
                yield Ratio(_polynomial(up), _polynomial(first)), Ratio(_polynomial(down), _polynomial(second))


def _apart(groups: Roots) -> Roots:
    """The groups with the two roots of every pair at their real part."""
    return [np.array([r.real + 0j]) for group in groups for r in group]


def padded(block: Ratio, n_zeros: int, n_poles: int) -> Ratio:
    """The block padded with zero coefficients up to these orders; a fit is free to move the new roots at z = 0."""
    b = np.append(block.b, np.zeros(max(n_zeros + 1 - block.b.size, 0)))
    return Ratio(b, np.append(block.a, np.zeros(max(n_poles + 1 - block.a.size, 0))))


def reflections(b: Array) -> list[Array]:
    """The numerators in which one zero, or one conjugate pair, is reflected at the unit circle.

    The gain stays the same at every frequency and only the phase changes.  A zero and its image are often two minima
    of a fit.
    """
    lead = int(np.flatnonzero(b)[0]) if np.any(b) else b.size
    groups = _groups(np.roots(b))
    found = []
    for i, group in enumerate(groups):
        others = [g for k, g in enumerate(groups) if k != i]
        image = _polynomial(np.concatenate([*others, 1.0 / np.conj(group)]))
        gain = b[lead] * float(np.prod(np.abs(group)))
        found.append(np.concatenate([np.zeros(lead), gain * image, np.zeros(b.size - lead - image.size)]))
    return found


# Numerators of an integrator of order 2 to 5 behind a hold, by their number of zeros; other blocks without zeros of
# their own have nearly the same (Astrom, Hagander and Sternby 1984, Zeros of sampled systems, Automatica 20(1)).
SAMPLING = {1: (1.0, 1.0), 2: (1.0, 4.0, 1.0), 3: (1.0, 11.0, 11.0, 1.0), 4: (1.0, 26.0, 66.0, 26.0, 1.0)}


def neighbours(theta: Array, dims: Integers) -> list[Array]:
    """Natural vectors with a root of one block exchanged for one of the other, with zeros reflected at the unit circle,
    and with those zeros that sampling gives to lags behind a hold; the weights are unchanged.
    """
    na, nb, nc, nd, nw = (int(n) for n in dims)
    thetas, c = exchanged(theta, (na, nb, nc, nd, nw)), na - 1 + nb + nw
    for part in (slice(0, na - 1), slice(c, c + nc - 1)):
        images = reflections(np.concatenate([[1.0], theta[part]]))
        for image in (*images, np.array(SAMPLING.get(part.stop - part.start, ()))):
            if image.size and image[0] != 0.0:  # else a zero at infinity: a delay
                moved = theta.copy()
                moved[part] = image[1:] / image[0]
                thetas.append(moved)
    return thetas


def _groups(roots: NDArray[Any]) -> Roots:
    """Real roots alone, conjugate pairs together; roots at zero, which are delays, are skipped."""
    roots = roots[np.abs(roots) > 1e-9]
    upper = roots[roots.imag > 1e-9 * np.abs(roots)]
    real = roots[np.abs(roots.imag) <= 1e-9 * np.abs(roots)]
    return [np.array([r, np.conj(r)]) for r in upper] + [np.array([r]) for r in real]


def _chosen(groups: Roots, marks: tuple[bool, ...], wanted: bool) -> NDArray[np.complex128]:
    parts = [g for g, mark in zip(groups, marks, strict=True) if mark is wanted]
    return np.concatenate([*parts, np.empty(0, dtype=complex)])


def _polynomial(roots: NDArray[np.complex128]) -> Array:
    return np.atleast_1d(np.real(np.poly(roots)))


# --- find the poles that a chain lacks: a score test of its free-run error -------------------------------------------
# A pole that is cancelled by a zero changes nothing.  The sensitivities at that location give the decrease of the sum
# of squares if the two were free to move, before anything is refitted (the Lagrange multiplier test: Godfrey 1988,
# Misspecification Tests in Econometrics, ch. 1).  The test shows where a chain has too few poles or has them in the
# wrong place, so the chain can grow downhill; random starts would have to hit all poles at once.
REAL = (-0.95, -0.85, -0.6, -0.3, 0.3, 0.6, 0.85, 0.95, 0.99)
RADII, ANGLES = (0.5, 0.75, 0.9, 0.96, 0.99), np.pi * (np.arange(16) + 0.5) / 16  # a fit finds the exact location
UNTOLD = 1e-5  # of the largest singular value; along smaller ones the parameters cannot be distinguished
BY_CHANCE = 0.01  # probability of such a decrease at the best location if nothing is missing and the error is white


# the grid of denominators: real poles alone, complex ones in pairs
GRID = [np.array([1.0, -r]) for r in REAL]
GRID += [np.array([1.0, -2.0 * r * np.cos(w), r * r]) for r in RADII for w in ANGLES]


def missing_poles(fitted: Fitted, data: IOData, largest: int, kept: int) -> list[tuple[float, FittedChain]]:
    """The ``kept`` most promising locations in each block, best first; none if the residual looks like noise.

    Each comes as the decrease of the sum of squares, to first order, and the chain with the pole and the zero that
    cancels it. ``fitted`` is at a minimum for these data. No block gets more than ``largest`` poles.
    """
    chain = fitted.chain
    signals = run(chain, data)
    slopes = sensitivities(chain, data)[1] * data.scale
    slopes /= np.maximum(np.linalg.norm(slopes, axis=1), 1e-300)[:, None]
    basis = orth(slopes.T, rcond=UNTOLD).T
    # twice a chi-squared of two degrees of freedom exceeds this once in 1/BY_CHANCE grids
    least = 2.0 * np.log(2 * len(GRID) / BY_CHANCE) * fitted.cost / max(int(data.counts.sum()), 1)
    found: tuple[list[tuple[float, FittedChain]], ...] = ([], [])
    for a in GRID:
        for block, signal in enumerate((signals.x, signals.y)):
            if (chain.a1, chain.a2)[block].size + a.size - 2 > largest:
                continue
            rows = delayed_rows(filter_rows(np.ones(1), a, signal[None, :], data.bounds)[0], a.size, data.bounds)[1:]
            if block == 0:
                rows = filter_rows(chain.b2, chain.a2, rows * signals.by_x, data.bounds)
            gain = _explained(rows * data.scale, basis, fitted.error)
            if gain > least:
                found[block].append((gain, with_pole(chain, block, a)))
    best = [p for of_block in found for p in sorted(of_block, key=lambda p: -p[0])[:kept]]
    return sorted(best, key=lambda p: -p[0])


def with_pole(chain: FittedChain, block: int, a: Array) -> FittedChain:
    """The same chain with the poles of ``a``, and zeros that cancel them, in its first (0) or second (1) block."""
    if block == 0:
        return chain._replace(b1=np.array([np.convolve(b, a) for b in chain.b1]), a1=np.convolve(chain.a1, a))
    return chain._replace(b2=np.convolve(chain.b2, a), a2=np.convolve(chain.a2, a))


def _explained(rows: Array, basis: Array, error: Array) -> float:
    """Part of the sum of squared errors that the rows explain in addition to the basis."""
    size = np.linalg.norm(rows, axis=1)
    rows = rows - (rows @ basis.T) @ basis
    new = np.linalg.norm(rows, axis=1)
    rows = rows[new > 1e-6 * size]
    if not len(rows):
        return 0.0
    rows = rows / np.linalg.norm(rows, axis=1)[:, None]
    q, r = np.linalg.qr(rows.T)
    return float(np.sum((q[:, np.abs(np.diag(r)) > 1e-6].T @ error) ** 2))


# --- leave a wrong minimum of the free-run error by moves that a descent cannot make --------------------------------
# On random systems (benchmarks/drawn_laws.py), useful moves reduce the sum of squares by 5 % or more.  Moves with less
# effect only shift the poles to compensate for a deficient law, and on the benchmark they would use up all rounds.
ROUNDS, WORTH = 10, 0.02  # rounds at most, and the share of the sum of squares that a round must remove
LARGEST = 8  # poles of a block
PLACES = 2  # locations at which a pole is tried in each block in a round
TRIED, REFINED = 14, 40  # iterations of each trial, iterations of the best


def improved(
    fitted: Fitted, data: IOData, moves: Callable[[Fitted, IOData], list[FittedChain]], *, free: bool = True
) -> Fitted:
    """Leave a wrong minimum by the best of the ``moves`` (`reflected`, `grown`), as often as it removes `WORTH`.

    ``fitted`` is at a minimum for these data.  ``free``: as of `refine`.
    """
    for _ in range(ROUNDS):
        tried = [refine(chain, data.head(SHORT), TRIED, free=free) for chain in moves(fitted, data)]
        best = min(tried, key=lambda f: f.cost, default=fitted)
        refitted = refine(best.chain, data, REFINED, free=free)
        if not refitted.cost < (1.0 - WORTH) * fitted.cost:
            break
        fitted = refitted
    return fitted


def reflected(fitted: Fitted, _: IOData) -> list[FittedChain]:
    """The chains, of one input, in which a zero is reflected at the unit circle."""
    chain = fitted.chain
    first = [chain._replace(b1=b[None, :]) for b in reflections(chain.b1[0])]
    return first + [chain._replace(b2=b) for b in reflections(chain.b2)]


def grown(fitted: Fitted, data: IOData) -> list[FittedChain]:
    """The chains with a pole where the error shows that one is missing, and the reflected ones."""
    return [c for _, c in missing_poles(fitted, data, LARGEST, PLACES)] + reflected(fitted, data)


# --- choose between several fitted chains on held-out data ----------------------------------------------------------
SIMPLER = 1.03  # a simpler model has at most 3 % more error on held-out data than the best
DEVIATIONS = 2.0  # and its error exceeds the best by at most two standard errors of the difference
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

    The simplest of ``candidates`` comes first; in ``later`` only the samples that their fits have not seen count.
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


LARGEST_LINEAR = 8  # total order of the best linear model; beyond it poles and zeros cancel, and blocks are padded


def of_orders(dims: Integers) -> tuple[SearchedOrders, ...]:
    """The structure with these n_a, n_b, n_c, n_d, and linear models of this total order and of smaller ones."""
    na, nb, nc, nd = (int(n) for n in dims[:4])
    poles, zeros = nb + nd, na + nc - 2
    surplus = max(poles - LARGEST_LINEAR, zeros - LARGEST_LINEAR, 0)
    linear = [(max(poles - k, 0), max(zeros - k, 0)) for k in range(surplus, max(poles, zeros) + 1)]
    return (SearchedOrders(tuple(dict.fromkeys(linear)), Orders(na - 1, nb, nc - 1, nd), exact=True),)


def delayed(u: Array, bounds: NDArray[np.int64], by: int) -> Array:
    """u (n, m) as rows (m, n), so many samples later, from rest in every experiment."""
    out = np.zeros(u.T.shape)
    for s, e in itertools.pairwise(bounds):
        out[:, s + by : e] = u.T[:, s : max(e - by, s)]
    return out


def record(u: Array, y: Array, restart: Bools, weights: Array | None = None, delay: int = 0) -> IOData:
    """A record for the fit, from u (n, m) and y (n,): starts of experiments, and which samples count and how much."""
    bounds = np.append(np.flatnonzero(restart), y.size).astype(np.int64)
    counts = np.ones(y.size, dtype=bool)
    for start, length in zip(bounds[:-1], np.diff(bounds), strict=True):
        counts[start : start + min(SKIP, length // 10)] = False
    if weights is not None:
        counts &= weights > 0.0
    root = None if weights is None else np.sqrt(weights)
    return IOData(delayed(u, bounds, delay), np.ascontiguousarray(y), bounds, counts, root)


def search(data: IOData, law: FrictionLaw, structures: tuple[SearchedOrders, ...] = UNKNOWN) -> Fitted:
    """The chain with the least free-run error; held-out data decide between structures.

    The knots of the ``law`` in x are placed again. If there are several ``structures``, the simplest first, the blocks
    may grow beyond them, and a polynomial replaces the law if held-out data cannot distinguish the two.
    """
    if len(structures) == 1:
        fitted = halving(starts(data, law, structures[0]), data)
        return finish(improved(fitted, data.head(LONG), reflected).chain, data)
    early = data.head(int((1 - HOLDOUT) * data.y.size))
    later = data._replace(counts=data.counts & (np.arange(data.y.size) >= early.y.size))
    found = [halving(starts(early, law, s), early) for s in structures]
    best, short = min(found, key=lambda f: squared_error(f.chain, later)), early.head(LONG)
    chosen = simplest([*found, improved(best, short, grown)], later)
    plain = FrictionLaw(static_terms("polynomial") or ())
    chosen = simplest([refine(chosen.chain._replace(law=plain, weights=plain.weights), short, 30), chosen], later)
    return finish(chosen.chain, data)


def halving(chains: list[FittedChain], data: IOData, *, free: bool = True) -> Fitted:
    """The best of many chains, by longer and longer refinements of fewer and fewer, the last on `LONG` samples."""
    for iterations, samples, kept in RUNGS:
        pool = best_in_turn([refine(c, data.head(samples), iterations, free=free) for c in chains], kept)
        chains = [f.chain for f in pool]
    return pool[0]


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


def starts(data: IOData, law: FrictionLaw, structure: SearchedOrders) -> list[FittedChain]:
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
        out += [f.chain for f in sorted(found, key=lambda f: f.cost)[:KEPT]]
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
