"""Packed logs are what was packed, by their first bytes and not by their names."""

from __future__ import annotations

import bz2
import gzip
import lzma
import zipfile

import pytest

from whsklearn.logs import LogError
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
