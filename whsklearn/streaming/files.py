"""The files of a stream: its source, its records and its checkpoint, all distinct, and the locks on them."""

from __future__ import annotations

import contextlib
import hashlib
import json
import math
import os
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO

from filelock import FileLock, Timeout

from whsklearn.logs.errors import ColumnError
from whsklearn.logs.files import check_writable, is_device, is_same
from whsklearn.state import is_state
from whsklearn.streaming.monitor import Record

PRINTED = 1 << 16  # bytes at the beginning and before the current position that identify a source


def check_files(source: str, out: Path | None, kept: Path, fresh: bool) -> None:
    """Reject a set of files that would destroy one of the user's files, or fail later.

    Raises ValueError if two of the files are the same, if the checkpoint would replace a file that is not a checkpoint,
    or if a file cannot be written.
    """
    named = {"the source": Path(source) if source != "-" else None, "--out": out, "--checkpoint": kept}
    files = {name: path for name, path in named.items() if path is not None}
    for name, path in files.items():
        for other, second in files.items():
            if name < other and is_same(path, second):
                raise ColumnError(f"{name} and {other} are the same file, {path}; give each a file of its own.")
    for path in files.values():
        if path in (out, kept) and not is_device(path):
            check_writable(path)
    if fresh and kept.exists() and not is_state(kept):
        raise ValueError(f"{kept} is no checkpoint, and --fresh replaces checkpoints only; give another --checkpoint.")


@contextlib.contextmanager
def alone(*paths: Path | None) -> Iterator[None]:
    """Hold locks on files for as long as the stream runs; the system releases them if the process is killed.

    Raises ValueError if another stream holds a lock on one of them.
    """
    with contextlib.ExitStack() as stack:
        for path in paths:
            if path is None or is_device(path):
                continue
            real = Path(os.path.realpath(path))
            try:
                stack.enter_context(FileLock(real.with_name(f".{real.name[:200]}.lock"), timeout=0))
            except Timeout:
                raise ValueError(f"{path} is in use by another stream; stop that one, or give another file.") from None
        yield


def fingerprint(file: BinaryIO, offset: int) -> str:
    """Identify what was read of a file by its first bytes and the last ones before ``offset``; empty for a pipe.

    It is the open file that counts: its name may be gone, or be that of the next one.
    """
    if not offset or not file.seekable():
        return ""
    at = file.tell()
    file.seek(0)
    head = file.read(min(PRINTED, offset))
    file.seek(max(0, offset - PRINTED))
    tail = file.read(min(PRINTED, offset))
    file.seek(at)
    return hashlib.sha256(head + tail).hexdigest()


# --- where a stream's records go: a file that a resumed stream cuts back to its checkpoint, or stdout ----------------
KINDS = ("estimate", "prediction", "alarm", "change", "moved", "bad_row")
BUFFERED = 1 << 16  # bytes


class OutputLost(OSError):
    """Raised if the records cannot be written; the message names the file."""


class Out:
    """Records as lines of JSON, to a file or to stdout.

    ``offset``: number of bytes at the time of the checkpoint; later bytes are cut off. None appends to the file.
    ``fresh``: whether to start over with an empty file.
    Raises ValueError if the file holds something other than records of a stream, or is shorter than at the checkpoint.
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
            gone = isinstance(error, BrokenPipeError)
            remedy = "the program that reads the records has ended; start both" if gone else "free some space and start"
            raise OutputLost(f"{said}; {remedy} again, nothing is lost.") from None
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
