"""Base parameters: the combinations of an arm's numbers that its drives can identify."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from whsklearn.effects.base import Array

# As a share of a column's length. The part that earlier columns leave unexplained is either rounding (1e-13 on random
# motion) or above 1e-5 (random arms of 2 to 7 joints); the tolerance lies between.
TOLERANCE = 1e-9


@dataclass(frozen=True, eq=False)
class BaseParameters:
    """Which columns a regression keeps, and which parameters each of their weights combines.

    Attributes
    ----------
    names : tuple of str
        Names of the columns kept, shape (b,).
    kept : ndarray of int, shape (b,)
        Their indices among all columns.
    mapping : ndarray of shape (b, n_columns)
        Maps a full set of parameters to base parameters: ``mapping @ numbers``.
    merged : dict of str to dict of str to float
        For each name kept, the other parameters that its weight includes, with their factors.
    unseen : tuple of str
        Parameters that no motion can reveal.

    References
    ----------
    Gautier 1991, Numerical calculation of the base inertial parameters of robots, J. Robotic Systems 8(4), 485-506.

    Examples
    --------
    >>> import numpy as np
    >>> from whsklearn.systems import base_parameters
    >>> a, b = np.random.default_rng(0).normal(size=(2, 20))
    >>> base = base_parameters(np.column_stack([a, b, a + 2 * b, 0 * a]), ["m", "J", "d", "z"])
    >>> base.names, base.unseen, base.merged["J"]["d"]
    (('m', 'J'), ('z',), 2.0)
    """

    names: tuple[str, ...]
    kept: NDArray[np.int64]
    mapping: Array
    merged: dict[str, dict[str, float]]
    unseen: tuple[str, ...]


def base_parameters(
    columns: ArrayLike, names: Sequence[str], groups: Sequence[int] = (), tolerance: float = TOLERANCE
) -> BaseParameters:
    """Keep each column that is not a combination of those before it, group by group in the given order.

    Within a group, the column with the largest remainder comes first: among the inertias of a link that turns about z,
    Izz then represents the sum, and not an Ixx that is visible only through a hundredth of a degree of tilt.

    Parameters
    ----------
    columns : array-like of shape (m, n_columns)
        Regressor along motion that excites everything, m at least as large as n_columns.
    names : sequence of str
        Names of the columns.
    groups : sequence of int, optional
        Number of columns in each group; by default each column is a group.
    tolerance : float
        Share of a column's length below which its remainder counts as zero.

    Examples
    --------
    >>> import numpy as np
    >>> base_parameters(np.ones((4, 2)), ["m", "copy"]).names
    ('m',)
    """
    y = np.asarray(columns, dtype=float)
    lengths = np.linalg.norm(y, axis=0)
    seen = lengths > tolerance * max(float(lengths.max(initial=0.0)), 1e-300)
    scaled: Array = np.asarray(
        np.linalg.qr(y / np.where(seen, lengths, 1.0), mode="r")
    )  # as many rows as columns, with the same dependences
    basis = np.zeros((scaled.shape[0], 0))
    kept: list[int] = []
    for group in np.split(np.arange(y.shape[1]), np.cumsum(groups)[:-1] if len(groups) else np.arange(1, y.shape[1])):
        open_ = [int(i) for i in group if seen[i]]
        while open_:
            left = scaled[:, open_]
            for _ in range(2):  # twice is enough (Kahan; Giraud et al. 2005, Numer. Math. 101)
                left = left - basis @ (basis.T @ left)
            sizes = np.linalg.norm(left, axis=0)
            best = int(np.argmax(np.where(sizes > tolerance, sizes * lengths[open_], 0.0)))
            if not sizes[best] > tolerance:
                break
            kept.append(open_.pop(best))
            basis = np.column_stack([basis, left[:, best] / sizes[best]])
    kept.sort()
    index = np.array(kept, dtype=np.int64)
    mapping: Array = np.asarray(np.linalg.lstsq(scaled[:, index], scaled, rcond=None)[0], dtype=float)
    mapping *= np.where(seen, lengths, 0.0)
    mapping /= lengths[index, None]
    mapping[np.abs(mapping) < tolerance * np.abs(mapping).max(initial=0.0)] = 0.0
    mapping[:, index] = np.eye(index.size)
    merged = {
        names[i]: {names[j]: round(float(row[j]), 12) for j in map(int, np.flatnonzero(row)) if j != i}
        for i, row in zip(kept, mapping, strict=True)
    }
    unseen = tuple(names[j] for j in map(int, np.flatnonzero(~mapping.any(axis=0))))
    return BaseParameters(tuple(names[i] for i in kept), index, mapping, {k: v for k, v in merged.items() if v}, unseen)
