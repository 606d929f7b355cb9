"""Logs in the dialects of drives, controllers and scripts are read with their own clock."""

from __future__ import annotations

import pytest

from benchmarks.vendor_logs import LOGS, motion, table, wrong
from tests.logs.rig import NAMES, text
from whsklearn.logs import ColumnError, LogError, load_log


@pytest.mark.parametrize("name", LOGS)
def test_a_dialect_is_read_as_it_was_written(name, tmp_path):
    assert wrong(name, tmp_path) == ""


def test_ticks_without_a_rate_are_asked_for_and_take_one(tmp_path):
    m = motion()
    ticks = (8 * 1e3 * m.t).round().astype(int)
    (tmp_path / "a.csv").write_text("ticks,torque_nm,position_rad\n" + table(ticks, m.u, m.q))
    with pytest.raises(ColumnError, match="counts ticks of unknown rate; add --unit time=ticks/8000"):
        load_log(tmp_path / "a.csv", time="ticks", drive=1, position=2)
    log = load_log(tmp_path / "a.csv", time="ticks", drive=1, position=2, units={"time": "ticks/8000"})
    assert log.sample_rate == pytest.approx(1000.0)


def test_whole_numbers_too_far_apart_for_seconds_are_milliseconds_and_that_is_said(tmp_path):
    m = motion()
    (tmp_path / "a.csv").write_text(
        "time,torque_nm,position_rad\n" + table((1e3 * m.t[::4]).round().astype(int), m.u[::4], m.q[::4])
    )
    log = load_log(tmp_path / "a.csv", time="time", drive=1, position=2)
    assert log.sample_rate == pytest.approx(250.0)
    assert any("were taken as ms" in n for n in log.notes)


def test_of_several_motors_one_is_asked_for_and_two_are_not_mixed(tmp_path):
    write, _ = LOGS["three motors in turns"]
    path = write(tmp_path, motion())
    with pytest.raises(
        ColumnError, match=r"several columns 'position_rad' for position: position_rad.1, position_rad.2"
    ):
        load_log(path, time="time_s", drive="torque_nm.1", position="position_rad")
    with pytest.raises(ColumnError, match="belong to several motors"):
        load_log(path, time="time_s", drive="torque_nm.1", position="position_rad.2")


def test_a_column_of_whole_numbers_that_tells_no_motors_changes_nothing(tmp_path):
    rows = [f"{r},{i // 100}" for i, r in enumerate(text(head=None).splitlines())]
    (tmp_path / "a.csv").write_text("time_s,torque_nm,position_rad,state_id\n" + "\n".join(rows) + "\n")
    assert len(load_log(tmp_path / "a.csv", **NAMES).y) == 300


def test_a_scope_project_and_an_empty_folder_are_refused_with_what_to_do(tmp_path):
    (tmp_path / "a.svdx").write_bytes(b"\x00" * 400)
    with pytest.raises(LogError, match="export its channels as CSV"):
        load_log(tmp_path / "a.svdx", drive=0, position=1)
    (tmp_path / "empty").mkdir()
    with pytest.raises(LogError, match="a folder with a CSV for each signal"):
        load_log(tmp_path / "empty", drive=0, position=1)
