"""Small pure helpers that columns are made of: the sign of velocity, waves over position, a derivative in time."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray


def direction(signals: Any) -> NDArray[np.float64]:
    """sign(v), or tanh(kappa v) where the signals carry a finite kappa."""
    velocity = np.asarray(signals.velocity, dtype=float)
    kappa = getattr(signals, "kappa", None)
    return np.sign(velocity) if kappa is None or not np.isfinite(kappa) else np.tanh(kappa * velocity)


def waves(argument: NDArray[np.float64]) -> NDArray[np.float64]:
    """cos and sin of an argument as two columns."""
    return np.column_stack([np.cos(argument), np.sin(argument)])


def rate(values: NDArray[np.float64], time: NDArray[np.float64]) -> NDArray[np.float64]:
    """Central difference of a signal in time."""
    return np.gradient(np.asarray(values, dtype=float), np.asarray(time, dtype=float))


def as_column(values: Any) -> NDArray[np.float64]:
    """A signal as a matrix of one column."""
    return np.asarray(values, dtype=float).reshape(-1, 1)
