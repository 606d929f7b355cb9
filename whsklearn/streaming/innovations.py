"""The innovations of a stream: one-step errors with the parameters that were known before.

The model of a block's beginning predicts the whole block one step ahead, from the rows before it.  Blocks lie
at fixed row counts, so neither the blocks in which rows arrive nor a restart changes an innovation.
"""

from __future__ import annotations

import copy
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sklearn.base import clone

BLOCK = 100  # rows
CONTEXT = 300  # rows before a block, in which the predictor forgets that it starts from rest


class Innovations:
    """One-step errors of a learning model, block by block.

    Parameters
    ----------
    model : estimator
        The one that learns; a second one of its kind does the predicting.
    n_outputs : int
        Outputs, the last columns of a row.

    Notes
    -----
    Where the lags smooth over a moving window (those of an arm), an innovation is of the sample in the middle of the
    window that ends with the row.
    """

    def __init__(self, model: Any, n_outputs: int = 1):
        self.model, self.n_outputs = model, n_outputs
        self._before: Any = None
        self.rows = np.empty((0, 0))
        self.experiments = np.empty(0, dtype=np.int64)
        self.new = 0

    def learnt(self, rows: NDArray[np.float64], experiments: NDArray[np.int64]) -> None:
        """Take note of rows that the model has learnt; at most up to the end of a block."""
        self.rows = np.concatenate([self.rows.reshape(-1, rows.shape[1]), rows])
        self.experiments = np.concatenate([self.experiments, experiments])
        self.new += len(rows)

    def of_block(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Outputs of the block that is complete and their innovations, (n, n_outputs) each; the next one begins.

        Innovations are NaN where nothing was known before.
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
        """What `set_state` needs to go on identically."""
        before = {} if self._before is None else self._before.get_state()
        return {"before": before, "rows": self.rows, "experiments": self.experiments, "new": self.new}

    def set_state(self, state: dict[str, Any]) -> None:
        """Go on from a state that `get_state` gave."""
        self._before = clone(self.model).set_state(state["before"]) if state["before"] else None
        self.rows, self.experiments, self.new = state["rows"], state["experiments"], state["new"]
