"""Text logs: CSV of any dialect, read column by column in bounded memory."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from whsklearn.logs.cells import as_numbers, is_plain, no_numbers
from whsklearn.logs.dialect import Dialect, dialect_of
from whsklearn.logs.errors import LogError
from whsklearn.logs.packed import DAMAGE, opened
from whsklearn.logs.source import Column, Source
from whsklearn.logs.units import symbol_of

HEAD = 1 << 16  # bytes that tell the dialect
_BLOCK = 1 << 20
_ROWS = 200_000  # of a chunk
_FOOTER = 5  # rows at the end that may hold words and not data
_DATE = r".*\d[-/:.T]\d.*"


def open_text(path: Path) -> Source:
    """A text file as a source of columns.

    Raises
    ------
    LogError
        If it is empty, damaged, binary, or no table of numbers.
    """
    try:
        with opened(path) as file:
            head = file.read(HEAD)
    except DAMAGE as error:
        raise LogError(f"{path.name} is no whole archive ({error}); copy or pack it again.") from None
    if not head.strip(b"\0 \t\r\n\xef\xbb\xbf"):
        what = "is empty" if not head else "holds nothing but blanks or zero bytes"
        raise LogError(f"{path.name} {what}; record the log again, or give another file.")
    encoding = _encoding(head, path.name)
    lines = _logical(head.decode(encoding, errors="replace").splitlines())
    if len(head) == HEAD and len(lines) > 1:
        lines.pop()
    clean = [t for t in lines if "\0" not in t]
    layout = dialect_of(clean)
    if layout is None:
        raise LogError(_why_none(clean, path.name))
    whole, notes = _whole_rows(path, encoding, layout)
    names = layout.names or [str(i) for i in range(layout.width)]
    units = {n: u for n, u in zip(names, map(_unit, layout.units or []), strict=False) if u}
    if encoding == "cp1252":
        notes.append("The file is not UTF-8; it was read as Windows text (cp1252).")
    if layout.decimal == ",":
        notes.append("Numbers have a decimal comma.")
    if layout.names is None:
        notes.append(f"The file has no header line; its columns are called 0 to {layout.width - 1}.")

    doubles = [n for i, n in enumerate(names) if n.removesuffix(f".{i}") in names[:i]]
    if doubles:
        first = doubles[0].rpartition(".")[0]
        notes.append(
            f"Several columns are called {first!r}; the first keeps the name, others are {', '.join(doubles)}."
        )

    def fetch(wanted: Sequence[str]) -> dict[str, Column]:
        return _read(path, encoding, layout, {w: names.index(w) for w in wanted}, whole, notes)

    return Source(path.name, names, fetch, layout.names is not None, units, notes)


def _unit(text: str) -> str:
    return symbol_of(text.strip("[]() ")) or ""


def _logical(lines: list[str]) -> list[str]:
    """Lines, one for a name in quotes that goes over several, as spreadsheets write them."""
    out: list[str] = []
    for line in lines:
        if out and out[-1].count('"') % 2 and len(out) < 20:
            out[-1] += " " + line
        else:
            out.append(line)
    return out


def _encoding(head: bytes, name: str) -> str:
    """The encoding of a text; a refusal for what is no text."""
    if head.startswith((b"\xff\xfe", b"\xfe\xff")):
        return "utf-16"
    even, odd = head[:4096:2].count(0), head[1:4096:2].count(0)
    if max(even, odd) > 0.4 * min(len(head), 4096) / 2 and min(even, odd) < 0.01 * len(head[:4096]):
        return "utf-16-be" if even > odd else "utf-16-le"  # without the mark that tells
    strange = sum(b < 9 or 13 < b < 32 for b in head.rstrip(b"\0")[:4096])
    if (strange > 0.02 * min(len(head), 4096) and head.rstrip(b"\0")[:4096].count(0) > 8) or strange > 200:
        start = head[:4].decode("latin-1").encode("unicode_escape").decode()
        raise LogError(
            f"{name} is a binary file that begins with '{start}', of no format that is read here; export it as CSV, "
            "Parquet, MAT, HDF5, TDMS, MDF4 or MCAP."
        )
    try:
        head[: len(head) - 4].decode("utf-8")
    except UnicodeDecodeError as error:
        if error.start < len(head) - 8:
            return "cp1252"
    return "utf-8-sig"


def _why_none(lines: list[str], name: str) -> str:
    """Why no table was found."""
    live = [t for t in lines if t.strip() and not t.lstrip().startswith(("#", "%"))]
    if len(live) <= 3 and live:
        return (
            f"{name} has a header and no samples; its first line is {live[0][:60]!r}. Record or export the log again."
        )
    if not live:
        return f"{name} holds comments only and no samples; record or export the log again."
    return (
        f"{name} is no table of numbers: line 1 is {live[0][:60]!r}, and no line after it holds numbers parted by "
        "comma, semicolon, tab or blanks; export the log as CSV with one header line."
    )


def _whole_rows(path: Path, encoding: str, layout: Dialect) -> tuple[int | None, list[str]]:
    """How many rows may be read: all (None), or those above a tail of zero bytes that a power loss left."""
    if encoding.startswith("utf-16"):
        return None, []
    lines, first = 0, None
    with opened(path) as file:
        while block := file.read(_BLOCK):
            if first is None and b"\0" in block:
                at = block.index(b"\0")
                first = lines + block.count(b"\n", 0, at)
                block = block[at:]
            if first is not None and block.strip(b"\0\r\n \t"):
                raise LogError(
                    f"{path.name}: line {first + 1} holds zero bytes amid the data; the file is damaged. Copy or "
                    "export it again, or cut that line."
                )
            lines += block.count(b"\n") if first is None else 0
    if first is None:
        return None, []
    return max(0, first - layout.first), ["The zero bytes at the end of the file were left out."]


def _read(
    path: Path, encoding: str, layout: Dialect, columns: dict[str, int], whole: int | None, notes: list[str]
) -> dict[str, Column]:
    """Columns by their places, as floats where they are numbers, else as text; what was done is added to `notes`.

    The file is read in chunks with all its columns, of which only the wanted ones are kept: with ``usecols`` pandas
    would drop in silence what a row has too much, a decimal comma amid comma-separated cells above all.
    """
    import pandas as pd

    numbers = list(columns.values())
    options: dict[str, Any] = {
        "sep": layout.separator, "decimal": layout.decimal, "header": None, "skiprows": layout.first,
        "skipinitialspace": layout.separator != r"\s+", "comment": layout.comment, "encoding": encoding,
        "names": list(range(layout.width)), "index_col": False, "chunksize": _ROWS, "low_memory": False,
        "nrows": whole,
    }  # fmt: skip
    types = {i: _type(layout.sample[i] if i < len(layout.sample) else "", layout.decimal) for i in set(numbers)}
    try:
        try:
            parts = _chunks(path, numbers, {**options, "dtype": types})
        except (ValueError, OverflowError) as error:
            if isinstance(error, pd.errors.ParserError | UnicodeDecodeError):
                raise
            parts = _chunks(path, numbers, {**options, "dtype": str})
    except (pd.errors.ParserError, UnicodeDecodeError, pd.errors.EmptyDataError, *DAMAGE) as error:
        reason = str(error).strip().rstrip(".")
        raise LogError(
            f"{path.name} is no readable CSV ({reason}); export it again as UTF-8 with one header line."
        ) from None
    return _typed({name: parts[i] for name, i in columns.items()}, layout.decimal, notes)


def _typed(cells: dict[str, Any], decimal: str, notes: list[str]) -> dict[str, Column]:
    """Floats where all cells of a column are numbers, else the text; words below the data and headers amid it go."""
    import pandas as pd

    text = {n: pd.Series(v, dtype="string") for n, v in cells.items() if not pd.api.types.is_numeric_dtype(v)}
    rows = len(next(iter(cells.values())))
    again = np.zeros(rows, dtype=bool)
    empty = np.ones(rows, dtype=bool)  # no number and no date in any column
    for name, cell in cells.items():
        if name not in text:
            empty &= np.isnan(cell)
            continue
        values = text[name]
        empty &= as_numbers(values, decimal)[0].isna().to_numpy() & ~_true(values.str.fullmatch(_DATE))
        again |= _true(values.str.strip().str.strip('"') == name)
    empty[:-_FOOTER] = False
    out = again | empty
    if out.any() and out.sum() < rows:
        notes.append(
            f"{out.sum()} row(s) of words amid or below the data were left out, the first is row {out.argmax()}."
        )
        cells = {n: v[~out] for n, v in cells.items()}
        text = {n: v[~out].reset_index(drop=True) for n, v in text.items()}
    found: dict[str, Column] = {}
    for name, values in cells.items():
        if name not in text:
            found[name] = Column(values)
            continue
        numbers, unit, more = as_numbers(text[name], decimal)
        notes += [m for m in more if m not in notes]
        whole = not no_numbers(text[name], numbers).any()
        found[name] = Column(numbers.to_numpy(dtype=float), unit=unit) if whole else Column(values)
    return found


def _true(flags: Any) -> Any:
    """Flags as booleans, False where there was no cell."""
    return flags.fillna(False).to_numpy(dtype=bool)


def _chunks(path: Path, numbers: list[int], options: dict[str, Any]) -> dict[int, Any]:
    """The wanted columns, joined."""
    import pandas as pd

    parts: dict[int, list[Any]] = {i: [] for i in numbers}
    with opened(path) as file, pd.read_csv(file, **options) as reader:
        for chunk in reader:
            for i in parts:
                parts[i].append(chunk[i].to_numpy())
    return {i: np.concatenate(parts.pop(i)) for i in list(parts)}


def _type(cell: str, decimal: str) -> type:
    """What a column is read as, going by its first cell: long whole numbers keep their last digits."""
    if len(cell.lstrip("+-")) > 15 and cell.lstrip("+-").isdigit():
        return np.int64
    return float if is_plain(cell, decimal) else str
