"""From innovations of position to missing torque: one fixed linear filter for model and measurement.

Missing torque = J (p^2 + l1 p + l2) e (see `axis_kernel`); the derivatives are those of a Gaussian,
so the filter is smooth, symmetric (no phase) and has the width where encoder noise, which grows
with the square of frequency, is still small against the drive.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]


@dataclass(frozen=True)
class Lens:
    """The filter, its rate and the samples it is used on.

    Attributes
    ----------
    taps : ndarray
        Impulse response from e to missing torque.
    smooth : ndarray
        Impulse response of the smoothing alone, for torque columns.
    every : int
        Decimation.
    gains : tuple of float
        Corrections of position and velocity by one innovation.
    cutoff : float
        Hz.
    """

    taps: Array
    smooth: Array
    every: int
    gains: tuple[float, float]
    cutoff: float
    dt: float

    def torque(self, innovation: Array) -> Array:
        """Missing torque, decimated; shape (n // every,)."""
        return _apply(innovation, self.taps, self.every)

    def blur(self, torque: Array) -> Array:
        """A torque seen through the same smoothing, decimated; shape (n // every, ...)."""
        return _apply(torque, self.smooth, self.every)

    def pick(self, signal: Array) -> Array:
        """The samples that the decimation keeps."""
        return signal[:: self.every][: -(-signal.shape[0] // self.every)]

    @property
    def noise_gain(self) -> float:
        """Standard deviation of missing torque for white position noise of one unit."""
        return float(np.sqrt(np.sum(self.taps**2)))

    @property
    def half_width(self) -> int:
        """Samples either side that an output draws on."""
        return self.taps.size // 2


def _apply(x: Array, taps: Array, every: int) -> Array:
    from scipy.signal import upfirdn

    # full[m] = sum_j taps[j] padded[m - j]; output i wants m = i * every + taps.size - 1, and
    # upfirdn keeps the multiples of ``every``, so the front is padded up to one
    half = taps.size // 2
    extra = -(taps.size - 1) % every
    edges = [(half, half)] + [(0, 0)] * (x.ndim - 1)
    front = [(extra, 0)] + [(0, 0)] * (x.ndim - 1)
    padded = np.pad(np.pad(x, edges, mode="edge"), front)
    skip = (taps.size - 1 + extra) // every
    return upfirdn(taps, padded, 1, every, axis=0)[skip : skip + -(-x.shape[0] // every)]


def make_lens(dt: float, inertia: float, noise: float, torque: float, *, tracking: float, goal: float = 0.004) -> Lens:
    """The lens whose floor from white position noise is ``goal`` times the rms drive, within 4 and 40 Hz.

    Parameters
    ----------
    dt, inertia, noise, torque : float
        Sampling time, inertia, standard deviation of position noise, rms drive.
    tracking : float
        Bandwidth of the observer, Hz.
    """
    w = 2 * np.pi * tracking
    gains = (2 * w * dt, w * w * dt)
    best = None
    highest = min(30.0, 0.08 / dt)
    for cutoff in np.geomspace(highest, min(3.0, 0.5 * highest), 16):
        sigma = 0.833 / (2 * np.pi * cutoff)
        half = int(np.ceil(4.5 * sigma / dt))
        t = np.arange(-half, half + 1) * dt
        g = np.exp(-0.5 * (t / sigma) ** 2)
        g /= g.sum()
        first = -t / sigma**2 * g
        second = (t**2 / sigma**4 - 1 / sigma**2) * g
        second -= g * second.sum()
        taps = inertia * (second + gains[0] / dt * first + gains[1] / dt * g)
        every = max(1, int(1.0 / (5.0 * cutoff * dt)))
        best = Lens(taps, g, every, gains, float(cutoff), dt)
        if best.noise_gain * noise <= goal * torque:
            break
    assert best is not None
    return best


def autoregression(x: Array, order: int, white: float) -> Array:
    """Coefficients [1, a1, ...] that whiten ``x`` (Yule-Walker) plus a white part of variance ``white``."""
    x = x - x.mean()
    n = x.size
    return solve_whitening(np.array([x[: n - i] @ x[i:] for i in range(order + 1)]) / n, white)


def solve_whitening(covariance: Array, white: float) -> Array:
    """The whitening polynomial of an autocovariance with a white part added (Yule-Walker)."""
    from scipy.linalg import solve_toeplitz

    r = covariance.copy()
    r[0] = r[0] * 1.0001 + white
    return np.concatenate([[1.0], solve_toeplitz(r[:-1], -r[1:])])


def whiten(d: Array, ar: Array) -> Array:
    """``d`` filtered by the whitening polynomial, along the first axis."""
    from scipy.signal import lfilter

    return lfilter(ar, [1.0], d, axis=0)
