"""The cells of a text table: numbers in every notation of spreadsheets and loggers."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import numpy as np

from whsklearn.logs.units import symbol_of

if TYPE_CHECKING:
    import pandas as pd

_PLAIN = r"(?:\d+\.?\d*|\.\d+)(?:[eEdD][+-]?\d+)?"
_NUMBER = re.compile(rf"[+-]?{_PLAIN}$|[+-]?(nan|inf|infinity)$|$", re.IGNORECASE)
_GROUP = r"'\u2019 \u00a0\u2009\u202f"  # thousands separators, besides the comma or point that is not the decimal sign
_THOUSANDS = {
    ".": re.compile(rf"[+-]?\d{{1,3}}(?:[,{_GROUP}]\d{{3}})+(?:\.\d*)?"),
    ",": re.compile(rf"[+-]?\d{{1,3}}(?:[.{_GROUP}]\d{{3}})+(?:,\d*)?"),
}
_DECIMAL_COMMA = re.compile(r"[+-]?\d*,\d+(?:[eE][+-]?\d+)?")
_HEX = re.compile(r"0[xX][0-9a-fA-F]+")
_BRACKETS = re.compile(r"\(\s*([^()+-]+)\)")  # accounting notation of negative numbers
_WITH_UNIT = re.compile(r"^([+-]?[\d.,]+(?:[eE][+-]?\d+)?)\s?([A-Za-zµ°%][\w°%·*/^ ]*)$")
_POINTED = re.compile(r"[+-]?\d{1,3}(?:\.\d{3})+,\d*|[+-]?\d{1,3}(?:\.\d{3}){2,}")  # points that part thousands
# What stands for no value: signs alone, words, and the names that C libraries have for what is no number
_MISSING = re.compile(r"[^\w\s]+|missing|#(div/0|value|wert|ref)!|none|null|n/a|na|[+-]?nan(\(\w*\))?", re.IGNORECASE)
_FLAGS = {"true": 1.0, "false": 0.0}


def plain(cell: str) -> str:
    """A cell stripped of blanks, quotes and a final semicolon, with a typographic minus replaced.

    >>> plain(" '\u22121.5' "), plain("0.25;")
    ('-1.5', '0.25')
    """
    return cell.strip().rstrip(";").strip("\"' ").replace("\u2212", "-")


def is_word(cell: str) -> bool:
    """Whether a cell holds a word that is neither a number nor a code for a missing value.

    >>> is_word("Port"), is_word("N/A"), is_word("1,5")
    (True, False, False)
    """
    text = plain(cell)
    return bool(re.match(r"[^\W\d_]", text)) and not _MISSING.fullmatch(text) and text.lower() not in {*_FLAGS, "inf"}


def is_number(cell: str, decimal: str = ".") -> bool:
    """Whether a cell is empty or holds a number in some notation.

    >>> [is_number(c) for c in ("1.5", "1,234.5", "1.2D-3", "0x1F", "1.5 Nm", "", "off")]
    [True, True, True, True, True, True, False]
    >>> is_number("1.234,5", ","), is_number("1.234,5")
    (True, False)
    """
    cell = plain(cell)
    if is_plain(cell, decimal) or _THOUSANDS[decimal].fullmatch(cell) or _HEX.fullmatch(cell):
        return True
    if (inside := _BRACKETS.fullmatch(cell)) is not None:
        return is_plain(inside[1], decimal)
    found = _WITH_UNIT.fullmatch(cell)
    return found is not None and " " in cell and symbol_of(found[2]) is not None and is_plain(found[1], decimal)


def is_plain(cell: str, decimal: str = ".") -> bool:
    """Whether a cell is empty or holds a number in programming notation."""
    if decimal == ",":
        cell = cell.replace(",", ".") if "." not in cell else "x"
    return _NUMBER.match(cell) is not None


def as_numbers(values: pd.Series, decimal: str) -> tuple[pd.Series, str, list[str]]:
    """Floats of cells, their common unit, and notes on conversions; NaN if a cell is not a number.

    ``values`` (n,): cells, or NaN for missing ones. ``decimal``: ``.`` or ``,``.

    >>> import pandas as pd
    >>> as_numbers(pd.Series(["1,234.5", "7"]), ".")[0].tolist(), as_numbers(pd.Series(["2 A", "-3 A"]), ".")[1]
    ([1234.5, 7.0], 'A')
    """
    import pandas as pd

    def number(part: pd.Series) -> pd.Series:
        part = part.str.replace(",", ".", regex=False) if decimal == "," else part
        return pd.Series(pd.to_numeric(part, errors="coerce").to_numpy(dtype=float, na_value=np.nan), part.index)

    text = values.str.strip().str.rstrip(";").str.strip("\"' ").str.replace("\u2212", "-", regex=False)
    out, unit, notes = number(text), "", []
    text = text.mask(text.str.fullmatch(_MISSING).fillna(False).to_numpy(dtype=bool))
    if decimal == "," and text.str.fullmatch(_POINTED).any():  # then 1.234 is a number of thousands, too
        out = out.mask(text.str.fullmatch(_THOUSANDS[","]).fillna(False).to_numpy(dtype=bool))
    for word, value in _FLAGS.items():
        out = out.mask((text.str.lower() == word).fillna(False).to_numpy(dtype=bool), value)

    def left() -> pd.Series:
        return text[out.isna() & text.notna() & (text != "")]

    def all_of(rest: pd.Series, pattern: re.Pattern[str]) -> bool:
        return bool(rest.size) and bool(rest.str.fullmatch(pattern).all())

    rest = left()
    found = rest.iloc[:1000].str.extract(_WITH_UNIT)
    if rest.size and found[1].nunique() == 1 and found.notna().all(axis=None) and symbol_of(str(found[1].iloc[0])):
        unit = str(found[1].iloc[0])
        cut = rest.str.removesuffix(unit).str.strip()
        out.loc[cut.index] = number(cut)
        notes.append(f"Each number is followed by its unit, {unit!r}, which was removed.")
        rest = left()
    other = "," if decimal == "." else "."
    if all_of(rest, _THOUSANDS[decimal]):
        out.loc[rest.index] = number(rest.str.replace(rf"[{other}{_GROUP}]", "", regex=True))
        notes.append("Thousands separators were removed from the numbers.")
    elif decimal == "." and all_of(rest, _DECIMAL_COMMA):
        out.loc[rest.index] = pd.to_numeric(rest.str.replace(",", ".", regex=False), errors="coerce")
        notes.append("Quoted numbers have a decimal comma.")
    elif all_of(rest, _HEX):
        out.loc[rest.index] = rest.map(lambda cell: float(int(cell, 16)))
        notes.append("Numbers are hexadecimal.")
    elif all_of(rest, _BRACKETS):
        out.loc[rest.index] = -number(rest.str.extract(_BRACKETS)[0])
        notes.append("Numbers in parentheses were read as negative.")
    elif rest.size:
        out.loc[rest.index] = number(rest.str.replace(r"(?<=[\d.])[dD](?=[+-]?\d)", "e", regex=True))
    return out, unit, notes


def no_numbers(values: Any, numbers: pd.Series) -> Any:
    """Cells that are not empty and not numbers."""
    text = values.str.strip()
    return numbers.isna() & text.notna() & (text != "") & ~text.str.fullmatch(_MISSING).fillna(False).astype(bool)
