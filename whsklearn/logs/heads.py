"""The header of a table: names and units in one or several rows, time columns, and the clock.

Controllers write a header of ``key; value`` lines (ctrlX, CODESYS) or a block of labelled rows, one of which contains
the names (TwinCAT Scope), and give each channel its own time column. Scripts put names and clock into comments.
"""

from __future__ import annotations

import itertools
import re
from typing import NamedTuple

from whsklearn.logs.cells import is_number
from whsklearn.logs.units import multiple_of, states_a_unit, symbol_of

COMMENTS = ("#", "%", "//", "!")
_NAMES = {"name", "names", "signal", "signals", "channel", "channels", "variable", "variables", "kanal", "signalname"}
_NAMES |= {"tracename"}
_UNITS = {"unit", "units", "einheit", "einheiten", "dimension", "y_unit_label"}
_UNITS |= {"vunit", "vert_units", "vertical unit", "vertical units"}  # of oscilloscopes and recorders
_TIME = {"time", "timestamp", "timestamps", "zeit", "zeitstempel", "t"}
_X_VALUE = "x_value"  # LabVIEW's name of the time
_TICKS = {"tick", "ticks"}
_ODRIVE = 8000.0  # Hz; control rate of an ODrive v3, whose scripts log its ticks
_SECONDS = {"s": 1.0, "sec": 1.0, "time": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
_HERTZ = {"hz": 1.0, "khz": 1e3, "mhz": 1e6, "1/s": 1.0, "s/s": 1.0, "sps": 1.0}
_RATE = re.compile(r"(\d+(?:[.,]\d+)?)\s*([kM]?)Hz\b", re.IGNORECASE)
_PERIOD = re.compile(
    r"\W*(?:(?:sampl\w*|cycle|task|scan|trace|rec|recording|abtast|zyklus)[\s_-]*"
    r"(?:time|period|interval\w*|zeit|rate|frequen\w*)|d?ts?|fs|interval|delta_x)"
    r"\s*(?:[\[(]\s*([^\])]+?)\s*[\])])?\s*[;:=,\t ]\s*(?=\S)",
    re.IGNORECASE,
)
# The unit of an oscilloscope's time; LabVIEW calls it the dimension, and counts time in s
_AXIS = re.compile(r"\W*(?:h|horz|horizontal|x)[\s_-]?(?:units?|dimension)\W+([a-z]+)\b", re.IGNORECASE)
_OF_RATE = re.compile(r"rate|frequen|fs", re.IGNORECASE)
_INCREMENT = {"increment", "xincrement", "x increment", "tinc", "t_inc"}
_VALUE = re.compile(r"\"?(\d+(?:[.,]\d+)?(?:e[+-]?\d+)?)\s*([a-z1µμ/]+)?\"?", re.IGNORECASE)


class Head(NamedTuple):
    """Names and units of the columns, and for each column the index of its time column if there are several."""

    names: list[str] | None
    units: list[str] | None
    clocks: list[int] | None = None


def headings(above: list[list[str]], width: int, apart: bool = False) -> Head | None:
    """The header formed by the rows of words above a table of `width` columns; None if they form none.

    ``above``: cells of the rows, from the top of the file to the first row of data. ``width``: columns of the table.
    ``apart``: whether the first column contains the labels of the header and no data.

    >>> head = headings([["Name", "q", "Name", "i"], ["Unit", "deg", "Unit", "A"], ["Port", "851", "Port", "851"]], 4)
    >>> head.names, head.units, head.clocks
    (['time', 'q', 'time.2', 'i'], ['', 'deg', '', 'A'], [0, 0, 2, 2])
    >>> headings([["Rig 7", ""], ["t", "q"], ["ms", "deg"]], 2)[:2]
    (['t', 'q'], ['ms', 'deg'])
    """
    labelled = [
        c for c in above
        if _label(c) in _NAMES and len(c) in (width, width + 1) and not any(x and is_number(x) for x in c)
    ]  # fmt: skip
    rows = [c for c in above if len(c) == (len(labelled[-1]) if labelled else width)]
    if labelled and len(above) > 1:
        names = labelled[-1]
        told = [_unit(u) for u in next((c for c in reversed(rows) if _label(c) in _UNITS), [""] * len(names))]
        if apart:
            return Head(unique(["", *names[1:]]), ["", *told[1:]])
        times = [i for i, n in enumerate(names) if n == names[0]]
        ms = "ms" if any(_label(c).startswith(("sampletime[ms]", "symbolbased")) for c in rows) else ""
        names = ["time" if i in times else n for i, n in enumerate(names)]
        told = [ms if i in times else u for i, u in enumerate(told)]
        drop = len(names) - width  # labels above a table without a time column
        return Head(unique(names[drop:]), told[drop:], None if drop else _clocks(times, width))
    channels = [c for c in above if _label(c) in _UNITS and len(c) == width + 1]
    if channels:  # unnamed channels below a header of labelled rows
        return Head(None, [_unit(u) for u in channels[-1][1:]])
    if not rows:
        return _extended(above, width)
    last = max((i for i, c in enumerate(rows) if _all_units(c)), default=0)
    first = last == 0 and len(rows) > 1 and _all_units(rows[0]) and _is_distinct(rows[1])
    if (_label(rows[last]) in _UNITS and last < len(rows) - 1) or first:  # units above the names, labelled or not
        names, units = rows[-1], rows[last]
    elif last:
        # Types may stand between names and units, as in MATLAB exports; a row with repeated entries does not hold
        # names.
        k = next((k for k in reversed(range(last)) if _is_distinct(rows[k])), last - 1)
        names, units = _stacked(rows[: k + 1]), rows[last]
    else:
        names, units = rows[-1], []
    if apart and names[0].lower() == _X_VALUE:  # LabVIEW names a time column that it left blank
        names = ["", *names[1:]]
    return Head(unique(names), [_unit(u) for u in units] or None, _clocks(_times(names), width))


def _is_distinct(cells: list[str]) -> bool:
    """Whether all cells differ."""
    said = [c for c in cells if c]
    return len(set(said)) == len(said) > 0


def _stacked(rows: list[list[str]]) -> list[str]:
    """The last row, with blanks filled from the rows above."""
    return [next((c for c in reversed(column) if c), "") for column in zip(*rows, strict=True)]


def _extended(above: list[list[str]], width: int) -> Head | None:
    """The header of a table whose last names refer to numbers in the next row: ``X,CH1,Start,Increment`` of a Rigol."""
    if len(above) < 2 or len(above[-2]) <= width or increment_in(above) is None:
        return None
    names = [n if not is_number(v) else "" for n, v in zip(above[-2], above[-1], strict=False)]
    return Head(unique(names[:width]), [_unit(c) for c in above[-1][:width]])


def increment_in(above: list[list[str]]) -> float | None:
    """Sample time in s, if a row of names contains ``Increment`` and the next row its value.

    >>> increment_in([["X", "CH1", "Start", "Increment"], ["Sequence", "Volt", "0", "1.0e-03"]])
    0.001
    """
    for names, values in itertools.pairwise(above):
        for name, value in zip(names, values, strict=False):
            if name.lower() in _INCREMENT and _VALUE.fullmatch(value):
                return float(value) or None
    return None


def commented(lines: list[str], width: int) -> Head:
    """The names in a comment, as written by ``numpy.savetxt`` and MATLAB scripts, and the units in another."""
    found: list[list[str]] = []
    for line in lines:
        if line.lstrip().startswith(COMMENTS):
            text = re.sub(r"^units?\s*[:=]\s*", "", line.strip().lstrip("#%/! ").rstrip(";, "), flags=re.IGNORECASE)
            for separator in (r"\s*[,;\t|]\s*", r"\s{2,}", r"\s+"):
                cells = re.split(separator, text)
                if len(cells) == width > 1 and not any(is_number(c) for c in cells):
                    found.append(cells)
                    break
    units = next(filter(_all_units, reversed(found)), None)
    names = next((c for c in reversed(found) if not _all_units(c)), units)
    return Head(unique(names) if names else None, [_unit(c) for c in units] if units else None)


def period_in(lines: list[str]) -> float | None:
    """Sample time in s, if a line above the table states it with its unit.

    >>> period_in(["Device; drive 1", "Sampling time; 250 us"]), period_in(["Samples: 300"])
    (0.00025, None)
    >>> period_in(["# sample rate [kHz] = 2"]), period_in(["HUnit,s,s", "SampleRate,2000.0,2000.0"])
    (0.0005, 0.0005)
    """
    axis = next((found[1].lower() for found in map(_AXIS.match, lines) if found), "")
    for line in lines:
        line = line.strip().lstrip("#%/! ")
        if (key := _PERIOD.match(line)) is None:
            continue
        for between in (r"[;\t]|,\s|,$", r"[;\t,]"):  # a comma inside a number, or between equal ones of channels
            cells = {c.strip() for c in re.split(between, line[key.end() :])}
            values = [v for v in map(_VALUE.fullmatch, cells - {"", line[: key.end()].strip()}) if v is not None]
            if values:
                break
        if len(values) != 1:  # channels of several rates
            continue
        usual = "hz" if axis == "s" and _OF_RATE.search(line[: key.end()]) else axis
        unit = (key[1] or values[0][2] or usual).lower().replace("µ", "u").replace("μ", "u")
        value = float(values[0][1].replace(",", "."))
        if value > 0 and unit in _SECONDS:
            return value * _SECONDS[unit]
        if value > 0 and unit in _HERTZ:
            return 1.0 / (value * _HERTZ[unit])
    return None


def ticks_in(lines: list[str], names: list[str]) -> tuple[int, float | None] | None:
    """The column that counts ticks and the ticks per second (None if not stated); None without such a column.

    >>> ticks_in(["% ODrive, time in ticks of 8 kHz"], ["0", "1", "2"]), ticks_in([], ["ticks", "q"])
    ((0, 8000.0), (0, None))
    >>> ticks_in(["% 8 kHz"], ["time_ms", "q"]) is None
    True
    """
    said = [t for t in lines if _TICKS & set(_words(t))]
    column = next((i for i, n in enumerate(names) if _TICKS & set(_words(n))), None)
    if column is None and said:
        column = next((i for i, n in enumerate(names) if _TIME & set(_words(n))), 0)
    if column is None or (
        len(said) == 0 and _words(names[column])[-1] not in _TICKS and not _RATE.search(names[column])
    ):
        return None
    for text in [names[column], *said, *lines]:
        if (rate := _RATE.search(text)) is not None:
            return column, float(rate[1].replace(",", ".")) * {"": 1.0, "k": 1e3, "m": 1e6}[rate[2].lower()]
    return column, _ODRIVE if any("odrive" in t.lower() for t in lines) else None


def unique(names: list[str]) -> list[str]:
    """Names without blanks or duplicates."""
    out: list[str] = []
    for i, name in enumerate(names):
        name = name or f"column {i}"
        out.append(name if name not in out else f"{name}.{i}")
    return out


def _label(cells: list[str]) -> str:
    return cells[0].strip(" :").lower() if cells else ""


def _words(text: str) -> list[str]:
    return re.findall(r"[a-z]+", text.lower()) or [""]


def _unit(text: str) -> str:
    text = text.partition(" (")[0].strip("[]() ")
    return symbol_of(text) or multiple_of(text) or (text if states_a_unit(text) else "")


def _all_units(cells: list[str]) -> bool:
    """Whether every cell is a unit or blank, and most are units; the first may be a label."""
    known = [symbol_of(c.strip("[]() ")) is not None or c.lower() in _UNITS for c in cells]
    said = sum(c != "" for c in cells)
    return sum(known) * 2 > said and all(k or len(c) <= 6 for k, c in zip(known, cells, strict=True))


def _times(names: list[str]) -> list[int]:
    """The time columns if each column or group has its own: one repeated name, or every other column."""
    times = [i for i, n in enumerate(names) if _TIME & set(_words(n)) or n.lower() == _X_VALUE]
    again = len({names[i] for i in times}) == 1 < len(times)
    return times if again or (len(times) > 1 and times == list(range(0, len(names), 2))) else []


def _clocks(times: list[int], width: int) -> list[int] | None:
    """The time column of each column, the nearest to its left; None unless several begin with the first column."""
    if len(times) < 2 or times[0] != 0:
        return None
    return [max(t for t in times if t <= i) for i in range(width)]


_ODRIVE_UNITS = {
    "pos_estimate": "turns", "pos_setpoint": "turns", "input_pos": "turns", "vel_estimate": "turns/s",
    "vel_setpoint": "turns/s", "input_vel": "turns/s", "iq_measured": "A", "iq_setpoint": "A",
}  # fmt: skip


def drive_unit(column: str) -> str:
    """The unit of a column that bears the name of an endpoint of an ODrive; empty for any other.

    >>> drive_unit("axis0.encoder.pos_estimate"), drive_unit("Iq_measured"), drive_unit("position")
    ('turns', 'A', '')
    """
    return _ODRIVE_UNITS.get(column.rpartition(".")[2].strip().lower(), "")
