"""Some of the odd logs of the documentation: what is mended is said, what is not is refused."""

from __future__ import annotations

import pytest

from benchmarks.odd_files import FILES, said

EXPECTED = {
    "decimal comma": (0, "decimal comma"),
    "no header, no --columns": (2, "--columns"),
    "wrapped at 2 pi": (0, "turn of 6.28"),
    "hole of 0.1 s": (0, "2 segments"),
    "clock restarts": (0, "time jumps back"),
    "emergency stop": (0, "emergency stop"),
    "a value of 1e300": (0, "row 500"),
    "the word 'off'": (3, "row 500 holds 'off'"),
    "empty file": (3, "is empty"),
    "header only": (3, "no samples"),
    "a binary file": (3, "binary file"),
    "a units row": (0, "Read as it is"),
    "UTF-16 without a mark": (0, "Read as it is"),
    "thousands 1,234.5": (0, "Thousands separators"),
    "thousands 1.234,5": (0, "Thousands separators"),
    "numbers with units": (0, "followed by its unit, 'Nm'"),
    "commas at the end of rows only": (0, "Read as it is"),
    "one name twice": (0, "the first keeps the name"),
    "the header again": (0, "between or below the data were left out, the first is row 9000"),
    "newest row first": (0, "rows were reversed"),
    "-9999 for none": (0, "at row 70 (-1e+04"),
    "over midnight": (0, "holds dates"),
    "days of a spreadsheet": (0, "holds days"),
    "a 32-bit counter of us": (0, "overflows at 4294967296"),
    "a cut gz": (3, "not a complete archive"),
    "a ZIP archive of two": (3, "a.csv, b.csv"),
    "JSON of vectors": (0, "Read as it is"),
    "one column for two": (2, "give two columns"),
}


@pytest.mark.parametrize("name", EXPECTED)
def test_what_is_said_of_an_odd_log(name, tmp_path, capsys):
    status, text = said(name, tmp_path, diagnose=False)
    assert status == EXPECTED[name][0]
    assert any(part in text + capsys.readouterr().err for part in EXPECTED[name][1].split("|"))


def test_there_are_at_least_25():
    assert len(FILES) >= 25
