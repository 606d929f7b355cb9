"""From position to motion: zero-phase derivatives for records, derivatives of known delay for streams.

A record is filtered forwards and backwards, so nothing is shifted in time.  A stream has no
future: there a moving window is fitted by a polynomial and read in its middle, which costs half a
window of delay, the same at every frequency, and no other distortion of phase.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numba import njit

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

__all__ = [
    "Motion",
    "causal_delay",
    "causal_kernels",
    "causal_motion",
    "causal_window",
    "central_difference",
    "decimate",
    "motion",
    "zero_phase",
]

_DECIMATOR_ORDER = 8
_DECIMATOR_RIPPLE = 0.05  # dB
_DECIMATOR_EDGE = 0.8  # of the new Nyquist frequency


class Motion(NamedTuple):
    """Position, velocity and acceleration, each of shape (n,), in the unit of the position, per s and per s2."""

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
    from scipy.signal import butter, filtfilt

    x = np.asarray(x, dtype=float)
    if not 0 < cutoff < sample_rate / 2:
        raise ValueError(
            f"cutoff is {cutoff:g} Hz, expected one between 0 and {sample_rate / 2:g} Hz, half the sampling rate."
        )
    pad = 3 * order
    if len(x) <= pad:
        raise ValueError(f"The record has {len(x)} samples, a zero-phase filter of order {order} needs {pad + 1}.")
    b, a = butter(order, cutoff / (sample_rate / 2))
    return filtfilt(b, a, x, axis=0, padlen=pad)


def central_difference(x: ArrayLike, sample_rate: float) -> NDArray[np.float64]:
    """(x(t+1) - x(t-1)) fs / 2, one-sided at the two ends; per second, along the first axis.

    Examples
    --------
    >>> central_difference([0.0, 1.0, 4.0, 9.0], 1.0)
    array([1., 2., 4., 5.])
    """
    return np.gradient(np.asarray(x, dtype=float), 1.0 / sample_rate, axis=0)


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


def causal_window(sample_rate: float, cutoff: float, degree: int = 3) -> int:
    """Odd length of the moving window whose local polynomial passes up to ``cutoff``.

    Notes
    -----
    Schafer 2011, What is a Savitzky-Golay filter?, IEEE Signal Process. Mag. 28(4), (12): the 3 dB point of a
    window of 2M + 1 samples and even degree N is (N + 1) / (3.2 M - 4.6) in units of half the sampling rate; an
    odd degree smooths as the even one below it.

    Examples
    --------
    >>> causal_window(1000.0, 50.0)
    23
    """
    if not 0 < cutoff < sample_rate / 2:
        raise ValueError(
            f"cutoff is {cutoff:g} Hz, expected one between 0 and {sample_rate / 2:g} Hz, half the sampling rate."
        )
    half = round(((degree // 2 * 2 + 1) * sample_rate / 2 / cutoff + 4.6) / 3.2)
    return 2 * max(half, degree // 2 + 1) + 1


def causal_kernels(sample_rate: float, window: int, degree: int = 3) -> NDArray[np.float64]:
    """Weights that read position, velocity and acceleration from the middle of a window.

    Parameters
    ----------
    sample_rate : float
        In Hz.
    window : int
        Odd number of samples; the values are those of (window - 1) / 2 samples ago.
    degree : int, default=3
        Degree of the local polynomial, at least 2.

    Returns
    -------
    ndarray of shape (3, window)
        ``weights @ newest_window`` (oldest sample first) is (q, dq/dt, d2q/dt2), exact for a polynomial of that degree.

    Raises
    ------
    ValueError
        If the window is even or too short for the degree.

    Notes
    -----
    Savitzky, Golay 1964, Anal. Chem. 36(8).

    Examples
    --------
    >>> w = causal_kernels(1.0, 5)
    >>> (w @ [0.0, 1.0, 4.0, 9.0, 16.0]).round(9)
    array([4., 4., 2.])
    """
    if window != int(window) or window % 2 == 0 or window <= degree or degree < 2:
        raise ValueError(
            f"window is {window} and degree {degree}, expected an odd window longer than the degree and a degree >= 2."
        )
    half = (int(window) - 1) // 2
    steps = np.arange(-half, half + 1) / half
    fit = np.linalg.pinv(np.vander(steps, degree + 1, increasing=True))
    scale = sample_rate / half
    return np.vstack([fit[0], fit[1] * scale, 2.0 * fit[2] * scale**2])


def causal_motion(
    position: NDArray[np.float64], memory: NDArray[np.float64], kernels: NDArray[np.float64]
) -> tuple[Motion, NDArray[np.float64]]:
    """Motion of the next piece of a stream, delayed by half a window.

    Parameters
    ----------
    position : ndarray of shape (n,)
        New samples, in order.
    memory : ndarray of shape (m,), m < window
        Samples before them, as returned last time; empty at the start.
    kernels : ndarray of shape (3, window)
        From `causal_kernels`.

    Returns
    -------
    motion : Motion
        Row t holds the values of (window - 1) / 2 samples before it; zeros until a window is full.
    memory : ndarray
        To be handed in with the next piece; any cutting into pieces gives the same numbers, bit by bit.

    Examples
    --------
    >>> import numpy as np
    >>> kernels = causal_kernels(1.0, 5)
    >>> first, memory = causal_motion(np.arange(6.0), np.empty(0), kernels)
    >>> first.velocity.round(9)
    array([0., 0., 0., 0., 1., 1.])
    """
    joined = np.concatenate([memory, position])
    return Motion(*_slide(joined, len(memory), kernels)), _tail(joined, kernels)


def causal_delay(
    x: NDArray[np.float64], memory: NDArray[np.float64], delay: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Another signal of the stream, ``delay`` samples late (zeros at first), and its memory.

    Examples
    --------
    >>> import numpy as np
    >>> causal_delay(np.arange(1.0, 5.0), np.empty(0), 2)
    (array([0., 0., 1., 2.]), array([3., 4.]))
    """
    joined = np.concatenate([np.zeros(max(delay - len(memory), 0)), memory, x])
    return joined[: len(x)], joined[len(x) :].copy()


def _tail(joined: NDArray[np.float64], kernels: NDArray[np.float64]) -> NDArray[np.float64]:
    """The samples that the next window still holds."""
    return joined[max(len(joined) - kernels.shape[1] + 1, 0) :].copy()


@njit(cache=True)
def _slide(joined, skip, kernels):
    """Kernels along the path; positions are taken relative to the window's middle, which spares digits."""
    window = kernels.shape[1]
    half = window // 2
    out = np.zeros((kernels.shape[0], joined.size - skip))
    for t in range(skip, joined.size):
        if t < window - 1:
            continue
        first = t - window + 1
        origin = joined[first + half]
        for k in range(kernels.shape[0]):
            total = 0.0
            for i in range(window):
                total += kernels[k, i] * (joined[first + i] - origin)
            out[k, t - skip] = total
        out[0, t - skip] += origin
    return out
