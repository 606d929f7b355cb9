"""The innovations of a stream: one-step errors with the parameters that were known beforehand.

The model at the beginning of a block predicts the whole block one step ahead, from the rows before it.  Blocks lie
at fixed row counts, so an innovation depends neither on the chunks in which rows arrive nor on restarts.
"""

from __future__ import annotations

import copy
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sklearn.base import clone

BLOCK = 100  # rows
CONTEXT = 300  # rows before a block, over which the effect of the predictor's start at rest dies out


class Innovations:
    """One-step errors of a learning model, block by block.

    Parameters
    ----------
    model : estimator
        The estimator that learns; a second one of the same kind predicts.
    n_outputs : int
        Number of outputs, which are the last columns of a row.

    Notes
    -----
    Where the lags smooth over a moving window (those of an arm), an innovation belongs to the sample in the middle of
    the window that ends with the row.
    """

    def __init__(self, model: Any, n_outputs: int = 1):
        self.model, self.n_outputs = model, n_outputs
        self._before: Any = None
        self.rows = np.empty((0, 0))
        self.experiments = np.empty(0, dtype=np.int64)
        self.new = 0

    def learnt(self, rows: NDArray[np.float64], experiments: NDArray[np.int64]) -> None:
        """Add rows that the model has learnt, at most up to the end of a block."""
        self.rows = np.concatenate([self.rows.reshape(-1, rows.shape[1]), rows])
        self.experiments = np.concatenate([self.experiments, experiments])
        self.new += len(rows)

    def of_block(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Outputs of the complete block and their innovations, (n, n_outputs) each; the next block begins.

        Innovations are NaN where there was no model yet.
        """
        first = len(self.rows) - self.new
        y = self.rows[:, -self.n_outputs :]
        e = np.full((self.new, self.n_outputs), np.nan)
        if self._before is not None:
            X, known = self.rows[:, : -self.n_outputs], y if self.n_outputs > 1 else y[:, 0]
            y_hat = self._before.predict_ahead(X, known, horizon=1, groups=self.experiments, settle=False)
            if self.n_outputs > 1:
                lags = self._before.lags_
                y = np.roll(y, lags.delay_, axis=0)
                begun = np.flatnonzero(np.diff(self.experiments, prepend=self.experiments[0] - 1))
                past = np.arange(len(y)) - begun[np.searchsorted(begun, np.arange(len(y)), side="right") - 1]
                y_hat[past < lags.warmup_] = np.nan
            e = (y - y_hat.reshape(y.shape))[first:]
        self._before = copy.copy(self.model)  # what set_state of a clone does, without its checks
        self._before.state_ = copy.deepcopy(self.model.state_)
        self.rows, self.experiments, self.new = self.rows[-CONTEXT:], self.experiments[-CONTEXT:], 0
        return y[first:], e

    def get_state(self) -> dict[str, Any]:
        """Everything that `set_state` needs to continue identically."""
        before = {} if self._before is None else self._before.get_state()
        return {"before": before, "rows": self.rows, "experiments": self.experiments, "new": self.new}

    def set_state(self, state: dict[str, Any]) -> None:
        """Continue from a state that `get_state` returned."""
        self._before = clone(self.model).set_state(state["before"]) if state["before"] else None
        self.rows, self.experiments, self.new = state["rows"], state["experiments"], state["new"]
