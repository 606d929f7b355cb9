"""From position to motion, for records: filters run forwards and backwards, so nothing is shifted in time.

Streams, which have no future, are served by `whsklearn.filtering.streams`.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

_DECIMATOR_ORDER = 8
_DECIMATOR_RIPPLE = 0.05  # dB
_DECIMATOR_EDGE = 0.8  # of the new Nyquist frequency


class Motion(NamedTuple):
    """Position, velocity and acceleration, each of shape (n,), in the unit of the position, per s and per s2.

    Attributes
    ----------
    position, velocity, acceleration : ndarray of shape (n,)

    References
    ----------
    Swevers, Verdonck and De Schutter 2007, IEEE Control Systems Magazine 27(5), 58-71, on derivatives of encoder
    readings.

    Examples
    --------
    >>> import numpy as np
    >>> from whsklearn.filtering import Motion, motion
    >>> q = 0.5 * np.sin(2 * np.arange(2000) / 1000)
    >>> m = motion(q, sample_rate=1000, cutoff=50)
    >>> isinstance(m, Motion), round(float(m.velocity[500]), 2)  # 0.5 x 2 x cos(1)
    (True, 0.54)
    """

    position: NDArray[np.float64]
    velocity: NDArray[np.float64]
    acceleration: NDArray[np.float64]


def zero_phase(x: ArrayLike, sample_rate: float, cutoff: float, order: int = 4) -> NDArray[np.float64]:
    """Low-pass a record without shifting it: a Butterworth filter run forwards and backwards.

    Parameters
    ----------
    x : array-like of shape (n,) or (n, k)
        Signals, one a column.
    sample_rate, cutoff : float
        In Hz; at the cutoff the amplitude is halved (the filter acts twice).
    order : int, default=4
        Order of the filter in one direction.

    Returns
    -------
    ndarray of the shape of x

    Raises
    ------
    ValueError
        If the cutoff is not between 0 and half the sampling rate, or the record is too short.

    Notes
    -----
    The reference method of Janot, Gautier, Brunot 2019 (EMPS) has order 4 and 100 Hz at 1 kHz.

    Examples
    --------
    >>> import numpy as np
    >>> t = np.arange(1000) / 1000
    >>> slow = np.sin(2 * np.pi * 3 * t)
    >>> noisy = slow + np.sin(2 * np.pi * 400 * t)
    >>> float(np.abs(zero_phase(noisy, 1000, 50) - slow)[100:-100].max()) < 1e-3
    True
    """
    from scipy.signal import filtfilt

    x = np.asarray(x, dtype=float)
    if not 0 < cutoff < sample_rate / 2:
        raise ValueError(
            f"cutoff is {cutoff:g} Hz, expected one between 0 and {sample_rate / 2:g} Hz, half the sampling rate."
        )
    pad = 3 * order
    if len(x) <= pad:
        raise ValueError(f"The record has {len(x)} samples, a zero-phase filter of order {order} needs {pad + 1}.")
    b, a = _butterworth(order, cutoff / (sample_rate / 2))
    return filtfilt(b, a, x, axis=0, padlen=pad)


@lru_cache(maxsize=64)
def _butterworth(order: int, share: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Numerator and denominator; the cut-off is a share of half the rate.  The design takes as long as a filtering."""
    from scipy.signal import butter

    b, a = butter(order, share)
    return b, a


def central_difference(x: ArrayLike, sample_rate: float) -> NDArray[np.float64]:
    """(8 (x(t+1) - x(t-1)) - x(t+2) + x(t-2)) fs / 12, of lower order at the ends; per second, along the first axis.

    Parameters
    ----------
    x : array-like of shape (n, ...)
    sample_rate : float
        In Hz.

    Notes
    -----
    Of fourth order: with (x(t+1) - x(t-1)) fs / 2 an acceleration at a hundredth of the sampling rate comes out
    0.13 % too small, and the inertia too large by as much, which at 500 Hz is more than its standard error.

    Examples
    --------
    >>> t = np.arange(6.0)
    >>> central_difference(t**4, 1.0)[2:-2]
    array([ 32., 108.])
    """
    x = np.asarray(x, dtype=float)
    slope = np.gradient(x, 1.0 / sample_rate, axis=0)
    if len(x) > 4:
        slope[2:-2] = (8.0 * (x[3:-1] - x[1:-3]) - x[4:] + x[:-4]) * (sample_rate / 12.0)
    return slope


def motion(position: ArrayLike, sample_rate: float, cutoff: float, order: int = 4) -> Motion:
    """Position, velocity and acceleration of a record: zero-phase filter, then central differences twice.

    Parameters
    ----------
    position : array-like of shape (n,)
        Measured position.
    sample_rate, cutoff, order
        As for `zero_phase`.

    Returns
    -------
    Motion
        Aligned in time with the position.

    Examples
    --------
    >>> import numpy as np
    >>> t = np.arange(2000) / 1000
    >>> m = motion(np.sin(2 * t), 1000, 50)
    >>> bool(np.allclose(m.acceleration[200:-200], -4 * np.sin(2 * t)[200:-200], atol=0.01))
    True
    """
    q = zero_phase(position, sample_rate, cutoff, order)
    v = central_difference(q, sample_rate)
    return Motion(q, v, central_difference(v, sample_rate))


def velocity_noise(position: ArrayLike, sample_rate: float, cutoff: float, order: int = 4) -> float:
    """Standard deviation of the noise in the velocity that `motion` gives, per s.

    White noise of the position is seen above the cutoff, where no motion is; what of it passes into the velocity
    follows from the filter's impulse response. A lattice of step q counts as noise of variance q^2 / 12.

    Parameters
    ----------
    position, sample_rate, cutoff, order
        As for `motion`.

    Examples
    --------
    >>> import numpy as np
    >>> t = np.arange(5000) / 1000
    >>> noise = 1e-4 * np.random.default_rng(0).normal(size=5000)
    >>> error = motion(np.sin(t) + noise, 1000, 50).velocity - np.cos(t)
    >>> bool(abs(velocity_noise(np.sin(t) + noise, 1000, 50) / error.std() - 1) < 0.1)
    True
    """
    q = np.asarray(position, dtype=float)
    left = q - zero_phase(q, sample_rate, cutoff, order)
    impulse = np.zeros(max(int(40 * sample_rate / cutoff), 200))
    impulse[impulse.size // 2] = 1.0
    answer = zero_phase(impulse, sample_rate, cutoff, order)
    above = float(np.sqrt(np.sum((impulse - answer) ** 2)))
    into_velocity = float(np.sqrt(np.sum(central_difference(answer, sample_rate) ** 2)))
    return 1.4826 * float(np.median(np.abs(left))) / above * into_velocity


def decimate(x: ArrayLike, factor: int) -> NDArray[np.float64]:
    """Low-pass and keep every ``factor``-th row: the parallel filter of a regression.

    Filtering target and columns alike takes out what lies above the motion's band and leaves the
    parameters where they are (Gautier 1997); the last row is always kept.

    Parameters
    ----------
    x : array-like of shape (n,) or (n, k)
        Signals, one a column.
    factor : int
        1 leaves the rows as they are.

    Returns
    -------
    ndarray of shape (ceil(n / factor), ...)

    Raises
    ------
    ValueError
        If the factor is below 1 or the record too short for the filter.

    Notes
    -----
    Chebyshev filter of type I, order 8, 0.05 dB ripple, edge at 0.8 of the new Nyquist frequency, forwards
    and backwards (IEEE, Programs for Digital Signal Processing, 1979, ch. 8).

    Examples
    --------
    >>> import numpy as np
    >>> decimate(np.ones((100, 2)), 10).shape
    (10, 2)
    """
    from scipy.signal import cheby1, filtfilt

    x = np.asarray(x, dtype=float)
    if factor != int(factor) or factor < 1:
        raise ValueError(f"factor is {factor}, expected a whole number of 1 or more.")
    factor = int(factor)
    if factor == 1:
        return x.copy()
    pad = 3 * _DECIMATOR_ORDER
    if len(x) <= pad:
        raise ValueError(f"The record has {len(x)} rows, decimation needs {pad + 1}; give a longer one or decimate=1.")
    b, a = cheby1(_DECIMATOR_ORDER, _DECIMATOR_RIPPLE, _DECIMATOR_EDGE / factor)
    return filtfilt(b, a, x, axis=0, padlen=pad)[(len(x) - 1) % factor :: factor]
