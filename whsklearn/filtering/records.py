"""From position to motion, for records: filters run forwards and backwards, so nothing is shifted in time.

Streams, which have no future, are served by `whsklearn.filtering.streams`.
"""

from __future__ import annotations

import itertools
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from whsklearn._numba import njit
from whsklearn.logs.check import lattice

Array = NDArray[np.float64]

UNROLLED = 4  # order of the zero-phase filter that has a loop of its own
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
    from scipy.signal import lfilter

    x = np.asarray(x, dtype=float)
    if not 0 < cutoff < sample_rate / 2:
        raise ValueError(
            f"cutoff is {cutoff:g} Hz, expected one between 0 and {sample_rate / 2:g} Hz, half the sampling rate."
        )
    pad = 3 * order
    if len(x) <= pad:
        raise ValueError(f"The record has {len(x)} samples, a zero-phase filter of order {order} needs {pad + 1}.")
    b, a, settled = _butterworth(order, cutoff / (sample_rate / 2))
    # as scipy.signal.filtfilt, which finds the state of a constant input anew in each call: a third of its time
    y = np.concatenate([2.0 * x[0] - x[pad:0:-1], x, 2.0 * x[-1] - x[-2 : -pad - 2 : -1]])
    settled = settled.reshape(-1, *[1] * (x.ndim - 1))
    if order == UNROLLED:
        columns = np.ascontiguousarray(y.reshape(len(y), -1))  # a copy of columns that lie one after the other
        _both_ways(b, a, settled.reshape(order, 1), np.empty((order, columns.shape[1])), columns)
        return columns.reshape(y.shape)[pad:-pad]
    for _ in range(2):
        y = lfilter(b, a, y, axis=0, zi=settled * y[:1])[0][::-1]
    return y[pad:-pad]


@njit(error_model="numpy", counted=False)
def _both_ways(b, a, settled, state, y):
    """Filter the columns of ``y`` (n, k) in place forwards, then backwards, each time as if the first sample had been
    there forever.  ``settled`` (4, 1) is the state of a constant input of one, ``state`` (4, k) what is overwritten.

    Of the order `UNROLLED`, whose coefficients stay in registers, with neighbouring columns side by side: of six
    columns `lfilter` takes five times as long, of 128 thirty times, and of one as long.  An arm's 4,000 filterings were
    a third of the time to its first ranking.
    """
    n = y.shape[0]
    b0, b1, b2, b3, b4, a1, a2, a3, a4 = b[0], b[1], b[2], b[3], b[4], a[1], a[2], a[3], a[4]
    for backwards in range(2):
        t, step = (n - 1, -1) if backwards else (0, 1)
        for j in range(y.shape[1]):
            for i in range(4):
                state[i, j] = settled[i, 0] * y[t, j]
        for _ in range(n):
            for j in range(y.shape[1]):
                x = y[t, j]
                out = b0 * x + state[0, j]
                state[0, j] = b1 * x - a1 * out + state[1, j]
                state[1, j] = b2 * x - a2 * out + state[2, j]
                state[2, j] = b3 * x - a3 * out + state[3, j]
                state[3, j] = b4 * x - a4 * out
                y[t, j] = out
            t += step


@lru_cache(maxsize=64)
def _butterworth(order: int, share: float) -> tuple[NDArray[np.float64], ...]:
    """Numerator, denominator and the state of a constant input of one; the cut-off is a share of half the rate.

    The design takes as long as a filtering.
    """
    from scipy.signal import butter, lfilter_zi

    b, a = butter(order, share)
    return b, a, lfilter_zi(b, a)


def central_difference(x: ArrayLike, sample_rate: float) -> NDArray[np.float64]:
    """(8 (x(t+1) - x(t-1)) - x(t+2) + x(t-2)) fs / 12, of lower order at the ends; per second, along the first axis.

    ``x`` (n, ...): a signal or several. ``sample_rate``: in Hz.

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

    ``position`` (n,): measured position. ``sample_rate``, ``cutoff``, ``order``: as for `zero_phase`. The result is
    aligned in time with the position.

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

    ``position``, ``sample_rate``, ``cutoff``, ``order``: as for `motion`.

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

    ``x`` (n,) or (n, k): signals, one a column. ``factor``: 1 leaves the rows as they are.
    Returns (ceil(n / factor), ...). Raises ValueError if the factor is below 1 or the record too short for the filter.

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


# --- smoothing and differentiation by one Gaussian: kernels, and how a signal goes through them without phase --------

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


# --- the drive between its samples: held by a digital controller, or smooth ------------------------------------------
HOLDS = ("zero", "cubic")


def fine_drive(u: Array, steps: int, hold: str = "zero", bounds: NDArray[np.int64] | None = None) -> Array:
    """The drive in the middle of every fine step, shape (n, steps).

    ``cubic`` is the spline through the samples of each segment, which is off a sine of a ninth of the sampling rate by
    1e-4 of it; held, that sine loses 2 % and comes half a sample late.

    ``u`` (n,): the drive. ``steps``: fine steps a sample. ``hold`` {"zero", "cubic"}: what is between two samples.
    ``bounds``: first sample of every segment, and the number of samples.
    """
    if hold == "zero":
        return np.repeat(u[:, None], steps, axis=1)
    from scipy.interpolate import CubicSpline

    bounds = np.array([0, u.size]) if bounds is None else bounds
    middle = (np.arange(steps) + 0.5) / steps
    out = np.empty((u.size, steps))
    for a, b in itertools.pairwise(bounds.tolist()):
        at = np.minimum(np.arange(b - a)[:, None] + middle, b - a - 1.0)  # behind the last sample it stays
        out[a:b] = CubicSpline(np.arange(b - a), u[a:b])(at)
    return out


# --- how much of a position is the encoder's noise, and the cut-off at which the acceleration is not -----------------
# Differentiated twice, white noise of variance s^2 at the rate fs leaves an acceleration of variance
#
#     2 s^2 / fs  int (A(f) D(f))^2 df,    A the zero-phase filter, D the second central difference,
#
# which grows with the fifth power of the cut-off.  In least squares it makes the inertia too small by
# its share of the acceleration's variance, however long the record.
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
