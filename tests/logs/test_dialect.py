"""Text files of any layout give the same numbers."""

from __future__ import annotations

import numpy as np
import pytest

from tests.logs.rig import HEAD, NAMES, columns, text
from whsklearn.logs import ColumnError, load_log
from whsklearn.logs.dialect import dialect_of

TABLE = columns(300)
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
    "a separator behind the names": text(head=[*HEAD, ""]),
    "a table of Markdown": "".join(
        f"| {row} |\n" for row in text(" | ", after=["---- | --------:|:------------:"]).splitlines()
    ),
}


@pytest.mark.parametrize("layout", LAYOUTS)
def test_every_layout_gives_the_same_numbers(tmp_path, layout):
    (tmp_path / "axis.csv").write_bytes(LAYOUTS[layout].encode())
    log = load_log(tmp_path / "axis.csv", **NAMES)
    assert np.allclose(log.X[:, 0], TABLE["torque_nm"], rtol=0, atol=1e-8)
    assert np.allclose(log.y, TABLE["position_rad"], rtol=0, atol=1e-8)


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "utf-32", "cp1252"])
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


def test_a_comma_beats_a_decimal_comma_only_where_it_parts_numbers():
    assert dialect_of(["a,b", "1,2", "3,4"]).separator == ","
    assert dialect_of(["a;b", "1,5;2,5", "3,5;4,5"])[:2] == (";", ",")
    assert dialect_of(["a\tb", "1,5\t2", "3,5\t4"])[:2] == ("\t", ",")


def test_names_with_blanks_stand_two_blanks_apart():
    found = dialect_of(["Time (s)   Motor torque (Nm)  Angle", "  0.00    1.5   2.5", "  0.01    1.6   2.6"])
    assert found.names == ["Time (s)", "Motor torque (Nm)", "Angle"]


@pytest.mark.parametrize("decimal", [".", ","])
def test_rows_of_a_date_and_words_are_not_one_column_of_dates(decimal):
    """A telescope's log: all separators but the right one leave a single cell, which begins like a date."""
    sep = "," if decimal == "." else ";"
    rows = [f"2026-03-04T21:15:{k:02d}{decimal}020Z{sep}{k}{sep}{k}{decimal}5{sep}TRACK{sep}ok" for k in range(20)]
    found = dialect_of([sep.join(["utc", "axis_arcsec", "motor_ma", "mode", "state"]), *rows])
    assert (found.separator, found.decimal, found.width) == (sep, decimal, 5)
    assert found.names == ["utc", "axis_arcsec", "motor_ma", "mode", "state"]
