"""Lines of a stream and what they hold: places and numbers, headers, rows that are none."""

from __future__ import annotations

import io
import os

import pytest

from whsklearn.logs import LogError
from whsklearn.streaming.rows import LONGEST, BadRow, CsvParser, FollowedFile, JsonParser, LineSource, OtherHeader


def test_lines_keep_their_numbers_and_places_whatever_the_blocks(tmp_path):
    text = b"a,b\n" + b"".join(b"%d,%d\n" % (i, i) for i in range(50_000)) + b"last,1"
    path = tmp_path / "log"
    path.write_bytes(text)
    source, lines = LineSource(io.BytesIO(text), open_end=True), []
    while (block := source.read()) is not None:
        lines += block
        assert text[: source.offset].rstrip(b"\n").split(b"\n") == lines or not lines
    assert lines == text.split(b"\n")
    assert (source.number, source.offset) == (50_002, len(text))


def test_a_line_without_end_takes_no_memory_and_is_no_row():
    text = b"1,1\n" + b"7" * (3 * LONGEST) + b",2\n3,3\n"
    source, lines = LineSource(io.BytesIO(text)), []
    while (block := source.read()) is not None:
        lines += block
        assert len(source._rest) <= LONGEST + (1 << 16)
    assert (lines[0], lines[2], source.offset) == (b"1,1", b"3,3", len(text))
    with pytest.raises(BadRow):
        CsvParser(b"u,y", ["u", "y"])(lines[1])


def test_a_followed_file_that_is_replaced_begins_anew(tmp_path):
    path = tmp_path / "log.csv"
    path.write_bytes(b"u,y\n1,1\n")
    source = FollowedFile(path)
    assert source.read() == [b"u,y", b"1,1"]
    (tmp_path / "new").write_bytes(b"u,y\n2,2\n")
    os.replace(tmp_path / "new", path)
    assert source.read() == []
    assert source.restarted
    assert source.read() == [b"u,y", b"2,2"]
    path.write_bytes(b"u,y\n")
    assert source.read() == []
    assert source.read() == [b"u,y"]
    source.close()


@pytest.mark.parametrize("header", [b"t,u,y", b'\xef\xbb\xbf"t","u","y"\r\n', b"t;u;y", b"t\tu\ty", b"t , u , y"])
def test_headers_of_many_kinds(header):
    parse = CsvParser(header, ["t", "u", "y"])
    assert parse(b"1,2.5,-3e2".replace(b",", parse.delimiter.encode())) == [1.0, 2.5, -300.0]
    assert parse(b'"1","2.5","-3e2"\r'.replace(b",", parse.delimiter.encode())) == [1.0, 2.5, -300.0]


@pytest.mark.parametrize(("header", "per_second"), [(b"stamp,u", 1.0), (b"stamp_ms,u", 1e3)])
def test_a_time_may_be_dates_and_no_other_column(header, per_second):
    parse = CsvParser(header, header.decode().split(","), timed=True)
    first = parse(b"2026-03-29T01:59:59.75+01:00,1")[0]
    assert first == parse(b'"2026-03-29 00:59:59.750Z",1')[0] == parse(b"2026-03-29 00:59:59.75,1")[0]
    # summer time begins between the two: wall clocks are an hour and a half second apart, the samples half a second
    assert parse(b"2026-03-29T03:00:00.25+02:00,1")[0] - first == 0.5 * per_second
    assert parse(b"2026-05-21 10:00:01.5 CEST,1")[0] - parse(b"2026-05-21 10:00:01.25 CEST,1")[0] == 0.25 * per_second
    with pytest.raises(BadRow, match="u is"):
        parse(b"1.5,2026-03-29")


@pytest.mark.parametrize(
    "header", ["t;u".encode("utf-16"), "t;u".encode("utf-16-le"), b"MATLAB 5.0\0\0", b"\x1f\x8b\x08t;u"]
)
def test_a_file_that_is_no_text_is_refused_with_what_to_do(header):
    with pytest.raises(LogError, match="export the log as CSV in UTF-8"):
        CsvParser(header, ["t", "u"])


def test_a_name_over_two_lines_is_said_to_be_one():
    with pytest.raises(LogError, match="ends within a quoted name"):
        CsvParser(b'"Time', ["Time [ms]"])


@pytest.mark.parametrize("line", [b"", b"1", b"1,2,3", b"a,1", b"nan,1", b"1,inf", b"1_0,1", b"\xff,1", b"1,,"])
def test_lines_that_are_no_rows(line):
    with pytest.raises(BadRow):
        CsvParser(b"u,y", ["u", "y"])(line)


@pytest.mark.parametrize(
    "line",
    [b"", b"{", b"[1,2]", b"3", b'{"u": 1}', b'{"u": "1", "y": 1}', b'{"u": true, "y": 1}', b'{"u": NaN, "y": 1}',
     b'{"u": 1e999, "y": 1}', b'{"u": 1' + b"0" * 400 + b', "y": 1}', b"[" * 100_000, b"\xff\xfe"],
)  # fmt: skip
def test_json_lines_that_are_no_rows(line):
    with pytest.raises(BadRow):
        JsonParser(["u", "y"])(line)


def test_a_header_amid_the_rows_is_skipped_unless_it_names_a_column_differently():
    parse = CsvParser(b"time_s,torque_nm,v", ["torque_nm", "v"])
    with pytest.raises(BadRow) as same:
        parse(b"time_s,torque_nm,v")
    with pytest.raises(BadRow) as word:
        parse(b"0.1,off,1.0")
    assert not isinstance(same.value, OtherHeader)
    assert not isinstance(word.value, OtherHeader)
    with pytest.raises(
        OtherHeader, match=r"a header in which 'torque_nm' is called 'torque_mnm'.*split the file there"
    ):
        parse(b'"time_s","torque_mnm",w')
    with pytest.raises(OtherHeader, match="a header with the columns in another order, v, torque_nm, time_s,"):
        parse(b"v,torque_nm,time_s")


def test_a_header_again_is_no_lost_row_where_stamps_tell_what_is_lost():
    parse = CsvParser(b"time_s,torque_nm,v", ["time_s", "torque_nm", "v"], timed=True)
    assert parse(b'"time_s","torque_nm","v"') is None
    with pytest.raises(BadRow):
        parse(b"time_s,torque_nm,off")
