"""Fetching measured records, without a network: what is asked for, and what is said when nothing comes."""

from __future__ import annotations

import builtins
from pathlib import Path
from types import SimpleNamespace
from urllib.parse import urlsplit

import pytest

from whsklearn.datasets import publishers

FETCHES = [publishers.download_emps, publishers.download_kr300]


def pooch_that(retrieve, folder="/cache"):
    return lambda: SimpleNamespace(os_cache=lambda name: folder, retrieve=retrieve, Unzip=lambda: "unzip")


@pytest.mark.parametrize("fetch", FETCHES)
def test_no_network_and_no_downloader_are_none(fetch, monkeypatch):
    def down(*args, **options):
        raise OSError("no route")

    monkeypatch.setattr(publishers, "_pooch", pooch_that(down))
    assert fetch() is None
    monkeypatch.undo()
    real = builtins.__import__

    def without(name, *rest, **options):
        if name == "pooch":
            raise ImportError(name)
        return real(name, *rest, **options)

    monkeypatch.setattr(builtins, "__import__", without)
    assert fetch() is None


def test_the_robots_files_are_those_of_one_commit_each_in_a_folder_of_its_own(monkeypatch):
    asked = {}

    def retrieve(address, *, known_hash, fname, path):
        asked[address] = path / fname

    monkeypatch.setattr(publishers, "_pooch", pooch_that(retrieve))
    assert publishers.download_kr300() == Path("/cache/kr300")
    assert len(set(asked.values())) == 3
    for address in asked:
        parts = urlsplit(address)
        assert " " not in address
        assert (parts.scheme, publishers._KR300_COMMIT in parts.path) == ("https", True)


def test_the_archive_is_where_its_record_lies(monkeypatch):
    files = ["/cache/EMPS.zip.unzip/a/readme.txt", "/cache/EMPS.zip.unzip/b/DATA_EMPS.mat"]
    monkeypatch.setattr(publishers, "_pooch", pooch_that(lambda *a, **k: files))
    assert publishers.download_emps() == Path("/cache/EMPS.zip.unzip/b")
    monkeypatch.setattr(publishers, "_pooch", pooch_that(lambda *a, **k: files[:1]))
    assert publishers.download_emps() is None
