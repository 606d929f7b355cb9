"""Choose between several fitted chains on held-out data."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.stats import chi2

from whsklearn.recursion.batch.simulation_error import Fitted, FittedChain, run

if TYPE_CHECKING:
    from whsklearn.recursion.batch.best_linear import IOData

SIMPLER = 1.03  # a simpler model has at most 3 % more error on held-out data than the best
BATCHES, DEVIATIONS = 60, 2.0  # and its error exceeds the best by at most two standard errors of the difference
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

    Parameters
    ----------
    candidates : list of Fitted
        Fits to the same data, the simplest first.
    later : IOData
        The record, in which only the samples that the fits have not seen count.
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
