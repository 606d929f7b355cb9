"""Streaming methods of the inverse dynamics, and the state that they carry from piece to piece."""

from __future__ import annotations

from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.utils.validation import check_is_fitted, validate_data

from whsklearn.effects import PreslidingHysteresis
from whsklearn.effects.base import Array
from whsklearn.filtering.streams import causal_motion
from whsklearn.lags.axis_rows import AT_START, RowState, advance, effect_terms, runs


class MotionStream:
    """Methods of a causal `InverseDynamicsLags`, which provides the attributes declared here."""

    _stream: RowState
    _kernels: Array
    _drive: Any
    _settle: Any
    fit: Any
    causal: bool
    cutoff_: float
    effects: Any
    law: Any
    sample_rate: float
    standstill: float | None
    terms_: tuple[Any, ...]
    warmup_: int

    def partial_fit_transform(self, X: ArrayLike, y: ArrayLike | None = None, groups: ArrayLike | None = None) -> Array:
        """Columns of the next piece of a stream, continuing where the last piece ended; shape (n, n_terms).

        Raises
        ------
        ValueError
            If the transformer is not causal, or an effect needs the whole record.
        """
        X = self._next_piece(X)
        drive = self._drive(X, y)
        return self._go_on(X, drive, drive, groups)[0]

    def partial_rows(self, X: ArrayLike, y: ArrayLike, groups: ArrayLike | None = None) -> tuple[Array, Array]:
        """Regression rows of the next piece of a stream, the torque delayed like the columns.

        Rows of the warm-up are dropped, so the first pieces may give no rows.
        """
        X = self._next_piece(X)
        target = np.asarray(y, dtype=float).ravel()
        if len(target) != len(X) or not np.isfinite(target).all():
            raise ValueError(f"y must be {len(X)} finite torques; give one for each row of X.")
        memory = self._stream.path
        phi, late, warm = self._go_on(X, self._drive(X, target), target, groups)
        keep = ~warm
        if self.standstill:
            speeds = [
                causal_motion(X[s, 0], np.empty(0) if i else memory, self._kernels)[0].velocity
                for i, s in enumerate(runs(groups, len(X)))
            ]
            keep &= np.abs(np.concatenate(speeds)) >= self.standstill
        return phi[keep], late[keep]

    def begin(self) -> None:
        """Begin a new experiment: the next row of a stream has no past."""
        self._stream = AT_START

    def get_state(self) -> dict[str, Any]:
        """The arrays and numbers that a stream needs to continue."""
        check_is_fitted(self, "terms_")
        return {"n_features_in": int(self.n_features_in_), "cutoff": float(self.cutoff_), **self._stream._asdict()}

    def set_state(self, state: dict[str, Any]) -> Self:
        """Continue from what `get_state` of a transformer with the same parameters returned.

        Raises
        ------
        ValueError
            If the state is of another kind.
        """
        if not isinstance(state, dict) or not {"n_features_in", "cutoff", *RowState._fields} <= state.keys():
            raise ValueError("This is not a state of InverseDynamicsLags; give what get_state() returned.")
        path, drive, torque = (np.array(state[name], dtype=float) for name in ("path", "drive", "torque"))
        self._settle()
        self.n_features_in_ = int(state["n_features_in"])
        self.cutoff_ = float(state["cutoff"])
        self._stream = RowState(path, drive, torque, int(state["seen"]))
        return self

    def _go_on(
        self, X: Array, drive: Array, target: Array, groups: ArrayLike | None
    ) -> tuple[Array, Array, NDArray[np.bool_]]:
        """Columns, delayed torque and warm-up rows of a piece of the stream; a new group starts a new stream."""
        stream, out = self._stream, []
        for i, s in enumerate(runs(groups, len(X))):
            stream = AT_START if i else stream
            warm = stream.seen + np.arange(s.stop - s.start) < self.warmup_
            phi, late, stream = self._advance(stream, X[s, 0], drive[s], target[s])
            out.append((phi, late, warm))
        self._stream = stream
        phis, lates, warms = zip(*out, strict=True)
        return np.concatenate(phis), np.concatenate(lates), np.concatenate(warms)

    def _advance(self, stream: RowState, path: Array, drive: Array, target: Array) -> tuple[Array, Array, RowState]:
        """Columns and delayed torque of the next piece, zeros in the warm-up, and the stream after it."""
        return advance(stream, path, drive, target, self.terms_, self._kernels, self.sample_rate)

    def _next_piece(self, X: ArrayLike) -> Array:
        """Check a piece of a stream; the first piece fixes the columns."""
        if not self.causal:
            raise ValueError(
                "A zero-phase filter needs the whole record; use causal=True for a stream, whose delay is then known."
            )
        terms = getattr(self, "terms_", None) or effect_terms(self.law, self.effects)
        whole = [t.name for t in terms if isinstance(t, PreslidingHysteresis) or t.column_kind == "first_order"]
        if whole:
            raise ValueError(f"{', '.join(whole)} needs the whole record; remove it from a stream's effects.")
        if not hasattr(self, "terms_"):
            self.fit(X)
        return validated(self, X)


def validated(owner: Any, X: ArrayLike, reset: bool = False) -> Array:
    """X as a finite (n, 1) or (n, 2) array of floats; an array that is valid already skips full validation."""
    known = () if reset or hasattr(owner, "feature_names_in_") else (getattr(owner, "n_features_in_", 0),)
    if type(X) is np.ndarray and X.dtype == np.float64 and X.shape[1:] == known and len(X) and np.isfinite(X).all():
        return X
    return np.asarray(validate_data(owner, X, dtype=np.float64, reset=reset))
