"""How a text file is laid out: encoding, comments, separator, decimal sign, header and units, from its first lines."""

from __future__ import annotations

import re
from typing import NamedTuple

from whsklearn.logs.cells import is_number, is_word, plain
from whsklearn.logs.heads import COMMENTS, Head, commented, headings

SEPARATORS = (",", ";", "\t", "|", r"\s+")
_DATE = re.compile(r"\d{1,4}[-/.:]\d{1,2}[-/.:]\d{1,4}")
_BODY = 50  # rows that tell what a column holds
_HEAD_BESIDE = 20  # rows of a head beside the data, at most
_FEW = 4  # rows; a table of fewer, above another one with names, is no log


class Dialect(NamedTuple):
    """Layout of a text file; `first` is the number of lines above the first row of data."""

    separator: str
    decimal: str
    first: int
    names: list[str] | None
    units: list[str] | None
    width: int
    comment: str | None
    sample: list[str]  # the first row's cells
    clocks: list[int] | None  # for each column the place of its time column, where there are several
    header: list[str] | None  # the cells above the data that do not fit it


def dialect_of(lines: list[str]) -> Dialect | None:
    """The layout that makes the most of the first lines a table of numbers; None if none does.

    Examples
    --------
    >>> d = dialect_of(["# rig 7", "Zeit;Moment", "s;Nm", "0,00;1,5", "0,01;1,6", "0,02;1,7"])
    >>> d.separator, d.decimal, d.first, d.names, d.units
    (';', ',', 3, ['Zeit', 'Moment'], ['s', 'Nm'])
    >>> dialect_of(["1 2.5", "2 2.6", "3 2.7"]).names is None
    True
    """
    live = [(i, t) for i, t in enumerate(lines) if _says(t) and not t.lstrip().startswith(COMMENTS)]
    best: tuple[float, Dialect] | None = None
    for separator in SEPARATORS:
        for decimal in (".", ",") if separator != "," else (".",):
            found = _read_as(lines, live, separator, decimal)
            if found is not None and (best is None or found[0] > best[0]):
                best = found
    return best[1] if best else None


def split(line: str, separator: str) -> list[str]:
    """Cells of a line, without quotes and blanks around them."""
    text = line.strip("\r\n")
    if separator == r"\s+":
        cells = text.split()
    elif '"' in text:
        cells = re.split(re.escape(separator) + r'(?=(?:[^"]*"[^"]*")*[^"]*$)', text)
    else:  # the look-ahead above takes the square of a line's length
        cells = text.split(separator)
    return [plain(c) for c in cells]


def _says(line: str) -> bool:
    """Whether a line holds anything but blanks, or the rule that is drawn below the names of a table."""
    return re.fullmatch(r"[\s|+=-]*", line) is None


def _is_data(cells: list[str], decimal: str) -> bool:
    """Numbers or dates in most of its cells, or in half of four or more of which the first is one; not all blank."""
    good = [is_number(c, decimal) or bool(_DATE.match(c)) for c in cells]
    half = len(cells) >= 4 and cells[0] != "" and good[0]  # time, name, value, unit
    return any(c and g for c, g in zip(cells, good, strict=True)) and 2 * sum(good) + half > len(cells)


def _read_as(
    lines: list[str], live: list[tuple[int, str]], separator: str, decimal: str
) -> tuple[float, Dialect] | None:
    """The layout under one separator and decimal sign, and how well it fits the first rows."""
    rows = [(i, split(t, separator)) for i, t in live]
    widths = [len(c) for _, c in rows]
    start = _first_row(rows, widths, decimal)
    if start is None:
        return None
    if 0 < start <= _HEAD_BESIDE and _beside(rows, start, decimal):
        start = 0
    width = widths[start]
    body = [c for _, c in rows[start : start + _BODY]]
    fits = sum(len(c) == width and _is_data(c, decimal) for c in body) / len(body)
    numeric = sum(is_number(x, decimal) and x != "" for c in body for x in c) / len(body)
    first, cells = rows[start]
    above = [c for k, (_, c) in enumerate(rows[:start]) if not _is_data(c, decimal) or _label(rows, k, decimal)]
    if all(not c[-1] for c in body):  # every row ends in a separator, the head may do without
        above = [[*c, ""] if len(c) == width - 1 else c for c in above]
    else:  # or the head alone does, as that of the Silverbox
        above = [c[:-1] if len(c) == width + 1 and not c[-1] else c for c in above]
    if start == 0 and width > 1 and _counts_up(cells) and len(rows) > 1:  # pandas heads nameless columns 0, 1, 2
        head, (first, cells) = Head([n or "index" for n in cells], None), rows[1]
    else:
        head = headings(above, width, apart=all(not c[0] for c in body)) or Head(commented(lines[:first], width), None)
    header = above[-1] if above and head.names is None and not head.units else None
    comment = next((t.lstrip()[0] for t in lines if t.lstrip().startswith(("#", "%"))), "#")
    # A comma that parts the cells beats one inside them only if every cell is then a number, which `fits` tells;
    # a point as decimal sign is the rule where both read the same.
    good = sum(is_number(x, decimal) or bool(_DATE.match(x)) for c in body for x in c) / sum(map(len, body))
    score = 10.0 * fits * good + min(numeric, 8.0) / 8.0 + 0.01 * (decimal == ".") + 0.5 * (width > 1)
    return score, Dialect(separator, decimal, first, head.names, head.units, width, comment, cells, head.clocks, header)


def _first_row(rows: list[tuple[int, list[str]]], widths: list[int], decimal: str, above: int = 0) -> int | None:
    """The first row of data at `above` or below it; a few numbers above another head are no log, but gains or so."""
    start = next(
        (
            k
            for k, (_, c) in enumerate(rows)
            if k >= above
            and _is_data(c, decimal)
            and _goes_on(rows, widths, k, decimal)
            and not _label(rows, k, decimal)
        ),
        None,
    )
    if start is None:
        return None
    for k in range(start + 1, min(start + _FEW, len(rows))):
        cells = rows[k][1]
        if len(cells) > 1 and all(map(is_word, cells)) and (start == 0 or cells != rows[start - 1][1]):
            return _first_row(rows, widths, decimal, k + 1) or start
    return start


def _goes_on(rows: list[tuple[int, list[str]]], widths: list[int], k: int, decimal: str) -> bool:
    """Whether the row after or the one before has as many cells, or there is none after; one cell alone needs more."""
    if k + 1 >= len(widths):
        return True
    if widths[k] == 1:  # a date in a head
        return widths[k + 1] == 1 and _is_data(rows[k + 1][1], decimal)
    return widths[k] in (widths[k + 1], widths[k - 1] if k else 0)


def _beside(rows: list[tuple[int, list[str]]], start: int, decimal: str) -> bool:
    """Whether all rows above the first of data are data too, beside a head in columns that soon are blank.

    An oscilloscope of Tektronix writes ``Record Length,2500,,-0.00125,0.04`` in its first rows.
    """
    body = [c for _, c in rows[start : start + _BODY]]
    width = len(body[0])
    said = [i for i in range(width) if any(len(c) == width and c[i] for c in body[_HEAD_BESIDE:])]
    above = [c for _, c in rows[:start]]
    return 0 < len(said) < width and all(
        len(c) == width and all(c[i] and is_number(c[i], decimal) for i in said) for c in above
    )


def _label(rows: list[tuple[int, list[str]]], k: int, decimal: str) -> bool:
    """Whether a row begins with a word where the rows below hold numbers: a line ``key; value``, or one of a head."""
    if not is_word(rows[k][1][0]) or bool(_DATE.match(rows[k][1][0])):
        return False
    below = [c[0] for _, c in rows[k + 1 :][-_BODY:]]
    return 2 * sum(is_number(c, decimal) or bool(_DATE.match(c)) for c in below) > len(below)


def _counts_up(cells: list[str]) -> bool:
    """Whether the cells are 0, 1, 2 ... after a blank for an index at most."""
    kept = cells[1:] if cells[0] == "" else cells
    return len(kept) > 1 and kept == [str(i) for i in range(len(kept))]
