"""Packed logs are what was packed, by their first bytes and not by their names."""

from __future__ import annotations

import bz2
import gzip
import io
import lzma
import pickle
import sqlite3
import tarfile
import zipfile

import pytest

from whsklearn.logs import LogError, open_source
from whsklearn.logs.packed import is_packed, member, members, opened

TEXT = b"time_s,torque_nm\n0,1\n"


@pytest.mark.parametrize("pack", [gzip.compress, bz2.compress, lzma.compress, bytes])
def test_bytes_come_back_whatever_the_name_says(tmp_path, pack):
    path = tmp_path / "log.txt"
    path.write_bytes(pack(TEXT))
    with opened(path) as file:
        assert file.read() == TEXT
    assert is_packed(path.read_bytes()) == (pack is not bytes)


def archive(path, *names):
    with zipfile.ZipFile(path, "w") as out:
        for name in names:
            out.writestr(name, TEXT)
    return path


def test_the_one_log_of_an_archive_is_found_beside_what_file_managers_leave(tmp_path):
    path = archive(tmp_path / "a.zip", "run/axis.csv", "__MACOSX/run/axis.csv", "run/.DS_Store")
    assert members(path) == ["run/axis.csv"]
    with opened(path) as file:
        assert file.read() == TEXT


def test_an_archive_without_the_one_log_is_refused(tmp_path):
    with pytest.raises(LogError, match=r"holds 2 files \(a, b\)"):
        member(archive(tmp_path / "two.zip", "a", "b"))
    with pytest.raises(LogError, match=r"holds 0 files \(nothing\)"):
        member(archive(tmp_path / "none.zip"))
    with pytest.raises(LogError, match="is a spreadsheet"):
        member(archive(tmp_path / "sheet.xlsx", "[Content_Types].xml", "xl/sheet1.xml"))
    (tmp_path / "torn.zip").write_bytes(b"PK\x03\x04" + bytes(50))
    with pytest.raises(LogError, match="not a complete ZIP archive"):
        members(tmp_path / "torn.zip")


def test_the_only_csv_of_an_archive_is_the_log_whatever_text_describes_it(tmp_path):
    with opened(archive(tmp_path / "a.zip", "run/readme.txt", "run/axis.csv", "photo.jpg")) as file:
        assert file.read() == TEXT
    with pytest.raises(LogError, match="holds 3 files"):
        member(archive(tmp_path / "b.zip", "readme.txt", "axis.csv", "other.csv"))


def packed_by_tar(mode):
    out = io.BytesIO()
    with tarfile.open(fileobj=out, mode=mode) as tar:
        entry = tarfile.TarInfo("axis.csv")
        entry.size = len(TEXT)
        tar.addfile(entry, io.BytesIO(TEXT))
    return out.getvalue()


def database(tmp_path):
    with sqlite3.connect(tmp_path / "made.db") as made:
        made.execute("create table log (time_s real)")
    made.close()
    return (tmp_path / "made.db").read_bytes()


@pytest.mark.parametrize(
    ("data", "what"),
    [
        (lambda _: packed_by_tar("w"), "log is a tar archive; extract"),
        (lambda _: packed_by_tar("w:gz"), "log is packed, and its content is a tar archive; extract"),
        (lambda _: pickle.dumps(TEXT), "log is a Python pickle, .* save the log as CSV"),
        (lambda _: pickle.dumps(TEXT, protocol=5), "log is a Python pickle"),
        (database, "log is an SQLite database; export"),
        (lambda _: b"\x28\xb5\x2f\xfd" + bytes(30), "log is packed by zstd; unpack"),
    ],
)
def test_a_file_of_a_known_kind_that_is_no_log_is_called_by_its_name(tmp_path, data, what):
    (tmp_path / "log").write_bytes(data(tmp_path))
    with pytest.raises(LogError, match=what):
        open_source(tmp_path / "log")


def test_an_archive_with_a_password_is_told(tmp_path):
    path = archive(tmp_path / "a.zip", "axis.csv")
    data = bytearray(path.read_bytes())
    for mark, flags in ((b"PK\x03\x04", 6), (b"PK\x01\x02", 8)):
        data[data.index(mark) + flags] |= 1
    path.write_bytes(data)
    with pytest.raises(LogError, match="locked with a password; unpack it first"):
        open_source(path)
