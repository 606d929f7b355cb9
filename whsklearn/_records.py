"""Is this a record that can be used: shapes, numbers, experiments."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

LARGEST = 1e30  # squares and products of four stay finite


def check_lengths(X: NDArray[np.float64], y: NDArray[np.float64]) -> None:
    """Raise if X and y differ in length or hold numbers that no log has."""
    if len(X) != len(y):
        raise ValueError(f"X has {len(X)} rows and y has {len(y)}; expected one output a row: cut the log to match.")
    for name, values in (("X", X), ("y", y)):
        if values.size and max(values.max(), -values.min()) > LARGEST:
            raise ValueError(f"{name} holds {np.abs(values).max():.3g}, expected at most {LARGEST:g}; check its unit.")


def starts(groups: ArrayLike | None, n: int, first: bool, last: object = None) -> NDArray[np.bool_]:
    """Where an experiment begins: where ``groups`` changes, and at row 0 if ``first``.

    ``last`` is the group of the sample before row 0.
    """
    restart = np.zeros(n, dtype=bool)
    if groups is not None:
        labels = np.asarray(groups)
        if labels.shape != (n,):
            raise ValueError(f"groups has shape {labels.shape}, expected ({n},): one experiment a row.")
        restart[1:] = labels[1:] != labels[:-1]
        restart[0] = str(labels[0]) != last
    if first and n:
        restart[0] = True
    return restart
