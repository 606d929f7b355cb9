"""How much of a position is the encoder's noise, and the cut-off at which the acceleration is not.

Differentiated twice, white noise of variance s^2 at the rate fs leaves an acceleration of variance

    2 s^2 / fs  int (A(f) D(f))^2 df,    A the zero-phase filter, D the second central difference,

which grows with the fifth power of the cut-off.  In least squares it makes the inertia too small by
its share of the acceleration's variance, however long the record.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from whsklearn.filtering.records import motion, zero_phase
from whsklearn.logs.lattice import lattice

WIDEST = 0.1  # of the sampling rate: beyond it the central difference is not a derivative
# Share of noise in the acceleration's variance.  It makes the inertia too small by as much, and that would allow 1e-4;
# but it also grows with the square of the frequency, and where it outweighs the torque's own noise near the cut-off the
# standard errors, which take the residual for white, come out too large: `benchmarks/encoder.py` held 99 % at 1e-4.
TOLERATED = 1e-6
KEPT = 0.9  # of the acceleration's variance passes at least, whatever its noise: a lower cut-off bends the friction
HIGHEST_SHARE = 1e-4  # of noise, where the motion asks for more than `TOLERATED`
STEPS_PER_DECADE = 12
FEWEST_PERIODS = 8.0  # of the cut-off in a record, at least


def encoder_noise(position: ArrayLike, sample_rate: float) -> float:
    """Standard deviation of the measurement noise of a position, in its unit.

    ``position`` is (n,), ``sample_rate`` in Hz. The noise is what it shows above a tenth of the sampling rate,
    where no axis moves, taken for white; on a lattice of step q at least q / sqrt(12), since a slow axis stays on one
    count for long and shows less.
    """
    q = np.asarray(position, dtype=float)
    cutoff = WIDEST * sample_rate
    left = q - zero_phase(q, sample_rate, cutoff)
    f = np.linspace(0.0, 0.5, 512)
    share = np.mean((1.0 - _amplitude(f, WIDEST, 4)) ** 2)
    seen = 1.4826 * float(np.median(np.abs(left))) / np.sqrt(share)
    return max(seen, lattice(q) / np.sqrt(12.0))


def motion_cutoff(position: ArrayLike, sample_rate: float, order: int = 4) -> float:
    """Cut-off, in Hz, that a position's own noise allows.

    The highest at which noise makes up no more than `TOLERATED` of the acceleration's variance; a higher one, up to
    `HIGHEST_SHARE`, where less than `KEPT` of the acceleration would pass.  Where none is low enough, the one with the
    least share; a tenth of the sampling rate without noise.

    ``position``, ``sample_rate``: as for `encoder_noise`. ``order``: of the zero-phase Butterworth filter.
    """
    q = np.asarray(position, dtype=float)
    noise = encoder_noise(q, sample_rate)
    widest = WIDEST * sample_rate
    lowest = min(FEWEST_PERIODS * sample_rate / q.size, widest)
    count = 1 + int(STEPS_PER_DECADE * np.log10(widest / lowest))
    cutoffs = widest / 10.0 ** (np.arange(count) / STEPS_PER_DECADE)
    best, least, full = widest, np.inf, np.inf
    for cutoff in cutoffs:
        edge = min(int(sample_rate / cutoff), q.size // 4)
        moved = motion(q, sample_rate, cutoff, order).acceleration[edge : q.size - edge]
        of_noise = noise**2 * _acceleration_gain(sample_rate, cutoff, order)
        of_motion = float(np.var(moved)) - of_noise
        share = of_noise / max(of_motion, 1e-3 * of_noise, 1e-300)
        if of_motion < KEPT * full and least <= HIGHEST_SHARE:
            return best
        if share <= TOLERATED:
            return float(cutoff)
        if share <= HIGHEST_SHARE and full == np.inf:
            full = of_motion
        if share < least:
            best, least = float(cutoff), share
    return best


def _amplitude(f: NDArray[np.float64], cutoff: float, order: int) -> NDArray[np.float64]:
    """Of the Butterworth filter run both ways; frequencies in units of the sampling rate."""
    return 1.0 / (1.0 + (np.tan(np.pi * np.minimum(f, 0.4999)) / np.tan(np.pi * cutoff)) ** (2 * order))


def _acceleration_gain(sample_rate: float, cutoff: float, order: int) -> float:
    """Variance of the acceleration for white noise of variance one."""
    f = np.linspace(0.0, min(4.0 * cutoff / sample_rate, 0.5), 512)
    angle = 2.0 * np.pi * f
    twice = ((8.0 * np.sin(angle) - np.sin(2.0 * angle)) / 6.0 * sample_rate) ** 2  # of `central_difference`
    return float(2.0 * np.trapezoid((_amplitude(f, cutoff / sample_rate, order) * twice) ** 2, f))
