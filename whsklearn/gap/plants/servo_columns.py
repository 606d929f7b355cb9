"""Torque columns of a candidate on given signals, by the catalogue's own equation."""

from __future__ import annotations

from typing import Any, NamedTuple

from numpy.typing import NDArray

from whsklearn.gap.plants.servo_candidates import Candidate

Array = NDArray[Any]


class ColumnSignals(NamedTuple):
    """The signals from which an effect's columns are computed, shape (n,) each.

    If an effect acts on the drive, ``drive`` is the torque that the model predicts; with the measured one the effect
    could explain the drive by itself.  ``kappa`` (s/rad) softens sign(v) to tanh(kappa v); None keeps the sign.
    """

    time: Array
    position: Array
    velocity: Array
    acceleration: Array
    drive: Array
    kappa: float | None = None


def effect_columns(kind: Candidate, shape: tuple[float, ...], signals: ColumnSignals) -> Array:
    """Torque per unit of size at this shape, shape (n, 1), or (n, 2) for a cosine and a sine."""
    return kind.unit_columns(shape, signals)
