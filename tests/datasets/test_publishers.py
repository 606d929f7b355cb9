"""Fetching measured records, without a network: what is asked for, and what is said when nothing comes."""

from __future__ import annotations

import sys
from pathlib import Path
from types import SimpleNamespace
from urllib.parse import urlsplit

import pytest

from whsklearn.datasets import publishers

FETCHES = [publishers.EMPS, publishers.KR300, publishers.SILVERBOX]


def pooch_that(retrieve, folder="/cache"):
    return SimpleNamespace(os_cache=lambda name: folder, retrieve=retrieve, Unzip=lambda: "unzip")


@pytest.mark.parametrize("fetch", FETCHES, ids=lambda f: f.name)
def test_no_network_and_no_downloader_are_none(fetch, monkeypatch):
    def down(*args, **options):
        raise OSError("no route")

    monkeypatch.setitem(sys.modules, "pooch", pooch_that(down))
    assert fetch.fetched() is None
    monkeypatch.setitem(sys.modules, "pooch", None)  # not installed
    assert fetch.fetched() is None


def test_the_robots_files_are_those_of_one_commit_each_in_a_folder_of_its_own(monkeypatch):
    asked = {}

    def retrieve(address, *, known_hash, fname, path):
        asked[address] = path / fname

    monkeypatch.setitem(sys.modules, "pooch", pooch_that(retrieve))
    assert publishers.KR300.fetched() == Path("/cache/kr300")
    assert len(set(asked.values())) == 3
    for address in asked:
        parts = urlsplit(address)
        assert " " not in address
        assert (parts.scheme, publishers._KR300_COMMIT in parts.path) == ("https", True)


def test_the_archive_is_where_its_record_lies(monkeypatch):
    files = ["/cache/EMPS.zip.unzip/a/readme.txt", "/cache/EMPS.zip.unzip/b/DATA_EMPS.mat"]
    monkeypatch.setitem(sys.modules, "pooch", pooch_that(lambda *a, **k: files))
    assert publishers.EMPS.fetched() == Path("/cache/EMPS.zip.unzip/b")
    monkeypatch.setitem(sys.modules, "pooch", pooch_that(lambda *a, **k: files[:1]))
    assert publishers.EMPS.fetched() is None


def test_the_user_s_own_folder_outweighs_the_environment_and_a_subfolder_the_folder(monkeypatch, tmp_path):
    monkeypatch.setenv("WHSKLEARN_DATA", str(tmp_path / "elsewhere"))
    for place in (tmp_path, tmp_path / "emps"):
        place.mkdir(exist_ok=True)
        (place / "there").touch()
    assert publishers.EMPS.folder(tmp_path, False, lambda where: (where / "there").exists()) == tmp_path / "emps"
    with pytest.raises(FileNotFoundError, match=r"does not hold emps/emps_train\.csv and .* get them from https"):
        publishers.EMPS.folder(None, False, lambda where: (where / "there").exists())
