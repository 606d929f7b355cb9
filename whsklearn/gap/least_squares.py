"""Least squares: linear ones with signs, and Levenberg-Marquardt within bounds on a residual that is simulated.

For the second, derivatives are finite differences.

Why not SciPy: a residual is a simulation of the whole record, and nearly all of the time goes into the differences of
the Jacobian. SciPy's ``trf`` cannot update a Jacobian from step to step, so on the fits of a diagnosis it evaluates
2.2 times as many residuals and takes 2.3 times as long for the same sum of squares (a ratio of 1.0000 in the median;
`python -m benchmarks.least_squares`).
"""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from whsklearn.gap.record import Array

# Dampings tried from one point, each eight times the last: up to 1e5 of the curvature. If a valley of the cost bends
# sharply (play, whose sides touch at one sample or the next), six dampings ended two fits of 26 at 2,300 times the
# least sum of squares (benchmarks/least_squares.py).
TRIES = 10
UNSEEN = 1e-3  # of the differences' steps: a shorter move changes nothing that they can resolve
MOST_CARRIED = 3  # steps in a row in which derivatives are updated before they are recomputed
# Actual over predicted drop of the sum of squares within which derivatives are updated; where a valley bends, they are
# recomputed.
AS_FORETOLD = (0.7, 1.3)
RIDGE = 3e-5  # per sample, for columns of unit rms: far below the information of any column worth naming


@dataclass
class Minimum:
    """Result of a minimisation.

    >>> wide = np.array([10.0])
    >>> found = least_squares(lambda x: x - 3.0, np.zeros(1), 1e-4 * wide, (-wide, wide))
    >>> round(float(found.x[0]), 3), found.cost < 1e-6
    (3.0, True)
    """

    x: Array  # (n,)
    residual: Array  # (m,)
    jacobian: Array  # (m, n): at the last accepted point (or one step before it)
    cost: float  # sum of squares


def jacobian(
    residual: Callable[[Array], Array], x: Array, r: Array, steps: Array, high: Array, workers: int | None = None
) -> Array:
    """Forward differences, backward at an upper bound; one per core at a time: compiled passes release the GIL."""

    def column(j: int) -> Array:
        h = steps[j] if x[j] + steps[j] <= high[j] else -steps[j]
        moved = x.copy()
        moved[j] += h
        return (residual(moved) - r) / h

    with ThreadPoolExecutor(workers or os.cpu_count()) as pool:
        return np.column_stack(list(pool.map(column, range(x.size))))


def least_squares(
    residual: Callable[[Array], Array],
    x0: Array,
    steps: Array,
    bounds: tuple[Array, Array],
    *,
    max_iterations: int = 15,
    tolerance: float = 2e-4,
    slopes: Callable[[Array], Array] | None = None,
    workers: int | None = None,
) -> Minimum:
    """Minimise the sum of squares of ``residual`` within bounds (Levenberg 1944, Marquardt 1963).

    It ends when an iteration reduces the sum of squares by less than ``tolerance``, because names are decided by
    percents of it. ``slopes`` gives the derivatives if differences of the residual would be too rough. ``workers`` is 1
    if two residuals must not be computed at a time; by default there is one per core.

    Differences cost one residual per number. After a step that reduced the sum of squares as predicted, they are
    updated by Broyden's formula (1965, Math. Comp. 19, 577-593), J + (r' - r - J s) s'D / (s'D s) with D the columns'
    powers. A fit ends with updated derivatives only at its ``max_iterations``, which does not count such steps.
    """
    low, high = bounds
    x = np.clip(x0, low, high)
    r = residual(x)
    cost = float(r @ r)
    damping = 1e-3
    jac, carried, taken = slopes(x) if slopes else jacobian(residual, x, r, steps, high, workers), 0, 1
    while True:
        gradient = jac.T @ r
        pinned = ((x <= low) & (gradient > 0)) | ((x >= high) & (gradient < 0))
        free = ~pinned
        moving = jac if free.all() else jac[:, free]
        normal = moving.T @ moving
        scale = np.maximum(np.diag(normal), 1e-300)
        improved, first_damping = False, damping
        for _ in range(TRIES):
            step = np.zeros_like(x)
            step[free] = -np.linalg.lstsq(normal + damping * np.diag(scale), gradient[free], rcond=1e-14)[0]
            trial = np.clip(x + step, low, high)
            if np.all(np.abs(trial - x) < UNSEEN * steps):
                break
            r_trial = residual(trial)
            c_trial = float(r_trial @ r_trial)
            if np.isfinite(c_trial) and c_trial < cost:
                improved = True
                break
            damping *= 8.0
        if improved:
            move, change, drop = trial - x, r_trial - r, cost - c_trial
            foretold = cost - float(np.sum((r + jac @ move) ** 2))
            small = drop < tolerance * max(cost, 1e-300)
            x, r, cost = trial, r_trial, c_trial
            damping = max(damping / 6.0, 1e-9)
            if small and not carried:
                break
            straight = AS_FORETOLD[0] * foretold < drop < AS_FORETOLD[1] * foretold
            if slopes is None and straight and not small and carried < MOST_CARRIED:
                jac, carried = carried_along(jac, move, change), carried + 1
                continue
        elif carried:
            damping = first_damping
        else:
            break
        if taken == max_iterations:
            break
        jac, carried, taken = slopes(x) if slopes else jacobian(residual, x, r, steps, high, workers), 0, taken + 1
    return Minimum(x, r, jac, cost)


def carried_along(jac: Array, move: Array, change: Array) -> Array:
    """Derivatives updated so that the last ``move`` gives the ``change`` of the residual.

    Of all such matrices it is the nearest to the previous one, in columns of unit length (Broyden 1965).
    """
    weighted = np.sum(jac**2, axis=0) * move
    return jac + np.outer(change - jac @ move, weighted / max(float(weighted @ move), 1e-300))


def gain_of(residual: Array, base: Array, columns: Array) -> tuple[float, Array]:
    """Drop of the sum of squares when ``columns`` join the ``base`` ones, and their coefficients."""
    q, _ = np.linalg.qr(base)
    z = columns - q @ (q.T @ columns)
    # A column in the span of the base leaves only rounding noise, and its weight would be noise over noise.
    z[:, np.linalg.norm(z, axis=0) <= 1e-9 * np.linalg.norm(columns, axis=0)] = 0.0
    r = residual - q @ (q.T @ residual)
    coefficients, *_ = np.linalg.lstsq(z, -r, rcond=1e-9)
    left = r + z @ coefficients
    return float(r @ r - left @ left), coefficients


def solve(columns: Array, target: Array, positive: NDArray[np.bool_]) -> tuple[Array, NDArray[np.bool_]]:
    """Sizes in the columns' own units, shape (p,), and a mask of the columns used; negative ones are dropped."""
    scale = np.sqrt(np.mean(columns**2, axis=0))
    scale[scale == 0.0] = 1.0
    z = np.column_stack([columns / scale, target])
    gram = z.T @ z
    free = np.ones(scale.size, dtype=bool)
    c = _ridge(gram, free, target.size)
    for _ in range(scale.size):
        bad = positive & free & (c < 0.0)
        if not bad.any():
            break
        worst = np.flatnonzero(bad)[np.argmin(c[bad])]  # one at a time, because the others may become positive again
        free[worst] = False
        c = _ridge(gram, free, target.size)
    return c / scale, free


def of_differences(columns: Array, target: Array) -> Array:
    """Sizes for which the first differences of columns and target agree best, shape (p,).

    If the error is a random walk rather than white, these are the efficient ones (Cochrane and Orcutt 1949, JASA
    44(245), 32-61, with a coefficient of one): a slow force that is missing hardly changes between two samples, while
    the acceleration does.
    """
    steps = np.diff(columns, axis=0)
    scale = np.linalg.norm(steps, axis=0) + 1e-300
    return np.linalg.lstsq(steps / scale, np.diff(target), rcond=1e-10)[0] / scale


def _ridge(gram: Array, free: NDArray[np.bool_], n: int) -> Array:
    out = np.zeros(free.size)
    at = np.flatnonzero(free)
    if at.size:
        held = gram[at[:, None], at]
        held.flat[:: at.size + 1] += RIDGE * n
        out[at] = np.linalg.solve(held, gram[at, -1])
    return out


def slope(x: Array, step: float) -> Array:
    """Five-point derivative of samples ``step`` seconds apart."""
    p = np.concatenate([x[:1], x[:1], x, x[-1:], x[-1:]])
    return (p[:-4] - 8 * p[1:-3] + 8 * p[3:-1] - p[4:]) / (12 * step)
