"""Least squares with bounds: Levenberg-Marquardt on a residual whose derivatives are differences."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]
THREADS = 2


@dataclass
class Fit:
    """Where a search ended.

    Attributes
    ----------
    x : ndarray of shape (n,)
    residual : ndarray of shape (m,)
    jacobian : ndarray of shape (m, n)
        At the last accepted point (or one step before it).
    cost : float
        Sum of squares.
    """

    x: Array
    residual: Array
    jacobian: Array
    cost: float


def jacobian(residual: Callable[[Array], Array], x: Array, r: Array, steps: Array, high: Array) -> Array:
    """Forward differences, backward at an upper bound; two at a time, since the compiled passes let go of the GIL."""

    def column(j: int) -> Array:
        h = steps[j] if x[j] + steps[j] <= high[j] else -steps[j]
        moved = x.copy()
        moved[j] += h
        return (residual(moved) - r) / h

    with ThreadPoolExecutor(THREADS) as pool:
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
) -> Fit:
    """Minimise the sum of squares of ``residual`` within bounds (Levenberg 1944, Marquardt 1963).

    It ends where an iteration takes off less than ``tolerance`` of the sum of squares: names are decided by percents of
    it. ``slopes`` gives the derivatives where differences of the residual would be too rough.
    """
    low, high = bounds
    x = np.clip(x0, low, high)
    r = residual(x)
    cost = float(r @ r)
    damping = 1e-3
    jac = slopes(x) if slopes else jacobian(residual, x, r, steps, high)
    for _ in range(max_iterations):
        gradient = jac.T @ r
        pinned = ((x <= low) & (gradient > 0)) | ((x >= high) & (gradient < 0))
        free = ~pinned
        normal = jac[:, free].T @ jac[:, free]
        scale = np.maximum(np.diag(normal), 1e-300)
        improved = False
        for _ in range(6):
            step = np.zeros_like(x)
            step[free] = -np.linalg.lstsq(normal + damping * np.diag(scale), gradient[free], rcond=1e-14)[0]
            trial = np.clip(x + step, low, high)
            r_trial = residual(trial)
            c_trial = float(r_trial @ r_trial)
            if np.isfinite(c_trial) and c_trial < cost:
                improved = True
                break
            damping *= 8.0
        if not improved:
            break
        drop = (cost - c_trial) / max(cost, 1e-300)
        x, r, cost = trial, r_trial, c_trial
        damping = max(damping / 6.0, 1e-9)
        if drop < tolerance:
            break
        jac = slopes(x) if slopes else jacobian(residual, x, r, steps, high)
    return Fit(x, r, jac, cost)


def gain_of(residual: Array, base: Array, columns: Array) -> tuple[float, Array]:
    """Drop of the sum of squares when ``columns`` join the ``base`` ones, and their coefficients."""
    q, _ = np.linalg.qr(base)
    z = columns - q @ (q.T @ columns)
    # A column that the base holds already leaves rounding noise, and its weight would be noise over noise.
    z[:, np.linalg.norm(z, axis=0) <= 1e-9 * np.linalg.norm(columns, axis=0)] = 0.0
    r = residual - q @ (q.T @ residual)
    coefficients, *_ = np.linalg.lstsq(z, -r, rcond=1e-9)
    left = r + z @ coefficients
    return float(r @ r - left @ left), coefficients
