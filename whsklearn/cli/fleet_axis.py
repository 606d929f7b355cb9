"""One axis of a fleet: read, identify, judge; runs in any process on any machine.

Functions here take and return plain values. An axis that fails is a row of the result like any other, because one bad
log among a million must not end the job.
"""

from __future__ import annotations

import time
import warnings
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sklearn.base import clone

Row = dict[str, Any]
OUTLYING = 6.0  # robust standard deviations from the median: at least so far, as real fleets have longer tails
FALSE = 0.01  # probability that a fleet of normal numbers has an outlier


def axes_of(folder: Path, axis: str) -> list[str]:
    """Names of the axes of a Parquet folder partitioned as ``axis=NAME/``, in order.

    Raises ValueError if the folder has no such partition.
    """
    names = sorted(p.name.split("=", 1)[1] for p in folder.glob(f"{axis}=*") if p.is_dir())
    if not names:
        raise ValueError(f"{folder} holds no folder {axis}=NAME; give a Parquet folder partitioned by {axis!r}.")
    return names


def read_rows(folder: Path, axis: str, name: str, columns: list[str], time_column: str | None) -> NDArray[np.float64]:
    """The columns of one axis, shape (n, n_columns), sorted by time, or in the order of files and rows.

    Raises ValueError if the axis has no rows, a column is missing or not numeric, or a time stamp is repeated.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    files = sorted((folder / f"{axis}={name}").glob("*.parquet"))
    if not files:
        raise ValueError("no Parquet file in its folder")
    parts = []
    for file in files:
        try:
            table = pq.ParquetFile(file).read(columns=columns)
        except (pa.ArrowException, OSError) as error:
            raise ValueError(f"{file.name} cannot be read: {str(error).splitlines()[0]}") from None
        if missing := [c for c in columns if c not in table.column_names]:
            raise ValueError(f"{file.name} has no column {', '.join(missing)}")
        try:
            parts.append(np.column_stack([table.column(c).to_numpy().astype(np.float64) for c in columns]))
        except (TypeError, ValueError):
            raise ValueError(f"{file.name} holds values that are not numbers") from None
    rows = np.concatenate(parts)
    if time_column:
        time = columns.index(time_column)
        rows = rows[np.argsort(rows[:, time], kind="stable")]
        if np.any(np.diff(rows[:, time]) <= 0):
            raise ValueError(f"a {time_column} is repeated")
    return rows


def servo_log(name: str, columns: list[str], rows: NDArray[np.float64]) -> Any:
    """The `whsklearn.logs.Log` of the rows of a servo axis in the units of its columns, repaired as that of a file.

    ``columns``: of drive, position and time.
    """
    from whsklearn.logs import Column, LogWarning, Source, load_log

    source = Source(name, columns, lambda names: {n: Column(rows[:, columns.index(n)]) for n in names})
    drive, position, time = columns
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", LogWarning)  # a fleet's table has a row for each axis, and no room for remarks
        return load_log(source, time=time, drive=drive, position=position)


def identify_axis(
    model: Any, X: NDArray[np.float64], y: NDArray[np.float64], test_share: float, groups: Any = None
) -> Row:
    """Fit a clone on the first part of the record, judge its free run on the rest; of a servo axis, its drive.

    Raises ValueError, with what `fit` warned of, if the filters of an axis leave no row to judge.
    """
    from whsklearn.lags.axis_rows import rows_and_samples
    from whsklearn.metrics import mu_e, nmse, rmse
    from whsklearn.plot import flat_parameters

    stop = len(y) - int(len(y) * test_share)
    whole, first = ({}, {}) if groups is None else ({"groups": groups}, {"groups": groups[:stop]})
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always", UserWarning)
        fitted = clone(model).fit(X[:stop], y[:stop], **first)
    y_hat = fitted.predict(X, **whole)  # from the start, so that the transient is over before the test part
    row: Row = {f"{name}": value for name, value in flat_parameters(fitted.parameters_).items()}
    rows, samples = rows_and_samples(getattr(fitted, "lags_", None), groups, len(y))
    judged = samples >= (stop if test_share else 0)
    if not judged.any():
        raise ValueError(" ".join(str(w.message) for w in said) or "No row is left to judge; give a longer record.")
    for warning in said:
        warnings.warn(warning.message, warning.category, stacklevel=2)
    for index in (nmse, mu_e, rmse):
        row[index.__name__] = index(y[samples[judged]], y_hat[rows[judged]])
    return row


def identify_axes(model: Any, names: list[str], source: dict[str, Any], test_share: float) -> list[Row]:
    """One result row for each of the named axes; ``source``: those options of the command that say what to read."""
    folder, axis, inputs, clock = Path(source["folder"]), source["axis"], source["inputs"], source["time_column"]
    columns = [*inputs, source["output"], *([clock] if clock else [])]
    done = []
    for name in names:
        began = time.perf_counter()
        row: Row = {"axis": name, "rows": 0, "failure": "", "digest": digest_of(folder, axis, name)}
        try:
            rows = read_rows(folder, axis, name, columns, clock)
            if "lags__sample_rate" in model.get_params():
                log = servo_log(name, columns, rows)
                row["rows"] = len(log.drive)
                known = clone(model).set_params(lags__sample_rate=log.sample_rate)
                seen = np.column_stack([log.position, log.drive])  # the age of the drive is seen in both
                row |= identify_axis(known, seen, log.drive, test_share, log.groups)
            else:
                row["rows"] = len(rows)
                row |= identify_axis(model, rows[:, : len(inputs)], rows[:, len(inputs)], test_share)
        except (ValueError, ArithmeticError, np.linalg.LinAlgError) as error:
            row["failure"] = str(error).splitlines()[0]
        done.append(row | {"seconds": time.perf_counter() - began})
    return done


def digest_of(folder: Path, axis: str, name: str) -> str:
    """A digest of an axis's files, from sizes and modification times, to see whether they changed."""
    stats = [f.stat() for f in sorted((folder / f"{axis}={name}").glob("*.parquet"))]
    return ",".join(f"{s.st_size}:{s.st_mtime_ns}" for s in stats)


def outliers(table: Any) -> Any:
    """Outliers of a result table, worst first, with the outlying columns in ``why``; failed axes are excluded.

    A column is outlying if `far_off` says so, and by at least `OUTLYING` units of the scaled median absolute deviation
    from the fleet's median, which is what ``why`` tells; nmse on a logarithmic scale and upwards only.
    """
    import pandas as pd

    numeric = table.drop(columns=["axis", "rows", "failure", "seconds", "mu_e", "rmse"], errors="ignore").astype(float)
    if "nmse" in numeric:
        numeric["nmse"] = np.log10(numeric["nmse"].clip(lower=1e-12))
    centre = numeric.median()
    spread = 1.4826 * (numeric - centre).abs().median()
    z = (numeric - centre) / spread.where(spread > 0)
    if "nmse" in z:
        z["nmse"] = z["nmse"].clip(lower=0.0)
    level = FALSE / max(len(z.columns), 1)
    size = z.abs().where(z.apply(lambda column: far_off(column.to_numpy(), level)), 0.0)
    why = pd.Series(
        [", ".join(f"{c} {z.at[i, c]:+.1f}" for c in size.columns if size.at[i, c] > OUTLYING) for i in table.index],
        index=table.index,
        dtype=object,
    )
    worst = size.max(axis=1) if len(size.columns) else pd.Series(0.0, table.index)
    found = table.assign(why=why, worst=worst)[(why != "") & (table["failure"] == "")]
    return found.sort_values("worst", ascending=False).drop(columns="worst")


def far_off(x: NDArray[np.float64], level: float) -> NDArray[np.bool_]:
    """Which of some normal numbers are outliers, at most a third of them; shape (n,), NaN is none.

    The generalised extreme Studentised deviate: the number farthest from the mean is taken out, and again of the rest;
    the last one that is too far off for chance, and all taken out before it, are outliers.  ``level`` is the
    probability of any where there is none.  By a limit for robust deviations, which are uncertain in a small fleet, one
    axis of nine had to be off by thirty.

    References
    ----------
    Rosner 1983, Percentage points for a generalized ESD many-outlier procedure, Technometrics 25(2), 165-172, eq. 2.5.

    >>> far_off(np.array([1.0, 1.1, 0.9, 1.0, 1.2, 0.8, 1.1, 7.0]), 0.01).nonzero()[0].tolist()
    [7]
    """
    from scipy.stats import t as student

    found = np.zeros(x.size, dtype=bool)
    order = np.argsort(x)[: np.isfinite(x).sum()]  # NaN comes last
    if order.size < 3:
        return found
    y = x[order] - np.median(x[order])
    left = order.size - np.arange(max(1, (order.size - 1) // 3))
    t = student.isf(level / (2 * left), left - 2)
    limits = (left - 1) * t / np.sqrt((left - 2 + t**2) * left)
    # sums from the middle outwards, because one number of 1e12 would take the digits of all others
    middle, powers = y.size // 2, np.column_stack([y, y**2])
    below, above = (np.vstack([np.zeros(2), np.cumsum(p, axis=0)]) for p in (powers[:middle][::-1], powers[middle:]))
    low, high, last, gone = 0, y.size - 1, 0, []
    for i, (n, limit) in enumerate(zip(left, limits, strict=True), 1):
        total, squares = below[middle - low] + above[high + 1 - middle]
        mean = total / n
        deviation = np.sqrt(max(squares - n * mean**2, 0.0) / (n - 1))
        at = high if y[high] - mean > mean - y[low] else low
        if abs(y[at] - mean) > limit * deviation:
            last = i
        gone.append(at)
        low, high = low + (at == low), high - (at == high)
    found[order[gone[:last]]] = True
    return found
