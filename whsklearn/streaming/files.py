"""The files of a stream: its source, its records and its checkpoint, all distinct, and the locks on them."""

from __future__ import annotations

import contextlib
import hashlib
import os
from collections.abc import Iterator
from pathlib import Path

from filelock import FileLock, Timeout

from whsklearn.logs.files import check_writable
from whsklearn.state import read_kind

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
            if name < other and _same(path, second):
                raise ValueError(f"{name} and {other} are the same file, {path}; give each a file of its own.")
    for path in files.values():
        if path in (out, kept) and not _is_device(path):
            check_writable(path)
    if kept.exists() and fresh:
        try:
            read_kind(kept)
        except ValueError as error:
            raise ValueError(f"{error} --fresh replaces checkpoints only; give another --checkpoint.") from None


@contextlib.contextmanager
def alone(*paths: Path | None) -> Iterator[None]:
    """Hold locks on files for as long as the stream runs; the system releases them if the process is killed.

    Raises ValueError if another stream holds a lock on one of them.
    """
    with contextlib.ExitStack() as stack:
        for path in paths:
            if path is None or _is_device(path):
                continue
            real = Path(os.path.realpath(path))
            try:
                stack.enter_context(FileLock(real.with_name(f".{real.name[:200]}.lock"), timeout=0))
            except Timeout:
                raise ValueError(f"{path} is in use by another stream; stop that one, or give another file.") from None
        yield


def fingerprint(source: str, offset: int) -> str:
    """Identify what was read of a file by its first bytes and the last ones before ``offset``; empty for a pipe."""
    if source == "-" or not offset:
        return ""
    with open(source, "rb") as file:
        head = file.read(min(PRINTED, offset))
        file.seek(max(0, offset - PRINTED))
        return hashlib.sha256(head + file.read(min(PRINTED, offset))).hexdigest()


def _same(a: Path, b: Path) -> bool:
    """Whether two names refer to the same file, whether or not it exists."""
    return (a.exists() and b.exists() and a.samefile(b)) or os.path.realpath(a) == os.path.realpath(b)


def _is_device(path: Path) -> bool:
    """Whether a path is something like /dev/null."""
    return path.exists() and not path.is_file() and not path.is_dir()
