"""Logs in JSON: one object per line, a list of records, or an object of vectors; nested names are joined by points."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from whsklearn.logs.errors import LogError, damaged
from whsklearn.logs.packed import DAMAGE, opened
from whsklearn.logs.source import Source

_BEGINS = re.compile(rb'\s*(?:\{\s*["}]|\[\s*[\[{])')
FEWEST = 3  # rows, or elements of a vector


def is_json(head: bytes) -> bool:
    """Whether a text begins like JSON.

    >>> is_json(b' {"t": 0'), is_json(b"[[1, 2]"), is_json(b"[Header]")
    (True, True, False)
    """
    return _BEGINS.match(head.removeprefix(b"\xef\xbb\xbf")) is not None


def open_json(path: Path) -> Source:
    """A JSON file as a source of columns. Raises LogError if it is truncated or damaged, or contains no vectors."""
    with damaged(path, "JSON file", UnicodeDecodeError, *DAMAGE), opened(path) as file:
        text = file.read().decode("utf-8-sig")
    notes: list[str] = []
    try:
        try:
            data = json.loads(text)
        except ValueError:
            data = _lines(text, path.name, notes)
        columns = {k: np.asarray(v) for k, v in _vectors(data)}
    except RecursionError:
        raise LogError(f"{path.name} is nested too deeply; save time, drive and position as vectors.") from None
    if not columns:
        raise LogError(
            f"{path.name} has no vectors of at least {FEWEST} numbers; save time, drive and position as vectors."
        )
    return Source.of_arrays(path.name, columns, notes=notes, units=_units(data, columns))


def _units(data: Any, columns: Iterable[str]) -> dict[str, str]:
    """Units of columns from an object ``units`` beside the vectors, by the last part of their names."""
    stated = data.get("units") if isinstance(data, dict) else None
    found = {c: stated.get(c.rpartition(".")[2]) for c in columns} if isinstance(stated, dict) else {}
    return {c: unit for c, unit in found.items() if isinstance(unit, str)}


def _lines(text: str, name: str, notes: list[str]) -> list[Any]:
    """One object per line; a truncated last line is left out."""
    lines = [(i, t) for i, t in enumerate(text.splitlines(), 1) if t.strip()]
    out = []
    for i, line in lines:
        try:
            out.append(json.loads(line))
        except ValueError:
            if i < lines[-1][0] or len(lines) < FEWEST:
                raise LogError(
                    f"{name} is neither complete JSON nor JSON lines: line {i} is {line[:50]!r}; export it "
                    "again, or cut it."
                ) from None
            notes.append("The last line is incomplete and was left out.")
    return out


def _vectors(data: Any, prefix: str = "") -> Iterator[tuple[str, list[Any]]]:
    """Vectors by joined names."""
    if isinstance(data, dict) and isinstance(data.get("columns"), list) and isinstance(data.get("data"), list):
        yield from _vectors([dict(zip(map(str, data["columns"]), row, strict=False)) for row in data["data"]], prefix)
    elif isinstance(data, dict) and len(data) >= FEWEST and all(map(str.isdigit, data)):  # pandas: by number of the row
        yield from _vectors(list(data.values()), prefix)
    elif isinstance(data, dict):
        for key, value in data.items():
            yield from _vectors(value, f"{prefix}{key}.")
    elif isinstance(data, list) and len(data) >= FEWEST:
        if all(isinstance(row, dict) for row in data):
            rows = [dict(_flat(row)) for row in data]
            for name in dict.fromkeys(k for row in rows for k in row):
                yield prefix + name, _of_one_kind([row.get(name) for row in rows])
        elif all(isinstance(row, list) for row in data):
            width = min(map(len, data))
            for i in range(width):
                yield f"{prefix}{i}", _of_one_kind([row[i] for row in data])
        elif not any(isinstance(row, dict | list) for row in data):
            yield prefix.rstrip("."), _of_one_kind(data)


def _flat(row: dict[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Names and values of a record."""
    for key, value in row.items():
        if isinstance(value, dict):
            yield from _flat(value, f"{prefix}{key}.")
        elif isinstance(value, list):
            yield from _flat(dict(enumerate(value)), f"{prefix}{key}.")  # type: ignore[arg-type]
        else:
            yield f"{prefix}{key}", value


def _of_one_kind(values: list[Any]) -> list[Any]:
    """Numbers with NaN for null; otherwise text."""
    if all(v is None or isinstance(v, int | float) for v in values):
        return [np.nan if v is None else v for v in values] if None in values else values
    return ["" if v is None else str(v) for v in values]
