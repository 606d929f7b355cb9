"""Update a simulation-error fit by one block of a stream; everything before the block is a quadratic form.

theta minimises |e_block(theta)|^2 + (theta - theta_0)' R (theta - theta_0) in a few Gauss-Newton steps, each
accepted only if this cost falls, and R grows by J'J of the block.  With surplus poles the same recursion
diverges sample by sample, but not block by block.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from whsklearn.effects.base import Array, Integers
from whsklearn.recursion.batch.best_linear import IOData
from whsklearn.recursion.batch.levenberg_marquardt import damped_step
from whsklearn.recursion.batch.simulation_error import FittedChain, orthonormal, run, sensitivities

STEPS = 3
DAMPING = (1e-9, 1e-4, 1e-2, 1.0)  # tried in turn until a step lowers the cost


class Coordinates(NamedTuple):
    """theta = (linear part, weights in an orthonormal basis); the ``held`` entries stay fixed."""

    basis: Array
    held: Integers

    @classmethod
    def of(cls, chain: FittedChain, data: IOData) -> Coordinates:
        """Choose a basis in which the law's columns on this record are orthonormal; b1[0] and b2[0] are held."""
        basis = orthonormal(run(chain, data).columns[:, data.counts])
        return cls(basis, np.array([0, chain.b1.size + chain.a1.size - 1]))

    def rows(self, chain: FittedChain, data: IOData) -> tuple[Array, Array]:
        """The error on the samples that count, and its sensitivities with the sign of dy."""
        y, rows = sensitivities(chain, data)
        n = chain.linear_part.size
        rows = np.vstack([rows[:n], self.basis @ rows[n:]]) * data.scale
        rows[self.held] = 0.0
        return (data.y - y) * data.scale, rows

    def moved(self, chain: FittedChain, step: Array) -> FittedChain:
        """The chain after a step of theta."""
        n = chain.linear_part.size
        return chain.moved(step[:n])._replace(weights=chain.weights + step[n:] @ self.basis)


def information_of(chain: FittedChain, data: IOData, at: Coordinates) -> Array:
    """J'J of a record."""
    rows = at.rows(chain, data)[1]
    return rows @ rows.T


def block_update(
    chain: FittedChain, information: Array, data: IOData, at: Coordinates
) -> tuple[FittedChain, Array, float]:
    """The chain after a block.

    ``chain``: the estimate so far.
    ``information`` (p, p): R.
    ``data``: the block, preceded by samples that do not count but determine the state.
    ``at``: coordinates of theta.
    Returns ``information`` (p, p).
    Returns ``loss``: sum of squared errors of the block before the update.
    """
    gone = np.zeros(len(information))
    error, rows = at.rows(chain, data)
    loss = cost = float(error @ error)
    for _ in range(STEPS):
        total = rows @ rows.T + information
        diagonal = np.diag(total)
        total[np.diag_indices_from(total)] = np.where(diagonal > 0, diagonal, 1.0)
        gradient = rows @ error - information @ gone
        for damping in DAMPING:
            step = damped_step(total, gradient, damping)
            trial = at.moved(chain, step)
            if not trial.stable:
                continue
            away = gone + step
            left = (data.y - run(trial, data).y) * data.scale
            new = float(left @ left + away @ information @ away)
            if new < cost:
                chain, gone, gain, cost = trial, away, 1 - new / cost, new
                error, rows = at.rows(chain, data)
                break
        else:
            break
        if gain < 1e-6:
            break
    return chain, information + rows @ rows.T, loss
