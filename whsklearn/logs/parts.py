"""Signals in separate files, or in separate rows with a column that distinguishes motors or signals."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from whsklearn.logs.errors import ColumnError, LogError
from whsklearn.logs.roles import guess, words_of
from whsklearn.logs.source import Column, Source
from whsklearn.logs.timebase import on_one_clock
from whsklearn.logs.units import unit_of

_TEXTS = {".csv", ".txt", ".tsv", ".dat", ".log", ".asc"}
_MOTOR = "(motor|joint|axis|servo|actuator|drive|node|can|canopen|device|dev|slave|leg|limb|arm|finger|wheel)"
_ID = re.compile(rf"({_MOTOR}_?)?(id|no|nr|number|num|index|name|addr|address)|{_MOTOR}")
_SIGNAL = re.compile("(signal|field|channel|variable|var|tag|metric|quantity)_?(id|name)?|name")
_SECONDS = re.compile(r"(|.*[._/ ])(?:secs?|seconds?)")
_PARTS = {  # of a second, per second: ROS, and the timeval of C
    1_000_000_000: re.compile(r"(|.*[._/ ])(?:nsecs?|nanosecs?|nanoseconds?)"),
    1_000_000: re.compile(r"(|.*[._/ ])(?:usecs?|microsecs?|microseconds?)"),
}
_MILLISECONDS = re.compile(r"(?:ms|msecs?|millis(?:econds?)?|millisekunden|毫秒)")
_VALUE = {"value", "val", "values", "varvalue", "wert", "reading"}
_UNIT = {"unit", "units", "einheit"}
_MOST_MOTORS = 64
_FEWEST_ROWS = 3


def with_nanoseconds(source: Source) -> Source:
    """Whole seconds completed by the nano- or microseconds beside them, as in ROS messages; else the source itself.

    >>> table = {"stamp.sec": [7, 7, 8], "stamp.nanosec": [0, 500_000_000, 0], "q": [0.0, 0.1, 0.2]}
    >>> rows = Source("a.csv", list(table), lambda wanted: {w: Column(np.array(table[w])) for w in wanted})
    >>> whole = with_nanoseconds(rows)
    >>> whole.names, whole.fetch(["stamp.sec"])["stamp.sec"].values, whole.units
    (['stamp.sec', 'q'], array([7000000000, 7500000000, 8000000000]), {'stamp.sec': 'ns'})
    """
    names = {n: re.sub(r"(?<=[a-z])(?=[A-Z])", "_", n).lower() for n in source.names}
    ends = {m[1]: (n, each) for each, end in _PARTS.items() for n, t in names.items() if (m := end.fullmatch(t))}
    pairs = {n: ends[m[1]] for n, t in names.items() if (m := _SECONDS.fullmatch(t)) and m[1] in ends}
    if not pairs or not source.header:
        return source

    joins = {n: (part, partial(_nanoseconds, each=each)) for n, (part, each) in pairs.items()}
    return replace(_completed(source, joins), units=source.units | dict.fromkeys(pairs, "ns"))


def with_milliseconds(source: Source) -> Source:
    """Times of the day in whole seconds completed by the column of milliseconds beside them, as controllers log them;
    otherwise the source itself.

    >>> table = {"Time": ["10:00:00", "10:00:00", "10:00:01"], "ms": [5, 505, 5], "q": [0.0, 0.1, 0.2]}
    >>> rows = Source("a.csv", list(table), lambda wanted: {w: Column(np.array(table[w])) for w in wanted})
    >>> whole = with_milliseconds(rows)
    >>> whole.names, whole.fetch(["Time"])["Time"].values.tolist()
    (['Time', 'q'], ['10:00:00.005', '10:00:00.505', '10:00:01.005'])
    """
    part = next((n for n in source.names if _MILLISECONDS.fullmatch(n.strip().lower())), None)
    if part is None or not source.header:
        return source
    rest = [n for n in source.names if n != part]
    try:
        time = guess(replace(source, names=rest), "time")
    except ColumnError:
        return source
    if time is None:
        return source
    read = source.fetch([time, part])
    clock, after = read[time].values, read[part].values
    text = clock.dtype.kind in "OUST" and len(clock) > 0 and re.fullmatch(r".*\d:\d\d", str(clock[0]).strip())
    if not text or after.dtype.kind not in "fiu" or not np.all((after >= 0) & (after <= 999) & (after == after // 1)):
        return source  # also where a row has none
    return _completed(source, {time: (part, _with_milliseconds)})


def _completed(source: Source, joins: Mapping[str, tuple[str, Callable[[Any, Any], Any]]]) -> Source:
    """Columns of time completed by others, parts of a second: by column, that of its part and how they are joined."""

    def fetch(wanted: Sequence[str]) -> dict[str, Column]:
        read = source.fetch([*wanted, *(joins[w][0] for w in wanted if w in joins)])
        for name in set(wanted) & set(joins):
            part, join = joins[name]
            read[name] = read[name]._replace(values=join(read[name].values, read.pop(part).values))
        return read

    parts = {part for part, _ in joins.values()}
    called = [f"Column {n!r} is completed by {part!r}, parts of a second." for n, (part, _) in joins.items()]
    kept = [n for n in source.names if n not in parts]
    return replace(source, names=kept, fetch=fetch, notes=[*source.notes, *called])


def _with_milliseconds(clock: NDArray[Any], ms: NDArray[Any]) -> NDArray[Any]:
    return np.array([f"{t}.{m:03.0f}" for t, m in zip(clock, ms, strict=True)])


def _nanoseconds(whole: NDArray[Any], part: NDArray[Any], each: int) -> NDArray[Any]:
    """Seconds and parts of a second in ns; a float, and from the first, if rows have no stamp."""
    by = 1_000_000_000 // each
    if whole.dtype.kind == "f":
        return np.asarray(1e9 * (whole - whole[np.isfinite(whole)][:1].sum()) + by * part)
    return np.asarray(whole, dtype=np.int64) * 1_000_000_000 + by * part.astype(np.int64)


def by_motor(source: Source) -> Source:
    """The columns of each motor, such as ``position.2``, if a column tells the motor of each row; else the source.

    >>> table = {"t": [0, 0, 1, 1, 2, 2], "id": [1, 2] * 3, "q": [0.0, 5.0, 0.1, 5.1, 0.2, 5.2]}
    >>> rows = Source("a.csv", list(table), lambda wanted: {w: Column(np.array(table[w])) for w in wanted})
    >>> motors = by_motor(rows)
    >>> motors.names, motors.fetch(["t", "q.2"])["q.2"].values
    (['t', 'q.1', 'q.2'], array([5. , 5.1, 5.2]))
    """
    column = next((n for n in source.names if _ID.fullmatch("_".join(words_of(n)))), None)
    if column is None or not source.header:
        return source
    ids = _ids(source.fetch([column])[column].values)
    numbers, counts = np.unique(ids, return_counts=True) if ids is not None else (np.empty(0), np.empty(0))
    if ids is None or not 2 <= numbers.size <= _MOST_MOTORS or counts.min() < _FEWEST_ROWS:
        return source
    shared = _times(source)[:1]
    where = {f"{n}.{i}": (n, i) for n in source.names if n not in (column, *shared) for i in numbers.tolist()}

    def fetch(wanted: Sequence[str]) -> dict[str, Column]:
        motors = {where[w][1] for w in wanted if w in where}
        if len(motors) > 1:
            raise ColumnError(
                f"{source.name}: {', '.join(w for w in wanted if w in where)} belong to several motors; name columns "
                "of one."
            )
        rows = ids == next(iter(motors)) if motors else np.ones(ids.size, dtype=bool)
        read = source.fetch([where[w][0] if w in where else w for w in wanted])
        return {w: (c := read[where[w][0] if w in where else w])._replace(values=c.values[rows]) for w in wanted}

    units = {w: source.units.get(n) or unit_of(n, "") for w, (n, _) in where.items()}
    units |= {n: source.units[n] for n in shared if n in source.units}
    notes = [*source.notes, f"The rows of {numbers.size} motors are distinguished by column {column!r}."]
    return Source(source.name, [*shared, *where], fetch, units={w: u for w, u in units.items() if u}, notes=notes)


def _times(source: Source) -> list[str]:
    """All columns that may be the time."""
    return [n for n in source.names if guess(replace(source, names=[n]), "time")]


def by_signal(source: Source) -> Source:
    """The signals of a long table, which has one row per reading with its time and its name; else the source.

    InfluxDB (``_time``, ``_field``, ``_value``), historians and many scripts write such tables.

    >>> table = {"t": [0, 0, 1, 1, 2, 2], "signal": ["q", "i"] * 3, "value": [0.0, 5.0, 0.1, 5.1, 0.2, 5.2]}
    >>> rows = Source("a.csv", list(table), lambda wanted: {w: Column(np.array(table[w])) for w in wanted})
    >>> signals = by_signal(rows)
    >>> signals.names, signals.fetch(["q"])["q"].values, signals.fetch(["q"])["q"].stamps
    (['i', 'q'], array([0. , 0.1, 0.2]), array([0., 1., 2.]))
    """

    def called(word: Callable[[str], Any]) -> str | None:
        return next((n for n in source.names if word("_".join(words_of(n)))), None)

    column, value = called(_SIGNAL.fullmatch), called(_VALUE.__contains__)
    times = _times(source)
    if column is None or value is None or not times:
        return source
    time = times[0]
    told = called(_UNIT.__contains__)
    read = source.fetch([column, value, time, *([told] if told else [])])  # together: all lose the same rows
    signal = read[column].values
    signal = signal.astype(str) if signal.dtype.kind in "OUS" else np.empty(0, dtype=str)
    names, counts = np.unique(signal[(signal != "nan") & (signal != "")], return_counts=True)
    if not 2 <= names.size <= _MOST_MOTORS or counts.min() < _FEWEST_ROWS:
        return source
    who, notes = signal, [*source.notes, f"The rows of {names.size} signals are distinguished by column {column!r}."]
    if _repeats(who, read[time].values):  # the same signal of several axes, as the tags of InfluxDB tell them apart
        others = [n for n in source.names if n not in read]
        more = source.fetch([*read, *others])
        texts = [n for n in others if more[n].values.dtype.kind in "OUS"]
        for tag in [*texts, *(n for n in others if n not in texts)]:
            apart = np.char.add(np.char.add(more[column].values.astype(str), "."), more[tag].values.astype(str))
            if not _repeats(apart, more[time].values):
                read, signal, who = more, more[column].values.astype(str), apart
                notes.append(f"Signals of the same name are distinguished by column {tag!r}.")
                break
    names = np.unique(who[(signal != "nan") & (signal != "")])
    base = {n: str(signal[np.argmax(who == n)]) for n in names.tolist()}
    units = {n: str(read[told].values[np.argmax(who == n)]) if told else unit_of(b, "") for n, b in base.items()}

    def fetch(wanted: Sequence[str]) -> dict[str, Column]:
        rows = [who == w for w in wanted]
        stamps = on_one_clock([read[time].values[r] for r in rows], source.units.get(time) or unit_of(time, ""), time)
        return {w: Column(_numbers(read[value].values[r]), t) for w, r, t in zip(wanted, rows, stamps, strict=True)}

    kept = {n: u for n, u in units.items() if u}
    return Source(source.name, names.tolist(), fetch, units=kept, notes=notes, clocked=True)


def _repeats(who: Any, stamps: Any) -> bool:
    """Whether a signal has several readings at one time."""
    pairs = np.char.add(np.char.add(who.astype(str), " "), stamps.astype(str))
    return bool(np.unique(pairs).size < pairs.size)


def _numbers(values: Any) -> Any:
    """Numbers where all are; beside signals of words the column is read as text."""
    import pandas as pd

    if values.dtype.kind not in "OUS":
        return values
    numbers = pd.to_numeric(pd.Series(values), errors="coerce").to_numpy(dtype=float)
    return numbers if np.isfinite(numbers).all() else values


def _ids(values: Any) -> Any:
    """The motor of each row, as text; None if the column contains measurements."""
    if values.dtype.kind in "fiu":
        whole = np.isfinite(values) & (values == np.round(values))
        return np.array([f"{v:.0f}" for v in values]) if whole.all() else None
    return values.astype(str) if values.dtype.kind in "OUS" else None


def open_folder(path: Path, opener: Callable[[Path], Source]) -> Source:
    """A folder of text tables, one per signal, each with or without its own time; columns are named after the files.

    Raises LogError if there is no table, only some have a time, or their times are in different units.
    """
    files = sorted(f for f in path.iterdir() if f.is_file() and f.suffix.lower() in _TEXTS and f.name[0] != ".")
    if not files:
        raise LogError(
            f"{path} is a folder without text tables, a ROS 2 bag (metadata.yaml) or a LeRobot data set "
            "(meta/info.json); give the file of a log, or a folder with a CSV for each signal."
        )
    where: dict[str, tuple[Source, str, str | None]] = {}
    units: dict[str, str] = {}
    for file in files:
        source = opener(file)
        time = _time_of(source)
        values = [n for n in source.names if n != time]
        for name in values:
            called = file.stem if len(values) == 1 else f"{file.stem}.{name}"
            where[called] = (source, name, time)
            units[called] = source.units.get(name) or unit_of(name, "") or unit_of(called, "")
    timed = {time is not None for _, _, time in where.values()}
    clocks = {unit_of(t, s.units.get(t, "")) if not s.units.get(t) else s.units[t] for s, _, t in where.values() if t}
    if len(timed) > 1 or len(clocks) > 1:
        raise LogError(
            f"The files of {path.name} differ in their time ({', '.join(sorted(clocks)) or 'some have none'}); export "
            "all alike."
        )

    def fetch(wanted: Sequence[str]) -> dict[str, Column]:
        read = {w: where[w][0].fetch([n for n in where[w][1:] if n is not None]) for w in wanted}
        if not timed or timed == {False}:
            return {w: read[w][where[w][1]] for w in wanted}
        clock = next(iter(clocks))
        stamps = on_one_clock([read[w][str(where[w][2])].values for w in wanted], clock, str(where[wanted[0]][2]))
        return {w: read[w][where[w][1]]._replace(stamps=t) for w, t in zip(wanted, stamps, strict=True)}

    notes = [f"{len(files)} files of a folder hold one signal each."]
    return Source(
        path.name, list(where), fetch, units={n: u for n, u in units.items() if u}, notes=notes, clocked=timed == {True}
    )


def _time_of(source: Source) -> str | None:
    """The time column: by its name, or the first of two unnamed columns."""
    if source.header:
        return guess(source, "time")
    return source.names[0] if len(source.names) == 2 else None
