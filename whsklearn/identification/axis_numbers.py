"""An axis as the kernel of its free run has it: its numbers in a vector, its record in pieces."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

import numpy as np

from whsklearn.effects import GravityImbalance, SpeedHinge
from whsklearn.recursion.batch.axis_free_run import AxisLog, free_run, settled

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from whsklearn.identification.view import View
    from whsklearn.models import AxisModel

    Array = NDArray[np.float64]

PIECE = 2.0  # s of a free run whose place is to be known
LEAST_PIECE = 100  # samples of it
FEWEST_SHOT = 20  # samples of a piece of multiple shooting, ten for each number of its state


def axis_log(log: View, knots: Array, *, hangs: bool) -> AxisLog:
    """The record as the fit of an axis takes it, in one piece, or in short ones where gravity pulls.

    Where it does the place counts, and a free run is off it after some seconds.
    """
    n = log.u.size
    piece = max(round(PIECE / log.dt), LEAST_PIECE) if hangs else n
    begins = np.concatenate([np.arange(a, b, piece) for a, b in itertools.pairwise(log.bounds)])
    return AxisLog(
        log.u, log.target, np.arange(n) >= 0, np.append(begins, n), log.target[begins], log.y[begins] * hangs, log.dt,
        knots, hangs=hangs,
    )  # fmt: skip


def shooting_log(log: View, seconds: float, knots: Array, *, hangs: bool) -> AxisLog:
    """A logged position in pieces of so many seconds, each of `FEWEST_SHOT` samples at least, for multiple shooting."""
    piece = max(round(seconds / log.dt), FEWEST_SHOT)
    ends = log.bounds.tolist()
    begins = np.concatenate(
        [np.linspace(a, b, max((b - a) // piece, 1) + 1)[:-1].astype(int) for a, b in itertools.pairwise(ends)]
    )
    return AxisLog(
        log.u, log.y, np.ones(log.u.size, dtype=bool), np.append(begins, log.u.size), log.target[begins], log.y[begins],
        log.dt, knots, of_position=True, hangs=hangs,
    )  # fmt: skip


def axis_residual(theta: Array, log: View, knots: Array, *, hangs: bool) -> Array:
    """What the axis leaves of a record in SI: of a position in pieces, each with its own state; else of one run."""
    if log.logged == "position":
        pieces = settled(theta, shooting_log(log, PIECE, knots, hangs=hangs))
        return pieces.target - free_run(theta, pieces)
    return log.target - free_run(theta, axis_log(log, knots, hangs=hangs))


def axis_theta(model: AxisModel) -> tuple[Array, Array, bool]:
    """The kernel's parameters of an axis that `axis_fit` made, its knots, and whether it hangs."""
    p = model.parameters
    hinges = [t for t in model.law.terms if isinstance(t, SpeedHinge)]
    gravity = [e for e in model.effects if isinstance(e, GravityImbalance)]
    forces = sine_and_cosine(gravity[0]) if gravity else (0.0, 0.0)
    theta = [model.inertia, p["viscous"], p["coulomb"], model.effects[0].magnitude, *forces]
    return np.array(theta + [t.magnitude for t in hinges]), np.array([t.knot for t in hinges]), bool(gravity)


def gravity_of(sine: float, cosine: float) -> GravityImbalance:
    """k1 sin q + k2 cos q as A cos(q + phi)."""
    return GravityImbalance(float(np.hypot(sine, cosine)), phase=float(np.arctan2(-sine, cosine)))


def sine_and_cosine(gravity: GravityImbalance) -> tuple[float, float]:
    """The reverse of `gravity_of`."""
    return -gravity.amplitude * np.sin(gravity.phase), gravity.amplitude * np.cos(gravity.phase)
