"""What the alarm bets on: cells of whitened innovations, and the odds of each under a wider or shifted law."""

from __future__ import annotations

import functools

import numpy as np
from numpy.typing import NDArray

# Cells by their tail probability: fine in the tails, where a change shows first.
_TAIL = np.array([0.001, 0.004, 0.012, 0.03, 0.07, 0.14, 0.24, 0.36])
LEVELS = np.r_[_TAIL, 0.5, 1 - _TAIL[::-1]]
_BETS = ((0.0, 1.2), (0.0, 1.6), (0.0, 3.0), (0.25, 1.0), (-0.25, 1.0), (1.0, 1.0), (-1.0, 1.0))  # shift, spread
_LARGEST_TILT = 10.0  # so that a burst of a few outliers, such as a sign() that flips, is no alarm
N_BETS = len(_BETS)


@functools.cache
def tilts() -> NDArray[np.float64]:
    """f_k of each cell: what a normal law with the bet's shift and spread puts there, over the nominal probability."""
    from scipy.special import ndtr, ndtri

    edges = np.r_[-np.inf, ndtri(LEVELS), np.inf]
    odds = np.array([np.diff(ndtr((edges - m) / s)) / np.diff(ndtr(edges)) for m, s in _BETS])
    return np.minimum(odds, _LARGEST_TILT)
