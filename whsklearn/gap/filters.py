"""The filter from innovations to missing torque, and whitening.

Missing torque = J (p^2 + l1 p + l2) e (`whsklearn.systems._servo_kernel`); the derivatives are those of a Gaussian,
so the filter is smooth and symmetric (no phase), and passes the frequencies at which encoder noise, which grows
with the square of frequency, is still small compared with the drive.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from whsklearn.filtering.records import CUTOFF_SIGMA, HIGHEST_CUTOFF, decimation, filtered, gaussian_derivatives
from whsklearn.gap.record import Array
from whsklearn.validation.residuals import whiteness_test

WHITENING = 12  # order of the autoregression that whitens the errors of an axis


@dataclass(frozen=True)
class ResidualFilter:
    """The filter, its rate and the samples to which it is applied.

    >>> ResidualFilter(np.full(4, 0.25), every=2, gains=(0.0, 0.0), cutoff=10.0).noise_gain
    0.5
    """

    taps: Array  # impulse response from e to missing torque
    every: int  # decimation
    gains: tuple[float, float]  # corrections of position and velocity by one innovation
    cutoff: float  # Hz

    def torque(self, innovation: Array) -> Array:
        """Missing torque, decimated; shape (n // every,)."""
        return filtered(innovation, self.taps, self.every)

    @property
    def noise_gain(self) -> float:
        """Standard deviation of missing torque for white position noise of one unit."""
        return float(np.sqrt(np.sum(self.taps**2)))

    @property
    def half_width(self) -> int:
        """Samples on either side that an output depends on."""
        return self.taps.size // 2


def observer_gains(tracking: float, dt: float) -> tuple[float, float]:
    """Corrections of position and velocity by one innovation, critically damped at the bandwidth ``tracking`` (Hz)."""
    w = 2 * np.pi * tracking
    return 2 * w * dt, w * w * dt


def residual_filter(
    dt: float, inertia: float, noise: float, torque: float, *, tracking: float, goal: float
) -> ResidualFilter:
    """The filter whose floor from white position noise is ``goal`` times the rms drive, between 4 and 40 Hz.

    ``dt``, ``inertia``, ``noise``, ``torque``: sampling time, inertia, standard deviation of position noise, rms drive.
    ``tracking``: bandwidth of the observer, Hz.
    """
    gains = observer_gains(tracking, dt)
    highest = min(30.0, HIGHEST_CUTOFF / dt)
    for cutoff in np.geomspace(highest, min(3.0, 0.5 * highest), 16):
        g, first, second = gaussian_derivatives(CUTOFF_SIGMA / (2 * np.pi * cutoff), dt)
        taps = inertia * (second + gains[0] / dt * first + gains[1] / dt * g)
        found = ResidualFilter(taps, decimation(float(cutoff), dt), gains, float(cutoff))
        if found.noise_gain * noise <= goal * torque:
            break
    return found


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

    return np.asarray(lfilter(ar, [1.0], d, axis=0))


def whiteness(e: Array, name: str, n_params: int = 0) -> dict[str, Any]:
    """Ljung and Box's test of a whitened residual, as a row of the report; ``n_params`` as for `whiteness_test`."""
    found = whiteness_test(e, n_params=n_params)
    return {"test": f"Ljung-Box, {found.lags.size} lags, {name}", "statistic": found.statistic,
            "p_value": found.p_value, "largest": float(np.abs(found.r).max()), "band": found.band}  # fmt: skip
