"""Finished axes of a fleet, saved while the others are computed: stopping the command loses at most one batch."""

from __future__ import annotations

import io
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import click

if TYPE_CHECKING:
    from whsklearn.cli.fleet_axis import Row

EVERY_SECONDS = 30.0


def write_table(found: Any, out: Path) -> None:
    """Write a table as Parquet, atomically."""
    from whsklearn.logs.files import atomic_write

    buffer = io.BytesIO()
    found.to_parquet(buffer, index=False)
    atomic_write(out, buffer.getvalue())


class Kept:
    """The finished rows of a fleet in ``OUT.part``, next to the table to be written, and in the same format.

    A row is reused if the settings and the files of its axis have not changed.

    Parameters
    ----------
    out : Path
        Of the table.
    settings : str
        Model, columns and share of the test.
    folder : Path
    axis : str
        As for `axes_of`.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as made:
    ...     kept = Kept(Path(made, "fleet.parquet"), "rls", Path(made), "axis")
    ...     print(kept.path.name, kept.rows(["one"]))
    fleet.parquet.part []
    """

    def __init__(self, out: Path, settings: str, folder: Path, axis: str):
        self.path = out.with_name(f"{out.name}.part")
        self._settings, self._folder, self._axis = settings, folder, axis
        self._done: list[Row] = []
        self._written, self._due = 0, time.monotonic() + EVERY_SECONDS

    def rows(self, names: list[str]) -> list[Row]:
        """Rows of an earlier start that are still valid."""
        import pandas as pd
        import pyarrow as pa

        from whsklearn.cli.fleet_axis import digest_of

        try:
            frame = pd.read_parquet(self.path)
            same = frame[(frame["settings"] == self._settings) & frame["axis"].isin(names)]
        except (OSError, KeyError, pa.ArrowException):  # there is none, or it is not ours
            return []
        digests = [digest_of(self._folder, self._axis, n) for n in same["axis"]]
        found = same[same["digest"] == digests].drop(columns="settings")
        # a column that an axis does not have is missing in its row, and NaN in the table
        self._done = [{k: v for k, v in row.items() if v == v} for row in found.to_dict("records")]
        self._written = len(self._done)
        return list(self._done)

    def add(self, rows: list[Row]) -> None:
        """Add finished rows; they are written every half minute and at the end."""
        self._done += rows
        if time.monotonic() > self._due:
            self.write()

    def write(self) -> None:
        """Write all rows so far."""
        import pandas as pd

        write_table(pd.DataFrame(self._done).assign(settings=self._settings), self.path)
        self._written, self._due = len(self._done), time.monotonic() + EVERY_SECONDS

    def remove(self) -> None:
        """Remove the file, after the table itself is written."""
        self.path.unlink(missing_ok=True)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: Any, error: Any, trace: Any) -> None:
        if kind is None:
            return
        if len(self._done) > self._written:
            self.write()
        count = len(self._done)
        if count:
            what = "1 axis is" if count == 1 else f"{count} axes are"
            click.echo(f"{what} kept in {self.path}; the same command resumes from there.", err=True)
        elif issubclass(kind, KeyboardInterrupt):
            click.echo("Stopped before the first axes were finished: nothing is kept.", err=True)
