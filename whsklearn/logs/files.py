"""Files: their names as UTF-8, and their bytes replaced whole.

A file is replaced in one step (written beside, flushed to the disk, renamed): whoever is killed, and when, there is the
old file or the new one.
"""

from __future__ import annotations

import contextlib
import glob
import os
import stat
import threading
import time
from pathlib import Path

_STALE_SECONDS = 600.0


def utf8(text: str) -> str:
    """A file name decoded as UTF-8 where the locale could not decode it (PEP 383)."""
    return text.encode("utf-8", "surrogateescape").decode("utf-8", "replace")


def atomic_write(path: str | os.PathLike[str], data: bytes) -> None:
    """Put ``data`` at ``path`` so that a crash at any instant leaves the old file or the new one.

    The bytes go to a hidden file in the same folder, are forced to the disk, and take the
    name in one `os.replace`; then the folder is forced to the disk too.  A file that is replaced
    keeps its mode, a symbolic link goes on pointing to the file that is replaced, and of several threads or
    processes that write at once the last one stands.  A device or a pipe is written to as it is.

    Parameters
    ----------
    path : str or path
    data : bytes

    Raises
    ------
    OSError
        If the folder or the disk does not take it; it names ``path``, which is as it was.

    Examples
    --------
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
    if _is_device(path):
        with open(path, "wb") as file:
            file.write(data)
        return
    # every writer has a file of its own; a long name is cut, as names have at most 255 bytes
    aside = target.with_name(f".{target.name[:150]}.{os.getpid()}.{threading.get_ident()}.tmp")
    try:
        with open(aside, "wb") as file:
            if hasattr(os, "fchmod") and target.exists():
                os.fchmod(file.fileno(), stat.S_IMODE(target.stat().st_mode))
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        os.replace(aside, target)
    except OSError as error:
        _remove(aside)
        raise type(error)(error.errno, error.strerror or str(error), os.fspath(path)) from None
    except BaseException:
        _remove(aside)
        raise
    _sync_folder(target.parent)
    _sweep(target)


def check_writable(path: str | os.PathLike[str]) -> None:
    """Raise now if `atomic_write` could not put a file at ``path`` later, before hours of work are spent on it.

    Parameters
    ----------
    path : str or path
        Of a file that there need not be.

    Raises
    ------
    ValueError
        If ``path`` is a folder, its folder is missing, or nothing can be written there.

    Examples
    --------
    >>> import tempfile
    >>> from whsklearn.logs.files import check_writable
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     check_writable(f"{folder}/axis.whs")  # says nothing: it can be written
    """
    target = Path(os.path.realpath(path))
    if target.is_dir():
        raise ValueError(f"{path} is a folder, expected the name of a file; add one.")
    if _is_device(path):
        return
    if not target.parent.is_dir():
        raise ValueError(f"The folder of {path} does not exist; make it, or write somewhere else.")
    aside = target.with_name(f".{target.name[:150]}.{os.getpid()}.{threading.get_ident()}.tmp")
    try:
        with open(aside, "wb") as file:
            file.write(b"\0")
    except OSError as error:
        raise ValueError(f"{path} cannot be written ({error.strerror}); write somewhere else.") from None
    finally:
        _remove(aside)


def _is_device(path: str | os.PathLike[str]) -> bool:
    """Whether it is there and neither file nor folder: ``/dev/null``, a pipe."""
    return os.path.exists(path) and not os.path.isfile(path) and not os.path.isdir(path)


def _remove(file: Path) -> None:
    """Remove a file that may be gone, in a folder that may be."""
    with contextlib.suppress(OSError):
        file.unlink()


def _sync_folder(folder: Path) -> None:
    """Make the rename itself durable, where the system can."""
    with contextlib.suppress(OSError):  # Windows cannot open a folder
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


def _sweep(target: Path) -> None:
    """Remove what writers of this file that were killed left beside it, if it is old."""
    for left in target.parent.glob(f".{glob.escape(target.name[:150])}.*.tmp"):
        with contextlib.suppress(OSError):
            if time.time() - left.stat().st_mtime > _STALE_SECONDS:
                left.unlink()
