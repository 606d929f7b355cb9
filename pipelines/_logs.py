"""A user's log as a record for the jobs, and the options that name its columns."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import click
import numpy as np
import pandas as pd

from pipelines._compare import Record
from whsklearn.datasets import load_log


def log_options(function: Callable[..., Any]) -> Callable[..., Any]:
    """``--log``, ``--input``, ``--output`` and ``--time``."""
    options = [
        click.option("--log", "log_file", type=click.Path(exists=True, dir_okay=False), help="A log, CSV or Parquet."),
        click.option("--input", "input_column", help="Column of the log that drives the axis."),
        click.option("--output", "output_column", help="Column of the log that answers."),
        click.option("--time", "time_column", help="Column of time stamps; if given, the sampling is checked."),
    ]
    for option in reversed(options):
        function = option(function)
    return function


def record_of(options: dict[str, Any], file: str | None = None) -> Record:
    """The record that the options of `log_options` name, or the same columns of another `file`."""
    if not options["input_column"] or not options["output_column"]:
        raise ValueError("--log needs --input and --output, the names of the columns that drive and that answer.")
    path, columns = file or options["log_file"], (options["input_column"], options["output_column"])
    if options["time_column"]:
        log = load_log(path, time=options["time_column"], input=columns[0], output=columns[1])
        return Record(Path(path).stem, log.X, log.y)
    return read_record(path, *columns)


def orders_of(text: str) -> dict[str, int]:
    """The four orders from ``2,2,2,2``."""
    parts = text.split(",")
    if len(parts) != 4 or not all(p.strip().isdigit() for p in parts):
        raise ValueError(f"--orders is {text!r}; expected four whole numbers n_a,n_b,n_c,n_d such as 2,2,2,2.")
    return dict(zip(("n_a", "n_b", "n_c", "n_d"), map(int, parts), strict=True))


def read_record(path: str | Path, input_column: str, output_column: str) -> Record:
    """Two columns of a CSV or Parquet file.

    Raises
    ------
    ValueError
        If a column is missing, not numeric or holds gaps, or the input never changes.
    """
    path = Path(path)
    frame = pd.read_parquet(path) if path.suffix == ".parquet" else pd.read_csv(path)
    signals = []
    for column in (input_column, output_column):
        if column not in frame:
            raise ValueError(f"{path.name} has no column {column!r}; it has: {', '.join(map(str, frame.columns))}.")
        values = pd.to_numeric(frame[column], errors="coerce").to_numpy(dtype=float)
        bad = np.flatnonzero(~np.isfinite(values))
        if bad.size:
            raise ValueError(
                f"{path.name}: {column} holds {bad.size} values that are no finite numbers, the first in data row "
                f"{bad[0] + 1}; repair or cut the log."
            )
        if values.size == 0 or np.ptp(values) == 0:
            raise ValueError(f"{path.name}: {column} never changes; give a log in which the axis is driven and moves.")
        signals.append(values)
    return Record(path.stem, signals[0][:, None], signals[1])
