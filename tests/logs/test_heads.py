"""The head of a table."""

from __future__ import annotations

import pytest

from whsklearn.logs.heads import commented, headings, period_in, ticks_in, unique


def test_names_units_and_types_may_stand_in_any_rows_above_the_data():
    for rows in (
        [["t", "q"], ["s", "deg"]],
        [["title", ""], ["t", "q"], ["s", "deg"]],
        [["t", "q"], ["double", "double"], ["s", "deg"]],
        [["s", "deg"], ["t", "q"]],
    ):
        head = headings(rows, 2)
        assert head is not None
        assert (head.names, head.units) == (["t", "q"], ["s", "deg"])


def test_one_row_of_names_has_no_units_and_rows_of_another_width_are_no_head():
    assert headings([["t", "q"]], 2) == (["t", "q"], None, None)
    assert headings([["a", "b", "c"]], 2) is None


def test_a_time_column_for_every_channel_is_its_clock():
    head = headings([["time", "q", "time", "i"]], 4)
    assert head is not None
    assert head.clocks == [0, 0, 2, 2]
    assert len(set(head.names or ())) == 4


def test_blank_and_double_names_are_made_distinct():
    assert unique(["q", "", "q"]) == ["q", "column 1", "q.2"]


def test_names_in_a_comment_are_those_that_are_as_many_as_the_columns():
    lines = ["# rig 7, second run", "# t, q, i", "% nothing"]
    assert commented(lines, 3).names == ["t", "q", "i"]
    assert commented(lines, 5).names is None
    assert commented([*lines, "# s deg A"], 3)[:2] == (["t", "q", "i"], ["s", "deg", "A"])  # the units had been names


@pytest.mark.parametrize(
    ("line", "seconds"),
    [("Sampling time; 2 ms", 2e-3), ("# sample rate = 500 Hz", 2e-3), ("Rate: 3", None), ("fs, 500 Hz, 1000 Hz", None)],
)
def test_a_period_is_taken_with_its_unit_and_not_guessed(line, seconds):
    assert period_in([line]) == (seconds if seconds is None else pytest.approx(seconds))


def test_ticks_are_counted_where_something_says_so():
    assert ticks_in(["% time in ticks of 20 kHz"], ["time", "q"]) == (0, 20_000.0)
    assert ticks_in(["% 20 kHz"], ["time_s", "q"]) is None
