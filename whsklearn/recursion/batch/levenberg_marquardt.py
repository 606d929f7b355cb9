"""Levenberg-Marquardt over points of any kind: the loop of the batch fits.

Why not SciPy's `least_squares`: a step is refused here where a pole leaves the unit circle, is cut where friction would
feed energy, and some numbers of a point are solved for inside it (the states of pieces, variable projection), while
SciPy moves a vector within fixed bounds.  Sensitivities come as rows (p, n) of which J J' is needed: for 10,000 samples
and 8 numbers that takes a tenth of the decomposition of J with which SciPy solves a step.
`simulation_error.refine` has a loop of its own, since it places the knots of a law again on the way.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Protocol, TypeVar

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

FIRST = 1e-2  # damping, of normal equations with a unit diagonal
TRIES = 8  # dampings tried from one point, each four times the last


class HasCost(Protocol):
    """A point of a descent."""

    @property
    def cost(self) -> float:
        """What is lowered."""


Point = TypeVar("Point", bound=HasCost)


def descend(
    point: Point,
    equations: Callable[[Point], tuple[Array, Array] | None],
    moved: Callable[[Point, Array], Point | None],
    iterations: int,
    *,
    enough: float,
) -> Point:
    """The point of least cost that is reached from ``point`` (Levenberg 1944, Marquardt 1963).

    Parameters
    ----------
    point : object with a ``cost``
        The start.
    equations : callable
        Point to normal equations J J' (p, p) and J e (p,); None where there is nothing to go on from.
    moved : callable
        (point, step of shape (p,)) to another point; None where the step is refused.
    iterations : int
        At most so many.
    enough : float
        The iteration that takes off a smaller share of the cost is the last.
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
