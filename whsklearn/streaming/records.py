"""Where a stream's records go: a file that a resumed stream cuts back to its checkpoint, or stdout."""

from __future__ import annotations

import json
import math
import os
import sys
from pathlib import Path
from typing import Any, BinaryIO

from whsklearn.streaming.monitor import Record

KINDS = ("estimate", "prediction", "alarm", "change", "moved", "bad_row")
BUFFERED = 1 << 16  # bytes


class OutputLost(OSError):
    """Raised if the records cannot be written; the message names the file."""


class Out:
    """Records as lines of JSON.

    Parameters
    ----------
    path : path, optional
        The file; stdout by default.
    offset : int, optional
        Number of bytes at the time of the checkpoint; later bytes are cut off.  None appends to the file.
    fresh : bool
        Whether to start over with an empty file.

    Raises
    ------
    ValueError
        If the file holds something other than records of a stream, or is shorter than at the time of the checkpoint.
    """

    def __init__(self, path: Path | None, offset: int | None, fresh: bool = False):
        self.path = path
        self._lines: list[bytes] = []
        self._size = 0
        if path is not None and path.exists() and not is_ours(path):
            raise ValueError(f"{path} holds no records of a stream; give another --out, or remove it yourself.")
        self.file: BinaryIO = sys.stdout.buffer if path is None else open(path, "ab", buffering=0)
        self.written = 0
        if path is not None:
            size = os.fstat(self.file.fileno()).st_size
            self.written = 0 if fresh else size if offset is None else offset
            if size < self.written:
                self.file.close()
                raise ValueError(f"{path} is shorter than when the checkpoint was written; give another --out.")
            self.file.truncate(self.written)

    def __call__(self, record: Record) -> None:
        """Write one record; values that are not finite become null."""
        line = json.dumps(_finite(record)).encode() + b"\n"
        self._lines.append(line)
        self._size += len(line)
        if self._size > BUFFERED:
            self._write()

    def settle(self) -> int:
        """Flush the buffer, to the disk if it is a file; return the number of bytes written."""
        self._write()
        if self.path is None:
            self.file.flush()
            return 0
        os.fsync(self.file.fileno())
        return self.written

    def close(self) -> None:
        """Close the file, but not stdout."""
        if self.path is not None:
            self.file.close()

    def _write(self) -> None:
        """Pass the lines to the system; a full disk may take some of them, and a restart cuts those off."""
        block = b"".join(self._lines)
        self._lines, self._size = [], 0
        try:
            at = 0
            while at < len(block):
                at += self.file.write(block[at:]) or 0
        except OSError as error:
            said = f"{self.path or 'stdout'} cannot be written ({error.strerror})"
            raise OutputLost(f"{said}; free some space and start again, nothing is lost.") from None
        self.written += len(block)


def is_ours(path: Path) -> bool:
    """Whether a file is empty or begins with a record of a stream."""
    try:
        with open(path, "rb") as file:
            first = file.readline(1 << 20)
        return not first or json.loads(first).get("kind") in KINDS
    except (ValueError, AttributeError, RecursionError):
        return False


def _finite(value: Any) -> Any:
    """The record with null for values that are not finite, as JSON requires."""
    if isinstance(value, dict):
        return {k: _finite(v) for k, v in value.items()}
    return None if isinstance(value, float) and not math.isfinite(value) else value
