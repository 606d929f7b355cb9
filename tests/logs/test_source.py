"""Columns of a source by name, by number, and refused with what there is."""

from __future__ import annotations

import pytest

from whsklearn.logs import ColumnError
from whsklearn.logs.source import Source


def source(names, header=True):
    return Source("axis.csv", list(names), lambda wanted: {}, header=header)


@pytest.mark.parametrize(
    ("wanted", "found"), [("Time [s]", "Time [s]"), ("time [S] ", "Time [s]"), (1, "u"), ("2", "U"), ("u", "u")]
)
def test_a_name_is_taken_before_its_lower_case_and_that_before_a_number(wanted, found):
    assert source(["Time [s]", "u", "U", "y"]).resolve(wanted, "drive") == found


def test_a_column_that_is_named_by_a_number_is_that_column():
    assert (
        source(["time", "u", "y"]).resolve("%time", "time") == "time"
    )  # of rostopic, whose comment sign is not a name
    assert source(["7", "0", "y"]).resolve("0", "drive") == "0"  # and not the first


@pytest.mark.parametrize("wanted", ["Y", "torque", "9", "-1"])
def test_what_is_not_there_or_twice_is_refused_with_the_names_that_are(wanted):
    with pytest.raises(ColumnError, match=rf"no column '{wanted}' for drive; it has: y, y , u"):
        source(["y", "y ", "u"]).resolve(wanted, "drive")


def test_long_lists_are_cut_and_a_file_without_a_header_asks_for_numbers():
    with pytest.raises(ColumnError, match=r"c29 and 10 more\."):
        source([f"c{i}" for i in range(40)]).resolve("torque", "drive")
    with pytest.raises(ColumnError, match="by number from 0 to 2, such as --columns 0,1,2"):
        source(["0", "1", "2"], header=False).resolve("torque", "drive")
