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


@pytest.mark.parametrize(("beside", "row_7"), [("", ""), ("\t", "\t"), ("", "\tgripper closed")])
@pytest.mark.parametrize("clocks", ["One", "No", "Multi"])
@pytest.mark.parametrize("decimal", ".,")
def test_every_form_of_a_labview_measurement_file_gives_the_same_numbers(tmp_path, decimal, clocks, beside, row_7):
    # NI's specification: X_Columns tells who has a time column, the last name is Comment, and rows may lack its cell.
    of = {"One": ["{t}", "{u}", "{q}"], "No": ["", "{u}", "{q}"], "Multi": ["{t}", "{u}", "{t}", "{q}"]}[clocks]
    names = {"{t}": "X_Value", "": "X_Value", "{u}": "Torque", "{q}": "Position"}

    def said(key, u, q):
        return "\t".join([key, *({"{u}": u, "{q}": q}.get(c, "") for c in of[1:]), ""])

    lines = [
        "LabVIEW Measurement\t", "Writer_Version\t2", "Separator\tTab", f"Decimal_Separator\t{decimal}",
        f"X_Columns\t{clocks}", f"Time\t10:00:00{decimal}0", "***End_of_Header***\t", "\t",
        said("Channels", "2", ""), said("Samples", "300", "300"), said("Date", "2026/03/03", "2026/03/03"),
        said("Y_Unit_Label", "Nm", "rad"), said("X_Dimension", "Time", "Time"),
        said("X0", f"0{decimal}0E+0", f"0{decimal}0E+0"), said("Delta_X", f"5{decimal}0E-3", f"5{decimal}0E-3"),
        said("***End_of_Header***", "", ""), "\t".join([*(names[c] for c in of), "Comment"]),
    ]  # fmt: skip
    for k, values in enumerate(zip(*TABLE.values(), strict=True)):
        t, u, q = (f"{v:.9f}".replace(".", decimal) for v in values)
        lines.append("\t".join(c.format(t=t, u=u, q=q) for c in of) + (row_7 if k == 7 else beside))
    (tmp_path / "axis.lvm").write_text("\n".join(lines))  # without a line end after the last row, which is whole
    log = load_log(tmp_path / "axis.lvm")
    assert np.allclose(log.X[:, 0], TABLE["torque_nm"], rtol=0, atol=1e-8)
    assert np.allclose(log.y, TABLE["position_rad"], rtol=0, atol=1e-8)
    assert log.sample_rate == pytest.approx(200.0)
    assert log.units == {"time": "s", "drive": "Nm", "position": "rad"}


def test_units_of_a_labview_file_need_no_cell_for_the_comment():
    head = ["Y_Unit_Label\tmNm\tdeg", "X_Dimension\tTime\tTime", "***End_of_Header***\t\t"]
    found = dialect_of([*head, "X_Value\tTorque\tAngle\tComment", *(f"{k}.0\t{k}.5\t0.{k}" for k in range(9))])
    assert found.names == ["X_Value", "Torque", "Angle", "Comment"]
    assert found.units == ["", "mNm", "deg", ""]


@pytest.mark.parametrize("comment", ["# units: s, mNm, deg", "% s mNm deg", "# s; mNm; deg"])
def test_units_may_stand_in_a_comment_above_the_names(comment):
    found = dialect_of(["# rig 7", comment, "t,u,q", *(f"0.{k},1.{k},2.{k}" for k in range(9))])
    assert (found.names, found.units) == (["t", "u", "q"], ["s", "mNm", "deg"])


def test_row_numbers_without_a_name_are_a_column_of_their_own():
    found = dialect_of(["time_s torque_nm position_rad", *(f'"{k + 1}" 0.{k} 1.{k} 2.{k}' for k in range(9))])
    assert found.names == ["index", "time_s", "torque_nm", "position_rad"]
    assert dialect_of(["time_s torque_nm position_rad", *(f"0.{k} 0.{k} 1.{k} 2.{k}" for k in range(9))]).names is None
