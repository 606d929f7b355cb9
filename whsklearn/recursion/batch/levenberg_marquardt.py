"""Levenberg-Marquardt over points of any kind: the loop of the batch fits.

SciPy's `least_squares` moves a vector within fixed bounds, which is not enough here.  A step is rejected if a pole
leaves the unit circle, and shortened if friction would feed in energy.  Some parts of a point are solved for inside it
(the states of pieces, variable projection).  Sensitivities are rows (p, n), and only J J' is needed: for 10,000 samples
and 8 parameters this takes a tenth of the time of the decomposition of J with which SciPy solves a step.
`simulation_error.refine` has its own loop, because it places the knots of a law again on the way.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol, TypeVar

import numpy as np

from whsklearn.effects.base import Array

FIRST = 1e-2  # initial damping, for normal equations with a unit diagonal
TRIES = 8  # dampings tried from one point, each four times the previous one


class HasCost(Protocol):
    """A point of a descent."""

    @property
    def cost(self) -> float:
        """The cost to minimise."""


Point = TypeVar("Point", bound=HasCost)


def descend(
    point: Point,
    equations: Callable[[Point], tuple[Array, Array] | None],
    moved: Callable[[Point, Array], Point | None],
    iterations: int,
    *,
    enough: float,
) -> Point:
    """The point of least cost reached from ``point`` (Levenberg 1944, Marquardt 1963).

    ``point``: the start.
    ``equations``: maps a point to its normal equations J J' (p, p) and J e (p,); None if the descent cannot continue
        there.
    ``moved``: maps (point, step of shape (p,)) to another point; None if the step is rejected.
    ``iterations``: largest number of iterations.
    ``enough``: the descent ends after an iteration that lowers the cost by a smaller share than this.
    """
    damping = FIRST
    for _ in range(iterations):
        found = equations(point)
        if found is None:
            return point
        for _ in range(TRIES):
            trial = moved(point, damped_step(*found, damping))
            if trial is not None and trial.cost < point.cost:
                break
            damping *= 4
        else:
            return point
        gain, point, damping = 1 - trial.cost / point.cost, trial, damping / 8
        if gain < enough:
            return point
    return point


def damped_step(information: Array, gradient: Array, damping: float) -> Array:
    """(D + damping I)^-1 of the normal equations, scaled to a unit diagonal."""
    scale = np.sqrt(np.maximum(np.diag(information), 1e-300))
    matrix = information / np.outer(scale, scale)
    matrix[np.diag_indices_from(matrix)] += damping
    try:
        return np.linalg.solve(matrix, gradient / scale) / scale
    except np.linalg.LinAlgError:
        return np.zeros_like(gradient)
