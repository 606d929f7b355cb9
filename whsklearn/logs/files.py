"""Files: names as UTF-8, and atomic replacement.

A file is replaced in one step (written next to it, flushed to the disk, renamed): whenever a process is killed, either
the old file or the new one is there.
"""

from __future__ import annotations

import contextlib
import glob
import os
import stat
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

_STALE_SECONDS = 600.0


def utf8(text: str) -> str:
    """A file name decoded as UTF-8 where the locale could not decode it (PEP 383)."""
    return text.encode("utf-8", "surrogateescape").decode("utf-8", "replace")


def atomic_write(path: str | os.PathLike[str], data: bytes) -> None:
    """Write ``data`` to ``path`` so that a crash at any instant leaves the old file or the new one.

    The bytes go to a hidden file in the same folder, are flushed to the disk, and take the name in one `os.replace`;
    then the folder is flushed too. A replaced file keeps its mode, a symbolic link keeps pointing to the replaced file,
    and if several threads or processes write at once, the last one wins. Devices and pipes are written to directly.

    Raises OSError if the file cannot be written; it names ``path``, which is unchanged.

    >>> import pathlib, tempfile
    >>> from whsklearn.logs.files import atomic_write
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = pathlib.Path(folder, "note.txt")
    ...     atomic_write(path, b"old")
    ...     atomic_write(path, b"new")
    ...     path.read_bytes()
    b'new'
    """
    target = Path(os.path.realpath(path))
    if is_device(path):
        with open(path, "wb") as file:
            file.write(data)
        return
    try:
        with _beside(target) as file:
            if hasattr(os, "fchmod") and target.exists():
                os.fchmod(file.fileno(), stat.S_IMODE(target.stat().st_mode))
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
            file.close()  # Windows renames no open file
            os.replace(file.name, target)
    except OSError as error:
        raise type(error)(error.errno, error.strerror or str(error), os.fspath(path)) from None
    _sync_folder(target.parent)
    _sweep(target)


def check_writable(path: str | os.PathLike[str]) -> None:
    """Raise now if `atomic_write` could not write ``path`` later, before hours of work are spent.

    ``path``: path of the file, which need not exist. Raises ValueError if ``path`` is a folder, its folder is missing,
    or nothing can be written there.

    >>> import tempfile
    >>> from whsklearn.logs.files import check_writable
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     check_writable(f"{folder}/axis.whs")  # says nothing: it can be written
    """
    target = Path(os.path.realpath(path))
    if target.is_dir():
        raise ValueError(f"{path} is a folder, expected the name of a file; add one.")
    if is_device(path):
        return
    if not target.parent.is_dir():
        raise ValueError(f"The folder of {path} does not exist; create it, or write somewhere else.")
    try:
        with _beside(target) as file:
            file.write(b"\0")
    except OSError as error:
        raise ValueError(f"{path} cannot be written ({error.strerror}); write somewhere else.") from None


def is_device(path: str | os.PathLike[str]) -> bool:
    """Whether it exists and is neither file nor folder: ``/dev/null``, a pipe."""
    return os.path.exists(path) and not os.path.isfile(path) and not os.path.isdir(path)


@contextlib.contextmanager
def _beside(target: Path) -> Iterator[BinaryIO]:
    """A hidden file in the same folder, open for writing, which is removed at the end unless it was renamed."""
    # every writer has its own file; a long name is cut because names have at most 255 bytes
    aside = target.with_name(f".{target.name[:150]}.{os.getpid()}.{threading.get_ident()}.tmp")
    try:
        with open(aside, "wb") as file:
            yield file
    finally:
        with contextlib.suppress(OSError):
            aside.unlink()


def _sync_folder(folder: Path) -> None:
    """Make the rename durable if the system supports it."""
    with contextlib.suppress(OSError):  # Windows cannot open a folder
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


def _sweep(target: Path) -> None:
    """Remove old temporary files that killed writers of this file left behind."""
    for left in target.parent.glob(f".{glob.escape(target.name[:150])}.*.tmp"):
        with contextlib.suppress(OSError):
            if time.time() - left.stat().st_mtime > _STALE_SECONDS:
                left.unlink()


def is_same(a: Path, b: Path) -> bool:
    """Whether two names refer to the same file, whether or not it exists.

    >>> is_same(Path("a.csv"), Path("folder/../a.csv")), is_same(Path("a.csv"), Path("b.csv"))
    (True, False)
    """
    return (a.exists() and b.exists() and a.samefile(b)) or os.path.realpath(a) == os.path.realpath(b)
