"""How far a measured output may lie from the predicted one, because of noise and of uncertain parameters."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from whsklearn.estimators import _model as wh

Array = NDArray[np.float64]

DRAWS = 100  # a standard deviation from so many draws is known to 7 %
SEED = 0  # the same draws for every call, so that predicting twice gives the same


def rows_spread(rows: Array, covariance: Array, noise_variance: float) -> Array:
    """sqrt(phi' P phi + sigma^2) of each row, shape (n,); infinite where sigma or P is not known."""
    variance = np.einsum("ti,ij,tj->t", rows, covariance, rows) + noise_variance
    return _known(np.sqrt(np.maximum(variance, 0.0)))


def draws(natural: Array, covariance: Array, s: wh.Structure, u: Array, restart: NDArray[np.bool_]) -> Array:
    """Standard deviation of the free runs of parameters drawn from N(natural, covariance), shape (n,).

    Draws are used, not sensitivities: where the law jumps, a free run is not a smooth function of its parameters.
    """
    if not np.isfinite(covariance).all():
        return np.full(len(u), np.inf)
    scale = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    values, vectors = np.linalg.eigh(covariance / np.outer(scale, scale))
    root = scale[:, None] * vectors * np.sqrt(np.maximum(values, 0.0))
    shifts = np.random.default_rng(SEED).standard_normal((DRAWS, natural.size)) @ root.T
    mean, squares = np.zeros(len(u)), np.zeros(len(u))
    for k, shift in enumerate(shifts, start=1):  # Welford 1962: a run at a time, whatever the record's length
        y = np.clip(np.nan_to_num(wh.free_run(natural + shift, s, u, restart), nan=1e30), -1e30, 1e30)
        away = y - mean
        mean += away / k
        squares += away * (y - mean)
    return np.sqrt(squares / (DRAWS - 1))


def noise_spread(variance: float, denominator: Array, restart: NDArray[np.bool_]) -> Array:
    """Standard deviation of white noise of this variance behind 1/(1 + denominator), from rest, shape (n,)."""
    from scipy.signal import lfilter

    begins = np.append(np.flatnonzero(restart), restart.size)
    lengths = np.diff(begins)
    longest = int(lengths.max(initial=0))
    impulse = np.zeros(longest)
    impulse[:1] = 1.0
    power = np.cumsum(lfilter([1.0], np.append(1.0, denominator), impulse) ** 2)
    return _known(np.sqrt(variance * np.concatenate([power[:n] for n in lengths] or [power])))


def _known(std: Array) -> Array:
    return np.where(np.isfinite(std), std, np.inf)
