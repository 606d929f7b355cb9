"""From position to motion, for streams: derivatives whose delay is known.

A moving window is fitted by a polynomial and read in its middle, which costs half a window of
delay, the same at every frequency, and no other distortion of phase.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from whsklearn._numba import njit
from whsklearn.filtering.records import Motion

# Hz.  The noise of an acceleration grows with the fifth power of the cut-off, and a stream does not know that of its
# encoder when it starts: up to a tenth of the rate it made the inertia of an axis 41 % too small at 20 kHz, 1 % at
# 5 kHz, and up to 100 Hz less than 0.1 % (tests/lags/test_inverse_dynamics.py).
WIDEST = 100.0


def causal_cutoff(sample_rate: float) -> float:
    """Cut-off of a stream for which none is given, in Hz: a tenth of the sampling rate, but no more than `WIDEST`.

    ``sample_rate``: in Hz.

    >>> causal_cutoff(500.0), causal_cutoff(20_000.0)
    (50.0, 100.0)
    """
    return min(0.1 * sample_rate, WIDEST)


def causal_window(sample_rate: float, cutoff: float, degree: int = 3) -> int:
    """Odd length of the moving window whose local polynomial passes up to ``cutoff``.

    ``sample_rate``, ``cutoff``: in Hz. ``degree``: of the local polynomial.

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
    past = joined[max(len(joined) - kernels.shape[1] + 1, 0) :].copy()  # what the next window still holds
    return Motion(*_slide(joined, len(memory), kernels)), past


def causal_delay(
    x: NDArray[np.float64], memory: NDArray[np.float64], delay: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Another signal of the stream, ``delay`` samples late (zeros at first), and its memory.

    ``x`` (n,) or (n, n_signals): new samples, in order. ``memory`` (m,) or (m, n_signals): as returned last time; empty
    at first. ``delay``: in samples.

    Examples
    --------
    >>> import numpy as np
    >>> causal_delay(np.arange(1.0, 5.0), np.empty(0), 2)
    (array([0., 0., 1., 2.]), array([3., 4.]))
    """
    joined = np.concatenate([np.zeros((max(delay - len(memory), 0), *x.shape[1:])), memory, x])
    return joined[: len(x)], joined[len(x) :].copy()


def window_averages(
    signals: NDArray[np.float64], taps: NDArray[np.float64], ends: NDArray[np.int64]
) -> NDArray[np.float64]:
    """Weighted averages of signals (n, k) over the windows that end at some samples, (len(ends), k).

    ``taps`` (window,): weights, the oldest sample first. ``ends``: indices of samples with a full window.

    >>> import numpy as np
    >>> window_averages(np.arange(4.0)[:, None], np.full(3, 1 / 3), np.array([2, 3])).ravel().round(9)
    array([1., 2.])
    """
    return np.asarray(_averaged(signals, taps, ends))


@njit(cache=True)
def _averaged(signals, taps, ends):
    """Each column's weighted sum over the window that ends at each index; loops, so that no cutting changes a bit."""
    out = np.zeros((ends.size, signals.shape[1]))
    for j in range(ends.size):
        first = ends[j] - taps.size + 1
        for i in range(taps.size):
            for k in range(signals.shape[1]):
                out[j, k] += taps[i] * signals[first + i, k]
    return out


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
