"""Signals in several files, or in rows that say whose they are."""

from __future__ import annotations

import json

import numpy as np
import pandas as pd
import pytest

from whsklearn.logs import LogWarning, load_log, open_source
from whsklearn.logs.errors import ColumnError, LogError
from whsklearn.logs.parts import by_motor, by_signal, open_folder, with_milliseconds, with_nanoseconds
from whsklearn.logs.source import Column, Source
from whsklearn.logs.text import open_text

N = 8


def table(**columns):
    values = {name: np.asarray(v) for name, v in columns.items()}
    return Source("a.csv", list(values), lambda wanted: {w: Column(values[w]) for w in wanted})


@pytest.fixture
def motors():
    order = np.random.default_rng(0).permutation(np.tile([3, 5], N))  # rows of two motors, in any order
    q = 10.0 * order + np.array([np.sum(order[:i] == m) for i, m in enumerate(order)])
    return by_motor(table(t=np.arange(2.0 * N), motor_id=order, q=q))


def test_each_motor_has_its_own_rows_and_two_are_not_mixed(motors):
    assert motors.names == ["t", "q.3", "q.5"]
    np.testing.assert_array_equal(motors.fetch(["q.5"])["q.5"].values, 50.0 + np.arange(N))
    read = motors.fetch(["t", "q.3"])
    assert read["t"].values.size == read["q.3"].values.size == N
    with pytest.raises(ColumnError, match="several motors"):
        motors.fetch(["q.3", "q.5"])


def two_legs(called):
    t = np.repeat(np.arange(200) / 100.0, 2)
    leg = np.tile(["front", "rear"], 200)
    q = np.where(leg == "front", np.sin(3 * t), 2.0 + np.cos(3 * t))
    return pd.DataFrame({"time_s": t, called: leg, "torque_nm": 0.1 * q, "angle_rad": q}), q


def test_rows_of_two_legs_are_told_apart_or_refused_and_never_mixed(tmp_path):
    table, q = two_legs("leg")
    table.to_csv(tmp_path / "legs.csv", index=False)
    log = load_log(tmp_path / "legs.csv", time="time_s", drive="torque_nm.rear", position="angle_rad.rear")
    np.testing.assert_allclose(log.y, q[1::2], atol=1e-6)
    table, _ = two_legs("whose")
    table.to_csv(tmp_path / "whose.csv", index=False)
    with pytest.raises(LogError, match="2 rows share each time stamp"):
        load_log(tmp_path / "whose.csv", time="time_s", drive="torque_nm", position="angle_rad")


def test_measurements_are_no_motors():
    source = table(t=np.arange(4.0), axis=[0.1, 0.2, 0.3, 0.4])
    assert by_motor(source) is source
    assert by_signal(source) is source


def test_a_long_table_gives_each_signal_its_own_times():
    time, names = np.arange(3.0 * N) / 10, np.tile(["q", "i", "q"], N)
    signals = by_signal(table(time_s=time, name=names, value=np.arange(3.0 * N)))
    assert signals.names == ["i", "q"]
    assert signals.clocked
    for name, column in signals.fetch(["q", "i"]).items():
        np.testing.assert_allclose(column.values, 10 * time[names == name])
        np.testing.assert_allclose(np.diff(column.stamps), np.diff(time[names == name]))


def test_a_folder_is_a_column_for_each_file(tmp_path):
    for name, scale in (("q_deg", 2.0), ("i_mA", 3.0)):
        lines = [f"{t / 10},{scale * t}" for t in range(N)]
        (tmp_path / f"{name}.csv").write_text("\n".join(["time_s,value", *lines, ""]))
    source = open_folder(tmp_path, open_text)
    assert source.names == ["i_mA", "q_deg"]
    assert source.units["q_deg"] == "deg"
    np.testing.assert_allclose(source.fetch(["q_deg", "i_mA"])["i_mA"].values, 3.0 * np.arange(N))


def test_a_folder_without_tables_and_one_with_some_times_only_are_refused(tmp_path):
    with pytest.raises(LogError, match="folder without text tables"):
        open_folder(tmp_path, open_text)
    (tmp_path / "q.csv").write_text("time_s,q\n" + "".join(f"{i},{i}\n" for i in range(N)))
    (tmp_path / "i.csv").write_text("i\n" + "".join(f"{i}\n" for i in range(N)))
    with pytest.raises(LogError, match="differ in their time"):
        open_folder(tmp_path, open_text)


# rows of readings as in InfluxDB's annotated CSV

HEAD = (
    "#group,false,false,true,true,false,false,true,true,true\n"
    "#datatype,string,long,dateTime:RFC3339,dateTime:RFC3339,dateTime:RFC3339Nano,double,string,string,string\n"
    "#default,_result,,,,,,,,\n,result,table,_start,_stop,_time,_value,_field,_measurement,axis\n"
)


def series(number, field, values, axis="x"):
    """A table of the answer to a query; its group key holds the field and the tags."""
    span = "2026-03-01T09:00:00Z,2026-03-01T11:00:00Z"
    return "".join(
        f",,{number},{span},2026-03-01T10:00:{0.01 * i:09.6f}Z,{v},{field},servo,{axis}\n" for i, v in enumerate(values)
    )


@pytest.fixture
def signals():
    rng = np.random.default_rng(0)
    return rng.normal(size=300).round(6), np.cumsum(rng.normal(size=300)).round(6)


def test_the_same_field_of_two_axes_is_two_signals(tmp_path, signals):
    u, y = signals
    tables = [series(0, "torque_nm", u), series(1, "position_rad", y)]
    tables += [series(2, "torque_nm", -u, "yaw"), series(3, "position_rad", 2 * y, "yaw")]
    (tmp_path / "a.csv").write_text(HEAD + "".join(tables))
    log = load_log(tmp_path / "a.csv", drive="torque_nm.yaw", position="position_rad.yaw")
    np.testing.assert_allclose(log.X[:, 0], -u)
    np.testing.assert_allclose(log.y, 2 * y)
    assert (log.units["drive"], log.sample_rate) == ("Nm", pytest.approx(100.0))
    with pytest.raises(ColumnError, match=r"several columns 'torque_nm' for drive: torque_nm.x, torque_nm.yaw"):
        load_log(tmp_path / "a.csv", drive="torque_nm", position="position_rad.x")


@pytest.mark.parametrize("state_first", [True, False])
def test_a_field_of_words_beside_fields_of_numbers_changes_nothing(tmp_path, signals, state_first):
    u, y = signals
    state = HEAD.replace("double", "string") + series(2, "state", ["RUNNING"] * 20)
    numbers = HEAD + series(0, "torque_nm", u) + series(1, "position_rad", y)
    (tmp_path / "a.csv").write_text("\n".join([state, numbers] if state_first else [numbers, state]))
    log = load_log(tmp_path / "a.csv", drive="torque_nm", position="position_rad")
    np.testing.assert_allclose(log.X[:, 0], u)
    np.testing.assert_allclose(log.y, y)


def test_a_time_column_that_became_the_stamps_of_each_signal_need_not_be_named(tmp_path, signals):
    (tmp_path / "a.csv").write_text(HEAD + series(0, "torque_nm", signals[0]) + series(1, "position_rad", signals[1]))
    with pytest.raises(ColumnError, match="its own time stamps; leave --time out"):
        open_source(tmp_path / "a.csv").resolve("_time", "time")


def test_seconds_and_nanoseconds_are_one_time(tmp_path):
    time = 1_700_000_000_000_000_000 + 5_000_000 * np.arange(400)
    position = np.sin(np.arange(400) / 20)
    rows = [f"{t // 10**9},{t % 10**9},{i},{q}" for i, (t, q) in enumerate(zip(time.tolist(), position, strict=True))]
    (tmp_path / "a.csv").write_text("\n".join([".header.stamp.secs,.header.stamp.nsecs,effort,position", *rows]))
    log = load_log(tmp_path / "a.csv", time=".header.stamp.secs", drive="effort", position="position")
    assert log.sample_rate == pytest.approx(200.0)
    assert open_source(tmp_path / "a.csv").names == [".header.stamp.secs", "effort", "position"]
    for names in ("timestampSec,timestampNanosec", "tv_sec,tv_nsec"):
        (tmp_path / "a.csv").write_text("\n".join([f"{names},effort,position", *rows]))
        assert load_log(tmp_path / "a.csv", time=0, drive="effort", position=2).sample_rate == pytest.approx(200.0)
    stamps = [{"header": {"stamp": {"sec": t // 10**9, "nanosec": t % 10**9}}, "effort": 0.1, "q": t} for t in time[:9]]
    (tmp_path / "a.json").write_text(json.dumps(stamps, default=int))  # of any format
    assert open_source(tmp_path / "a.json").names == ["header.stamp.sec", "effort", "q"]
    timeval = with_nanoseconds(table(tv_sec=[7, 8], tv_usec=[500_000, 0]))
    assert timeval.fetch(["tv_sec"])["tv_sec"].values.tolist() == [7_500_000_000, 8_000_000_000]
    alone = table(**{"a.sec": [0, 1, 2], "b.nanosec": [0, 0, 0]})
    assert with_nanoseconds(alone) is alone  # of two messages
    (tmp_path / "hole.csv").write_text("\n".join(["sec,nanosec,effort,position", *rows[:200], ",,,", *rows[200:]]))
    with pytest.warns(LogWarning, match="Column 'sec' has no value at row 200"):
        log = load_log(tmp_path / "hole.csv", time="sec", drive="effort", position="position")
    assert (log.y.size, log.sample_rate) == (400, pytest.approx(200.0))


def test_times_of_the_day_are_completed_by_the_milliseconds_beside_them(tmp_path):
    rows = [0, 1, 2, 5, 6, 7, 8, 9]  # two samples were lost, so spreading the rows evenly would be wrong
    lines = [f"10:00:0{(990 + 10 * k) // 1000};{(990 + 10 * k) % 1000};{k % 3};{k * k}" for k in rows]
    (tmp_path / "plc.csv").write_text("\n".join(["Time;ms;Torque [Nm];Angle [deg]", *lines, ""]))
    with pytest.warns(LogWarning, match="about 2 samples"):
        log = load_log(tmp_path / "plc.csv")
    np.testing.assert_allclose(log.time, np.arange(10) / 100, atol=1e-9)
    np.testing.assert_allclose(log.y, np.arange(10.0) ** 2, atol=1e-6)


@pytest.mark.parametrize("time", [["0.1", "0.2"], ["10:00:00.1", "10:00:00.2"], ["10:00:00", "10:00:01"]])
def test_milliseconds_beside_a_full_clock_are_a_signal_of_their_own(time):
    source = table(time=time, ms=[5.0, 1005.0], q=[0.0, 1.0])
    assert with_milliseconds(source) is source
