"""Signals in several files, or in rows that say whose they are."""

from __future__ import annotations

import numpy as np
import pytest

from whsklearn.logs.errors import ColumnError, LogError
from whsklearn.logs.parts import by_motor, by_signal, open_folder
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
