"""CSV files as programs leave them: compressed, with comments, cut off in the middle of a row."""

from __future__ import annotations

import gzip

import numpy as np
import pytest

from tests.logs.rig import NAMES, text
from whsklearn.logs import ColumnError, LogError, load_log, open_source


def test_gzip_comments_amid_the_data_and_a_half_written_last_row(tmp_path):
    lines = text().splitlines()
    lines.insert(100, "# emergency stop tested")
    with gzip.open(tmp_path / "axis.csv.gz", "wt") as file:
        file.write("\n".join([*lines, "1.5,0.2"]))
    log = load_log(tmp_path / "axis.csv.gz", **NAMES)
    assert len(log.y) == 300
    assert any("last row is incomplete" in n for n in log.notes)


def test_ticks_whose_name_has_a_unit_of_time_have_a_known_rate(tmp_path):
    rows = [
        "tick_ms,torque_nm,position_rad",
        *(f"{10 * k},{np.sin(k / 9):.6f},{np.cos(k / 9):.6f}" for k in range(400)),
    ]
    (tmp_path / "axis.csv").write_text("\n".join(rows))
    assert load_log(tmp_path / "axis.csv").sample_rate == pytest.approx(100.0)


def test_a_tail_of_zero_bytes_is_left_out_and_zeros_amid_the_data_are_refused(tmp_path):
    good = text().encode()
    (tmp_path / "tail.csv").write_bytes(good + bytes(5000))
    log = load_log(tmp_path / "tail.csv", **NAMES)
    assert len(log.y) == 300
    assert any("zero bytes" in n for n in log.notes)
    (tmp_path / "amid.csv").write_bytes(good[:3000] + bytes(3) + good[3000:])
    with pytest.raises(LogError, match=r"line \d+ has zero bytes"):
        load_log(tmp_path / "amid.csv", **NAMES)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "is empty"),
        (b"\n \n", "only blanks"),
        (bytes(900), "only blanks or zero bytes"),
        (b"time_s,torque_nm,position_rad\n", "has a header but no samples"),
        (b"# only a remark\n", "has comments but no samples"),
        (b"Dear Ann,\nhere is\nthe log,\nas agreed.\nYours\n", "is not a table of numbers: line 1 is 'Dear Ann,'"),
        (b"\x7fELF\x02\x01\x01" + bytes(range(256)) * 20, "binary file that begins with"),
        (
            b"time_s,torque_nm,position_rad\n0,0,1\n0,01,1,2\n0,02,1,3\n",
            "cells of the first|line 3 has 4 cells where 3 were expected",
        ),
    ],
)
def test_what_is_no_table_is_refused_in_a_sentence(tmp_path, content, message):
    (tmp_path / "axis.csv").write_bytes(content)
    with pytest.raises(LogError, match=message):
        load_log(tmp_path / "axis.csv", **NAMES)


def test_a_last_number_that_is_cut_is_no_value_and_a_whole_last_row_without_a_line_end_is_one(tmp_path):
    (tmp_path / "cut.csv").write_text(text()[:-6])
    (tmp_path / "whole.csv").write_text(text()[:-1])
    assert len(load_log(tmp_path / "cut.csv", **NAMES).y) == 299
    assert len(load_log(tmp_path / "whole.csv", **NAMES).y) == 300


@pytest.mark.parametrize(("separator", "digits"), [(" ", 2), ("\t", 1), (",", 1)])
def test_a_last_number_of_fewer_digits_before_its_point_is_whole(tmp_path, separator, digits):
    """10.20 and more in the rows from which a type is taken, 9.50 in the last one."""
    numbers = enumerate(np.linspace(20.0, 9.5, 200))
    rows = [f"{k / 100:.2f}{separator}{k % 7}.5{separator}{x:.{digits}f}" for k, x in numbers]
    for name, content, samples in (("whole", rows, 200), ("cut", [*rows[:-1], rows[-1][:-1]], 199),
                                   ("halved", [*rows[:-1], rows[-1][: -digits - 1]], 199)):  # fmt: skip
        (tmp_path / f"{name}.txt").write_text("\n".join(content))
        assert len(load_log(tmp_path / f"{name}.txt", time=0, drive=1, position=2).y) == samples


def test_blank_lines_and_names_beyond_the_first_bytes_are_passed(tmp_path):
    (tmp_path / "blank.csv").write_text("\n" * 100_000 + text())
    assert len(load_log(tmp_path / "blank.csv", **NAMES).y) == 300
    (tmp_path / "long.csv").write_text("# " + "x" * 5_000_000 + "\n" + text())
    assert len(load_log(tmp_path / "long.csv", **NAMES).y) == 300
    (tmp_path / "lines.csv").write_text("# remark on the rig\n" * 250_000 + text())
    assert len(load_log(tmp_path / "lines.csv", **NAMES).y) == 300


def test_a_row_of_blank_cells_below_the_names_is_no_header(tmp_path):
    (tmp_path / "elmo.csv").write_text("Time [sec],Position [cnt],Active Current [A]\n,,\n0,5,0.1\n1,6,0.2\n2,7,0.3\n")
    assert open_source(tmp_path / "elmo.csv").names == ["Time [sec]", "Position [cnt]", "Active Current [A]"]


@pytest.mark.parametrize("word", ["start", "n/a?"])
def test_a_row_with_a_word_for_its_time_below_the_names_is_no_header(tmp_path, word):
    lines = text().splitlines()
    lines.insert(1, ",".join([word, *lines[1].split(",")[1:]]))
    (tmp_path / "axis.csv").write_text("\n".join(lines) + "\n")
    log = load_log(tmp_path / "axis.csv", **NAMES)
    assert len(log.y) == 300


def test_a_header_that_does_not_fit_its_rows_is_told_as_it_is(tmp_path):
    rows = text(head=None).splitlines()
    (tmp_path / "wide.csv").write_text("time_s,torque_nm,position_rad\n" + "\n".join(f"{r},7" for r in rows) + "\n")
    with pytest.raises(ColumnError, match="the header line has 3 names where the rows have 4 cells"):
        load_log(tmp_path / "wide.csv", **NAMES)
    assert len(load_log(tmp_path / "wide.csv", time=0, drive=1, position=2).y) == 300


def test_decimal_commas_between_commas_need_quotes(tmp_path):
    plain = load_log(_written(tmp_path / "plain.csv", text()), **NAMES)
    head, *rows = text().splitlines()
    comma = [[c.replace(".", ",") for c in row.split(",")] for row in rows]
    quoted = "\n".join([head, *(",".join(f'"{c}"' for c in cells) for cells in comma)])
    log = load_log(_written(tmp_path / "quoted.csv", quoted), **NAMES)
    assert (log.X == plain.X).all()
    assert (log.y == plain.y).all()
    torn = "\n".join([head, *(",".join(cells) for cells in comma)])
    with pytest.raises(LogError, match=r"decimal commas too: 3 names above 6 cells"):
        load_log(_written(tmp_path / "torn.csv", torn), **NAMES)


def _written(path, content):
    path.write_text(content)
    return path


def test_a_header_amid_the_data_may_repeat_the_names_but_not_change_their_units(tmp_path):
    lines = text().splitlines()
    assert lines[0] == "time_s,torque_nm,position_rad"
    (tmp_path / "same.csv").write_text("\n".join([*lines[:150], lines[0], *lines[150:], ""]))
    log = load_log(tmp_path / "same.csv", **NAMES)
    assert len(log.y) == 300
    other = "time_s,torque_mnm,position_rad"
    (tmp_path / "other.csv").write_text("\n".join([*lines[:150], other, *lines[150:], ""]))
    with pytest.raises(LogError, match=r"row 149 is a header in which 'torque_nm' is called 'torque_mnm'.*split"):
        load_log(tmp_path / "other.csv", **NAMES)


def test_lists_in_cells_are_told(tmp_path):
    rows = [f"{k / 100},\"['yaw', 'pitch']\",\"[{k / 7:.3f}, 0.1]\"" for k in range(20)]
    (tmp_path / "states.csv").write_text("\n".join(["time,name,position", *rows]))
    with pytest.raises(LogError, match=r"has lists in its cells, such as '\[0.000, 0.1\]'; .* one column for each"):
        open_source(tmp_path / "states.csv")
