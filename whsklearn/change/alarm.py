"""An alarm on an estimator's innovations, with a stated false-alarm rate, and how fast to forget after one."""

from __future__ import annotations

import copy
import functools
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.base import BaseEstimator

from whsklearn._inputs import check_whole, real_array
from whsklearn._numba import njit

# Tail probabilities that bound the cells; the cells are fine in the tails, where a change shows first.
_TAIL = np.array([0.001, 0.004, 0.012, 0.03, 0.07, 0.14, 0.24, 0.36])
LEVELS = np.r_[_TAIL, 0.5, 1 - _TAIL[::-1]]
_BETS = ((0.0, 1.2), (0.0, 1.6), (0.0, 3.0), (0.25, 1.0), (-0.25, 1.0), (1.0, 1.0), (-1.0, 1.0))  # shift, spread
_LARGEST_TILT = 10.0  # so that a short burst of outliers, such as a sign() that flips, raises no alarm
N_BETS = len(_BETS)


@functools.cache
def tilts() -> NDArray[np.float64]:
    """f_k of each cell: its probability under a normal law with the bet's shift and spread, over the nominal one."""
    from scipy.special import ndtr, ndtri

    edges = np.r_[-np.inf, ndtri(LEVELS), np.inf]
    odds = np.array([np.diff(ndtr((edges - m) / s)) / np.diff(ndtr(edges)) for m, s in _BETS])
    return np.asfortranarray(np.minimum(odds, _LARGEST_TILT))  # `watch` takes all bets of a cell at once


_MOST = 1e6  # largest number of samples that the cell frequencies represent


class ChangeAlarm(BaseEstimator):
    """Shiryaev-Roberts alarm on whitened innovations, for noise of any distribution.

    Parameters
    ----------
    interval : float, default=1e6
        Lower bound on the mean number of samples between false alarms.  At 1 kHz, 1e6 means one false alarm in
        17 minutes and 6e8 one per week.
    n_reference : int, default=2000
        Samples from which the innovations' normal behaviour is learnt; watching begins with the first half of them.
    order : int, default=4
        Order of the autoregression that whitens; 0 if the innovations are white.
    n_settle : int, default=1000
        Samples ignored at the start and after an alarm, while the estimator converges.

    Attributes
    ----------
    n_samples_ : int
        Innovations seen.
    n_alarms_ : int
        Alarms raised.
    evidence_ : float
        Current value of R; the alarm is raised when it reaches ``interval``.

    Notes
    -----
    Each whitened innovation falls into one of 18 cells, whose frequencies are learnt and keep being
    updated.  A bet k on a wider or shifted distribution pays e_k = f_k(cell) / E f_k, so
    E e_k = 1 as long as nothing changes, and R_k <- (1 + R_k) e_k makes R_k - t a martingale: the
    mean time to a false alarm of R = mean_k R_k >= A is at least A (Shiryaev 1963; Pollak 1985, Ann. Statist.
    13(1); for mixtures of bets Shin, Ramdas and Rinaldo 2024, e-detectors).  The noise need not be Gaussian, and the
    innovations need not be independent after whitening: what a model lacks follows the motion and comes in spells.
    So a bet pays e_k^(1 / tau), tau being the largest integrated autocorrelation time of the log e_k in the reference
    (`dependence`), 1 if they are independent.  By Hoelder's inequality tau such payments multiply to one at most on
    average, however they depend on each other; the price is that a change is noticed tau times later.  An outlier stays
    in the whitening filter for ``order`` samples and would be counted as often, as one wrong sign of dx is; these
    samples are left out.
    Samples where y is predicted exactly (an idle axis) are skipped.  The bets are on a larger spread and on a shift,
    so an estimator whose innovations become smaller raises no alarm.

    References
    ----------
    Shiryaev 1963, Theory of Probability and its Applications 8(1), 22-46; Pollak 1985, Annals of Statistics 13(1),
    206-227; Shin, Ramdas and Rinaldo 2024, E-detectors, The New England Journal of Statistics in Data Science 2(2).

    Examples
    --------
    >>> import numpy as np
    >>> from whsklearn.change import ChangeAlarm
    >>> e = np.random.default_rng(0).normal(size=8000)
    >>> e[6000:] *= 2
    >>> alarm = ChangeAlarm(interval=1e5)
    >>> [6000 < t < 6100 for t in alarm.update(e).tolist()]
    [True]
    """

    _buffer: NDArray[np.float64] | None  # the reference while it fills, None while watching
    _past: NDArray[np.float64]
    _ar: NDArray[np.float64]
    _edges: NDArray[np.float64]
    _counts: NDArray[np.float64]
    _evidence: NDArray[np.float64]
    _rest: NDArray[np.int64]
    _power: float  # 1 / tau

    def __init__(self, interval: float = 1e6, n_reference: int = 2000, order: int = 4, n_settle: int = 1000):
        self.interval = interval
        self.n_reference = n_reference
        self.order = order
        self.n_settle = n_settle

    def update(self, innovations: ArrayLike) -> NDArray[np.int64]:
        """Process innovations y - y_hat(t|t-1) in time order; return the indices at which an alarm was raised.

        ``innovations`` (n,): in the unit of y. Raises ValueError if a parameter is out of range or an innovation is not
        a finite number.  The alarm then stays unchanged.
        """
        e = np.atleast_1d(real_array(innovations, "ChangeAlarm: innovations"))
        if e.ndim != 1 or not np.isfinite(e).all():
            raise ValueError(f"ChangeAlarm: got innovations of shape {e.shape}, expected finite numbers of shape (n,).")
        self._check_params()
        if not self.started:
            self.n_samples_, self.n_alarms_ = 0, 0
            self._begin()
        active = np.flatnonzero(e)  # exact zeros come from an idle axis and hold no information
        e, alarms, start = e[active], [], 0
        while start < e.size:
            skipped = min(self._left_to_settle, e.size - start)
            self._settled += skipped
            start += skipped
            left = e.size if self._buffer is None else self._left_of(self._buffer)
            stop, at = min(e.size, start + left), -1
            if self.watching_:
                learnt = (self._past, self._ar, self._edges, tilts(), self._counts, self._evidence, self._rest)
                at = int(watch(e[:stop], start, *learnt, self._power, float(self.interval), _MOST))
            if at >= 0:
                alarms.append(at)
                start = at + 1
                self.n_alarms_ += 1
                self._begin()
                continue
            if self._buffer is not None:
                self._buffer[self._filled : self._filled + stop - start] = e[start:stop]
                self._filled += stop - start
                if stop - start == left:
                    self._end_learning(self._buffer)
            start = stop
        self.n_samples_ += np.size(innovations)
        return active[alarms]

    def begin(self) -> None:
        """Learn the normal behaviour again, as after an alarm; use it if the model is about to change anyway."""
        if self.started:
            self._begin()

    @property
    def started(self) -> bool:
        """Whether any innovation has been seen."""
        return hasattr(self, "n_samples_")

    @property
    def evidence_(self) -> float:
        """Current value of R; 0 until it watches."""
        return float(np.mean(self._evidence)) if self.started else 0.0

    @property
    def watching_(self) -> bool:
        """Whether a change can raise the alarm: half of the reference has been learnt."""
        return self.started and self._edges.size > 0

    @property
    def learnt_(self) -> bool:
        """Whether the whole reference has been learnt."""
        return self.started and self._buffer is None

    @property
    def settled_(self) -> bool:
        """Whether the samples that settle the estimator are over."""
        return self.started and not self._left_to_settle

    @property
    def lacking_(self) -> int:
        """Innovations that are still to come before it watches."""
        if not self.started:
            return self.n_settle + self.n_reference // 2
        return 0 if self._buffer is None or self.watching_ else self._left_to_settle + self._left_of(self._buffer)

    def get_state(self) -> dict[str, Any]:
        """Everything that `set_state` needs to continue identically."""
        learnt = vars(self).keys() - self.get_params()
        return {name: copy.copy(value) for name, value in vars(self).items() if name in learnt and value is not None}

    def set_state(self, state: dict[str, Any]) -> ChangeAlarm:
        """Continue from a ``state`` that `get_state` returned."""
        self._begin()
        self._buffer = None
        for name, value in state.items():
            setattr(self, name, copy.copy(value))
        return self

    def _check_params(self) -> None:
        """Reject parameters that are out of range."""
        if not self.interval > 1:
            raise ValueError(f"ChangeAlarm: interval is {self.interval!r}, expected samples > 1, such as 1e6.")
        check_whole("ChangeAlarm: n_settle", self.n_settle, 0)
        check_whole("ChangeAlarm: order", self.order, 0)
        check_whole("ChangeAlarm: n_reference", self.n_reference, 200 + 10 * self.order, ", 200 + 10 * order")

    def _begin(self) -> None:
        """Settle, then learn a new reference."""
        self._settled = self._filled = 0
        self._rest, self._power, self._evidence = np.zeros(1, dtype=np.int64), 1.0, np.zeros(N_BETS)
        self._buffer, self._edges = np.zeros(self.n_reference), np.empty(0)

    def _left_of(self, reference: NDArray[np.float64]) -> int:
        """Samples up to the half of a reference, from which on it is watched, or up to its end.

        A change before it is full would else be a part of what is normal, and never be told.
        """
        half = reference.size // 2
        return (half if self._filled < half else reference.size) - self._filled

    @property
    def _left_to_settle(self) -> int:
        """Samples to skip; none once the reference has begun."""
        return 0 if self._filled else max(self.n_settle - self._settled, 0)

    def _end_learning(self, buffer: NDArray[np.float64]) -> None:
        """Compute the whitening filter, the cells and their frequencies from the reference so far."""
        m, reference = self.order, buffer[: self._filled]
        self._ar = _autoregression(reference, m)
        white = reference[m:] - sum((self._ar[i] * reference[m - 1 - i : -1 - i] for i in range(m)), np.zeros(1))
        self._edges = np.quantile(white, LEVELS, method="inverted_cdf")
        cells = np.searchsorted(self._edges, white)
        self._counts = np.bincount(cells, minlength=LEVELS.size + 1).astype(np.float64)
        self._counts[-1] += 1.0  # the next of n + 1 samples is as likely above all others as between two neighbours
        self._past = reference[::-1][:m].copy()
        odds = tilts()
        paid = np.log(odds[:, cells] * cells.size / (odds @ self._counts)[:, None])
        self._power = 1.0 / max(map(dependence, paid))
        self._buffer = None if self._filled == buffer.size else buffer


def _autoregression(e: NDArray[np.float64], order: int) -> NDArray[np.float64]:
    """Yule-Walker coefficients; zeros for a constant signal."""
    centred = e - e.mean()
    r = np.array([centred[k:] @ centred[: e.size - k] for k in range(order + 1)])
    if order == 0 or r[0] <= 0:
        return np.zeros(order)
    toeplitz = r[np.abs(np.subtract.outer(np.arange(order), np.arange(order)))]
    return np.linalg.solve(toeplitz + 1e-9 * r[0] * np.eye(order), r[1:])


def dependence(x: NDArray[np.float64]) -> float:
    """Samples of a stationary series that tell as much as an independent one: 1 if all are independent.

    It is the larger of two estimates of the integrated autocorrelation time: the sum of the autocorrelations up to the
    first that two standard errors of white noise cover, and, where it exceeds one by two of its own, the variance of
    the means of sqrt(n) samples over that of independent ones, which sees correlations that are weak but long.

    Source: Flegal and Jones 2010, Batch means and spectral variance estimators in Markov chain Monte Carlo, Annals of
    Statistics 38(2), 1034-1070.

    >>> noise = np.random.default_rng(0).normal(size=4000)
    >>> dependence(noise), 15 < dependence(np.convolve(noise, np.ones(20), "valid")) < 25
    (1.0, True)
    """
    n, centred = x.size, x - x.mean()
    power = max(float(centred @ centred), 1e-300)
    spectrum = np.fft.rfft(centred, 2 * n)
    r = np.fft.irfft(spectrum * spectrum.conj())[1 : n // 4] / power
    white = np.flatnonzero(r <= 2.0 / np.sqrt(n))
    long = round(n**0.5)
    means = centred[: n // long * long].reshape(-1, long).mean(axis=1)
    of_means = float(long * n * means.var(ddof=1) / power)
    known = of_means > 1.0 + 2.0 * (2.0 / means.size) ** 0.5
    return max(float(1.0 + 2.0 * r[: white[0] if white.size else None].sum()), of_means * known)


@njit(cache=True)
def watch(innovations, first, past, ar, edges, tilt, counts, evidence, rest, power, threshold, most):
    """Process samples from index ``first`` until the evidence reaches the threshold.

    ``evidence`` holds R of each bet and is updated by R <- (1 + R) e^power, with e = f(cell) / E f, where the
    expectation is under the cell frequencies seen so far.  ``rest`` counts the samples that an outlier still
    spoils.  Returns the index of the sample that raised the alarm, or -1.
    """
    order, n_cells, n_bets = ar.size, counts.size, evidence.size
    expected = np.empty(n_bets)
    total = 0.0
    for j in range(n_cells):
        total += counts[j]
    for t in range(first, innovations.size):
        w = innovations[t]
        for i in range(order):
            w -= ar[i] * past[i]
        for i in range(order - 1, 0, -1):
            past[i] = past[i - 1]
        if order > 0:
            past[0] = innovations[t]
        cell = np.searchsorted(edges, w)
        if rest[0] > 0:
            rest[0] -= 1
            continue
        if cell == 0 or cell == n_cells - 1:
            rest[0] = order
        expected[:] = 0.0
        for j in range(n_cells):
            for k in range(n_bets):
                expected[k] += tilt[k, j] * counts[j]
        mean = 0.0
        for k in range(n_bets):
            paid = tilt[k, cell] * total / expected[k]
            evidence[k] = (1.0 + evidence[k]) * (paid if power == 1.0 else paid**power)
            mean += evidence[k]
        counts[cell] += 1.0
        total += 1.0
        if total > most:
            total = 0.0
            for j in range(n_cells):
                counts[j] *= 0.5
                total += counts[j]
        if mean >= threshold * n_bets:
            return t
    return -1


# --- how fast an estimator forgets after a change, so that it follows the change and then settles --------------------
_QUICK_MEMORY = 200.0  # samples, right after a change


def forgetting_after(rows: int, settled: float = 1.0) -> float:
    """Forgetting factor for the sample that comes ``rows`` samples after a change was detected.

    It is 1 - 1 / (200 + rows).  The weights of the samples since the change then fall linearly
    into the past, so the memory grows with the time since the change, and the estimate
    settles.  The samples before the change are forgotten at once by the estimator's ``forget_past``.

    ``rows``: samples since the change was detected. ``settled``: final forgetting factor.

    Examples
    --------
    >>> from whsklearn.change import forgetting_after
    >>> [round(forgetting_after(n), 4) for n in (0, 999, 2000, 100_000)]
    [0.995, 0.9992, 0.9995, 1.0]
    """
    return min(settled, 1.0 - 1.0 / (_QUICK_MEMORY + max(rows, 0)))


def set_forgetting(model: Any, forgetting: float) -> None:
    """Change the forgetting factor of a recursive estimator in mid-stream, from its next sample on.

    Lower it for a while after an alarm so that the estimate follows the change, then raise it
    again so that the estimate settles.

    ``model``: an estimator with a parameter ``forgetting``; its learned state is kept. ``forgetting``: the new
    forgetting factor, in (0, 1]. Raises ValueError if ``forgetting`` is out of range.

    Examples
    --------
    >>> from whsklearn import RLSRegressor
    >>> from whsklearn.change import set_forgetting
    >>> model = RLSRegressor().partial_fit([[1.0], [2.0]], [2.0, 4.0])
    >>> set_forgetting(model, 0.99)
    >>> model.forgetting
    0.99
    """
    if not 0 < forgetting <= 1:
        raise ValueError(f"set_forgetting: forgetting is {forgetting!r}, expected a number above 0 and at most 1.")
    model.set_params(forgetting=forgetting)
    schedule = getattr(model, "state_", {}).get("forgetting")
    if schedule is not None:  # the exact gradient carries its schedule: present value, final value, rate
        schedule[:2] = forgetting
