"""What noise does in a chain: errors several samples ahead, the floor that a spectrum gives, rounded readings."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from whsklearn.gap.plants import chain_evidence as rules
from whsklearn.gap.plants.chain_model import ChainModel, Setting, raw_errors, stable_output
from whsklearn.gap.record import lattice, rms

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

BANDS = 16  # of a spectrum, of which the quietest is taken
RESPONSE = 400  # samples of L2's response to noise


def response_behind(s: Setting, m: ChainModel, n: int) -> Array:
    """Response of L2's denominator to noise of (2); shape (n,)."""
    nd = int(s.dims[3])
    d = stable_output(s, m.theta)[m.theta.size - nd :]
    h = np.zeros(n)
    h[0] = 1.0
    for i in range(1, n):
        h[i] = -sum(d[j] * h[i - 1 - j] for j in range(min(nd, i)))
    return h


def gain_behind(s: Setting, m: ChainModel, colour: Array) -> float:
    """Rms of the output per rms of white noise that passes 1 / colour and L2's denominator."""
    from scipy.signal import lfilter

    return float(np.sqrt(np.sum(lfilter([1.0], colour, response_behind(s, m, RESPONSE)) ** 2)))


def ahead_errors(s: Setting, m: ChainModel, horizon: int) -> Array:
    """Prediction errors ``horizon`` samples ahead, sum_i h_i e(t-i) with h the response of L2's denominator."""
    e = raw_errors(s, m)
    return np.convolve(e, response_behind(s, m, horizon))[: e.size]


def quietest_band(y: Array) -> float:
    """Rms of white noise at the level of the quietest sixteenth of the output's spectrum: no floor lies above it.

    Signal only adds to a spectrum, so where the input or the blocks leave a band empty this is the noise of the
    readings itself; with an input that fills every band it says little, and the models' errors are the lower bound.

    Examples
    --------
    >>> t = np.arange(20000)
    >>> noise = 1e-3 * np.random.default_rng(0).normal(size=t.size)
    >>> round(1e3 * quietest_band(np.sin(0.05 * t) + noise), 1)
    0.9
    """
    from scipy.signal import welch

    density = welch(y, 1.0, nperseg=min(512, y.size // 4))[1][1:]
    return math.sqrt(0.5 * min(float(part.mean()) for part in np.array_split(density, BANDS)))


def coarse_grid(s: Setting, m: ChainModel) -> float:
    """Step of the grid on which the readings lie, if rounding is a good part of what is left; 0 otherwise."""
    step = lattice(s.y)
    if not step or step / math.sqrt(12.0) < rules.COARSE_READING * rms(s.y):
        return 0.0
    nd = int(s.dims[3])
    gain = 1.0 + float(np.sum(m.theta[m.theta.size - nd :] ** 2))
    e = raw_errors(s, m)[s.fit]
    limit = rules.WRONG_SIDE * rules.MAD * float(np.median(np.abs(e))) + 1e-300
    return step if gain * step**2 / 12.0 > rules.ROUNDING * float(np.mean(np.clip(e, -limit, limit) ** 2)) else 0.0
