"""Logs of a user's own axis, from CSV or Parquet, looked over before anything is fitted."""

from __future__ import annotations

import itertools
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, overload

import numpy as np
from sklearn.utils import Bunch

from whsklearn.datasets.log_report import Finding, LogReport, check_log

if TYPE_CHECKING:
    import os

    import pandas as pd
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

__all__ = ["load_log"]

_UNITS = {
    "s": "s", "ms": "ms", "us": "us", "v": "V", "a": "A", "n": "N", "nm": "Nm", "rad": "rad", "deg": "deg", "m": "m",
    "mm": "mm", "rad_s": "rad/s", "deg_s": "deg/s", "m_s": "m/s", "counts": "counts",
}  # fmt: skip
_SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6}
_LONG_GAP = 5.0  # periods; a longer gap is not bridged, it starts a new group


@overload
def load_log(
    path: str | os.PathLike[str],
    *,
    time: str,
    input: str | None = ...,
    output: str | None = ...,
    reference: str | None = ...,
    drive: str | None = ...,
    position: str | None = ...,
    units: dict[str, str] | None = ...,
    resample: bool = ...,
    return_X_y: Literal[False] = ...,
) -> Bunch: ...
@overload
def load_log(
    path: str | os.PathLike[str],
    *,
    time: str,
    input: str | None = ...,
    output: str | None = ...,
    reference: str | None = ...,
    drive: str | None = ...,
    position: str | None = ...,
    units: dict[str, str] | None = ...,
    resample: bool = ...,
    return_X_y: Literal[True],
) -> tuple[Array, Array]: ...
def load_log(
    path: str | os.PathLike[str],
    *,
    time: str,
    input: str | None = None,
    output: str | None = None,
    reference: str | None = None,
    drive: str | None = None,
    position: str | None = None,
    units: dict[str, str] | None = None,
    resample: bool = False,
    return_X_y: bool = False,
) -> Bunch | tuple[Array, Array]:
    """Read the log of an axis and say what is wrong with it.

    Parameters
    ----------
    path : str or path
        A CSV file (comma, semicolon or tab), or Parquet (``.parquet``, ``.pq``; needs pyarrow).
    time : str
        Column of the time stamps: numbers, or dates as ISO 8601 has them.
    input, drive : str
        Column of what drives the axis: torque, force, voltage, or u. Two names for one thing.
    output, position : str
        Column of what the axis does: its position, or y. Two names for one thing.
    reference : str, optional
        Column of the reference.
    units : dict of str to str, optional
        Units of ``time``, ``drive``, ``position`` and ``reference`` where the columns' names do not
        end in one (``time_s``, ``torque_nm``, ``position_rad``). Stated, not converted, but for time in
        ms or us.
    resample : bool, default=False
        Put an irregular log on a regular grid at its median step, linearly; rows without a number and
        stamps that do not increase are dropped, and a gap of five steps or more starts a new group.
    return_X_y : bool, default=False
        Only the drive as X (n, 1) and the position as y (n,).

    Returns
    -------
    Bunch
        ``X`` (n, 1), ``y`` (n,), ``time`` (n,) in s from 0, ``reference`` (n,) or None, ``groups`` (n,)
        int, ``sample_rate`` in Hz, ``units``, ``frame`` (the columns read), ``report`` (`LogReport`).

    Raises
    ------
    ValueError
        If a column is missing or not numeric, a value is missing, or the sampling is irregular beyond
        1 % (the row is named) and ``resample`` is not set.
    FileNotFoundError
        If there is no such file.

    Examples
    --------
    >>> import numpy as np, pandas as pd, tempfile, pathlib
    >>> folder = tempfile.TemporaryDirectory()
    >>> file = pathlib.Path(folder.name) / "axis.csv"
    >>> t = np.arange(500) / 100
    >>> table = {"time_s": t, "torque_nm": np.cos(t), "position_rad": np.round(np.sin(t), 3)}
    >>> pd.DataFrame(table).to_csv(file, index=False)
    >>> log = load_log(file, time="time_s", drive="torque_nm", position="position_rad")
    >>> log.X.shape, round(log.sample_rate, 6), log.units["drive"], log.report.codes
    ((500, 1), 100.0, 'Nm', ('LOG007',))
    >>> folder.cleanup()
    """
    roles = _roles(time, _one_name("input", input, "drive", drive), _one_name("output", output, "position", position))
    if reference is not None:
        roles["reference"] = reference
    frame = _read(Path(path))
    table = _numbers(frame, roles, Path(path).name)
    stated = {role: _unit(role, column, units) for role, column in roles.items()}
    table["time"] = table["time"] * _SECONDS.get(stated["time"], 1.0)
    stated["time"] = "s"
    table, extra = _present(table, roles, resample)
    report = check_log(table["time"], {k: v for k, v in table.items() if k != "time"}, extra)
    table, groups, report = _regular(table, report, resample, Path(path).name)
    if return_X_y:
        return table["drive"][:, None], table["position"]
    stamps = table["time"] - table["time"][0]
    return Bunch(
        X=table["drive"][:, None],
        y=table["position"],
        time=stamps,
        reference=table.get("reference"),
        groups=groups,
        sample_rate=float(1.0 / np.median(np.diff(stamps))),
        units=stated,
        frame=frame[list(dict.fromkeys(roles.values()))],
        report=report,
    )


def _one_name(first: str, a: str | None, second: str, b: str | None) -> str:
    """One of two names for the same argument."""
    if (a is None) == (b is None):
        got = "neither" if a is None else "both"
        raise ValueError(f"load_log got {got} of {first} and {second}, two names for one column; give one of them.")
    return a if a is not None else str(b)


def _roles(time: str, drive: str, position: str) -> dict[str, str]:
    """Column names by role."""
    return {"time": time, "drive": drive, "position": position}


def _read(path: Path) -> pd.DataFrame:
    """The file as a frame."""
    import pandas as pd

    if not path.is_file():
        raise FileNotFoundError(f"There is no file {path}; give the path of a CSV or Parquet log.")
    if path.suffix.lower() in {".parquet", ".pq"}:
        try:
            return pd.read_parquet(path)
        except ImportError:
            raise ImportError(f"Reading {path.name} needs pyarrow; install whsklearn[parquet] or give a CSV.") from None
    with path.open(encoding="utf-8-sig", errors="replace") as file:
        head = file.readline()
    if not head.strip():
        raise ValueError(f"{path.name} is empty or starts with an empty line; its first line must name the columns.")
    separator = next((s for s in (",", ";", "\t") if s in head), ",")
    try:
        return pd.read_csv(
            path, sep=separator, decimal="," if separator == ";" else ".", skipinitialspace=True, encoding="utf-8-sig"
        )
    except (pd.errors.ParserError, UnicodeDecodeError) as error:
        reason = str(error).strip().rstrip(".")
        raise ValueError(
            f"{path.name} is no readable CSV ({reason}); export it again as UTF-8 with one header line."
        ) from None


def _numbers(frame: pd.DataFrame, roles: dict[str, str], name: str) -> dict[str, Array]:
    """The columns asked for, as floats; NaN where a value is missing."""
    import pandas as pd

    out = {}
    for role, column in roles.items():
        if column not in frame.columns:
            there = ", ".join(map(str, frame.columns))
            raise ValueError(f"{name} has no column {column!r} for {role}; it has: {there}.")
        values = frame[column]
        numeric = _clock(values) if role == "time" else None
        numeric = pd.to_numeric(values, errors="coerce") if numeric is None else numeric
        bad = np.flatnonzero((numeric.isna() & values.notna()).to_numpy())
        if bad.size:
            raise ValueError(
                f"Column {column!r} of {name} is not numeric: row {bad[0]} holds {str(values.iloc[bad[0]])[:40]!r}; "
                "give a column of numbers."
            )
        out[role] = numeric.to_numpy(dtype=float)
    if len(frame) < 3:
        raise ValueError(f"{name} has {len(frame)} rows; a log needs 3 at the very least.")
    return out


def _clock(values: pd.Series) -> pd.Series | None:
    """Seconds since the first stamp, if the stamps are dates; None if they are not."""
    import pandas as pd

    if pd.api.types.is_numeric_dtype(values):
        return None
    if not pd.api.types.is_datetime64_any_dtype(values):
        try:
            values = pd.to_datetime(values.astype("string"), format="ISO8601")
        except (ValueError, TypeError):
            return None
    return (values - values.dropna().iloc[0]).dt.total_seconds() if values.notna().any() else None


def _unit(role: str, column: str, units: dict[str, str] | None) -> str:
    """The unit stated on the call, or the one at the end of the column's name."""
    if units and role in units:
        return units[role]
    words = re.split(r"[^a-z0-9]+", str(column).lower())
    for n in (2, 1):
        tail = "_".join(words[-n:])
        if len(words) > n and tail in _UNITS:
            return _UNITS[tail]
    return "s" if role == "time" else "as logged"


def _present(
    table: dict[str, Array], roles: dict[str, str], resample: bool
) -> tuple[dict[str, Array], tuple[Finding, ...]]:
    """Rows that hold a finite number in every column."""
    missing = ~np.all([np.isfinite(v) for v in table.values()], axis=0)
    if not missing.any():
        return table, ()
    rows = np.flatnonzero(missing)
    role = next(r for r, v in table.items() if not np.isfinite(v[rows[0]]))
    if not resample:
        raise ValueError(
            f"Column {roles[role]!r} has no finite value at row {rows[0]} ({rows.size} such rows in all); "
            "fill or drop them, or pass resample=True."
        )
    if missing.size - rows.size < 3:
        raise ValueError(f"Only {missing.size - rows.size} rows hold a number in every column; a log needs 3 at least.")
    text = f"{rows.size} rows without a number were dropped, the first is row {rows[0]}; they are interpolated."
    found = Finding("LOG010", "warning", text, tuple(int(r) for r in rows[:10]), rows.size / missing.size)
    return {k: v[~missing] for k, v in table.items()}, (found,)


def _regular(
    table: dict[str, Array], report: LogReport, resample: bool, name: str
) -> tuple[dict[str, Array], NDArray[np.int64], LogReport]:
    """The log on a regular grid, or the refusal that names the row."""
    stamps = [f for f in report.findings if f.code in {"LOG001", "LOG002", "LOG003", "LOG004", "LOG010"}]
    if not stamps:
        return table, np.zeros(len(table["time"]), dtype=np.int64), report
    if not resample:
        worst = stamps[0]
        raise ValueError(f"{name}: {worst.title.lower()}. {worst.explanation} (resample=True does it on reading.)")
    kept = _increasing(table)
    if len(kept["time"]) < 3:
        raise ValueError(f"{name}: only {len(kept['time'])} stamps increase; check the column of time.")
    period = float(np.median(np.diff(kept["time"])))
    breaks = np.flatnonzero(np.diff(kept["time"]) >= _LONG_GAP * period)
    bounds = [0, *(breaks + 1).tolist(), len(kept["time"])]
    pieces: list[dict[str, Any]] = []
    for group, (start, stop) in enumerate(itertools.pairwise(bounds)):
        old = kept["time"][start:stop]
        grid = old[0] + period * np.arange(int((old[-1] - old[0]) / period * (1 + 1e-9)) + 1)
        piece: dict[str, Any] = {k: np.interp(grid, old, v[start:stop]) for k, v in kept.items()}
        pieces.append({**piece, "time": grid, "groups": np.full(len(grid), group)})
    joined = {k: np.concatenate([p[k] for p in pieces]) for k in pieces[0]}
    groups = joined.pop("groups")
    text = f"Linearly, at the median step of {period:.6g} s, in {len(pieces)} group(s)."
    done = tuple(
        f if f not in stamps else Finding(f.code, "warning", f.explanation, f.rows, f.value) for f in report.findings
    )
    more = (Finding("LOG011", "info", text, value=period),)
    return joined, groups, LogReport(done + more, report.not_applicable, report.jitter, report.quantum)


def _increasing(table: dict[str, Array]) -> dict[str, Array]:
    """Rows whose stamp is later than all before them."""
    time = table["time"]
    later = np.r_[True, time[1:] > np.maximum.accumulate(time)[:-1]]
    return {k: v[later] for k, v in table.items()}
