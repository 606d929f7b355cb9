"""Columns that name themselves are found, and doubtful ones are asked for."""

from __future__ import annotations

import pytest

from whsklearn.logs.errors import ColumnError
from whsklearn.logs.roles import by_number, guess
from whsklearn.logs.source import Source


def source(*names):
    return Source("axis.csv", list(names), lambda wanted: {})


def test_usual_names_in_two_languages_and_two_spellings():
    s = source("timestamp", "goal_position", "position", "motorCurrent", "speed")
    assert [guess(s, r) for r in ("time", "position", "drive", "reference")] == [
        "timestamp", "position", "motorCurrent", "goal_position"
    ]  # fmt: skip
    german = source("Zeit [s]", "Drehmoment [Nm]", "Winkel [deg]")
    assert [guess(german, r) for r in ("time", "drive", "position")] == german.names


def test_two_of_a_kind_are_asked_for_and_none_is_none():
    with pytest.raises(ColumnError, match="several columns for position: position_1, position_2; name one"):
        guess(source("t", "position_1", "position_2"), "position")
    assert guess(source("a", "b"), "drive") is None


def test_columns_by_number_want_two_to_four():
    assert by_number("0,1,2,3")["reference"] == "3"
    with pytest.raises(ValueError, match="expected two"):
        by_number("1")
