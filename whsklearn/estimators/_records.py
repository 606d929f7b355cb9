"""Several records in one call: as a list, or as one array with ``groups``; and a weight for each sample."""

from __future__ import annotations

import sys
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from whsklearn._inputs import LARGEST
from whsklearn.effects.base import Array, Integers
from whsklearn.logs.source import as_frame


class Given(NamedTuple):
    """The caller's arguments, joined: X, y, groups, sample_weight and, for a list of records, their lengths."""

    X: Any
    y: Any
    groups: Any
    sample_weight: Any
    lengths: tuple[int, ...] | None = None

    def apart(self, values: Array) -> Any:
        """The result for every sample, as a list if the records came as a list."""
        return values if self.lengths is None else np.split(values, np.cumsum(self.lengths)[:-1])


def sample_numbers(X: Any) -> Integers | None:
    """Positions of the samples in their original record, shape (n,); None if they are unknown.

    They are known from a frame's index, or from scikit-learn while it fits a fold.
    """
    index = getattr(X, "index", None)
    if getattr(getattr(index, "dtype", None), "kind", "") in ("i", "u"):
        return np.asarray(index, dtype=np.int64)
    fold = fold_of_a_search()
    train = None if fold is None else fold.get("train")
    same = isinstance(train, np.ndarray) and train.dtype.kind in "iu" and train.size == len(X)
    return train.astype(np.int64) if same else None  # type: ignore[union-attr]


def fold_of_a_search() -> dict[str, Any] | None:
    """Information from scikit-learn on the fold that it fits or scores; None outside a search or a cross-validation.

    scikit-learn hands an estimator the samples of a fold without their indices.
    """
    frame = sys._getframe()
    while frame is not None:
        if frame.f_code.co_name in ("_fit_and_score", "_fit_and_predict"):
            return frame.f_locals
        frame = frame.f_back  # type: ignore[assignment]
    return None


def joined(
    X: ArrayLike, y: ArrayLike | None = None, groups: ArrayLike | None = None, sample_weight: ArrayLike | None = None,
    first: int = 0,
) -> Given:  # fmt: skip
    """Join the records of a list, each an experiment of its own; return anything else, such as rows, unchanged.

    ``X`` is (n_i, n_features): arrays or frames.
    ``y``, ``sample_weight`` are (n_i,).
    ``groups``: not allowed together with a list.
    ``first``: label of the first experiment.
    Raises ValueError if the lists differ in length, or are given together with groups.
    """
    if not (isinstance(X, (list, tuple)) and X and all(len(getattr(x, "shape", ())) == 2 for x in X)):
        return Given(X, y, groups, sample_weight)
    if groups is not None:
        raise ValueError("X is a list of records, each an experiment of its own, so groups is not allowed; remove it.")
    records: Any = X
    lengths = tuple(len(x) for x in records)
    parts = {}
    for name, values in (("y", y), ("sample_weight", sample_weight)):
        if values is None:
            continue
        got = [np.shape(v)[:1] for v in values] if isinstance(values, (list, tuple)) else None
        if got != [(n,) for n in lengths]:
            raise ValueError(
                f"X is a list of {len(lengths)} records, expected {name} as a list of as many arrays, each as long as "
                "its record."
            )
        parts[name] = np.concatenate([np.asarray(v) for v in values])  # type: ignore[union-attr]
    labels = np.repeat(np.arange(first, first + len(lengths)), lengths)
    together = _stacked(records)
    return Given(together, parts.get("y"), labels, parts.get("sample_weight"), lengths)


def _stacked(X: Any) -> Any:
    """Frames keep the names of their columns."""
    if all(hasattr(x, "columns") for x in X):
        from pandas import concat

        return concat([as_frame(x) for x in X], ignore_index=True)
    widths = {np.shape(x)[1] for x in X}
    if len(widths) > 1:
        raise ValueError(f"The records have {sorted(widths)} columns, expected the same number; give the same inputs.")
    return np.concatenate([np.asarray(x) for x in X])


def checked_weights(sample_weight: ArrayLike | None, n: int, *, some: bool) -> Array | None:
    """Weights as a float array; None if all are one.

    ``sample_weight`` is (n,), a number, or None. ``some``: whether at least one must be above zero. Raises ValueError
    if they have another shape, are not finite, are negative, or are all zero.
    """
    if sample_weight is None:
        return None
    try:
        weights = np.asarray(sample_weight, dtype=np.float64)
    except (TypeError, ValueError):
        weights = np.array(np.nan)
    weights = np.full(n, float(weights)) if weights.ndim == 0 else weights
    if weights.shape != (n,):
        raise ValueError(f"sample_weight has shape {weights.shape}, expected ({n},): one weight per sample.")
    if not np.isfinite(weights).all() or (weights < 0).any() or (weights > 1e12).any():
        raise ValueError("sample_weight holds invalid weights, expected 0 to 1e12; correct those samples.")
    if some and n and not weights.any():
        raise ValueError("sample_weight is zero for every sample; give at least one sample a weight above zero.")
    return None if (weights == 1.0).all() else np.ascontiguousarray(weights)


def is_plain(X: Any, y: Any, n_features: int) -> bool:
    """Whether X and y are what validation would return unchanged: the guarded fast path."""
    if type(X) is not np.ndarray or type(y) is not np.ndarray:
        return False
    if X.dtype != np.float64 or y.dtype != np.float64 or X.ndim != 2 or y.ndim != 1:
        return False
    if X.shape[0] != y.shape[0] or X.shape[1] != n_features or y.shape[0] == 0:
        return False
    if not (X.flags.carray and y.flags.carray):
        return False
    if y.size == 1:
        # Plain numbers: one NumPy call takes longer than checking a short row. No comparison holds for NaN.
        return abs(y.item()) < LARGEST and all(abs(v) < LARGEST for v in X.ravel().tolist())
    with np.errstate(over="ignore"):  # the sum of squares is not finite if any number is not
        return bool(np.dot(y, y) < 1e60) and bool(np.vdot(X, X) < 1e60)
