"""Regressor columns of an effect: its compiled equation over the arrays of a record."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from whsklearn.effects import codes
from whsklearn.effects.base import Effect
from whsklearn.effects.own import address_of, own_values_along
from whsklearn.effects.rows import values_along

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

_BARELY = 1e-300  # the size at which a column that changes with the size is read off where the size is zero


def columns_of(effect: Effect, signals: Any) -> Array:
    """Columns (n_samples, n_columns) of an effect at its shape, for its coefficients; see `Effect.columns`."""
    n = np.asarray(signals.position).size
    if effect.column_kind == "first_order":
        return _rate(signals).reshape(-1, 1)
    if effect.column_kind == "none" or effect.code < 0:
        return np.empty((n, 0))
    if effect.column_kind == "at_size":
        size = effect.magnitude
        if math.isinf(size):
            return np.zeros((n, 1))
        size = size if size != 0.0 else _BARELY
        return (values(effect, (size, *effect.row[1:]), signals) / size).reshape(-1, 1)
    shape = effect.row[effect.linear() :]
    return np.column_stack([values(effect, (*unit, *shape), signals) for unit in np.eye(effect.linear())])


def values(effect: Effect, row: tuple[float, ...], signals: Any) -> Array:
    """The drive that the effect takes (Nm), or what it adds to the reading (rad), with the numbers of ``row``: (n,)."""
    absent = np.zeros(np.asarray(signals.position).size)
    time, position, velocity, acceleration, drive = (
        np.ascontiguousarray(getattr(signals, name, absent), dtype=float)
        for name in ("time", "position", "velocity", "acceleration", "drive")
    )
    if effect.evaluate is not None:
        return own_values_along(address_of((type(effect),)), np.array(row), time, position, velocity, drive)
    p = np.zeros((1, codes.N_NUMBERS))
    p[0, : len(row)] = row
    kappa = getattr(signals, "kappa", None)
    sharpness = math.inf if kappa is None else float(kappa)
    return values_along(effect.code, p, time, position, velocity, acceleration, drive, sharpness)


def _rate(signals: Any) -> Array:
    """Central difference of the drive in time: what a small delay or lag takes from it, a second of either."""
    return np.gradient(np.asarray(signals.drive, dtype=float), np.asarray(signals.time, dtype=float))
