"""A file of signals in any format: names are read first, and then the few columns that are needed."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from whsklearn.logs.errors import ColumnError
from whsklearn.logs.files import utf8

if TYPE_CHECKING:
    import pandas as pd


class Column(NamedTuple):
    """A column of a file.

    Attributes
    ----------
    values : ndarray of shape (n,)
        Numbers, text or dates.
    stamps : ndarray of shape (n,), optional
        Times of its own (s), where the format has them.
    unit : str
        As stated in the file; empty if it is not.

    References
    ----------
    Shafranovich 2005, Common Format and MIME Type for Comma-Separated Values (CSV) Files, RFC 4180.

    Examples
    --------
    >>> import numpy as np
    >>> from whsklearn.logs import Column
    >>> Column(np.array([0.1, 0.2]), unit="Nm").stamps is None
    True
    """

    values: NDArray[Any]
    stamps: NDArray[np.float64] | None = None  # s, shape (n,)
    unit: str = ""


@dataclass
class Source:
    """The columns of a file.

    Attributes
    ----------
    name : str
        Of the file.
    names : list of str
        Of the columns; a number from 0 is accepted as a name too.
    fetch : callable
        Reads several columns at once, by their names.
    header : bool
        Whether the names are the file's own.
    units : dict of str to str
        By column, where the file states them apart from the names.
    notes : list of str
        How the file was read.
    nameless : str
        Why the columns have no names; empty if they have names.
    clocked : bool
        Whether the columns have their own time stamps, so that no time column is needed.
    sample_rate : float, optional
        In Hz, if the file states it and has no time column.

    References
    ----------
    Shafranovich 2005, Common Format and MIME Type for Comma-Separated Values (CSV) Files, RFC 4180.

    Examples
    --------
    >>> import numpy as np
    >>> from whsklearn.logs import Column, Source
    >>> source = Source("log.csv", ["time_s", "torque_nm"], lambda names: {n: Column(np.zeros(3)) for n in names})
    >>> source.resolve(1, "drive"), source.resolve("Torque_Nm", "drive")
    ('torque_nm', 'torque_nm')
    """

    name: str
    names: list[str]
    fetch: Callable[[Sequence[str]], dict[str, Column]]
    header: bool = True
    units: dict[str, str] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    nameless: str = ""
    clocked: bool = False
    sample_rate: float | None = None

    def __post_init__(self) -> None:
        self.name = utf8(self.name)

    @classmethod
    def of_arrays(cls, name: str, arrays: Mapping[str, Any], **known: Any) -> Source:
        """The columns of a file that is in memory as a whole.

        ``name``: of the file. ``arrays`` (n,): by the names of the columns. ``**known``: other fields, such as
        ``units``.
        """
        return cls(name, list(arrays), lambda wanted: {w: Column(np.asarray(arrays[w])) for w in wanted}, **known)

    def resolve(self, wanted: str | int, role: str) -> str:
        """The column's name for a name or a number from 0.

        ``wanted``: name, or number from 0. ``role``: the role it is needed for, such as ``drive``; for the message.
        Raises ColumnError if there is no such column.
        """
        text = utf8(str(wanted))
        if text in self.names:
            return text
        for plain in (_folded, _letters):
            close = [n for n in self.names if plain(n) == plain(text) != ""]
            if len(close) == 1:
                return close[0]
        if text.isdigit() and int(text) < len(self.names):
            return self.names[int(text)]
        there = ", ".join(self.names[:30]) + (f" and {len(self.names) - 30} more" if len(self.names) > 30 else "")
        if not self.header:
            raise ColumnError(
                f"{self.name}: {self.nameless or 'the file has no header line'}, so {text!r} names no column "
                f"for {role}; give the columns by number from 0 to {len(self.names) - 1}, such as --columns 0,1,2 for "
                "time, drive and position."
            )
        parts = [n for n in self.names if n.startswith(f"{text}.")]
        if parts:
            raise ColumnError(
                f"{self.name} has several columns {text!r} for {role}: {', '.join(parts[:8])}; name one of them."
            )
        own = " Each of them has its own time stamps; leave --time out." if role == "time" and self.clocked else ""
        raise ColumnError(f"{self.name} has no column {text!r} for {role}; it has: {there}.{own}")


def _folded(name: str) -> str:
    return name.strip().lower()


def _letters(name: str) -> str:
    """A name without a leading list marker or comment sign: ``- joint_effort``, ``%time``."""
    return _folded(name).lstrip("-*+#>% ").rstrip(": ")


def as_frame(log: Any) -> pd.DataFrame:
    """The frame of a log; of one of another library, such as Polars, the columns are taken by their names."""
    from pandas import DataFrame

    named = hasattr(log, "columns") and not isinstance(log, DataFrame)
    return DataFrame({c: np.asarray(log[c]) for c in log.columns} if named else log)
