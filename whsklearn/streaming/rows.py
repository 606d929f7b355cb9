"""Where a stream's rows come from: a CSV file, the same file as it grows, or JSON lines on stdin.

Sources return whole lines with their numbers and remember the byte that follows the last
one, so that a stream can continue there.  Parsers convert a line to floats, or say in a few
words why it is not a row.
"""

from __future__ import annotations

import json
import os
import select
import time
from collections.abc import Sequence
from datetime import UTC, datetime
from math import isfinite
from pathlib import Path
from typing import BinaryIO

from whsklearn.logs.cells import is_word
from whsklearn.logs.errors import ColumnError, LogError
from whsklearn.logs.packed import is_packed
from whsklearn.logs.text import legacy_encoding
from whsklearn.logs.timebase import ZONE
from whsklearn.logs.units import seconds_of, unit_of

BLOCK = 1 << 16
AT_ONCE = 64  # lines returned at once: signals and checkpoints are handled between them, however slow the model is
LONGEST = 1 << 20  # bytes of one line; a longer one is not a row
TOO_LONG = b"\0"
POLL_SECONDS = 0.2


class BadRow(ValueError):
    """A line that is not a row; the message says why."""


class OtherHeader(BadRow):
    """A header amid the rows that names a column differently, as after a change of units."""


class LineSource:
    """Whole lines from a file descriptor, whose next line begins behind ``offset`` bytes and ``number`` lines.

    With ``follow`` it waits for more data at the end of the file, and ``restarted`` is set when the file was replaced;
    the caller resets it. With ``open_end`` it accepts a last line without a newline, which is otherwise ``left``: half
    a number is still a number, so a CSV file must not, but half a JSON object is not a JSON object.
    """

    def __init__(
        self, file: BinaryIO, *, offset: int = 0, number: int = 0, follow: bool = False, open_end: bool = False
    ):
        self.file, self.follow = file, follow
        self.offset, self.number = offset, number
        self.restarted = False
        self._rest, self._dropped = b"", 0  # the incomplete line, and how many of its bytes were dropped
        self._ready: list[bytes] = []
        self._ended = self._open_end = False
        self._takes_open_end, self.left = open_end, b""
        if offset:
            file.seek(offset)

    def hand_back(self, lines: list[bytes]) -> None:
        """Take back the last lines returned, so that reading continues with them."""
        unended = bool(lines) and self._ended and self._open_end
        self.offset -= sum(map(len, lines)) + len(lines) - unended
        self.number -= len(lines)

    def close(self) -> None:
        """Close the file."""
        self.file.close()

    def read(self) -> list[bytes] | None:
        """The next lines, at most `AT_ONCE`; [] if none arrived for a moment, None at the end."""
        if self._ended:
            return None
        if self._ready:
            return self._next()
        block = self._block()
        if block is None:
            return []
        if not block:
            if self.follow:
                time.sleep(POLL_SECONDS)
                return []
            self._ended, self._open_end = True, bool(self._rest)
            if not self._takes_open_end:
                self.left, self._rest = self._rest, b""
            self._ready, self._rest = ([self._rest] if self._rest else []), b""
            self._count_dropped()
            return self._next(unended=len(self._ready))
        *self._ready, rest = (self._rest + block).split(b"\n")
        self._count_dropped()
        if len(rest) > LONGEST:  # replace it by a mark that no parser accepts
            self._dropped += len(rest) - len(TOO_LONG)
            rest = TOO_LONG
        self._rest = rest
        return self._next()

    def _count_dropped(self) -> None:
        """A line that was too long is now complete and is the first to be returned."""
        if self._ready:
            self.offset, self._dropped = self.offset + self._dropped, 0

    def _next(self, unended: int = 0) -> list[bytes]:
        """Waiting lines, counted as returned."""
        lines, self._ready = self._ready[:AT_ONCE], self._ready[AT_ONCE:]
        self.offset += sum(map(len, lines)) + len(lines) - unended
        self.number += len(lines)
        return lines

    def _block(self) -> bytes | None:
        """Some bytes; b"" at the end, None if nothing arrived in time."""
        return self.file.read(BLOCK)


class FollowedFile(LineSource):
    """A file that grows; if it is replaced or truncated, it is read from its new beginning."""

    def __init__(self, path: Path, *, offset: int = 0, number: int = 0):
        self.path = path
        super().__init__(open(path, "rb"), offset=offset, number=number, follow=True)

    def _block(self) -> bytes | None:
        """The bytes that were appended, or the beginning of the new file if there is one."""
        block = self.file.read(BLOCK)
        if block:
            return block
        try:
            now = os.stat(self.path)
        except FileNotFoundError:
            return b""  # between being moved away and created again
        old = os.fstat(self.file.fileno())
        if (now.st_ino, now.st_dev) != (old.st_ino, old.st_dev) or now.st_size < self.file.tell():
            self.file.close()
            self.file = open(self.path, "rb")
            self._rest, self.offset, self.number, self.restarted = b"", 0, 0, True
        return b""


class PipedLines(LineSource):
    """Lines from a pipe or a terminal; a read waits only for a moment."""

    def _block(self) -> bytes | None:
        """The bytes that are available now."""
        ready, _, _ = select.select([self.file], [], [], POLL_SECONDS)
        return os.read(self.file.fileno(), BLOCK) if ready else None


class CsvParser:
    """Numbers from the named ``columns`` of a CSV line, whose names are in ``header``, the first line of the file.

    With ``timed`` the first of them is a time, which may be dates in ISO 8601: they become the unit that the column's
    name states, or seconds, since 1970.

    Raises LogError if the file is not text in UTF-8 or a code page, ColumnError if a column is missing or its name
    occurs more than once.
    """

    def __init__(self, header: bytes, columns: Sequence[str], timed: bool = False):
        if b"\0" in header or is_packed(header):
            raise LogError(
                f"The first line, {_short(header)!r}, is not text in UTF-8, which a stream reads as it is written; "
                "export the log as CSV in UTF-8. identify and gap read other encodings and formats."
            )
        text = text_of(header).lstrip("\ufeff").strip("\r\n")
        if text.startswith("{"):
            raise LogError("The file holds JSON lines, which a stream reads from stdin: whsklearn stream - < FILE.")
        self.delimiter = max(",;\t", key=text.count)
        if text.count('"') % 2:
            raise LogError(
                f"The first line, {text[:80]!r}, ends within a quoted name, and a stream reads names from one line; "
                "put them on one line. identify and gap read such a header."
            )
        names = [name.strip().strip('"') for name in text.split(self.delimiter)]
        for name in columns:
            if names.count(name) != 1:
                what = "several columns" if name in names else "no column"
                raise ColumnError(f"The header has {what} {name!r}; it has: {', '.join(names)[:300]}.")
        self.n_fields, self._names = len(names), names
        self._at = [(names.index(name), name) for name in columns]
        self._split = self.delimiter.encode()
        self._comma = self.delimiter != ","  # a comma inside a field is a decimal sign
        self._clock = columns[0] if timed else None
        self._second = 1.0 / seconds_of(unit_of(columns[0], "s")) if timed else 1.0

    def __call__(self, line: bytes) -> list[float] | None:
        """The values of one line; None for the header again if stamps tell what is missing; BadRow if it has none."""
        fields = line.split(self._split)
        if len(fields) != self.n_fields:
            raise BadRow(f"{len(fields)} fields, expected {self.n_fields}")
        row = []
        for i, name in self._at:
            field = fields[i]
            try:
                value = float(field)
            except ValueError:
                date = _date(field) if name == self._clock else None
                if date is None and self._is_the_header(fields) and self._clock:
                    return None
                value = _number(field, name, self._comma) if date is None else date * self._second
            if not isfinite(value) or b"_" in field:  # Python reads 1_000 as a number, but no logger writes it
                raise BadRow(f"{name} is {_short(field.strip())!r}, not a finite number")
            row.append(value)
        return row

    def _is_the_header(self, fields: list[bytes]) -> bool:
        """Whether a line repeats the header; OtherHeader if one names a wanted column by another word."""
        said = [text_of(field).strip().strip('"') for field in fields]
        other = [(name, said[i]) for i, name in self._at if said[i] != name and is_word(said[i])]
        if other and sorted(said) == sorted(self._names):
            raise OtherHeader(
                f"a header with the columns in another order, {', '.join(said)[:80]}, in which the rows below are; "
                "split the file there"
            )
        if other and any(a == b and is_word(a) for a, b in zip(said, self._names, strict=True)):
            raise OtherHeader(
                f"a header in which {other[0][0]!r} is called {other[0][1]!r}, so the rows below may have other units; "
                "split the file there"
            )
        return said == self._names


class JsonParser:
    """Numbers from the named members of a JSON object, one object per line."""

    def __init__(self, columns: Sequence[str]):
        self._names = list(columns)

    def __call__(self, line: bytes) -> list[float]:
        """The values of one line; BadRow if it has none."""
        try:
            record = json.loads(line)
        except (ValueError, RecursionError):
            raise BadRow(f"not JSON, which stdin takes (give a CSV file by its name): {_short(line)}") from None
        if not isinstance(record, dict):
            raise BadRow(f"a JSON {type(record).__name__}, expected an object")
        row = []
        for name in self._names:
            value = record.get(name)
            if isinstance(value, bool) or not isinstance(value, int | float):
                raise BadRow(f"{name} is {_short(json.dumps(value).encode())}, expected a number")
            try:
                row.append(float(value))
            except OverflowError:
                raise BadRow(f"{name} is too large") from None
            if not isfinite(row[-1]):
                raise BadRow(f"{name} is {value}")
        return row


def text_of(header: bytes) -> str:
    """The text of a header, whatever its encoding."""
    try:
        return header.decode()
    except UnicodeDecodeError:
        return header.decode(legacy_encoding(header), errors="replace")


def _number(field: bytes, name: str, comma: bool) -> float:
    """A float from a field that may be quoted, or have a decimal comma."""
    text = field.strip().strip(b'"')
    if comma and text.count(b",") == 1:
        text = text.replace(b",", b".")
    try:
        return float(text)
    except ValueError:
        raise BadRow(f"{name} is {_short(text)!r}, not a number") from None


def _date(field: bytes) -> float | None:
    """Seconds since 1970 of a date in ISO 8601, UTC if it has no zone; None if it is none.

    A zone by its letters, such as CEST, is passed over, as `whsklearn.logs` does: only differences count.
    """
    try:
        date = datetime.fromisoformat(ZONE.sub("", field.strip().strip(b'"').decode()))
    except ValueError:
        return None
    return (date if date.tzinfo else date.replace(tzinfo=UTC)).timestamp()


def _short(text: bytes) -> str:
    """The beginning of a text, for a message."""
    shown = text[:40].decode("utf-8", errors="replace")
    return shown if len(text) <= 40 else shown + "..."
