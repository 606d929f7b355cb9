"""Find the poles that a chain lacks: a score test of its free-run error, over a grid of locations in both blocks.

A pole that is cancelled by a zero changes nothing.  The sensitivities at that location give the decrease of the sum of
squares if the two were free to move, before anything is refitted (the Lagrange multiplier test: Godfrey 1988,
Misspecification Tests in Econometrics, ch. 1).  The test shows where a chain has too few poles or has them in the wrong
place, so the chain can grow downhill; random starts would have to hit all poles at once.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.linalg import orth

from whsklearn.effects.base import Array
from whsklearn.recursion.batch.block_split import reflections
from whsklearn.recursion.batch.linear_filter import delayed_rows, filter_rows
from whsklearn.recursion.batch.simulation_error import Fitted, FittedChain, refine, run, sensitivities

if TYPE_CHECKING:
    from whsklearn.recursion.batch.best_linear import IOData


REAL = (-0.95, -0.85, -0.6, -0.3, 0.3, 0.6, 0.85, 0.95, 0.99)
RADII, ANGLES = (0.5, 0.75, 0.9, 0.96, 0.99), np.pi * (np.arange(16) + 0.5) / 16  # a fit finds the exact location
UNTOLD = 1e-5  # of the largest singular value; along smaller ones the parameters cannot be distinguished
CHANCE = 0.01  # probability of such a decrease at the best location if nothing is missing and the error is white


class Promise(NamedTuple):
    """Decrease of the sum of squares, to first order, and the chain with the pole and the zero that cancels it."""

    gain: float
    chain: FittedChain


def denominators() -> list[Array]:
    """The grid: real poles alone, complex ones in pairs."""
    return [np.array([1.0, -r]) for r in REAL] + [
        np.array([1.0, -2.0 * r * np.cos(w), r * r]) for r in RADII for w in ANGLES
    ]


def missing_poles(fitted: Fitted, data: IOData, largest: int, kept: int) -> list[Promise]:
    """The most promising locations in each block, best first; none if the residual looks like noise.

    ``fitted``: a chain at a minimum for these data. ``data``: the record. ``largest``: largest number of poles of a
    block. ``kept``: number of locations returned for each block.
    """
    chain = fitted.chain
    signals = run(chain, data)
    slopes = sensitivities(chain, data)[1] * data.scale
    slopes /= np.maximum(np.linalg.norm(slopes, axis=1), 1e-300)[:, None]
    basis = orth(slopes.T, rcond=UNTOLD).T
    grid = denominators()
    # twice a chi-squared of two degrees of freedom exceeds this once in 1/CHANCE grids
    least = 2.0 * np.log(2 * len(grid) / CHANCE) * fitted.cost / max(int(data.counts.sum()), 1)
    found: tuple[list[Promise], list[Promise]] = ([], [])
    for a in grid:
        for block, signal in enumerate((signals.x, signals.y)):
            if (chain.a1, chain.a2)[block].size + a.size - 2 > largest:
                continue
            rows = delayed_rows(filter_rows(np.ones(1), a, signal[None, :], data.bounds)[0], a.size, data.bounds)[1:]
            if block == 0:
                rows = filter_rows(chain.b2, chain.a2, rows * signals.by_x, data.bounds)
            gain = _explained(rows * data.scale, basis, fitted.error)
            if gain > least:
                found[block].append(Promise(gain, with_pole(chain, block, a)))
    best = [p for of_block in found for p in sorted(of_block, key=lambda p: -p.gain)[:kept]]
    return sorted(best, key=lambda p: -p.gain)


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
SHORT, TRIED, REFINED = 5_000, 14, 40  # samples and iterations of each trial, iterations of the best


def improved(fitted: Fitted, data: IOData) -> Fitted:
    """Leave a wrong minimum: add poles where the error shows that some are missing, and reflect zeros.

    Zeros are reflected at the unit circle.  One round of moves is always made; there is no further round once the error
    shows that no pole is missing.

    ``fitted``: a chain with one input, at a minimum for these data. ``data``: the record.
    """
    short = data.head(SHORT)
    for i in range(ROUNDS):
        chain = fitted.chain
        trials = [p.chain for p in missing_poles(fitted, data, LARGEST, PLACES)]
        if i and not trials:
            break
        trials += [chain._replace(b1=b[None, :]) for b in reflections(chain.b1[0])]
        trials += [chain._replace(b2=b) for b in reflections(chain.b2)]
        if not trials:
            break
        best = min((refine(t, short, TRIED) for t in trials), key=lambda f: f.cost)
        refitted = refine(best.chain, data, REFINED)
        if not refitted.cost < (1.0 - WORTH) * fitted.cost:
            break
        fitted = refitted
    return fitted
