"""Source, records and checkpoint of a stream are three files, and nobody else's."""

from __future__ import annotations

import os

import pytest
from filelock import FileLock

from tests.streaming.short_stream import carried, rows, run, write
from whsklearn.streaming.files import Out, OutputLost


@pytest.mark.parametrize("option", ["--out", "--checkpoint"])
@pytest.mark.parametrize("link", [False, True])
def test_the_source_is_never_written_to(tmp_path, option, link):
    log = write(tmp_path / "log.csv", rows(50))
    other = tmp_path / "link" if link else log
    if link:
        other.symlink_to(log)
    before = log.read_bytes()
    done = run(log, option, other, "--fresh")
    assert done.exit_code == 2
    assert "are the same file" in done.stderr
    assert log.read_bytes() == before


def test_records_and_checkpoint_are_two_files(tmp_path):
    log = write(tmp_path / "log.csv", rows(50))
    assert "are the same file" in run(log, "--out", tmp_path / "a", "--checkpoint", tmp_path / "a").stderr
    assert not (tmp_path / "a").exists()


@pytest.mark.parametrize("fresh", [["--fresh"], []])
@pytest.mark.parametrize("option", ["--out", "--checkpoint"])
def test_a_file_that_is_not_ours_stays(tmp_path, option, fresh):
    log, diary = write(tmp_path / "log.csv", rows(50)), tmp_path / "diary.txt"
    diary.write_text("years of work\n")
    done = run(log, option, diary, *fresh)
    assert done.exit_code == 1
    assert "diary.txt" in done.stderr
    assert diary.read_text() == "years of work\n"


def test_a_checkpoint_that_is_cut_off_is_told_and_may_be_replaced(tmp_path):
    log, kept = write(tmp_path / "log.csv", rows(50)), tmp_path / "log.csv.whs"
    assert run(log).exit_code == 0
    kept.write_bytes(kept.read_bytes()[:-100])
    done = run(log)
    assert done.exit_code == 1
    assert "cut off" in done.stderr
    assert "--fresh" in done.stderr
    assert run(log, "--fresh").exit_code == 0
    assert carried(kept)["rows"] == 50


def test_two_streams_on_one_checkpoint(tmp_path):
    log = write(tmp_path / "log.csv", rows(50))
    with FileLock(tmp_path / ".log.csv.whs.lock"):
        done = run(log)
    assert done.exit_code == 1
    assert "in use by another stream" in done.stderr
    assert run(log).exit_code == 0


def test_a_longer_file_in_the_place_of_the_source_is_noticed(tmp_path):
    log = write(tmp_path / "log.csv", rows(50))
    assert run(log).exit_code == 0
    write(log, rows(90, first=7))
    assert "not the file that the checkpoint was written for" in run(log).stderr
    assert carried(tmp_path / "log.csv.whs")["rows"] == 50


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="no /dev/full")
def test_records_that_find_no_room_are_an_error_with_the_files_name(tmp_path):
    out = Out(tmp_path / "out", None)
    out.file.close()
    out.file = open("/dev/full", "ab", buffering=0)
    out({"kind": "estimate"})
    with pytest.raises(OutputLost, match="out cannot be written"):
        out.settle()
    out.close()


def test_a_reader_of_the_records_that_ended_is_no_full_disk(tmp_path):
    out = Out(tmp_path / "out", None)
    out.file.close()
    read, write_end = os.pipe()
    os.close(read)
    out.file = os.fdopen(write_end, "wb", buffering=0)
    out({"kind": "estimate"})
    with pytest.raises(OutputLost, match="the program that reads the records has ended"):
        out.settle()
    out.close()
