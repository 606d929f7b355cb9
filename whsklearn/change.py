"""Has the system changed?  An alarm with a stated rate of false ones, and a sentence on what changed.

`ChangeAlarm` watches the innovations of an estimator, for changes faster than the
estimator's own tracking.  `compare_parameters` sets two estimates with their covariances
side by side, for those that the estimator has followed without surprise ("coulomb rose
20 % since Tuesday").
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from sklearn.base import BaseEstimator

from whsklearn._alarm_kernel import watch
from whsklearn._real import real_array

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray

__all__ = ["ChangeAlarm", "ParameterChange", "compare_parameters", "forgetting_after", "set_forgetting"]

# Cells by their tail probability: fine in the tails, where a change shows first.
_TAIL = np.array([0.001, 0.004, 0.012, 0.03, 0.07, 0.14, 0.24, 0.36])
_LEVELS = np.r_[_TAIL, 0.5, 1 - _TAIL[::-1]]
_BETS = ((0.0, 1.2), (0.0, 1.6), (0.0, 3.0), (0.25, 1.0), (-0.25, 1.0), (1.0, 1.0), (-1.0, 1.0))  # shift, spread
_LARGEST_TILT = 10.0  # so that a burst of a few outliers, such as a sign() that flips, is no alarm
_QUICK_MEMORY = 200.0  # samples, right after a change
_MOST = 1e6  # samples remembered by the cell frequencies


class ChangeAlarm(BaseEstimator):
    """Shiryaev-Roberts alarm on whitened innovations, for noise of any distribution.

    Parameters
    ----------
    interval : float, default=1e6
        Mean number of samples between false alarms, at least.  At 1 kHz 1e6 is one in 17 minutes, 6e8 one a week.
    n_reference : int, default=2000
        Samples from which the innovations' normal behaviour is learnt before watching begins.
    order : int, default=4
        Order of the autoregression that whitens; 0 if the innovations are white.
    n_settle : int, default=1000
        Samples left out at the start and after an alarm, while the estimator converges.

    Attributes
    ----------
    n_samples_ : int
        Innovations seen.
    n_alarms_ : int
        Alarms raised.
    evidence_ : float
        R now; the alarm is raised when it reaches ``interval``.

    Notes
    -----
    Each whitened innovation falls into one of 18 cells, whose frequencies are learnt and go
    on being learnt.  A bet k on a wider or shifted distribution pays e_k = f_k(cell) / E f_k, so
    E e_k = 1 as long as nothing changes, and R_k <- (1 + R_k) e_k makes R_k - t a martingale: the
    mean time to a false alarm of R = mean_k R_k >= A is at least A (Shiryaev 1963; Pollak 1985, Ann. Statist.
    13(1); for mixtures of bets Shin, Ramdas and Rinaldo 2024, e-detectors).  No Gaussian noise is assumed; that the
    innovations are independent after whitening is.  Samples where y is predicted exactly (an idle
    axis) are passed over.  Bets are on more spread and on a shift: an estimator that
    improves, and so surprises less, raises no alarm.

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

    def __init__(self, interval: float = 1e6, n_reference: int = 2000, order: int = 4, n_settle: int = 1000):
        self.interval = interval
        self.n_reference = n_reference
        self.order = order
        self.n_settle = n_settle

    def update(self, innovations: ArrayLike) -> NDArray[np.int64]:
        """Take innovations y - y_hat(t|t-1) in their order; return the indices at which an alarm was raised.

        Raises
        ------
        ValueError
            If a parameter is out of range or an innovation is no finite number; nothing is changed then.
        """
        e = np.atleast_1d(real_array(innovations, "ChangeAlarm: innovations"))
        if e.ndim != 1 or not np.isfinite(e).all():
            raise ValueError(f"ChangeAlarm: got innovations of shape {e.shape}, expected finite numbers of shape (n,).")
        self._check_params()
        if not self.started:
            self.n_samples_, self.n_alarms_ = 0, 0
            self._begin()
        active = np.flatnonzero(e)  # exact zeros come from an idle axis and say nothing
        e, alarms, start = e[active], [], 0
        while start < e.size:
            if self._buffer is not None:
                start = self._learn(e, start)
                continue
            learnt = (self._past, self._ar, self._edges, _tilts(), self._counts, self._evidence)
            at = int(watch(e, start, *learnt, float(self.interval), _MOST))
            if at < 0:
                break
            alarms.append(at)
            start = at + 1
            self.n_alarms_ += 1
            self._begin()
        self.n_samples_ += np.size(innovations)
        return active[alarms]

    @property
    def started(self) -> bool:
        """Whether an innovation was seen."""
        return hasattr(self, "n_samples_")

    @property
    def evidence_(self) -> float:
        """R now, 0 while the reference is being learnt."""
        return float(np.mean(self._evidence)) if self.watching_ else 0.0

    @property
    def watching_(self) -> bool:
        """Whether the reference is learnt."""
        return self.started and self._buffer is None

    def get_state(self) -> dict[str, Any]:
        """All that `set_state` needs to go on identically."""
        names = ("n_samples_", "n_alarms_", "_settled", "_filled", "_buffer", "_past", "_ar", "_edges", "_counts")
        return {
            name: value.copy() if isinstance(value, np.ndarray) else value
            for name in (*names, "_evidence")
            if (value := getattr(self, name, None)) is not None
        }

    def set_state(self, state: dict[str, Any]) -> ChangeAlarm:
        """Go on from a state that `get_state` gave."""
        self._begin()
        self._buffer = None
        for name, value in state.items():
            setattr(self, name, value.copy() if isinstance(value, np.ndarray) else value)
        return self

    def _check_params(self) -> None:
        """Refuse parameters out of range."""
        if not self.interval > 1:
            raise ValueError(f"ChangeAlarm: interval is {self.interval!r}, expected samples > 1, such as 1e6.")
        if self.n_settle < 0 or self.order < 0:
            raise ValueError(f"ChangeAlarm: n_settle is {self.n_settle} and order {self.order}, expected both >= 0.")
        if self.n_reference < 200 + 10 * self.order:
            raise ValueError(
                f"ChangeAlarm: n_reference is {self.n_reference}, expected at least 200 + 10 * order samples."
            )

    def _begin(self) -> None:
        """Settle, then learn a new reference."""
        self._settled = self._filled = 0
        self._buffer = np.zeros(self.n_reference)

    def _learn(self, e: NDArray[np.float64], start: int) -> int:
        """Let samples pass while settling, then fill the reference; returns where it stopped."""
        skipped = min(self.n_settle - self._settled, e.size - start)
        self._settled += skipped
        start += skipped
        taken = min(self.n_reference - self._filled, e.size - start)
        self._buffer[self._filled : self._filled + taken] = e[start : start + taken]  # type: ignore[index]
        self._filled += taken
        if self._filled == self.n_reference:
            self._end_learning()
        return start + taken

    def _end_learning(self) -> None:
        """Whitening filter, cells and their frequencies from the full reference."""
        reference, m = self._buffer, self.order
        assert reference is not None
        self._ar = _autoregression(reference, m)
        white = reference[m:] - sum((self._ar[i] * reference[m - 1 - i : -1 - i] for i in range(m)), np.zeros(1))
        self._edges = np.quantile(white, _LEVELS)
        cells = np.searchsorted(self._edges, white)
        self._counts = np.bincount(cells, minlength=_LEVELS.size + 1).astype(np.float64)
        self._past = reference[::-1][:m].copy()
        self._evidence = np.zeros(len(_BETS))
        self._buffer = None


@dataclass(frozen=True)
class ParameterChange:
    """One parameter before and after, with the standard error of the difference."""

    name: str
    before: float
    after: float
    standard_error: float
    z: float
    significant: bool

    @property
    def percent(self) -> float:
        """Change of the parameter's size in per cent of what it was; inf if it was zero."""
        if self.before == 0:
            return math.inf if self.after else 0.0
        return 100.0 * (abs(self.after) - abs(self.before)) / abs(self.before)

    def __str__(self) -> str:
        if self.before * self.after < 0:
            what = "changed sign"
        else:
            what = f"{'rose' if self.percent > 0 else 'fell'} {abs(self.percent):.3g} %"
        return f"{self.name} {what} ({self.before:.4g} to {self.after:.4g}, standard error {self.standard_error:.2g})"


def compare_parameters(
    names: Sequence[str],
    before: ArrayLike,
    before_covariance: ArrayLike,
    after: ArrayLike,
    after_covariance: ArrayLike,
    level: float = 0.01,
) -> list[ParameterChange]:
    """Which parameters changed between two estimates, the surest first.

    Parameters
    ----------
    names : sequence of str
        One a parameter.
    before, after : array-like of shape (n_params,)
        The two estimates.
    before_covariance, after_covariance : array-like of shape (n_params, n_params) or (n_params,)
        Their covariances, or the squared standard errors.
    level : float, default=0.01
        Probability that any parameter is called changed though none did (Bonferroni over the parameters).

    Raises
    ------
    ValueError
        If sizes do not fit or a variance is negative.

    Notes
    -----
    The two estimates are taken as independent, which they nearly are if their effective memories,
    1 / (1 - forgetting) samples each, do not overlap.

    Examples
    --------
    >>> from whsklearn.change import compare_parameters
    >>> changes = compare_parameters(["viscous", "coulomb"], [0.05, 0.70], [1e-6, 1e-4], [0.0501, 0.84], [1e-6, 1e-4])
    >>> print(*[c for c in changes if c.significant])
    coulomb rose 20 % (0.7 to 0.84, standard error 0.014)
    """
    from scipy.special import ndtri

    old, new = real_array(before, "before"), real_array(after, "after")
    variances = [
        np.diag(v) if v.ndim == 2 else v
        for v in map(real_array, (before_covariance, after_covariance), ("before_covariance", "after_covariance"))
    ]
    if not (old.shape == new.shape == variances[0].shape == variances[1].shape == (len(names),)):
        raise ValueError(
            f"compare_parameters: {len(names)} names, estimates of shapes {old.shape} and {new.shape}, variances of "
            f"shapes {variances[0].shape} and {variances[1].shape}; give one of each a parameter."
        )
    total = variances[0] + variances[1]
    if not np.all(total >= 0) or not 0 < level < 1:
        raise ValueError("compare_parameters: expected variances >= 0 and 0 < level < 1; check the covariances.")
    limit = float(-ndtri(level / 2 / max(len(names), 1)))
    changes = []
    for name, b, a, error in zip(names, old.tolist(), new.tolist(), np.sqrt(total).tolist(), strict=True):
        z = (a - b) / error if error > 0 else math.copysign(math.inf, a - b) if a != b else 0.0
        changes.append(ParameterChange(name, b, a, error, z, abs(z) > limit))
    return sorted(changes, key=lambda c: -abs(c.z))


def forgetting_after(rows: int, settled: float = 1.0) -> float:
    """Forgetting factor for the sample that comes ``rows`` samples after a change was noticed.

    1 - 1 / (200 + rows): what came since the change is kept with weights that fall linearly
    into the past, so the memory grows with the time since the change, and the estimate
    settles.  What was learnt before goes at once, by the estimator's ``forget_past``.

    Parameters
    ----------
    rows : int
        Samples since the change was noticed.
    settled : float, default=1
        Forgetting factor to which it settles.

    Examples
    --------
    >>> from whsklearn.change import forgetting_after
    >>> [round(forgetting_after(n), 4) for n in (0, 999, 2000, 100_000)]
    [0.995, 0.9992, 0.9995, 1.0]
    """
    return min(settled, 1.0 - 1.0 / (_QUICK_MEMORY + max(rows, 0)))


def set_forgetting(model: Any, forgetting: float) -> None:
    """Let a recursive estimator forget at another rate from its next sample on, mid-stream.

    Lowered for a while after an alarm, it makes room for what is new; raised again, the
    estimate settles.

    Parameters
    ----------
    model : estimator
        With a parameter ``forgetting``; what it has learnt stays.
    forgetting : float
        In (0, 1].

    Raises
    ------
    ValueError
        If it is out of range.

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


def _autoregression(e: NDArray[np.float64], order: int) -> NDArray[np.float64]:
    """Yule-Walker coefficients; zeros for a constant signal."""
    centred = e - e.mean()
    r = np.array([centred[k:] @ centred[: e.size - k] for k in range(order + 1)])
    if order == 0 or r[0] <= 0:
        return np.zeros(order)
    toeplitz = r[np.abs(np.subtract.outer(np.arange(order), np.arange(order)))]
    return np.linalg.solve(toeplitz + 1e-9 * r[0] * np.eye(order), r[1:])


@functools.cache
def _tilts() -> NDArray[np.float64]:
    """f_k of each cell: what a normal law with the bet's shift and spread puts there, over the nominal probability."""
    from scipy.special import ndtr, ndtri

    edges = np.r_[-np.inf, ndtri(_LEVELS), np.inf]
    tilts = np.array([np.diff(ndtr((edges - m) / s)) / np.diff(ndtr(edges)) for m, s in _BETS])
    return np.minimum(tilts, _LARGEST_TILT)
