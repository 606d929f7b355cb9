"""Some of the odd logs of the documentation: what is mended is said, what is not is refused."""

from __future__ import annotations

import pytest

from benchmarks.odd_files import FILES, said

EXPECTED = {
    "decimal comma": (0, "decimal comma"),
    "no header, no --columns": (2, "--columns"),
    "wrapped at 2 pi": (0, "turn of 6.28"),
    "hole of 0.1 s": (0, "longest of 2 segments|2 segments"),
    "clock starts anew": (0, "time falls back"),
    "emergency stop": (0, "emergency stop"),
    "a value of 1e300": (0, "row 500"),
    "the word 'off'": (3, "row 500 holds 'off'"),
    "empty file": (3, "is empty"),
    "header only": (3, "no samples"),
    "a binary file": (3, "binary file"),
}


@pytest.mark.parametrize("name", EXPECTED)
def test_what_is_said_of_an_odd_log(name, tmp_path, capsys):
    status, text = said(name, tmp_path, diagnose=False)
    assert status == EXPECTED[name][0]
    assert any(part in text + capsys.readouterr().err for part in EXPECTED[name][1].split("|"))


def test_there_are_at_least_25():
    assert len(FILES) >= 25
