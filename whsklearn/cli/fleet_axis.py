"""One axis of a fleet: read, identify, judge; runs in any process on any machine.

Functions here take and return plain values. An axis that fails is a row of the result like any other, because one bad
log among a million must not end the job.
"""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sklearn.base import clone

Row = dict[str, Any]
OUTLYING = 6.0  # robust standard deviations from the median: at least so far, as real fleets have longer tails
FALSE = 0.01  # probability that a fleet of normal numbers has an outlier
# The median absolute deviation of n normal numbers is as certain as the standard deviation of 0.37 n (Hampel 1974,
# J. American Statistical Association 69, 383-393).  With the limit that follows, at most 0.4 % of 4,000 fleets of 3 to
# 100 axes with 12 numbers had an outlier by chance; with `OUTLYING` alone 90 % of fleets of 3, 64 % of 5, 20 % of 10.
EFFICIENCY = 0.37


def axes_of(folder: Path, axis: str) -> list[str]:
    """Names of the axes of a Parquet folder partitioned as ``axis=NAME/``, in order.

    Raises ValueError if the folder has no such partition.
    """
    names = sorted(p.name.split("=", 1)[1] for p in folder.glob(f"{axis}=*") if p.is_dir())
    if not names:
        raise ValueError(f"{folder} holds no folder {axis}=NAME; give a Parquet folder partitioned by {axis!r}.")
    return names


def read_axis(
    folder: Path, axis: str, name: str, inputs: list[str], output: str, time_column: str | None
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """X (n, n_inputs) and y (n,) of one axis, sorted by time, or in the order of files and rows.

    Raises ValueError if the axis has no rows, a column is missing or not numeric, or a time stamp is repeated.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    columns = [*([time_column] if time_column else []), *inputs, output]
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
        rows = rows[np.argsort(rows[:, 0], kind="stable")]
        if np.any(np.diff(rows[:, 0]) <= 0):
            raise ValueError(f"a {time_column} is repeated")
        rows = rows[:, 1:]
    return rows[:, :-1], rows[:, -1]


def identify_axis(model: Any, X: NDArray[np.float64], y: NDArray[np.float64], test_share: float) -> Row:
    """Fit a clone on the first part of the record, judge its free run on the rest."""
    from whsklearn.metrics import mu_e, nmse, rmse
    from whsklearn.plot import flat_parameters

    stop = len(y) - int(len(y) * test_share)
    fitted = clone(model).fit(X[:stop], y[:stop])
    y_hat = fitted.predict(X)  # from the start, so that the transient is over before the test part
    row: Row = {f"{name}": value for name, value in flat_parameters(fitted.parameters_).items()}
    judged = slice(stop, None) if test_share else slice(None)
    for index in (nmse, mu_e, rmse):
        row[index.__name__] = index(y[judged], y_hat[judged])
    return row


def identify_axes(model: Any, names: list[str], source: dict[str, Any], test_share: float) -> list[Row]:
    """One result row for each of the named axes; ``source`` holds the arguments of `read_axis`."""
    done = []
    for name in names:
        began = time.perf_counter()
        folder = Path(source["folder"])
        row: Row = {"axis": name, "rows": 0, "failure": "", "digest": digest_of(folder, source["axis"], name)}
        try:
            X, y = read_axis(**(source | {"name": name, "folder": folder}))
            row["rows"] = len(y)
            row |= identify_axis(model, X, y, test_share)
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

    A column is outlying by its distance from the fleet's median in units of the scaled median absolute deviation,
    nmse on a logarithmic scale and upwards only.  The fewer axes there are, the less certain that unit is, and the
    further off a column must be: as Student's t has it.
    """
    import pandas as pd
    from scipy.stats import t as student

    numeric = table.drop(columns=["axis", "rows", "failure", "seconds", "mu_e", "rmse"], errors="ignore").astype(float)
    if "nmse" in numeric:
        numeric["nmse"] = np.log10(numeric["nmse"].clip(lower=1e-12))
    centre = numeric.median()
    spread = 1.4826 * (numeric - centre).abs().median()
    z = (numeric - centre) / spread.where(spread > 0)
    if "nmse" in z:
        z["nmse"] = z["nmse"].clip(lower=0.0)
    size = z.abs().fillna(0.0)
    n, width = max(int((table["failure"] == "").sum()), 2), max(len(size.columns), 1)
    limit = max(OUTLYING, float(student.isf(0.5 * FALSE / (n * width), EFFICIENCY * (n - 1))))
    why = pd.Series(
        [", ".join(f"{c} {z.at[i, c]:+.1f}" for c in size.columns if size.at[i, c] > limit) for i in table.index],
        index=table.index,
        dtype=object,
    )
    worst = size.max(axis=1) if len(size.columns) else pd.Series(0.0, table.index)
    found = table.assign(why=why, worst=worst)[(why != "") & (table["failure"] == "")]
    return found.sort_values("worst", ascending=False).drop(columns="worst")
