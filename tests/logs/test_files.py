"""Files are replaced whole, whoever writes at once and whatever fails."""

from __future__ import annotations

import os
import stat
import threading
from concurrent.futures import ThreadPoolExecutor

import pytest

from whsklearn.logs.files import atomic_write, check_writable, utf8


def test_threads_that_save_to_one_path_leave_a_whole_file_and_nothing_else(tmp_path):
    path, errors = tmp_path / "axis.whs", []

    def save(value):
        try:
            for _ in range(20):
                atomic_write(path, 3000 * bytes([value]))
        except Exception as error:
            errors.append(error)

    threads = [threading.Thread(target=save, args=(i,)) for i in range(6)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert errors == []
    assert len(set(path.read_bytes())) == 1
    assert path.stat().st_size == 3000
    assert os.listdir(tmp_path) == ["axis.whs"]


def test_mode_and_link_of_a_file_that_is_replaced_stay(tmp_path):
    path, link = tmp_path / "axis.whs", tmp_path / "link.whs"
    atomic_write(path, b"1")
    path.chmod(0o640)
    link.symlink_to(path)
    atomic_write(link, b"2")
    assert link.is_symlink()
    assert path.read_bytes() == b"2"
    assert stat.S_IMODE(path.stat().st_mode) == 0o640


def test_a_long_name_and_a_failing_disk(tmp_path, monkeypatch):
    path = tmp_path / ("n" * 250)
    atomic_write(path, b"old")

    def full(descriptor):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OSError, match=r"No space left on device: .*nnn"):
        atomic_write(path, b"new")
    assert path.read_bytes() == b"old"
    assert len(os.listdir(tmp_path)) == 1


def test_what_cannot_be_written_is_told_before(tmp_path):
    check_writable(tmp_path / "new")
    assert os.listdir(tmp_path) == []
    with pytest.raises(ValueError, match="is a folder"):
        check_writable(tmp_path)
    with pytest.raises(ValueError, match="does not exist"):
        check_writable(tmp_path / "none" / "file")


def test_a_name_in_bytes_is_read_as_utf8():
    assert utf8(os.fsdecode("a\u00e9.csv".encode())) == "a\u00e9.csv"
    assert utf8("a\udcc3\udca9") == "a\u00e9"


def test_a_device_is_written_to_and_not_replaced(tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    check_writable(pipe)
    with ThreadPoolExecutor(1) as pool:
        read = pool.submit(pipe.read_bytes)
        atomic_write(pipe, b"through")
        assert read.result() == b"through"
    assert pipe.is_fifo()
    assert [p.name for p in tmp_path.iterdir()] == ["pipe"]
