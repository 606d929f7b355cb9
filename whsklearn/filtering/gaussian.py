"""Smoothing and differentiation by one Gaussian: kernels, and how a signal goes through them without phase."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]

# sigma at which a Gaussian is cut: at 4 a second derivative does not sum to zero and is a phantom spring of -24 1/s2 at
# 1 kHz
HALF_WIDTH = 6.0
# 2 pi fc sigma of a Gaussian that is 3 dB down at fc
CUTOFF_SIGMA = 0.833
HIGHEST_CUTOFF = 0.08  # share of the sampling rate: above it the kernels of the derivatives have too few samples
PER_CUTOFF = 5.0  # samples per period of the cut-off that decimation keeps


def gaussian_derivatives(sigma: float, dt: float) -> tuple[Array, Array, Array]:
    """Kernels that smooth, differentiate once and differentiate twice, exact on polynomials up to degree two.

    ``sigma``: width of the Gaussian in s. ``dt``: sampling time in s. Returns ``g``, ``g1``, ``g2`` (2 m + 1,): for
    convolution: sum g = 1; sum g1 = 0 and -sum k dt g1 = 1; sum g2 = 0 and sum (k dt)^2 g2 / 2 = 1.
    """
    half = max(3, int(np.ceil(HALF_WIDTH * sigma / dt)))
    t = np.arange(-half, half + 1) * dt
    g = np.exp(-0.5 * (t / sigma) ** 2)
    g /= g.sum()
    g1 = -t * g
    g1 /= -float(t @ g1)
    g2 = (t**2 / sigma**2 - 1.0) * g
    g2 -= g * g2.sum()
    g2 /= 0.5 * float((t**2) @ g2)
    return g, g1, g2


def decimation(cutoff: float, dt: float) -> int:
    """Samples from one that is kept to the next behind a Gaussian with a cut-off (Hz)."""
    return max(1, int(1.0 / (PER_CUTOFF * cutoff * dt)))


def filtered(x: Array, taps: Array, every: int) -> Array:
    """``x`` (n, ...) through a symmetric kernel without phase, decimated; edges repeat the first and last sample."""
    from scipy.signal import upfirdn

    # full[m] = sum_j taps[j] padded[m - j]; output i wants m = i * every + taps.size - 1, and
    # upfirdn keeps the multiples of ``every``, so the front is padded up to one
    x, half = np.asarray(x), taps.size // 2
    extra = -(taps.size - 1) % every
    padded = np.zeros((extra + half + x.shape[0] + half, *x.shape[1:]))
    padded[extra : extra + half], padded[padded.shape[0] - half :] = x[0], x[-1]
    padded[extra + half : padded.shape[0] - half] = x
    skip = (taps.size - 1 + extra) // every
    return upfirdn(taps, padded, 1, every, axis=0)[skip : skip + -(-x.shape[0] // every)]
