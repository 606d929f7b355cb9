"""Residual tests: structure in e = y - y_hat, and whether chance explains it.

Bands are 1.96 / sqrt(N) for 95 %.  They are for one lag and hold where one of the two
signals is white; 25 lags inside 95 % bands raise a false alarm in most records.  So the
tests judge the largest |r| of all lags against the same maximum after circular shifts,
which keeps each signal's own colour and breaks only what binds them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from whsklearn._inputs import real_array


@dataclass(frozen=True)
class WhitenessTest:
    """Ljung-Box test: lags, r(k), statistic Q, degrees of freedom and p-value.

    Attributes
    ----------
    lags, r : ndarray of shape (n_lags,)
        In samples; correlation, without a unit.
    band : float
        Half width for one lag at 95 %.
    statistic, p_value : float
        Ljung and Box's Q and its p-value.
    degrees : int
        Of freedom.

    References
    ----------
    Ljung and Box 1978, On a measure of lack of fit in time series models, Biometrika 65(2), 297-303.

    Examples
    --------
    >>> import numpy as np
    >>> from whsklearn.validation import whiteness_test
    >>> e = np.random.default_rng(0).normal(size=2000)
    >>> whiteness_test(e).p_value > 0.05, whiteness_test(np.cumsum(e)).p_value < 1e-6
    (True, True)
    """

    lags: NDArray[np.int64]
    r: NDArray[np.float64]
    band: float
    statistic: float
    degrees: int
    p_value: float


@dataclass(frozen=True)
class CorrelationTest:
    """Cross-correlation test: r at each lag, the band of one lag, max |r| and its p-value.

    Attributes
    ----------
    name : str
        Of the pair, such as ``u, e``.
    lags, r : ndarray of shape (n_lags,)
        In samples; correlation, without a unit.
    band : float
        Half width for one lag at 95 %.
    statistic, p_value : float
        max |r| and its p-value over all lags.

    References
    ----------
    Ljung 1999, System Identification, 2nd ed., sec. 16.6, Residual analysis.

    Examples
    --------
    >>> import numpy as np
    >>> from whsklearn.validation import cross_correlation_test
    >>> u = np.random.default_rng(0).normal(size=2000)
    >>> test = cross_correlation_test(np.roll(u, 3), u)  # e(t) = u(t - 3)
    >>> int(test.lags[np.argmax(np.abs(test.r))]), test.p_value < 0.01
    (3, True)
    """

    name: str
    lags: NDArray[np.int64]
    r: NDArray[np.float64]
    band: float
    statistic: float
    p_value: float


Z95 = 1.959963984540054  # the two-sided 95 % point of the normal distribution


def whiteness_test(e: ArrayLike, max_lag: int = 25, n_params: int = 0) -> WhitenessTest:
    """Ljung-Box test of the hypothesis that e is white.

    Parameters
    ----------
    e : array-like of shape (n,)
        One-step prediction errors.  A free run's errors are coloured as soon as the noise is,
        so there a failing test says nothing about the model's structure.
    max_lag : int, default=25
        Number of lags h.
    n_params : int, default=0
        Parameters of a noise model fitted to the same record; they cost degrees of freedom.

    Raises
    ------
    ValueError
        If e is too short, constant or not finite, or ``n_params >= max_lag``.

    Notes
    -----
    Q = N (N + 2) sum_k r(k)^2 / (N - k), chi-squared with h - n_params degrees of freedom
    (Ljung and Box 1978, Biometrika 65(2)).

    Examples
    --------
    >>> import numpy as np
    >>> from whsklearn.validation import whiteness_test
    >>> e = np.random.default_rng(0).normal(size=500)
    >>> whiteness_test(e).p_value > 0.05, whiteness_test(np.cumsum(e)).p_value < 1e-6
    (True, True)
    """
    from scipy.stats import chi2

    if not 0 <= n_params < max_lag:
        raise ValueError(f"whiteness_test: n_params is {n_params}, expected 0 <= n_params < max_lag = {max_lag}.")
    e = _centred(e, "e", max_lag)
    r, statistic = ljung_box(e, max_lag)
    degrees, lags = max_lag - n_params, np.arange(1, max_lag + 1)
    return WhitenessTest(lags, r, Z95 / e.size**0.5, statistic, degrees, float(chi2.sf(statistic, degrees)))


def ljung_box(e: NDArray[np.float64], max_lag: int) -> tuple[NDArray[np.float64], float]:
    """r(1), ..., r(max_lag) and Q of a signal without its mean; zero where it is zero throughout."""
    n = e.size
    r = np.array([e[k:] @ e[: n - k] for k in range(1, max_lag + 1)]) / max(float(e @ e), 1e-300)
    return r, float(n * (n + 2) * np.sum(r**2 / (n - np.arange(1, max_lag + 1))))


def cross_correlation_test(
    e: ArrayLike, u: ArrayLike, max_lag: int = 25, *, negative_lags: bool = False, name: str = "u, e"
) -> CorrelationTest:
    """Test whether e still depends on u: the largest |r_ue(k)|, judged by circular shifts.

    Parameters
    ----------
    e, u : array-like of shape (n,)
        Residual, and input (or any signal of the same length).
    max_lag : int, default=25
        r(k) correlates e(t) with u(t - k) for k = 0, ..., max_lag.
    negative_lags : bool, default=False
        Take k = -max_lag, ..., max_lag; a dependence at negative lags is feedback.
    name : str, optional
        Carried into the result.

    Returns
    -------
    CorrelationTest
        ``p_value`` is the share of circular shifts of u, the present one counted, whose
        largest |r| over the same lags is no smaller; all shifts are used, none drawn at random.

    Raises
    ------
    ValueError
        If lengths differ, the record has fewer than ten times as many samples as lags, or a
        signal is constant or not finite.

    Notes
    -----
    Correlations are circular, which moves r by at most k / N and makes every shift equally likely
    if e and u are stationary and independent, whatever their spectra.

    Examples
    --------
    >>> import numpy as np
    >>> from whsklearn.validation import cross_correlation_test
    >>> u, e = np.random.default_rng(0).normal(size=(2, 1000))
    >>> cross_correlation_test(e, u).p_value > 0.05
    True
    """
    e, u = _centred(e, "e", 2 * max_lag), _centred(u, "u", 2 * max_lag)
    if e.size != u.size:
        raise ValueError(f"cross_correlation_test: e has {e.size} samples and u {u.size}; give the same samples.")
    width = 2 * max_lag + 1 if negative_lags else max_lag + 1
    if e.size < 10 * width:
        raise ValueError(
            f"cross_correlation_test: {e.size} samples for {width} lags; give at least {10 * width} or fewer lags."
        )
    lags = np.arange(-max_lag if negative_lags else 0, max_lag + 1)
    spectrum = np.fft.rfft(e) * np.conj(np.fft.rfft(u))
    r = np.fft.irfft(spectrum, e.size) / np.sqrt((e @ e) * (u @ u))  # r[k]: e(t) with u(t - k), k modulo n
    windows = np.lib.stride_tricks.sliding_window_view(np.r_[np.abs(r), np.abs(r[: width - 1])], width).max(axis=1)
    start = int(lags[0]) % e.size
    observed = float(windows[start])
    # A window that shares lags with the tested one is no independent shift.
    distance = (np.arange(e.size) - start) % e.size
    apart = windows[(distance >= width) & (distance <= e.size - width)]
    p_value = (1 + int(np.sum(apart >= observed))) / (1 + apart.size)
    return CorrelationTest(name, lags, r[lags], Z95 / e.size**0.5, observed, p_value)


def residual_tests(e: ArrayLike, u: ArrayLike, max_lag: int = 25) -> dict[str, CorrelationTest]:
    """The classical battery of cross-correlations, by name.

    ``u, e`` sees linear dynamics, delay and gain; ``u^2, e`` even nonlinearities and offsets;
    ``u^2, e^2`` odd ones as well (Coulomb, saturation), at little power; ``|u|, |e|`` what
    the others miss.  They tell that something is left and of what family, not what it is.

    ``e``, ``u`` (n,): residuals and input. ``max_lag``: in samples.

    Notes
    -----
    Billings and Voon 1986, Int. J. Control 44(1); Zhang, Zhu and Longden 2009 for the absolute values.
    Four tests at 5 % raise a false alarm in up to 18.5 % of records: compare the least
    p-value with 0.05 / 4.

    Examples
    --------
    >>> import numpy as np
    >>> from whsklearn.validation import residual_tests
    >>> u = np.random.default_rng(0).normal(size=1000)
    >>> tests = residual_tests(np.roll(u, 1) ** 2, u)  # what is left is even in u
    >>> list(tests), tests["u^2, e"].p_value < 0.05 / 4
    (['u, e', 'u^2, e', 'u^2, e^2', '|u|, |e|'], True)
    """
    e, u = _centred(e, "e", 2 * max_lag), _centred(u, "u", 2 * max_lag)
    pairs = {"u, e": (u, e), "u^2, e": (u**2, e), "u^2, e^2": (u**2, e**2), "|u|, |e|": (np.abs(u), np.abs(e))}
    return {name: cross_correlation_test(b, a, max_lag, name=name) for name, (a, b) in pairs.items()}


def _centred(signal: ArrayLike, name: str, more_than: int) -> NDArray[np.float64]:
    """A finite signal without its mean that is longer than ``more_than`` and not constant."""
    array = real_array(signal, name)
    if array.ndim != 1 or array.size <= more_than or more_than < 0:
        raise ValueError(f"{name} has shape {array.shape}, expected (n,) with n > {more_than}; give a longer record.")
    if not np.isfinite(array).all():
        raise ValueError(f"{name} holds NaN or infinite values; leave such samples out.")
    size = float(np.max(np.abs(array)))
    centred = array / size - np.mean(array / size) if size > 0 else array
    if np.max(np.abs(centred)) <= 8 * np.finfo(float).eps:
        raise ValueError(f"{name} is constant; a correlation with it is undefined.")
    return centred / np.max(np.abs(centred))
