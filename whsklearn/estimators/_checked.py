"""Checks of the user's input, and warnings about it."""

from __future__ import annotations

import sys
import warnings
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from sklearn.utils import check_random_state
from sklearn.utils.validation import validate_data

from whsklearn._inputs import check_lengths, in_one_sentence, starts, writeable
from whsklearn.effects.base import Array, Bools
from whsklearn.estimators import _advice
from whsklearn.estimators._kept import KeptModel
from whsklearn.estimators._records import Given, checked_weights, sample_numbers

PACKAGE = str(Path(__file__).resolve().parents[1])
TOLD: set[str] = set()  # warnings that are given once per process


class CheckedModel(KeptModel):
    """A model that rejects invalid input with one sentence and stays unchanged, and warns about unsuitable input."""

    _finds_constant = False  # whether the model can have a constant besides those of its law

    def _validate(self, X: ArrayLike, y: ArrayLike, reset: bool) -> tuple[Array, Array]:
        """X and y as contiguous float64, checked."""
        with in_one_sentence(X, y):
            u, target = validate_data(
                self, X, y, reset=reset, dtype=np.float64, order="C", y_numeric=True, multi_output=self._answers_several
            )
        target = np.asarray(target, dtype=np.float64)
        check_lengths(u, target)
        return writeable(u), writeable(target)

    def _check_parameters(self) -> None:
        """Raise in one sentence if a parameter is invalid."""

    def _checked_record(self, given: Given) -> tuple[Array, Array, Bools, Array | None]:
        """X, y, starts of experiments and weights of a record that is learnt from a clean start."""
        self._keep_lags()
        self._check_parameters()
        X, y = self._validate(given.X, given.y, reset=True)
        restart = starts(given.groups, len(X), first=True)
        self._need_rows(restart)
        weights = self._weights(given.sample_weight, len(X), some=True)
        self._warn_of_order(given.X)
        self._warn_of_record(X, y)
        if self.lags is None:  # what that means differs between the estimators
            if self._is_wiener_hammerstein:
                warn(_advice.of_several_inputs(type(self).__name__, X.shape[1]))
            else:
                warn(_advice.of_a_dynamic_record(type(self).__name__, X, y, restart))
        return X, y, restart, weights

    def _weights(self, sample_weight: ArrayLike | None, n: int, *, some: bool) -> Array | None:
        """Weights of the samples; None if all are one. With ``some``, at least one must be above zero."""
        weights = checked_weights(sample_weight, n, some=some)
        if weights is not None and self.lags is not None and not self._is_wiener_hammerstein:
            raise ValueError(
                f"sample_weight is given, and {type(self.lags).__name__} filters samples into fewer rows; omit "
                "it, or weight the rows of lags.rows(X, y) with lags=None."
            )
        return weights

    def _rows(self, X: Array, y: Array, groups: ArrayLike | None) -> tuple[Array, Array]:
        """Rows and targets of a record, made by lags other than the Wiener-Hammerstein ones."""
        return (X, y) if self.lags is None else self.lags_.rows(X, y, groups)

    def _need_rows(self, restart: Bools) -> None:
        """Raise if no experiment is long enough to fill the lags; warn of no more samples than parameters."""
        n = len(restart)
        needed = self._lags.max_lag + 1 if self._is_wiener_hammerstein else 1
        longest = int(np.diff(np.append(np.flatnonzero(restart), n)).max())
        if longest < needed <= n:
            raise ValueError(
                f"The longest of {np.count_nonzero(restart)} experiments has {longest} "
                f"sample{'s' if longest != 1 else ''}, expected at least {needed}, one more than the lags reach "
                "back; give longer records, and in groups the rows of each experiment one after another."
            )
        if n < needed:
            raise ValueError(
                f"Found {n} sample{'s' if n != 1 else ''} (n_samples={n}), expected at least {needed}, one more "
                "than the lags reach back; give a longer record."
            )
        n_parameters = int(self._structure().slices()[-1].stop) if self._is_wiener_hammerstein else 0
        warn(_advice.of_few_samples(n, n_parameters))

    def _warn_of_record(self, X: Array, y: Array) -> None:
        """Warn of records that do not show the dynamics, or that need a constant the model lacks."""
        if not self._is_wiener_hammerstein or len(X) <= self._lags.max_lag:
            return
        said = _advice.of_a_signal_at_rest(X, y)
        if said is None and not self._finds_constant:
            said = _advice.of_a_constant(self._structure().law, X, y)
        warn(said)

    def _warn_of_order(self, X: Any) -> None:
        """Warn of a dynamic model that is fitted to shuffled samples; once, not for every fold."""
        said = None if self.lags is None else _advice.of_the_order(sample_numbers(X))
        if said is not None and said not in TOLD:
            TOLD.add(said)
            warn(said)

    def _draw_seed(self) -> int:
        """A whole number from ``random_state``; 0 if nothing is drawn."""
        if not self._is_wiener_hammerstein or getattr(self, "gradient", "full") != "full":
            return 0
        return int(check_random_state(getattr(self, "random_state", None)).randint(2**31 - 1))


def warn(said: str | None) -> None:
    """Issue the warning, if there is one, at the line outside the package that led to it."""
    if said is None:
        return
    frame: Any = sys._getframe(1)
    level = 2
    while frame.f_back is not None and frame.f_code.co_filename.startswith(PACKAGE):
        frame, level = frame.f_back, level + 1
    warnings.warn(said, UserWarning, stacklevel=level)
