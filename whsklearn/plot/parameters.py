"""Parameters by name, and how they move while a record streams by."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

BLOCKS = {"a": "L1", "b": "L1", "c": "L2", "d": "L2"}


def flat_parameters(parameters: Mapping[str, Any]) -> dict[str, float]:
    """One number a name, in the order of the chain: L1, friction, L2; a[0] = c[0] = 1 are left out.

    Parameters
    ----------
    parameters : mapping of str to float or array
        Such as ``parameters_`` of an estimator.

    Examples
    --------
    >>> flat_parameters({"a": [1.0, 2.2], "b": [1.0], "c": [1.0], "d": [0.4], "coulomb": 0.7})
    {'a2': 2.2, 'b1': 1.0, 'coulomb': 0.7, 'd1': 0.4}
    """
    blocks = {
        k: {
            f"{k}{i}": float(w)
            for i, w in enumerate(np.atleast_1d(parameters.get(k, ())), 1)
            if not (k in "ac" and i == 1)
        }
        for k in BLOCKS
    }
    law = {k: float(v) for k, v in parameters.items() if k not in BLOCKS and np.ndim(v) == 0}
    return {**blocks["a"], **blocks["b"], **law, **blocks["c"], **blocks["d"]}


def parameter_paths(
    estimator: Any, X: ArrayLike, y: ArrayLike, *, every: int = 10
) -> tuple[NDArray[np.int64], dict[str, NDArray[np.float64]]]:
    """Feed a fresh clone the record in blocks of `every` samples and note its parameters after each.

    Parameters
    ----------
    estimator : estimator
        With `partial_fit`; it stays as it is.
    X : array-like of shape (n, n_features)
    y : array-like of shape (n,)
    every : int, default=10
        Samples between two notes.

    Returns
    -------
    steps : ndarray of shape (n_blocks,)
        Samples seen.
    paths : dict of str to ndarray of shape (n_blocks,)
        One path a parameter of `flat_parameters`.

    Examples
    --------
    >>> import numpy as np
    >>> from whsklearn import RLSRegressor, WienerHammersteinLags
    >>> from whsklearn.plot import parameter_paths
    >>> X = np.random.default_rng(0).normal(size=(40, 1))
    >>> lags = WienerHammersteinLags(n_a=1, n_b=0, n_c=1, n_d=0, law="linear")
    >>> model = RLSRegressor(lags, gradient="pseudolinear")
    >>> steps, paths = parameter_paths(model, X, np.r_[0.0, 0.0, 2.0 * X[:-2, 0]], every=20)
    >>> steps.tolist(), paths["x1"].round(3)[-1]
    ([20, 40], np.float64(2.0))
    """
    from sklearn.base import clone

    X, y, model = np.asarray(X), np.asarray(y), clone(estimator)
    ends = np.unique([*range(every, len(y), every), len(y)])
    rows, start = [], 0
    for end in ends:
        model.partial_fit(X[start:end], y[start:end])
        rows.append(flat_parameters(model.parameters_))
        start = end
    return ends, {name: np.array([row[name] for row in rows]) for name in rows[0]}


def block_of(name: str) -> str:
    """The block of the chain that a name of `flat_parameters` belongs to: L1, L2 or friction."""
    return BLOCKS.get(name[0], "friction") if name[1:].isdigit() else "friction"
