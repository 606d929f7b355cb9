"""The layout of a text file from its first lines: encoding, comments, separator, decimal sign, header and units."""

from __future__ import annotations

import re
from typing import NamedTuple

from whsklearn.logs.cells import is_number, is_word, plain
from whsklearn.logs.heads import COMMENTS, Head, commented, headings

SEPARATORS = (",", ";", "\t", "|", r"\s+")
# A date alone in its cell, perhaps with a comma before the fraction: a whole row that begins with one is no date.
_DATE = re.compile(r"\d{1,4}[-/.:]\d{1,2}[-/.:]\d{1,4}[^,;|\t]*(?:,\d{1,9}[^,;|\t]*)?")
_BODY = 50  # rows from which the type of a column is determined
_HEAD_BESIDE = 20  # maximum number of header rows beside the data
_FEW = 4  # rows; a shorter table above another one with names is not a log


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
    clocks: list[int] | None  # for each column the index of its time column, if there are several
    header: list[str] | None  # cells above the data that do not belong to the table


def dialect_of(lines: list[str]) -> Dialect | None:
    """The layout under which most of the first lines form a table of numbers; None if there is none.

    >>> d = dialect_of(["# rig 7", "Zeit;Moment", "s;Nm", "0,00;1,5", "0,01;1,6", "0,02;1,7"])
    >>> d.separator, d.decimal, d.first, d.names, d.units
    (';', ',', 3, ['Zeit', 'Moment'], ['s', 'Nm'])
    >>> dialect_of(["1 2.5", "2 2.6", "3 2.7"]).names is None
    True
    """
    live = [i for i, t in enumerate(lines) if _says(t) and not t.lstrip().startswith(COMMENTS)]
    quoted = any('"' in lines[i] for i in live)  # only then can a comma be both separator and decimal sign
    signs = {separator: (".", ",") if separator != "," or quoted else (".",) for separator in SEPARATORS}
    found = [_read_as(lines, live, separator, decimal) for separator in SEPARATORS for decimal in signs[separator]]
    best = max(filter(None, found), key=lambda f: f[0], default=None)
    return best[1] if best else None


def split(line: str, separator: str) -> list[str]:
    """Cells of a line, without surrounding quotes and blanks."""
    text = line.strip("\r\n")
    if separator == r"\s+":
        cells = text.split()
    elif '"' in text:
        cells = re.split(re.escape(separator) + r'(?=(?:[^"]*"[^"]*")*[^"]*$)', text)
    else:  # the look-ahead above takes quadratic time in the length of a line
        cells = text.split(separator)
    return [plain(c) for c in cells]


def _names_apart(line: str, width: int) -> list[str] | None:
    """The cells of a header of blank-separated rows whose names hold blanks and stand two blanks apart."""
    cells = re.split(r"\s{2,}|\t", line.strip())
    return [plain(c) for c in cells] if len(cells) == width else None


def _says(line: str) -> bool:
    """Whether a line contains anything but blank cells or the rule below the header of a table."""
    return re.fullmatch(r"[\s|+=,;:-]*", line) is None


def _is_value(cell: str, decimal: str) -> bool:
    return is_number(cell, decimal) or _DATE.fullmatch(cell) is not None


def _is_data(cells: list[str], decimal: str) -> bool:
    """Whether most cells are numbers or dates, or half of four or more with the first, and not all are blank."""
    good = [_is_value(c, decimal) for c in cells]
    half = len(cells) >= 4 and cells[0] != "" and good[0]  # time, name, value, unit
    return any(c and g for c, g in zip(cells, good, strict=True)) and 2 * sum(good) + half > len(cells)


def _read_as(lines: list[str], live: list[int], separator: str, decimal: str) -> tuple[float, Dialect] | None:
    """The layout for one separator and decimal sign, and how well it fits the first of the `live` lines."""
    rows = [split(lines[i], separator) for i in live]
    start = _first_row(rows, decimal)
    if start is None:
        return None
    if 0 < start <= _HEAD_BESIDE and _beside(rows, start, decimal):
        start = 0
    first, cells = live[start], rows[start]
    width, body = len(cells), rows[start : start + _BODY]
    fits = sum(len(c) == width and _is_data(c, decimal) for c in body) / len(body)
    numeric = sum(is_number(x, decimal) and x != "" for c in body for x in c) / len(body)
    above = [
        _names_apart(lines[live[k]], width) or c if separator == r"\s+" and len(c) > width else c
        for k, c in enumerate(rows[:start])
        if not _is_data(c, decimal) or (_label(rows, k, decimal) and not _below_names(rows, k, decimal))
    ]
    if all(not c[-1] for c in body):  # every row ends in a separator, which the header may lack
        above = [[*c, ""] if len(c) == width - 1 else c for c in above]
    elif above and len(above[-1]) == width + 1 and above[-1][-1].lower() == "comment":
        width += 1  # LabVIEW names a column that a row has only if someone wrote a comment beside it
        above = [[*c, ""] if len(c) == width - 1 else c for c in above]
    elif above and len(above[-1]) == width - 1 and all(map(is_word, above[-1])) and _numbered(body):
        above = [*above[:-1], ["index", *above[-1]]]  # R numbers the rows in a column without a name
    else:  # or only the header does, as in the Silverbox files
        above = [c[:-1] if len(c) == width + 1 and not c[-1] else c for c in above]
    if start == 0 and width > 1 and _counts_up(cells) and len(rows) > 1:  # pandas names unnamed columns 0, 1, 2
        head, first, cells = Head([n or "index" for n in cells], None), live[1], rows[1]
    else:
        said = commented(lines[:first], width)
        head = headings(above, width, apart=all(not c[0] for c in body)) or said
        if not head.units and head.clocks is None:
            head = head._replace(units=said.units)
    header = above[-1] if above and head.names is None and not head.units else None
    comment = next((t.lstrip()[0] for t in lines if t.lstrip().startswith(("#", "%"))), "#")
    # A comma as separator is preferred to a decimal comma only if every cell is then a number (see `fits`); a decimal
    # point is assumed if both readings agree.
    good = sum(_is_value(x, decimal) for c in body for x in c) / sum(map(len, body))
    score = 10.0 * fits * good + min(numeric, 8.0) / 8.0 + 0.01 * (decimal == ".") + 0.5 * (width > 1)
    return score, Dialect(separator, decimal, first, head.names, head.units, width, comment, cells, head.clocks, header)


def _first_row(rows: list[list[str]], decimal: str, above: int = 0) -> int | None:
    """The first row of data at or below `above`; a few numbers above another header are not a log but parameters."""

    def begins(k: int) -> bool:
        return _is_data(rows[k], decimal) and _goes_on(rows, k, decimal) and not _label(rows, k, decimal)

    start = next(filter(begins, range(above, len(rows))), None)
    if start is None:
        return None
    for k in range(start + 1, min(start + _FEW, len(rows))):
        cells = rows[k]
        if len(cells) > 1 and all(map(is_word, cells)) and (start == 0 or cells != rows[start - 1]):
            return _first_row(rows, decimal, k + 1) or start
    return start


def _goes_on(rows: list[list[str]], k: int, decimal: str) -> bool:
    """Whether an adjacent row has as many cells, or no row follows; a single cell needs more evidence."""
    if k + 1 >= len(rows):
        return True
    if len(rows[k]) == 1:  # a date in a header
        return len(rows[k + 1]) == 1 and _is_data(rows[k + 1], decimal)
    return len(rows[k]) in (len(rows[k + 1]), len(rows[k - 1]) if k else 0)


def _beside(rows: list[list[str]], start: int, decimal: str) -> bool:
    """Whether all rows above the first data row are data too, next to header columns that are soon blank.

    An oscilloscope of Tektronix writes ``Record Length,2500,,-0.00125,0.04`` in its first rows.
    """
    body = rows[start : start + _BODY]
    width = len(body[0])
    said = [i for i in range(width) if any(len(c) == width and c[i] for c in body[_HEAD_BESIDE:])]
    return 0 < len(said) < width and all(
        len(c) == width and all(c[i] and is_number(c[i], decimal) for i in said) for c in rows[:start]
    )


def _label(rows: list[list[str]], k: int, decimal: str) -> bool:
    """Whether a row begins with a word where the rows below have numbers: a ``key; value`` line, or a header."""
    if not is_word(rows[k][0]) or _DATE.fullmatch(rows[k][0]):
        return False
    below = [c[0] for c in rows[k + 1 :][-_BODY:]]
    return 2 * sum(_is_value(c, decimal) for c in below) > len(below)


def _below_names(rows: list[list[str]], k: int, decimal: str) -> bool:
    """Whether a row has numbers behind its first cell, and names above it: data with a word in place of the time."""
    cells = rows[k]
    named = any(len(c) == len(cells) and all(map(is_word, c)) for c in rows[:k])
    return named and len(cells) > 1 and all(is_number(c, decimal) and c != "" for c in cells[1:])


def _numbered(rows: list[list[str]]) -> bool:
    """Whether the first cells of three rows and more count them."""
    said = [c[0] for c in rows]
    return len(said) > 2 and said[0].isdigit() and said == [str(int(said[0]) + i) for i in range(len(said))]


def _counts_up(cells: list[str]) -> bool:
    """Whether the cells are 0, 1, 2 ..., possibly after a blank cell for an index."""
    kept = cells[1:] if cells[0] == "" else cells
    return len(kept) > 1 and kept == [str(i) for i in range(len(kept))]
