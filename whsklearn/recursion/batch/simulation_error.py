"""Least squares of the free run of a Wiener-Hammerstein chain, with exact sensitivities.

x = b1/a1 u, v = sum w_k f_k(x, dx), y = b2/a2 v, from rest.  After every trial step the weights of
the law are solved for again (variable projection): 7 of 8 segments of the benchmark converge with
it, and 1 of 8 without it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from whsklearn._numba import njit
from whsklearn.effects import FrictionLaw
from whsklearn.effects.base import Array
from whsklearn.effects.law import placed
from whsklearn.effects.rows import term
from whsklearn.recursion.batch.best_linear import EDGE, IOData, damped_step, delayed_rows, filter_rows
from whsklearn.systems.stability import is_stable

PLACE_AT = (4, 9, 17, 33)  # iterations after which knots are placed again for x; the cost changes only there
DEARER = 1.05  # factor by which placing the knots again may temporarily raise the cost
SHARPNESS = 100.0  # of a smoothed sign, kappa rms(dx); at the end 1 sample in 80 is within its transition


class FittedChain(NamedTuple):
    """The chain's numbers: numerators beginning with the direct path, denominators with their leading 1.

    ``b1`` has one row per input, shape (m, n); all inputs share a1.
    """

    b1: Array
    a1: Array
    b2: Array
    a2: Array
    law: FrictionLaw
    weights: Array

    @property
    def linear_part(self) -> Array:
        """b1, a1[1:], b2, a2[1:] in one vector."""
        return np.concatenate([self.b1.ravel(), self.a1[1:], self.b2, self.a2[1:]])

    def moved(self, step: Array) -> FittedChain:
        """The chain after a step of its linear part."""
        cuts = np.cumsum([self.b1.size, self.a1.size - 1, self.b2.size])
        b1, a1, b2, a2 = np.split(step, cuts)
        return self._replace(
            b1=self.b1 + b1.reshape(self.b1.shape),
            a1=self.a1 + np.append(0.0, a1),
            b2=self.b2 + b2,
            a2=self.a2 + np.append(0.0, a2),
        )

    @property
    def gains(self) -> list[int]:
        """Places in the linear part of b1[0] and b2[0], two gains that the law has as well."""
        return [0, self.b1.size + self.a1.size - 1]

    @property
    def stable(self) -> bool:
        """Whether all poles are inside the circle of radius `EDGE`."""
        return all(is_stable(np.ascontiguousarray(a[1:]), EDGE) for a in (self.a1, self.a2))


class ChainSignals(NamedTuple):
    """The signals of a run: x, v, y, the law's columns (k, n) and its slopes in x and in dx."""

    x: Array
    v: Array
    y: Array
    columns: Array
    by_x: Array
    by_dx: Array


class Fitted(NamedTuple):
    """A chain, its error on the samples that count (zero elsewhere), and the sum of squares of that error."""

    chain: FittedChain
    error: Array
    cost: float

    @property
    def n_parameters(self) -> int:
        """Number of the chain's parameters, less the two gains that the law has as well."""
        return self.chain.linear_part.size + len(self.chain.law) - 2


def before_law(chain: FittedChain, data: IOData) -> Array:
    """x, which enters the law, of shape (n,)."""
    x = np.zeros(data.y.size)
    for b, u in zip(chain.b1, data.u, strict=True):
        x += filter_rows(b, chain.a1, u[None, :], data.bounds)[0]
    return x


def run(chain: FittedChain, data: IOData) -> ChainSignals:
    """Simulate the chain from rest."""
    x = before_law(chain, data)
    rows = law_rows(chain, x, data)
    columns, by_x, by_dx = rows[:-2], rows[-2], rows[-1]
    v = chain.weights @ columns
    return ChainSignals(x, v, filter_rows(chain.b2, chain.a2, v[None, :], data.bounds)[0], columns, by_x, by_dx)


def solve_law(chain: FittedChain, data: IOData) -> Fitted:
    """The same blocks with the best weights of the law, by linear least squares."""
    x = before_law(chain, data)
    if not np.isfinite(x).all():
        return Fitted(chain, data.y, np.inf)
    columns = law_rows(chain, x, data)[:-2]
    basis = orthonormal(columns[:, data.counts])
    rows = filter_rows(chain.b2, chain.a2, basis @ columns, data.bounds) * data.scale
    target = data.y * data.scale
    weights = damped_step(rows @ rows.T, rows @ target, 1e-10)
    error = target - weights @ rows
    cost = float(error @ error)
    return Fitted(chain._replace(weights=weights @ basis), error, cost if np.isfinite(cost) else np.inf)


def sensitivities(chain: FittedChain, data: IOData) -> tuple[Array, Array]:
    """(y, its derivatives with respect to b1, a1[1:], b2, a2[1:] and the weights, one row each)."""
    s = run(chain, data)
    one = np.ones(1)
    inner = filter_rows(one, chain.a1, np.vstack([data.u, s.x]), data.bounds)
    first = np.vstack(
        [
            *(delayed_rows(filtered, chain.b1.shape[1], data.bounds) for filtered in inner[:-1]),
            -delayed_rows(inner[-1], chain.a1.size, data.bounds)[1:],
        ]
    )
    through_law = first * s.by_x
    if s.by_dx.any():
        before = np.zeros_like(first)
        before[:, 1:] = first[:, :-1]
        before[:, data.bounds[:-1]] = 0.0
        through_law += (first - before) * s.by_dx
    outer = filter_rows(one, chain.a2, np.vstack([s.v, s.y]), data.bounds)
    rows = np.vstack(
        [
            filter_rows(chain.b2, chain.a2, through_law, data.bounds),
            delayed_rows(outer[0], chain.b2.size, data.bounds),
            -delayed_rows(outer[1], chain.a2.size, data.bounds)[1:],
            filter_rows(chain.b2, chain.a2, s.columns, data.bounds),
        ]
    )
    return s.y, rows


def refine(chain: FittedChain, data: IOData, iterations: int, *, free: bool = True) -> Fitted:
    """Levenberg-Marquardt on the free-run error; steps to a pole beyond radius 0.9999 are rejected.

    The weights of ``chain`` may be arbitrary. If the scale of x is ``free``, x is scaled to unit standard deviation and
    the knots of the law follow it. Otherwise b1[0] and b2[0] stay as they are, which laws such as tanh(dx) need.
    """
    best = least = solve_law(chain, data)
    if free:
        refitted = solve_law(normalised(chain, data), data)
        best = refitted if not best.cost * DEARER < refitted.cost else best
    held = [] if free else chain.gains
    damping = 1e-2
    for i in range(iterations):
        if not np.isfinite(best.cost):
            break
        if free and i in PLACE_AT:
            refitted = solve_law(normalised(best.chain, data), data)
            least = min(least, best, key=lambda f: f.cost)  # knots at a kink are not always found again
            best = refitted if refitted.cost < DEARER * best.cost else best
        rows = sensitivities(best.chain, data)[1] * data.scale
        n = best.chain.linear_part.size
        rows[held] = 0.0
        information, gradient = rows @ rows.T, rows @ best.error
        accepted = False
        for _ in range(7):
            trial = best.chain.moved(damped_step(information, gradient, damping)[:n])
            if trial.stable:
                found = solve_law(trial, data)
                if found.cost < best.cost:
                    accepted, gain, best, damping = True, 1 - found.cost / best.cost, found, damping / 8
                    break
            damping *= 4
        if not accepted or (gain < 1e-7 and i > max(PLACE_AT[:2])):
            break
    return min(best, least, key=lambda f: f.cost)


def normalised(chain: FittedChain, data: IOData) -> FittedChain:
    """Scale x to unit deviation and b2 to unit length, and place knots for x; the weights must be solved for again."""
    x = before_law(chain, data)[data.counts]
    scale = float(np.std(x))
    if not np.isfinite(scale) or scale == 0.0:
        return chain
    law = FrictionLaw(placed(chain.law.terms, x / scale))
    return chain._replace(b1=chain.b1 / scale, b2=chain.b2 / max(float(np.linalg.norm(chain.b2)), 1e-300), law=law)


def orthonormal(columns: Array) -> Array:
    """A matrix m for which the rows of ``m @ columns`` are orthonormal; truncated powers are nearly dependent."""
    thin = np.ascontiguousarray(columns[:, :: 1 + columns.shape[1] // 4000])
    scale = np.maximum(np.sqrt(np.mean(thin**2, axis=1)), 1e-300)
    r = np.linalg.qr((thin / scale[:, None]).T, mode="r") / np.sqrt(thin.shape[1])
    return np.linalg.pinv(r, rcond=1e-10).T / scale


def law_rows(chain: FittedChain, x: Array, data: IOData) -> Array:
    """Every term at unit weight, then the slopes of the weighted law in x and in dx, shape (k + 2, n).

    The value of the law's signs is exact, their slope is that of a tanh.
    """
    moving = np.diff(x[data.counts])
    rms = float(np.sqrt(np.mean(moving**2))) if moving.size else 0.0
    kappa = -SHARPNESS / rms if rms > 0 and np.isfinite(rms) else -1.0
    return np.asarray(_law_rows(chain.law.codes, chain.law.shapes, chain.weights, x, data.bounds, kappa))


@njit(cache=True, error_model="numpy")
def _law_rows(codes, shapes, weights, x, bounds, kappa):
    out = np.zeros((codes.size + 2, x.size))
    columns, by_x, by_dx = out[:-2], out[-2], out[-1]
    for e in range(bounds.size - 1):
        before = 0.0
        for t in range(bounds[e], bounds[e + 1]):
            for k in range(codes.size):
                value, slope, slope_dx = term(
                    codes[k], shapes[k, 0], shapes[k, 1], shapes[k, 2], x[t], x[t] - before, kappa
                )
                columns[k, t] = value
                by_x[t] += weights[k] * slope
                by_dx[t] += weights[k] * slope_dx
            before = x[t]
    return out


# --- update a simulation-error fit by one block of a stream; everything before the block is a quadratic form ---------
# theta minimises |e_block(theta)|^2 + (theta - theta_0)' R (theta - theta_0) in a few Gauss-Newton steps, each
# accepted only if this cost falls, and R grows by J'J of the block.  With surplus poles the same recursion
# diverges sample by sample, but not block by block.
STEPS = 3
DAMPING = (1e-9, 1e-4, 1e-2, 1.0)  # tried in turn until a step lowers the cost


def with_basis(chain: FittedChain, data: IOData, basis: Array) -> tuple[Array, Array]:
    """The error on the samples that count, and its sensitivities to theta with the sign of dy.

    theta = (linear part, weights in the ``basis``, which is `orthonormal`); the gains are held.
    """
    y, rows = sensitivities(chain, data)
    n = chain.linear_part.size
    rows = np.vstack([rows[:n], basis @ rows[n:]]) * data.scale
    rows[chain.gains] = 0.0
    return (data.y - y) * data.scale, rows


def block_update(
    chain: FittedChain, information: Array, data: IOData, basis: Array
) -> tuple[FittedChain, Array, float]:
    """The chain and R (p, p) after a block, and the sum of squared errors of the block before the update.

    In ``data`` samples that do not count, but determine the state, precede the block.
    """
    gone = np.zeros(len(information))
    error, rows = with_basis(chain, data, basis)
    n = chain.linear_part.size
    loss = cost = float(error @ error)
    for _ in range(STEPS):
        total = rows @ rows.T + information
        gradient = rows @ error - information @ gone
        for damping in DAMPING:
            step = damped_step(total, gradient, damping)
            trial = chain.moved(step[:n])._replace(weights=chain.weights + step[n:] @ basis)
            if not trial.stable:
                continue
            away = gone + step
            left = (data.y - run(trial, data).y) * data.scale
            new = float(left @ left + away @ information @ away)
            if new < cost:
                chain, gone, gain, cost = trial, away, 1 - new / cost, new
                error, rows = with_basis(chain, data, basis)
                break
        else:
            break
        if gain < 1e-6:
            break
    return chain, information + rows @ rows.T, loss
