"""Fits of the free run: a base model starts from divisions of the best linear model, other models from their values.

Signs are sharpened in steps.  Under a soft sign the error is smooth in the numbers of L1; under the true sign it is the
error of the system itself.

The error of a missing pole, or of a straight law in place of a curve, also follows the input, and the nearest effect of
the catalogue would be named for it.  So the base model is also fitted with one and two more poles and zeros in each
block, and with kinks in x and dx beside its law.  If that explains more than the effects found, the report says so.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable
from typing import Any

import numpy as np

from whsklearn.effects import FrictionLaw, Power
from whsklearn.effects.base import Array
from whsklearn.effects.law import placed, static_terms
from whsklearn.gap.calibration import gain
from whsklearn.gap.least_squares import least_squares
from whsklearn.gap.plants import chain_model as cm
from whsklearn.gap.plants.chain_model import ChainHypothesis, ChainTerm, Record
from whsklearn.gap.search import LEAST_SHARE
from whsklearn.recursion.batch.best_linear import IOData, Ratio, best_linear
from whsklearn.recursion.batch.simulation_search import Orders, divisions, neighbours, of_orders, padded, search
from whsklearn.recursion.memory.starts import random_stable
from whsklearn.systems.stability import is_stable

N_RANDOM = 16  # starts besides the divisions, for blocks that are far from those of a linear model
KEPT = 5  # starts of a kind that go on, after a cheaper fit has ranked them


def cost(s: Record, m: ChainHypothesis) -> float:
    """Sum of squares over the samples of the fit under the true sign, with outliers capped."""
    return cm.deviance(cm.left(s, m)[s.fit])


def climb(
    s: Record, m: ChainHypothesis, sharpness: float, steps: int, *, robust: bool = True, held: bool = False
) -> ChainHypothesis:
    """The model fitted at a sharpness (kappa times rms dx) with its noise colour unchanged.

    The fit never steps from a stable model to an unstable one, which a short record of a slow pole may prefer.
    ``held``: the first number of the last effect stays as it is.
    """
    z = cm.sizes(s, m)
    kappa = sharpness / z.dx
    low, high = cm.bounds(m, z)
    x = np.clip(cm.to_vector(m), low, high)
    if held:
        i = x.size - len(m.terms[-1].free)
        low[i] = high[i] = x[i]
    first = cm.from_vector(m, x)
    run = cm.simulate(s, first, kappa)
    sigma = np.sqrt(cm.variance_of(cm.left_by(s, first, run[2])[s.fit]))
    begins_stable = _stable(s, m.theta)
    unit = cm.units_of(s, first, cm.sensitivities(s, first, kappa, run), run)
    unseen = unit == 0.0
    unit[unseen] = 1.0
    last: list[Any] = [None]  # the vector simulated last, its model, free run and errors: slopes are asked for there

    def model(x: Array) -> ChainHypothesis:
        return cm.from_vector(m, np.clip(x * unit, low, high))

    def simulated(x: Array) -> Any:
        if last[0] is not x:
            at = model(x)
            run = cm.simulate(s, at, kappa)
            last[:] = x, at, run, cm.left_by(s, at, run[2])[s.fit] / sigma
        return last[1:]

    def errors(x: Array) -> Array:
        if begins_stable and not _stable(s, x[: m.theta.size]):
            return np.full(int(s.fit.sum()), np.inf)
        e = simulated(x)[2]
        return np.copysign(np.sqrt(cm.capped(e**2)), e) if robust else e

    def slopes(x: Array) -> Array:
        """Derivatives of `errors`; a capped error is the root of its cost, so its slope is e w(e) over that root."""
        at, run, e = simulated(x)
        out = cm.sensitivities(s, at, kappa, run)[s.fit] * unit / sigma
        out[:, unseen] = 0.0
        if robust:
            out *= (cm.share(e**2) * np.abs(e) / np.maximum(np.sqrt(cm.capped(e**2)), 1e-150))[:, None]
        return out

    x, ends = x / unit, (low / unit, high / unit)
    near = cm.SMALL * np.maximum(np.abs(x), 0.05)
    try:
        found = least_squares(errors, x, near, ends, max_iterations=steps, tolerance=cm.SMALL, slopes=slopes)
    except (ValueError, np.linalg.LinAlgError):
        return m
    return model(found.x)


def coloured(s: Record, m: ChainHypothesis) -> ChainHypothesis:
    """The model with the noise colour of its residual."""
    white = dataclasses.replace(m, ar=np.zeros_like(m.ar))
    e = cm.left(s, white)
    return dataclasses.replace(m, ar=cm.colour([e[piece][cm.SKIP :] for piece in cm.pieces_of(s.seen)]))


def sharpened(
    s: Record, m: ChainHypothesis, rungs: Iterable[float] = cm.HARD, steps: int = 8, *,
    robust: bool = True, held: bool = False,
) -> ChainHypothesis:  # fmt: skip
    """The model fitted rung by rung, with its noise colour updated after each; the best one under the true sign."""
    tried = [m := coloured(s, climb(s, m, rung, steps, robust=robust, held=held)) for rung in rungs]
    return min(tried, key=lambda m: cost(s, m))


def polished(s: Record, m: ChainHypothesis) -> ChainHypothesis:
    """The model at its minimum: refitted from its present values, through a soft sign, and from there again.

    Every sample close to a reversal makes a local minimum of its own.  Errors that are not capped pull the model across
    a sign that a sample is on the wrong side of, the softer it is the further.  A pole and a zero that cancel are
    released.
    """
    best = min([m, sharpened(s, m, cm.RUNGS[2:]), sharpened(s, m, (cm.SHARPEST,), 10)], key=lambda w: cost(s, w))
    best = min([best, *(sharpened(s, w, cm.RUNGS[2:]) for w in released(s, best))], key=lambda w: cost(s, w))
    for rungs in (cm.HARD, cm.RUNGS[1:]):
        across = sharpened(s, best, rungs, 15, robust=False)
        best = min([best, across, sharpened(s, across, (cm.SHARPEST,))], key=lambda w: cost(s, w))
    return best


def released(s: Record, m: ChainHypothesis) -> list[ChainHypothesis]:
    """The model with a pole and a zero that cancel moved to the origin, block by block, where that costs nothing.

    A pair that cancels at the unit circle is stuck there, because a fit takes no step to an unstable model, and the
    record cannot show that the block lacks it elsewhere.  A lag or a resonance used to be named in its place.
    """
    n, out = float(s.fit.sum()), []
    for part in (s.blocks[:2], s.blocks[3:]):
        zeros, poles = (np.roots(np.concatenate([[1.0], m.theta[i]])) for i in part)
        far = np.abs(zeros[:, None] - poles)
        far[(zeros.imag != 0.0)[:, None] | (poles.imag != 0.0)] = np.inf
        if not np.isfinite(far).any():
            continue
        i, j = np.unravel_index(np.argmin(far), far.shape)
        theta = m.theta.copy()
        theta[part[0]] = np.real(np.poly([*np.delete(zeros, i), 0.0]))[1:]
        theta[part[1]] = np.real(np.poly([*np.delete(poles, j), 0.0]))[1:]
        moved = climb(s, dataclasses.replace(m, theta=theta), cm.SHARPEST, 2)
        if gain(cost(s, moved), cost(s, m), n) < 2.0 * np.log(n):  # the record does not need these two numbers
            out.append(moved)
    return out


# --- starts ---------------------------------------------------------------------------------------
def of_dx(law: FrictionLaw) -> bool:
    """Whether a law depends on dx alone, so that its linear part is a difference."""
    return bool(np.all(law([-1.0, 0.5, 2.0], 0.0) == 0.0))


def linear_model(s: Record, u: Array, extra_poles: int = 0) -> Ratio:
    """The best linear model from u to y with the chain's numbers of poles and zeros, its delays and its difference."""
    na, nb, nc, nd, _ = (int(i) for i in s.dims)
    return best_linear(_data(s, u), nb + nd + extra_poles, na + nc - 2 + (1 if extra_poles else 0))


def misfit(s: Record, ratio: Ratio, u: Array) -> float:
    """Mean square residual of a linear model."""
    data = _data(s, u)
    return float(np.mean((data.y - ratio.run(data))[data.counts] ** 2))


def _data(s: Record, u: Array) -> IOData:
    late = np.concatenate([np.zeros(2), u[:-2]])
    late = np.diff(late, prepend=0.0) if of_dx(s.law) else late
    counts = s.fit & (np.arange(u.size) >= cm.SKIP)
    return IOData(np.ascontiguousarray(late[None, :]), s.y - s.y[counts].mean(), np.array([0, u.size]), counts)


def divided(s: Record, ratio: Ratio, terms: tuple[ChainTerm, ...] = ()) -> list[Array]:
    """theta for every division of a linear model's poles and zeros between the blocks; weights by least squares."""
    na, nb, nc, nd, _ = (int(i) for i in s.dims)
    out = []
    for one, two in divisions(ratio, Orders(na - 1, nb, nc - 1, nd)):
        a, c = padded(one, na - 1, nb), padded(two, nc - 1, nd)
        out.append(weighed(s, np.concatenate([a.b[1:], a.a[1:]]), np.concatenate([c.b[1:], c.a[1:]]), terms))
    return out


def weighed(s: Record, first: Array, second: Array, terms: tuple[ChainTerm, ...] = ()) -> Array:
    """theta of two blocks with the weights that fit y best under a soft sign, together with these effects."""
    nw = int(s.dims[4])
    m = ChainHypothesis(np.concatenate([first, np.zeros(nw), second]), tuple(t for t in terms if not t.kind.folds))
    kappa = 1.0 / cm.rms_dx(s, m)
    plain = cm.simulate(s, m, kappa)[2]
    rows = np.empty((s.u.size, nw))
    for i in range(nw):
        theta = m.theta.copy()
        theta[s.blocks[2].start + i] = 1.0
        rows[:, i] = cm.simulate(s, dataclasses.replace(m, theta=theta), kappa)[2] - plain
    theta, rows = m.theta.copy(), cm.finite(rows[s.fit])
    size = np.linalg.norm(rows, axis=0)
    if np.all(size < cm.LARGEST):
        size = np.maximum(size, cm.LEAST)
        theta[s.blocks[2]] = np.linalg.lstsq(rows / size, (s.y - plain)[s.fit], rcond=1e-4)[0] / size
    return theta


def random_thetas(s: Record, rng: np.random.Generator, n: int) -> list[Array]:
    """theta of random stable blocks; weights by least squares."""
    na, nb, nc, nd, _ = (int(i) for i in s.dims)

    def block(zeros: int, poles: int) -> Array:
        return np.concatenate([rng.normal(0.0, 1.0, zeros), random_stable(poles, rng)])

    return [weighed(s, block(na - 1, nb), block(nc - 1, nd)) for _ in range(n)]


def ranked(s: Record, models: Iterable[ChainHypothesis], sharpness: float, steps: int) -> list[ChainHypothesis]:
    """Stable starts after a few steps under a soft sign and white noise; the best of each minimum comes first."""
    found: list[tuple[float, ChainHypothesis]] = []
    for m in models:
        if np.all(np.isfinite(m.theta)) and _stable(s, m.theta):
            m = climb(s, m, sharpness, steps, robust=False)
            value = float(np.sum(cm.left(s, m, sharpness / cm.rms_dx(s, m))[s.fit] ** 2))
            found += [(value, m)] if np.isfinite(value) else []
    found.sort(key=lambda f: f[0])
    # two minima differ if their likelihoods do by a factor of e
    apart = [i for i in range(len(found)) if i == 0 or gain(found[i][0], found[i - 1][0], s.fit.sum()) > 1.0]
    return [found[i][1] for i in apart]


def _stable(s: Record, theta: Array) -> bool:
    _, b, _, _, d = s.blocks
    return all(is_stable(np.ascontiguousarray(theta[part]), 0.9999) for part in (b, d))


def minima(s: Record, starts: Iterable[ChainHypothesis]) -> list[ChainHypothesis]:
    """Distinct minima that the starts lead to, best first; the best is fitted until it converges."""
    out = sharpest(s, ranked(s, starts, cm.RUNGS[0], 8)[:KEPT])
    return [least(s, polished(s, m)) for m in out[:1]] + out[1:]


def sharpest(s: Record, soft: list[ChainHypothesis]) -> list[ChainHypothesis]:
    """Sharpen models found under a soft sign, best first."""
    softer = sorted((sharpened(s, m, cm.RUNGS[1:3]) for m in soft), key=lambda m: cost(s, m))
    return sorted((sharpened(s, m) for m in softer[:2]), key=lambda m: cost(s, m))


def least(s: Record, m: ChainHypothesis) -> ChainHypothesis:
    """The least minimum that is reached from one by exchanging roots of the blocks or reflecting zeros, time and again.

    An effect that puts a root where it belongs would be named for it.
    """
    while True:
        found = [sharpened(s, w, cm.RUNGS[1:]) for w in ranked(s, neighbours_of(s, m), cm.RUNGS[1], 6)[:KEPT]]
        other = min(found, key=lambda w: cost(s, w), default=m)
        if gain(cost(s, m), cost(s, other), s.fit.sum()) <= 1.0:  # two minima differ by a factor of e in likelihood
            return m
        m = polished(s, other)


def neighbours_of(s: Record, m: ChainHypothesis) -> list[ChainHypothesis]:
    """The model with the blocks of each of the `neighbours` of theta; weights by least squares."""
    _, b, _, c, _ = s.blocks
    found = neighbours(m.theta, s.dims)
    return [dataclasses.replace(m, theta=weighed(s, t[: b.stop], t[c.start :], m.terms)) for t in found]


def base_starts(s: Record, rng: np.random.Generator) -> list[ChainHypothesis]:
    """Starting models: the divisions of the best linear model, refined if the law allows it, and random blocks."""
    found = searched(s) if all(isinstance(t, Power) for t in s.law.terms) else divided(s, linear_model(s, s.u))
    return [ChainHypothesis(t) for t in (*found, *random_thetas(s, rng, N_RANDOM))]


def searched(s: Record) -> list[Array]:
    """theta of the least free-run error that is reached from the divisions of linear models of several orders."""
    chain = search(_data(s, s.u)._replace(y=s.y), s.law, of_orders(s.dims)).chain
    first, second = ((b[1:] / b[0], a[1:]) for b, a in ((chain.b1[0], chain.a1), (chain.b2, chain.a2)))
    return [weighed(s, np.concatenate(first), np.concatenate(second))]


# --- the law, and whether orders and law suffice ---------------------------------------------------
EXTRA = (1, 2)  # poles and zeros added to each block


def with_knots(s: Record, m: ChainHypothesis, asked: FrictionLaw) -> tuple[Record, list[ChainHypothesis]]:
    """(record, [fitted model]) with the knots of the law placed for the model's x."""
    at = s.with_law(FrictionLaw(placed(asked.terms, cm.simulate(s, m)[0])))
    _, b, weights, _, _ = s.blocks
    theta = weighed(at, m.theta[: b.stop], m.theta[weights.stop :])
    return at, [polished(at, sharpened(at, dataclasses.replace(m, theta=theta), cm.RUNGS[2::2], 15))]


def raised(s: Record, m: ChainHypothesis, more: int) -> tuple[Record, ChainHypothesis]:
    """(record, model) with ``more`` additional zeros in a, b, c and d: the same model with a higher order."""
    a, b, w, c, d = (m.theta[part] for part in s.blocks)
    zero = np.zeros(more)
    theta = np.concatenate([a, zero, b, zero, w, c, zero, d, zero])
    dims = s.dims + np.array([more, more, more, more, 0])
    return dataclasses.replace(s, dims=dims), dataclasses.replace(m, theta=theta)


def freed(s: Record, m: ChainHypothesis) -> tuple[Record, ChainHypothesis]:
    """(record, model) with kinks in x, all of weight zero, and a cubic beside its law."""
    kinks = placed(static_terms("piecewise_linear:8") or (), cm.simulate(s, m)[0])
    law = FrictionLaw([*s.law.terms, *(Power(0.0, float(k)) for k in (1, 2, 3)), *kinks])
    theta = np.insert(m.theta, s.blocks[2].stop, np.zeros(len(law) - len(s.law)))
    return s.with_law(law), dataclasses.replace(m, theta=theta)


def falls_short(s: Record, base: ChainHypothesis, model: ChainHypothesis) -> str:
    """A sentence on what the base model's orders or law lack; empty if larger ones explain no more than the effects.

    Both explain the same record, so they are compared by n ln of the mean square residual, in which a common noise
    floor has no effect, with a penalty of ln n for each additional number (Schwarz 1978, Annals of Statistics 6(2),
    461-464).
    """

    def fitted(pair: tuple[Record, ChainHypothesis]) -> tuple[Record, ChainHypothesis, float]:
        at, m = pair[0], sharpened(*pair, cm.RUNGS[1::2], 15)
        return at, m, cost(at, m)

    n, value = float(s.fit.sum()), cost(s, base)
    orders = min((fitted(raised(s, base, more)) for more in EXTRA), key=lambda f: f[2])
    law = fitted(freed(s, base))
    own = base.theta.size + sum(t.kind.n_numbers for t in model.terms)
    larger = (orders, law, fitted(freed(*orders[:2])))
    if all(gain(cost(s, model), after, n) <= (m.theta.size - own) * np.log(n) for _, m, after in larger):
        return ""
    parts, (by_orders, by_law) = [], (1.0 - found[2] / value for found in (orders, law))
    if by_orders > LEAST_SHARE:
        before, after = (",".join(str(int(n)) for n in o.dims[:4]) for o in (s, orders[0]))
        parts.append(
            f"linear dynamics are missing: more poles and zeros alone take {100 * by_orders:.0f} % off the mean square "
            f"of the error (orders {before} were given; try {after})"
        )
    if by_law > LEAST_SHARE:
        parts.append(
            f"the law has another shape: free functions of x alone take {100 * by_law:.0f} % off it (give another law)"
        )
    told = "; ".join(parts) or "orders and law together are too small"
    return f"The base model itself falls short: {told}. No effect is named until that is corrected."
