"""Text logs: CSV of any dialect, read column by column in bounded memory."""

from __future__ import annotations

import codecs
import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from whsklearn.logs.cells import as_numbers, is_number, is_plain, is_word, no_numbers
from whsklearn.logs.dialect import Dialect, dialect_of, split
from whsklearn.logs.errors import LogError, damaged
from whsklearn.logs.heads import increment_in, period_in, ticks_in
from whsklearn.logs.packed import DAMAGE, opened
from whsklearn.logs.roles import WORDS, words_of
from whsklearn.logs.source import Column, Source
from whsklearn.logs.timebase import on_one_clock
from whsklearn.logs.units import is_time, unit_of

HEAD = 1 << 16  # bytes from which the dialect is determined
MOST_HEAD = 1 << 26  # bytes in which rows of data are sought, past blank lines or the names of a great many columns
FEW_ROWS = 50  # lines of data from which the type of a column is determined
_NOTHING = b"\0 \t\r\n\xef\xbb\xbf"
_BLOCK = 1 << 20
_CALLED = {
    "cp1252": "Windows text (cp1252)",
    "cp932": "Japanese text (Shift JIS)",
    "gb18030": "Chinese text (GB 18030)",
}
_ROWS = 200_000  # of a chunk
_FOOTER = 50  # rows at the end that may contain words instead of data: statistics and signatures of recorders
_DATE = r".*\d[-/:.T]\d.*"
_MOST_HEADERS = 1000  # that are compared with the first one
_LIST = re.compile(r"\[[^\[\]\"]*\d[^\[\]\"]*\]")


def open_text(path: Path) -> Source:
    """A text file as a source of columns.

    Raises LogError if it is empty, damaged, binary, or not a table of numbers.
    """
    head, encoding, clean, layout = _begin(path)
    if layout is None:
        raise LogError(_why_none(clean, path.name, len(head) >= MOST_HEAD))
    if _is_torn(layout):
        raise LogError(
            f"{path.name} separates cells by commas and has decimal commas too: {len(layout.header or ())} names above "
            f"{layout.width} cells. Export it with semicolons, or with a decimal point."
        )
    rows, last, notes = _whole_rows(path, encoding, layout)
    cut = _is_cut(last.decode(encoding, errors="replace"), clean, layout)
    if cut:
        notes.append("The last row is incomplete and was left out.")
    names = layout.names or [str(i) for i in range(layout.width)]
    units = {n: u for n, u in zip(names, layout.units or [], strict=False) if u}
    if encoding in _CALLED:
        notes.append(f"The file is not UTF-8; it was read as {_CALLED[encoding]}.")
    if layout.decimal == ",":
        notes.append("Numbers have a decimal comma.")
    period = _clock_above(clean[: layout.first], layout.separator, names, units, notes)
    why = _why_nameless(layout) if layout.names is None else ""
    if why:
        notes.append(f"{why[0].upper()}{why[1:]}; its columns are called 0 to {layout.width - 1}.")
    doubles = [n for i, n in enumerate(names) if n.removesuffix(f".{i}") in names[:i]]
    if doubles and layout.clocks is None:
        first = doubles[0].rpartition(".")[0]
        notes.append(
            f"Several columns are called {first!r}; the first keeps the name, others are {', '.join(doubles)}."
        )

    def read(wanted: Iterable[str]) -> dict[str, Column]:
        places = sorted({names.index(w) for w in wanted})
        cells = _cells(path, places, layout, {"encoding": encoding, "nrows": rows})
        return _typed(path.name, {names[i]: v[:-1] if cut else v for i, v in cells.items()}, layout.decimal, notes)

    def fetch(wanted: Sequence[str]) -> dict[str, Column]:
        of = layout.clocks
        if of is None or any(of[names.index(w)] == names.index(w) for w in wanted):
            return read(wanted)
        clocks = {w: names[of[names.index(w)]] for w in wanted}
        return with_clocks(read([*wanted, *clocks.values()]), clocks, units)

    return Source(
        path.name, names, fetch, not why, units, notes,
        nameless=why, clocked=layout.clocks is not None, sample_rate=1.0 / period if period else None,
    )  # fmt: skip


def _clock_above(
    above: list[str], separator: str, names: list[str], units: dict[str, str], notes: list[str]
) -> float | None:
    """The time between two rows (s) by the lines above them, if there is no time column; the unit of one of ticks."""
    ticks = ticks_in(above, names)
    if ticks is not None and names[ticks[0]] not in units and not is_time(unit_of(names[ticks[0]])):
        column, rate = ticks
        units[names[column]] = f"ticks/{rate:.10g}" if rate else "ticks"
        if rate:
            notes.append(f"Column {names[column]!r} counts ticks, {rate:g} a second.")
    if any(is_time(units.get(n) or unit_of(n)) or {*WORDS["time"]} & {*words_of(n)} for n in names):
        return None
    period = period_in(above) or increment_in([split(t, separator) for t in above])
    if period:
        notes.append(f"Rows are {period:.6g} s apart, according to the header.")
    return period


def _begin(path: Path) -> tuple[bytes, str, list[str], Dialect | None]:
    """The first bytes, enough to contain rows of data, with their encoding, lines and layout."""
    size = HEAD
    while True:
        with damaged(path, "archive", *DAMAGE), opened(path) as file:
            head = file.read(size)
        encoding = _encoding(head[:HEAD], path.name) if head.strip(_NOTHING) else "utf-8-sig"
        lines = _logical(head.decode(encoding, errors="replace").splitlines())
        if len(head) == size and len(lines) > 1:
            lines.pop()
        clean = [t for t in lines if "\0" not in t]
        layout = dialect_of(clean)
        if len(head) < size or size >= MOST_HEAD or (layout is not None and len(clean) - layout.first >= FEW_ROWS):
            break
        size *= 4
    if not head.strip(_NOTHING):
        what = "is empty" if not head else "contains only blanks or zero bytes"
        raise LogError(f"{path.name} {what}; record the log again, or give another file.")
    return head, encoding, clean, layout


def _is_torn(layout: Dialect) -> bool:
    """Whether decimal commas cut every number in two: half as many names as cells, and no cell with a point."""
    names = len(layout.header or ())
    whole = not any("." in cell for cell in layout.sample)
    return layout.separator == "," and layout.names is None and 2 * names == layout.width and names > 1 and whole


def _why_nameless(layout: Dialect) -> str:
    """Why the columns have no names."""
    if layout.header is None or not any(is_word(c) for c in layout.header):
        return "the file has no header line"
    return f"the header line has {len(layout.header)} names where the rows have {layout.width} cells"


def _is_cut(last: str, lines: list[str], layout: Dialect) -> bool:
    """Whether a last line without a line end is truncated: cells are missing, or the last number is too short."""
    if not last.strip() or (layout.comment and last.lstrip().startswith(layout.comment)):
        return False
    cells = split(last, layout.separator)
    if not any(is_number(c, layout.decimal) and c for c in cells):
        return False  # a footer
    ends = [split(t, layout.separator)[-1] for t in lines[layout.first :][:FEW_ROWS]]
    ends = [c for c in ends if is_plain(c, layout.decimal)]
    # behind the decimal sign: 9.50 below rows of 10.20 is whole; a number without the sign that all others have is not
    behind = [len(c.lstrip("+-").rpartition(layout.decimal)[2]) for c in (*ends, cells[-1])]
    signless = layout.decimal not in cells[-1] and all(layout.decimal in c for c in ends)
    short = len(cells) < len(layout.sample) or (bool(ends) and (signless or behind[-1] < min(behind[:-1])))
    return short or (bool(ends) and not is_number(cells[-1], layout.decimal))


def _logical(lines: list[str]) -> list[str]:
    """Lines, with a quoted name that spans several lines, as in spreadsheets, joined into one."""
    out: list[str] = []
    for line in lines:
        if out and out[-1].count('"') % 2 and len(out) < 20:
            out[-1] += " " + line
        else:
            out.append(line)
    return out


def _encoding(head: bytes, name: str) -> str:
    """The encoding of a text; a binary file is refused."""
    if head.startswith((b"\xff\xfe\0\0", b"\0\0\xfe\xff")):
        return "utf-32"
    if head.startswith((b"\xff\xfe", b"\xfe\xff")):
        return "utf-16"
    even, odd = head[:4096:2].count(0), head[1:4096:2].count(0)
    if max(even, odd) > 0.4 * min(len(head), 4096) / 2 and min(even, odd) < 0.01 * len(head[:4096]):
        return "utf-16-be" if even > odd else "utf-16-le"  # without a byte order mark
    strange = sum(b < 9 or 13 < b < 32 for b in head.rstrip(b"\0")[:4096])
    if (strange > 0.02 * min(len(head), 4096) and head.rstrip(b"\0")[:4096].count(0) > 8) or strange > 200:
        start = head[:4].decode("latin-1").encode("unicode_escape").decode()
        raise LogError(
            f"{name} is a binary file that begins with '{start}', in a format that is not supported; export it as CSV, "
            "Parquet, MAT, HDF5, TDMS, MDF4 or MCAP."
        )
    try:
        head[: len(head) - 4].decode("utf-8")
    except UnicodeDecodeError as error:
        if error.start < len(head) - 8:
            return legacy_encoding(head)
    return "utf-8-sig"


def legacy_encoding(head: bytes) -> str:
    """The encoding of a text that is not Unicode: kana are Japanese, byte pairs in common rows of GB 2312 Chinese.

    >>> legacy_encoding("時間,トルク指令".encode("cp932")), legacy_encoding("时间;转矩(N·m)".encode("gb18030"))
    ('cp932', 'gb18030')
    >>> legacy_encoding("Zeit;Größe;Übermaß in °".encode("cp1252"))
    'cp1252'
    """
    try:
        japanese = codecs.getincrementaldecoder("cp932")().decode(head)
    except UnicodeDecodeError:
        japanese = ""
    wide = re.findall(r"[^\x00-\x7f]", japanese)
    if any("\u3040" <= c <= "\u30ff" for c in wide):
        return "cp932"
    runs = re.findall(rb"[\x80-\xff]+", head[:-4])
    pairs = [run[i : i + 2] for run in runs for i in range(0, len(run), 2)]
    common = sum(0xB0 <= p[0] <= 0xD7 and p[-1] >= 0xA1 for p in pairs)
    if pairs and all(len(p) == 2 for p in pairs) and 2 * common >= len(pairs):
        return "gb18030"
    return "cp1252"


def _why_none(lines: list[str], name: str, more: bool) -> str:
    """Why no table was found."""
    if more:
        return f"{name} has no rows of numbers in its first {MOST_HEAD >> 20} MB; export the log without that head."
    live = [t for t in lines if t.strip() and not t.lstrip().startswith(("#", "%"))]
    if len(live) <= 3 and live:
        return (
            f"{name} has a header but no samples; its first line is {live[0][:60]!r}. Record or export the log again."
        )
    if not live:
        return f"{name} has comments but no samples; record or export the log again."
    lists = [_LIST.search(t) for t in live[1:3]]
    if all(lists):
        return (
            f"{name} has lists in its cells, such as {lists[0][0][:40]!r}; export the log with one column for each "  # type: ignore[index]
            "element, or as MCAP, a ROS bag or Parquet."
        )
    return (
        f"{name} is not a table of numbers: line 1 is {live[0][:60]!r}, and no later line has numbers separated by "
        "commas, semicolons, tabs or blanks; export the log as CSV with one header line."
    )


def _whole_rows(path: Path, encoding: str, layout: Dialect) -> tuple[int | None, bytes, list[str]]:
    """The number of rows to read (None for all; fewer above a tail of zero bytes that a power loss left), and a last
    line without a line end.
    """
    if encoding.startswith(("utf-16", "utf-32")):
        return None, b"", []
    lines, first, tail = 0, None, b""
    with opened(path) as file:
        while block := file.read(_BLOCK):
            if first is None and b"\0" in block:
                at = block.index(b"\0")
                first = lines + block.count(b"\n", 0, at)
                block = block[at:]
            if first is not None and block.strip(b"\0\r\n \t"):
                raise LogError(
                    f"{path.name}: line {first + 1} has zero bytes within the data; the file is damaged. Copy or "
                    "export it again, or cut that line."
                )
            lines += block.count(b"\n") if first is None else 0
            tail = (tail + block)[-HEAD:]
    if first is None:
        return None, tail[max(tail.rfind(b"\n"), tail.rfind(b"\r")) + 1 :], []
    return max(0, first - layout.first), b"", ["The zero bytes at the end of the file were left out."]


def with_clocks(read: dict[str, Column], clocks: dict[str, str], units: dict[str, str]) -> dict[str, Column]:
    """Columns with the stamps of their time columns, without the rows left blank by slower or shorter channels."""
    names = list(dict.fromkeys(clocks.values()))
    stamps = dict(
        zip(names, on_one_clock([read[c].values for c in names], units.get(names[0], ""), names[0]), strict=True)
    )
    out = {}
    for name, clock in clocks.items():
        values = read[name].values
        there = np.isfinite(stamps[clock])
        there &= np.isfinite(values) if values.dtype.kind == "f" else True
        out[name] = Column(values[there], stamps[clock][there], read[name].unit)
    return out


def _cells(path: Path, numbers: list[int], layout: Dialect, how: dict[str, Any]) -> dict[int, Any]:
    """Columns by index, as numbers if all their cells are plain ones, otherwise as text.

    The file is read in chunks with all its columns, of which only the wanted ones are kept: with ``usecols`` pandas
    would silently drop surplus cells of a row, such as those of a decimal comma among comma-separated cells.
    """
    import pandas as pd

    options: dict[str, Any] = how | {
        "sep": layout.separator, "decimal": layout.decimal, "header": None, "skiprows": layout.first,
        "skipinitialspace": layout.separator != r"\s+", "comment": layout.comment, "names": list(range(layout.width)),
        "index_col": False, "chunksize": _ROWS, "low_memory": False,
    }  # fmt: skip
    types = {i: _type(layout.sample[i] if i < len(layout.sample) else "", layout.decimal) for i in numbers}
    try:
        try:
            return _chunks(path, numbers, {**options, "dtype": types})
        except (ValueError, OverflowError) as error:
            if isinstance(error, pd.errors.ParserError | UnicodeDecodeError):
                raise
            return _chunks(path, numbers, {**options, "dtype": str})
    except (pd.errors.ParserError, UnicodeDecodeError, pd.errors.EmptyDataError, *DAMAGE) as error:
        ragged = re.search(r"Expected (\d+) fields in line (\d+), saw (\d+)", str(error))
        if ragged is not None:
            raise LogError(
                f"{path.name}: line {ragged[2]} has {ragged[3]} cells where {ragged[1]} were expected; look for a "
                "separator inside a cell, or cut that line."
            ) from None
        reason = str(error).strip().rstrip(".")
        raise LogError(f"{path.name} is not a readable CSV file ({reason}); export it again as UTF-8.") from None


def _typed(file: str, cells: dict[str, Any], decimal: str, notes: list[str]) -> dict[str, Column]:
    """Floats if all cells of a column are numbers, otherwise the text; rows without data are left out."""
    import pandas as pd

    text = {n: pd.Series(v, dtype="string") for n, v in cells.items() if not pd.api.types.is_numeric_dtype(v)}
    rows = len(next(iter(cells.values())))
    out = _without_data(file, text, list(cells), rows, decimal)
    if out.any() and out.sum() < rows:
        notes.append(
            f"{out.sum()} row(s) of text between or below the data were left out, the first is row {out.argmax()}."
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


def _without_data(file: str, text: dict[str, Any], names: list[str], rows: int, decimal: str) -> Any:
    """Flags (rows,) of repeated headers, words below the data, and events between them.

    A header in between that names a column differently, as after a change of units, is refused.
    """
    import pandas as pd

    again = np.zeros(rows, dtype=bool)
    words = {n: np.zeros(rows, dtype=bool) for n in names}
    dates: list[str] = []
    for name, values in text.items():
        again |= _true(values.str.strip().str.strip('"') == name)
        odd = np.asarray(no_numbers(values, as_numbers(values, decimal)[0]), dtype=bool)
        if 2 * odd.sum() > rows:
            odd = ~_true(values.str.fullmatch(_DATE)) & ~_true(values.isna())
            dates += [name]
        if 2 * odd.sum() > rows:  # neither numbers nor dates: a column of words does not qualify its rows
            del words[name]
        else:
            words[name] = odd
    for row in np.flatnonzero(again)[:_MOST_HEADERS]:
        for name, values in text.items():
            cell = "" if pd.isna(values[row]) else values[row].strip().strip('"')
            if is_word(cell) and not re.fullmatch(re.escape(cell) + r"(\.\d+)?", name):
                raise LogError(
                    f"{file}: row {row} is a header in which {name!r} is called {cell!r}, so the rows below may have "
                    "other units; split the file there."
                )
    # A footer line begins with a word, such as "Mean;0.3;0.1"; a word in a later cell is a failed reading.
    footer = next(iter(words.values()), np.zeros(rows, dtype=bool)).copy()
    footer[: max(rows - int(np.argmin(footer[::-1])), rows - _FOOTER)] = False
    # A row with a date, words and no number is an event or a comment, such as "STOP TRG" of a trace.
    values = [n for n in names if n not in dates]
    silent = [
        words[n] | _true(text[n].isna() | (text[n].str.strip() == "")) for n in values if n in text and n in words
    ]
    event = np.zeros(rows, dtype=bool)
    if dates and silent and len(silent) == len(values):
        event = np.logical_and.reduce(silent) & np.logical_or.reduce([words[n] for n in values])
    return again | footer | event


def _true(flags: Any) -> Any:
    """Flags as booleans, False for missing cells."""
    return flags.fillna(False).to_numpy(dtype=bool)


def _chunks(path: Path, numbers: list[int], options: dict[str, Any]) -> dict[int, Any]:
    """The wanted columns, concatenated."""
    import pandas as pd

    parts: dict[int, list[Any]] = {i: [] for i in numbers}
    with opened(path) as file, pd.read_csv(file, **options) as reader:
        for chunk in reader:
            for i in parts:
                parts[i].append(chunk[i].to_numpy())
    return {i: np.concatenate(parts.pop(i)) for i in list(parts)}


def _type(cell: str, decimal: str) -> type:
    """The type as which a column is read, by its first cell, so that long integers keep their last digits."""
    if len(cell.lstrip("+-")) > 15 and cell.lstrip("+-").isdigit():
        return np.int64
    return float if is_plain(cell, decimal) else str
