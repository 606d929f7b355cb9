"""What a source's first rows say of an axis; streams of one are in `test_stream`."""

from __future__ import annotations

import pytest
from click.testing import CliRunner

from whsklearn.cli.axis_stream import head_of
from whsklearn.cli.stream import main


@pytest.mark.parametrize(
    ("time", "stamps"),
    [
        ("time_s", ["0", "0.002", "0.004", "0.006"]),
        ("t_ms", ["0", "2", "4", "6"]),
        ("time_s", ["0,000", "0,002", "0,004", "0,006"]),
        ("stamp", [f"2026-01-01T00:00:00.00{k}Z" for k in (0, 2, 4, 6)]),
        ("time_s", ["0", "0.002", "0.004", "0.5", "0.502"]),
        ("t_ms", ["0", "2", "2", "4", "4", "6"]),
    ],
    ids=["seconds", "milliseconds", "decimal comma", "dates", "a pause", "rows that share a stamp"],
)
def test_the_usual_step_is_that_of_the_time_in_any_form(tmp_path, time, stamps):
    log = tmp_path / "log.csv"
    log.write_text(f"{time};q\n" + "".join(f"{t};1\n" for t in stamps))
    names, step = head_of(str(log), time)
    assert names == [time, "q"]
    assert step == pytest.approx(0.002)


@pytest.mark.parametrize("rate", [400.0, 667.0, 800.0])
def test_stamps_in_whole_milliseconds_tell_the_rate_of_the_rows(tmp_path, rate):
    """The median of 2, 3, 2, 3 ms is 3 ms; an inertia had come out by the square of that too large."""
    log = tmp_path / "log.csv"
    log.write_text("t_ms,q\n" + "".join(f"{round(1e3 * k / rate)},1\n" for k in range(1000)))
    assert head_of(str(log), "t_ms")[1] == pytest.approx(1.0 / rate, rel=0.005)


@pytest.mark.parametrize("rows", ["", "t,q\n", "t,q\n0,1\n1,1\n", "t,q\n5,1\n5,1\n5,1\n"])
def test_a_source_that_shows_no_step_has_none(tmp_path, rows):
    log = tmp_path / "log.csv"
    log.write_text(rows)
    assert head_of(str(log), "t")[1] is None
    assert head_of("-", "t") == ([], None)


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (b"", "holds no rows"),
        (b"time_s,torque_nm,position_rad\n", "holds no rows"),
        ("time_s,torque_nm,position_rad\n0,1,2\n".encode("utf-16"), "is not text in UTF-8"),
        (b"\x8f\x00\xfe\x01\n\x00\x02", "is not text in UTF-8"),
        (b"time_s,torque,position_rad\n0,1,2\n", "no column 'torque_nm'; it has: time_s, torque, position_rad"),
        (b"time_s,torque_nm,position_rad\n0,1,2\n", "does not show its sample rate"),
    ],
    ids=["empty", "a header", "UTF-16", "binary", "another column", "one row"],
)
def test_a_file_that_is_no_log_is_told_as_what_it_is(tmp_path, content, says):
    source = tmp_path / "log.csv"
    source.write_bytes(content)
    columns = ("--input", "torque_nm", "--output", "position_rad", "--time", "time_s")
    done = CliRunner().invoke(main, [str(source), *columns, "--no-track"])
    assert done.exit_code != 0
    assert says in done.output
