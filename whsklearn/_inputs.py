"""Checks of what a user gives: real numbers, shapes of records, marks of experiments."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from numbers import Real
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

LARGEST = 1e30  # squares and products of four stay finite


def check_whole(name: str, value: Any, least: int, meaning: str = "") -> None:
    """Raise if a setting is no whole number of ``least`` or more; True is none either."""
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or value < least:
        raise ValueError(f"{name} is {value!r}, expected a whole number of {least} or more{meaning}.")


def check_above_zero(name: str, value: Any, meaning: str = "") -> None:
    """Raise if a setting is no finite number above zero; True is none either."""
    if isinstance(value, (bool, np.bool_)) or not isinstance(value, Real) or not 0.0 < float(value) < np.inf:
        raise ValueError(f"{name} is {value!r}, expected a number above zero{meaning}.")


def check_lengths(X: NDArray[np.float64], y: NDArray[np.float64]) -> None:
    """Raise if X and y differ in length or hold what no log has, such as the NaN that "nan" becomes."""
    if len(X) != len(y):
        raise ValueError(f"X has {len(X)} rows and y has {len(y)}; expected one output a row: cut the log to match.")
    for name, values in (("X", X), ("y", y)):
        if not np.isfinite(values).all():
            raise ValueError(_reworded(f"{name} contains NaN", X, y))
        if values.size and max(values.max(), -values.min()) > LARGEST:
            raise ValueError(f"{name} holds {np.abs(values).max():.3g}, expected at most {LARGEST:g}; check its unit.")


def writeable(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """A contiguous array that is not read-only: for those a kernel would be compiled once more."""
    return np.array(values) if not values.flags.writeable else np.ascontiguousarray(values)


@contextmanager
def in_one_sentence(X: Any, y: Any = None) -> Iterator[None]:
    """Reword what scikit-learn's validation refuses: what was got, what was expected, what to do.

    Missing values in columns of objects are refused first: scikit-learn lets some through, and trips over others.
    """
    for name, values in (("X", X), ("y", y)):
        if (row := _first_missing(values)) >= 0:
            raise ValueError(f"{name} contains NaN, first in row {row}, expected finite numbers; cut such samples out.")
    try:
        with np.errstate(invalid="ignore", over="ignore"):  # the sum of inf and -inf is how it is looked for
            yield
    except ValueError as error:
        raise ValueError(_reworded(str(error), X, y)) from None


def _reworded(message: str, X: Any, y: Any) -> str:
    """The sentence; words that scikit-learn's own checks look for are kept."""
    first = message.splitlines()[0].rstrip(". ") if message else ""
    for name, values in (("X", X), ("y", y)):
        if f"{name} contains" in first:
            what = "NaN" if "NaN" in first else "inf or a value too large"
            return f"{name} contains {what}{_first_bad_row(values)}, expected finite numbers; cut such samples out."
    if "Expected 2D array" in first or "dim 3" in first or "dim 4" in first:
        return f"X has shape {np.shape(X)}, expected (n, columns), a row a sample: Reshape your data, X.reshape(-1, 1)."
    if "inconsistent numbers of samples" in first:
        return f"X has {len(X)} rows and y has {len(y)}; expected one output a row: cut the log to match."
    if "could not convert string" in first:
        return f"{first}, expected numbers; convert that column or leave it out."
    if "Complex data not supported" in first:
        return "Complex data not supported, expected real numbers; give the real part."
    if "is expecting" in first:
        return f"{first}; give the columns it was fitted on."
    if "should be a 1d array" in first:
        return f"{first}, expected one output a row; pick one column."
    return message


def _first_bad_row(values: Any) -> str:
    """Where the first number is that is not finite."""
    try:
        good = np.isfinite(np.asarray(values, dtype=np.float64))
    except (TypeError, ValueError):
        return ""
    return f", first in row {np.argmin(good.reshape(len(good), -1).all(axis=1))}"


def _first_missing(values: Any) -> int:
    """The first row of an array of objects that holds None, NaN, NaT or pandas' NA; -1 if there is none."""
    if values is None:
        return -1
    try:
        array = np.asarray(values)
    except ValueError:  # rows of different lengths, which is said elsewhere
        return -1
    if array.dtype.kind != "O" or not array.ndim or not array.size:
        return -1
    from pandas import isna

    missing = np.asarray(isna(array)).reshape(len(array), -1).any(axis=1)
    return int(np.argmax(missing)) if missing.any() else -1


def starts(groups: ArrayLike | None, n: int, first: bool, last: object = None) -> NDArray[np.bool_]:
    """Where an experiment begins: where ``groups`` changes, and at row 0 if ``first``.

    ``last`` is the group of the sample before row 0.
    """
    restart = np.zeros(n, dtype=bool)
    if groups is not None:
        labels = np.asarray(groups)
        if labels.shape != (n,):
            raise ValueError(f"groups has shape {labels.shape}, expected ({n},): one experiment a row.")
        if (missing := labels != labels).any():  # NaN
            raise ValueError(f"groups has no label in row {np.argmax(missing)}, expected one a row; give it a number.")
        restart[1:] = labels[1:] != labels[:-1]
        restart[0] = str(labels[0]) != last
    if first and n:
        restart[0] = True
    return restart


def real_array(values: Any, name: str) -> NDArray[np.float64]:
    """A float array of any shape; complex numbers, dates and text are refused, not converted.

    Raises ValueError if ``values`` are not real numbers or rows have different lengths.
    """
    try:
        array = np.asarray(values)
        if array.dtype.kind == "O":
            array = array.astype(np.float64)
    except (TypeError, ValueError):
        array = np.array("")
    if array.dtype.kind not in "biuf":
        raise ValueError(f"{name} holds values that are not numbers; expected real numbers, rows of one length.")
    return array.astype(np.float64, copy=False)
