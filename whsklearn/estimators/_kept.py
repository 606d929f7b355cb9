"""Keeping the learned state: between threads, as a dict, in a file."""

from __future__ import annotations

import copy
import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Self

import numpy as np
from sklearn.base import clone
from sklearn.utils.validation import check_is_fitted

from whsklearn.estimators._fitted import FittedModel
from whsklearn.state.files import read_state, write_state

LARGEST_COUNT = 2**62  # of samples: a stream at 1 MHz reaches it after 100,000 years; twice as many exceed an int64
LEARNT = ("theta", "ud", "loss", "memory_u", "memory_y", "recent_u", "recent_y", "rows", "targets", "before")


class KeptModel(FittedModel):
    """A fitted model whose state can be taken, set, saved and loaded, by one thread at a time."""

    @property
    def _lock(self) -> threading.RLock:
        """The lock for threads that learn or read; it is not part of the state, so it is not copied or saved."""
        found: threading.RLock = self.__dict__.get("_own_lock") or self.__dict__.setdefault(
            "_own_lock", threading.RLock()
        )
        return found

    @contextmanager
    def _alone(self) -> Iterator[None]:
        """Block other threads that learn or read the learned state."""
        with self._lock:
            yield

    def __getstate__(self) -> dict[str, Any]:
        state = dict(super().__getstate__())
        state.pop("_own_lock", None)
        return state

    def __setstate__(self, state: dict[str, Any]) -> None:
        super().__setstate__(state)
        held: dict[str, Any] = state.get("state_", {})
        for name, value in held.items():  # joblib maps large arrays from a file, read-only; a stream changes its own
            held[name] = value.copy() if isinstance(value, np.ndarray) and not value.flags.writeable else value

    def get_state(self) -> dict[str, Any]:
        """Return a copy of the learned state as a dict of arrays and numbers."""
        check_is_fitted(self, "state_")
        with self._alone():
            state = {"n_features_in": int(self.n_features_in_), "state": copy.deepcopy(self.state_)}
            if hasattr(self, "feature_names_in_"):
                state["feature_names_in"] = [str(n) for n in self.feature_names_in_]
            if hasattr(getattr(self, "lags_", None), "get_state"):
                state["lags"] = self.lags_.get_state()
        return state

    def set_state(self, state: dict[str, Any]) -> Self:
        """Continue from what `get_state` of an estimator with the same parameters returned.

        Raises ValueError if the state is of another kind of estimator, or its orders differ.
        """
        if not isinstance(state, dict) or not {"n_features_in", "state"} <= state.keys():
            raise ValueError("This is not a state of an estimator; give what get_state() returned.")
        with self._alone(), self._unchanged_if_refused():
            self._keep_lags()
            if type(state["n_features_in"]) is not int or state["n_features_in"] < 1:
                raise ValueError(f"This state has {state['n_features_in']!r} inputs, expected a whole number.")
            self.n_features_in_ = state["n_features_in"]
            self.__dict__.pop("feature_names_in_", None)
            if "feature_names_in" in state:
                self.feature_names_in_ = np.array(state["feature_names_in"], dtype=object)
            if "lags" in state and hasattr(getattr(self, "lags_", None), "set_state"):
                self.lags_.set_state(state["lags"])
            try:
                self._check_state(state["state"])
            except (TypeError, KeyError, IndexError, AttributeError, ArithmeticError, MemoryError):
                raise ValueError("This state holds invalid values; give what get_state() returned.") from None
            self.state_ = copy.deepcopy(state["state"])
        return self

    def _check_state(self, state: dict[str, Any]) -> None:
        """Raise if a state cannot belong to this estimator."""
        if not isinstance(state, dict) or "theta" not in state:
            raise ValueError("This state holds no theta; give what get_state() of the same estimator returned.")
        seen = state.get("seen", 0)
        if type(seen) is not int or seen < 0:
            raise ValueError(f"The state has seen {seen!r}, expected a count; go back to an earlier one.")
        for name, value in state.items():
            if isinstance(value, np.ndarray) and value.dtype.kind == "f" and np.isnan(value).any() and name in LEARNT:
                raise ValueError(f"This state has NaN in {name}, expected numbers; go back to an earlier one.")
            whole = isinstance(value, int) or (isinstance(value, np.ndarray) and value.dtype.kind in "iu")
            if whole and np.any(np.abs(value) >= LARGEST_COUNT):
                raise ValueError(f"This state has {np.max(np.abs(value))} in {name}, an impossible count.")

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write parameters and state to a file, atomically and without pickle."""
        write_state(path, type(self).__name__, self.get_params(deep=False), self.get_state())

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Self:
        """Read what `save` wrote; a stream continues from there.

        Raises ValueError if the file is damaged, not one that `save` wrote, or of another estimator.
        """
        params, state = read_state(path, cls.__name__)
        try:
            return cls(**params).set_state(state)
        except TypeError:
            more = sorted(set(params) - set(cls().get_params(deep=False)))
            raise ValueError(
                f"{os.fspath(path)}: this state has {', '.join(more) or 'values'} that {cls.__name__} does not know; "
                "upgrade whsklearn, or go back to an earlier file."
            ) from None
        except ValueError as error:
            raise ValueError(f"{os.fspath(path)}: {error}") from None

    @contextmanager
    def _unchanged_if_refused(self) -> Iterator[None]:
        """Restore every attribute if the call within fails, including fitted ones such as n_features_in_."""
        before = self.__dict__.copy()
        try:
            yield
        except BaseException:
            self.__dict__ = before  # one step, which a second interrupt cannot split
            raise

    def _keep_lags(self) -> None:
        """Check the kind of ``lags`` and keep a copy as ``lags_``."""
        lags = self._given_lags
        self.__dict__.pop("lags_", None)
        if lags is None:
            return
        makes_rows = hasattr(lags, "partial_rows") and not self._is_wiener_hammerstein
        if isinstance(lags, type) or not (hasattr(lags, "key_term") or makes_rows):
            raise ValueError(
                f"lags is {lags!r}, expected None, WienerHammersteinLags() or, for recursive least squares, "
                "InverseDynamicsLags(); give one of them."
            )
        if hasattr(lags, "advance") and lags.advance() != 0 and not self._takes_direct_paths:
            raise ValueError(
                f"delays is {lags.delays!r}, but {type(self).__name__} needs one sample in each block; leave it at "
                '(1, 1), or fit PEMRegressor(lags, criterion="simulation").'
            )
        self.lags_ = clone(lags)
