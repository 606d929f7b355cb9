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
_TABLES = {".csv", ".tsv"}  # a text of another ending beside one of these describes it
# place and bytes of a signature, what the file is, and what to do with it
_FOREIGN: tuple[tuple[int, bytes | tuple[bytes, ...], str], ...] = (
    (0, b"\x28\xb5\x2f\xfd", "packed by zstd; unpack it first"),
    (0, b"\x04\x22\x4d\x18", "packed by lz4; unpack it first"),
    (0, b"7z\xbc\xaf\x27\x1c", "a 7z archive; extract the log from it"),
    (0, b"Rar!\x1a\x07", "a RAR archive; extract the log from it"),
    (0, (b"\x89PNG", b"\xff\xd8\xff", b"%PDF"), "a picture or a page; export the values as CSV"),
    (257, b"ustar", "a tar archive; extract the log from it"),
    (0, b"SQLite format 3\0", "an SQLite database; export the table of the log as CSV"),
    (0, (b"\x80\x04\x95", b"\x80\x05\x95"), "a Python pickle, which could run code; save the log as CSV or Parquet"),
)


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


def foreign(head: bytes) -> str:
    r"""What a file is that no reader takes, and the remedy; empty if it is none of these.

    ``head``: its first 512 bytes.

    >>> foreign(b"7z\xbc\xaf\x27\x1c"), foreign(b"time_s,torque_nm")
    ('a 7z archive; extract the log from it', '')
    """
    return next((what for place, magic, what in _FOREIGN if head.startswith(magic, place)), "")


def members(path: Path) -> list[str]:
    """The files in a ZIP archive, without the metadata of file managers.

    Raises LogError if the archive is damaged or locked.
    """
    with damaged(path, "ZIP archive", *DAMAGE), zipfile.ZipFile(path) as archive:
        inside = [i for i in archive.infolist() if not i.is_dir()]
    if any(i.flag_bits & 1 for i in inside):
        raise LogError(f"{path.name} is locked with a password; unpack it first.")
    names = [i.filename for i in inside]
    return [n for n in names if not n.startswith("__MACOSX/") and not Path(n).name.startswith(".")]


def member(path: Path) -> str:
    """The one log in a ZIP archive: its only file, or its only CSV.

    Raises LogError if there is none, or more than one.
    """
    names = members(path)
    if "[Content_Types].xml" in names:
        raise LogError(f"{path.name} is a spreadsheet; save its sheet as CSV.")
    tables = [n for n in names if Path(n).suffix.lower() in _TABLES]
    if len(tables) == 1:
        return tables[0]
    if len(names) != 1:
        there = ", ".join(names[:8]) or "nothing"
        raise LogError(
            f"{path.name} holds {len(names)} files ({there}); extract the log that you want and give its path."
        )
    return names[0]
