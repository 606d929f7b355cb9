"""Text files of any layout give the same numbers."""

from __future__ import annotations

import gzip

import numpy as np
import pytest

from tests.logs.rig import columns
from whsklearn.logs import ColumnError, LogError, load_log
from whsklearn.logs.dialect import dialect_of

TABLE = columns(300)
NAMES = {"time": "time_s", "drive": "torque_nm", "position": "position_rad"}
HEAD = ["time_s", "torque_nm", "position_rad"]


def text(sep=",", head=HEAD, before=(), decimal=".", line="\n", after=()):
    rows = [sep.join(f"{v:.9f}".replace(".", decimal) for v in row) for row in zip(*TABLE.values(), strict=True)]
    return line.join([*before, *([sep.join(head)] if head else []), *after, *rows]) + line


LAYOUTS = {
    "comma": text(),
    "semicolon": text(";"),
    "decimal comma": text(";", decimal=","),
    "tab with decimal comma": text("\t", decimal=","),
    "blanks": text("  "),
    "bar": text("|"),
    "Windows lines": text(line="\r\n"),
    "comments above": text(before=["# rig 7", "# operator: Ann", ""]),
    "a preamble without marks": text(before=["Device: rig 7", "Samples: 300"]),
    "percent": text(before=["% made by a script"]),
    "units in a line of their own": text(";", after=["s;Nm;rad"]),
    "numpy's header": text(head=None, before=["# time_s,torque_nm,position_rad"]),
    "quoted header": text(head=[f'"{h}"' for h in HEAD]),
}


@pytest.mark.parametrize("layout", LAYOUTS)
def test_every_layout_gives_the_same_numbers(tmp_path, layout):
    (tmp_path / "axis.csv").write_bytes(LAYOUTS[layout].encode())
    log = load_log(tmp_path / "axis.csv", **NAMES)
    assert np.allclose(log.X[:, 0], TABLE["torque_nm"], rtol=0, atol=1e-8)
    assert np.allclose(log.y, TABLE["position_rad"], rtol=0, atol=1e-8)


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "cp1252"])
def test_encodings_and_units_in_brackets(tmp_path, encoding):
    (tmp_path / "axis.csv").write_bytes(text(";", head=["Zeit [s]", "Größe [A]", "Winkel (deg)"]).encode(encoding))
    log = load_log(tmp_path / "axis.csv", time="Zeit [s]", drive="Größe [A]", position=2)
    assert log.units == {"time": "s", "drive": "A", "position": "deg"}
    assert len(log.y) == 300


def test_without_a_header_columns_are_numbers(tmp_path):
    path = tmp_path / "axis.csv"
    path.write_text(text(head=None))
    assert len(load_log(path, time=0, drive=1, position=2).y) == 300
    with pytest.raises(ColumnError, match=r"no header line.*--columns 0,1,2"):
        load_log(path, **NAMES)


def test_gzip_comments_amid_the_data_and_a_half_written_last_row(tmp_path):
    lines = text().splitlines()
    lines.insert(100, "# emergency stop tested")
    with gzip.open(tmp_path / "axis.csv.gz", "wt") as file:
        file.write("\n".join([*lines, "1.5,0.2"]))
    with pytest.warns(UserWarning, match="no value at row 300"):
        log = load_log(tmp_path / "axis.csv.gz", **NAMES)
    assert len(log.y) == 300


def test_a_tail_of_zero_bytes_is_left_out_and_zeros_amid_the_data_are_refused(tmp_path):
    good = text().encode()
    (tmp_path / "tail.csv").write_bytes(good + bytes(5000))
    log = load_log(tmp_path / "tail.csv", **NAMES)
    assert len(log.y) == 300
    assert any("zero bytes" in n for n in log.notes)
    (tmp_path / "amid.csv").write_bytes(good[:3000] + bytes(3) + good[3000:])
    with pytest.raises(LogError, match=r"line \d+ holds zero bytes"):
        load_log(tmp_path / "amid.csv", **NAMES)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "is empty"),
        (b"\n \n", "nothing but blanks"),
        (bytes(900), "nothing but blanks or zero bytes"),
        (b"time_s,torque_nm,position_rad\n", "has a header and no samples"),
        (b"# only a remark\n", "comments only"),
        (b"Dear Ann,\nhere is\nthe log,\nas agreed.\nYours\n", "is no table of numbers: line 1 is 'Dear Ann,'"),
        (b"\x7fELF\x02\x01\x01" + bytes(range(256)) * 20, "binary file that begins with"),
        (b"time_s,torque_nm,position_rad\n0,0,1\n0,01,1,2\n0,02,1,3\n", "cells of the first|no readable CSV"),
    ],
)
def test_what_is_no_table_is_refused_in_a_sentence(tmp_path, content, message):
    (tmp_path / "axis.csv").write_bytes(content)
    with pytest.raises(LogError, match=message):
        load_log(tmp_path / "axis.csv", **NAMES)


def test_a_comma_beats_a_decimal_comma_only_where_it_parts_numbers():
    assert dialect_of(["a,b", "1,2", "3,4"]).separator == ","
    assert dialect_of(["a;b", "1,5;2,5", "3,5;4,5"])[:2] == (";", ",")
    assert dialect_of(["a\tb", "1,5\t2", "3,5\t4"])[:2] == ("\t", ",")
