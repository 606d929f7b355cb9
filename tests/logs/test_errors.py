"""What is raised tells the log from the call."""

from __future__ import annotations

import pytest

from whsklearn.logs import ColumnError, LogError, LogWarning, load_log


def test_a_log_that_cannot_be_used_is_bad_input():
    assert issubclass(LogError, ValueError)
    assert issubclass(LogWarning, UserWarning)


def test_a_wrong_column_is_told_from_a_wrong_log(tmp_path):
    path = tmp_path / "axis.csv"
    path.write_text("time_s,torque_nm,position_rad\n" + "".join(f"{k / 100},{k % 7},{k % 5}\n" for k in range(200)))
    with pytest.raises(ColumnError, match="torque_nm"):  # it says what columns there are
        load_log(path, time="time_s", drive="moment", position="position_rad")
    empty = tmp_path / "empty.csv"
    empty.write_text("")
    with pytest.raises(LogError, match="empty"):
        load_log(empty, drive="torque_nm", position="position_rad")
