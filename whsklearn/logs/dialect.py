"""How a text file is laid out: encoding, comments, separator, decimal sign, header and units, from its first lines."""

from __future__ import annotations

import re
from typing import NamedTuple

from whsklearn.logs.cells import is_number, plain
from whsklearn.logs.units import symbol_of

SEPARATORS = (",", ";", "\t", "|", r"\s+")
_DATE = re.compile(r"\d{1,4}[-/.:]\d{1,2}[-/.:]\d{1,4}")
_COMMENTS = ("#", "%", "//", "!")


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
    live = [(i, t) for i, t in enumerate(lines) if t.strip() and not t.lstrip().startswith(_COMMENTS)]
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
    cells = (
        text.split() if separator == r"\s+" else re.split(re.escape(separator) + r'(?=(?:[^"]*"[^"]*")*[^"]*$)', text)
    )
    return [plain(c) for c in cells]


def _is_data(cells: list[str], decimal: str) -> bool:
    """A row of data has numbers or dates in most of its cells, and one that is no blank."""
    good = [is_number(c, decimal) or bool(_DATE.match(c)) for c in cells]
    return any(c and g for c, g in zip(cells, good, strict=True)) and 2 * sum(good) > len(cells)


def _read_as(
    lines: list[str], live: list[tuple[int, str]], separator: str, decimal: str
) -> tuple[float, Dialect] | None:
    """The layout under one separator and decimal sign, and how well it fits the first rows."""
    rows = [(i, split(t, separator)) for i, t in live]
    widths = [len(c) for _, c in rows]
    start = next((k for k, (_, c) in enumerate(rows) if _is_data(c, decimal) and _goes_on(widths, k)), None)
    if start is None:
        return None
    width = widths[start]
    body = [c for _, c in rows[start : start + 50]]
    fits = sum(len(c) == width and _is_data(c, decimal) for c in body) / len(body)
    numeric = sum(is_number(x, decimal) and x != "" for c in body for x in c) / len(body)
    first, cells = rows[start]
    if start == 0 and width > 1 and _counts_up(cells) and len(rows) > 1:  # pandas heads nameless columns 0, 1, 2
        names: list[str] | None = [n or "index" for n in cells]
        units, (first, cells) = None, rows[1]
    else:
        names, units = _header(lines, rows, start, width, separator, decimal)
    comment = next((t.lstrip()[0] for t in lines if t.lstrip().startswith(("#", "%"))), "#")
    # A comma that parts the cells beats one inside them only if every cell is then a number, which `fits` tells;
    # a point as decimal sign is the rule where both read the same.
    good = sum(is_number(x, decimal) or bool(_DATE.match(x)) for c in body for x in c) / sum(map(len, body))
    score = 10.0 * fits * good + min(numeric, 8.0) / 8.0 + 0.01 * (decimal == ".") + 0.5 * (width > 1)
    return score, Dialect(separator, decimal, first, names, units, width, comment, cells)


def _goes_on(widths: list[int], k: int) -> bool:
    """Whether the row after or the one before has as many cells, or there is none after."""
    return k + 1 >= len(widths) or widths[k] in (widths[k + 1], widths[k - 1] if k else 0)


def _counts_up(cells: list[str]) -> bool:
    """Whether the cells are 0, 1, 2 ... after a blank for an index at most."""
    kept = cells[1:] if cells[0] == "" else cells
    return len(kept) > 1 and kept == [str(i) for i in range(len(kept))]


def _header(
    lines: list[str], rows: list[tuple[int, list[str]]], start: int, width: int, separator: str, decimal: str
) -> tuple[list[str] | None, list[str] | None]:
    """Names and units of the columns, from the lines above the data or the last comment."""
    above = [c for _, c in rows[max(0, start - 2) : start] if not _is_data(c, decimal)]
    if all(not c[-1] for _, c in rows[start : start + 50]):  # every row ends in a separator, the header may do without
        above = [[*c, ""] if len(c) == width - 1 else c for c in above]
    above = [c for c in above if len(c) == width]
    if not above:
        return _commented(lines[: rows[start][0]], width, separator), None
    if len(above) == 2 and _all_units(above[1]):
        return _unique(above[0]), above[1]
    return _unique(above[-1]), None


def _commented(lines: list[str], width: int, separator: str) -> list[str] | None:
    """The names that a comment holds, as ``numpy.savetxt`` writes them."""
    for line in reversed(lines):
        if line.lstrip().startswith(_COMMENTS):
            cells = split(line.lstrip().lstrip("#%/! "), separator)
            if len(cells) == width and width > 1 and not any(is_number(c) for c in cells):
                return _unique(cells)
    return None


def _all_units(cells: list[str]) -> bool:
    """Whether every cell is a unit or blank, and most are units."""
    known = [symbol_of(c.strip("[]() ")) is not None for c in cells]
    return sum(known) * 2 > len(cells) and all(k or len(c) <= 6 for k, c in zip(known, cells, strict=True))


def _unique(names: list[str]) -> list[str]:
    """Names without blanks or doubles."""
    out: list[str] = []
    for i, name in enumerate(names):
        name = name or f"column {i}"
        out.append(name if name not in out else f"{name}.{i}")
    return out
