"""Compressed logs: gzip, bzip2, xz by their first bytes, and a ZIP archive with one log in it."""

from __future__ import annotations

import bz2
import gzip
import lzma
import zipfile
import zlib
from pathlib import Path
from typing import IO, Any, cast

from whsklearn.logs.errors import LogError, damaged

DAMAGE = (EOFError, gzip.BadGzipFile, lzma.LZMAError, zlib.error, zipfile.BadZipFile)
_OPENERS: dict[bytes, Any] = {b"\x1f\x8b": gzip.open, b"BZh": bz2.open, b"\xfd7zXZ": lzma.open}
ZIP = b"PK\x03\x04"


def opened(path: Path) -> IO[bytes]:
    """The decompressed bytes of a log."""
    with path.open("rb") as file:
        head = file.read(8)
    for magic, opener in _OPENERS.items():
        if head.startswith(magic):
            return cast("IO[bytes]", opener(path, "rb"))
    if head.startswith(ZIP):
        return zipfile.ZipFile(path).open(member(path))
    return path.open("rb")


def is_packed(head: bytes) -> bool:
    """Whether a file is compressed, by its first bytes."""
    return head.startswith((*_OPENERS, ZIP))


def members(path: Path) -> list[str]:
    """The files in a ZIP archive, without the metadata of file managers.

    Raises LogError if the archive is damaged.
    """
    with damaged(path, "ZIP archive", *DAMAGE), zipfile.ZipFile(path) as archive:
        names = [i.filename for i in archive.infolist() if not i.is_dir()]
    return [n for n in names if not n.startswith("__MACOSX/") and not Path(n).name.startswith(".")]


def member(path: Path) -> str:
    """The one log in a ZIP archive.

    Raises LogError if there is none, or more than one file.
    """
    names = members(path)
    if "[Content_Types].xml" in names:
        raise LogError(f"{path.name} is a spreadsheet; save its sheet as CSV.")
    if len(names) != 1:
        there = ", ".join(names[:8]) or "nothing"
        raise LogError(
            f"{path.name} holds {len(names)} files ({there}); extract the log that you want and give its path."
        )
    return names[0]
