"""Stamps of a stream: one wrong one, a restart, rows sent again, a pause, rows out of order."""

from __future__ import annotations

import pytest

from whsklearn.streaming.clock import Clock


def verdicts(times, values=None):
    clock, found = Clock(), []
    for line, now in enumerate(times):
        value = line if values is None else values[line]
        found += [(v.what, v.line) for v in clock.take(line, [now, float(value)])]
    return found


def lines_of(found, what):
    return [line for kind, line in found if kind == what]


@pytest.mark.parametrize("stamp", [1e9, 30.0, -1e9, 0.0, 3.5])
def test_one_wrong_stamp_is_one_bad_row(stamp):
    times = [float(i) for i in range(20)]
    times[8] = stamp
    found = verdicts(times)
    assert lines_of(found, "bad") == [8]
    assert lines_of(found, "row") == [i for i in range(20) if i != 8]


def test_a_clock_that_restarts_begins_a_new_experiment_and_loses_no_row():
    found = verdicts([float(i) for i in range(20)] + [float(i) for i in range(15)])
    assert lines_of(found, "row") == list(range(35))
    assert lines_of(found, "restart") == [20]
    assert lines_of(found, "bad") == []


@pytest.mark.parametrize("again", [range(20), range(12, 20), range(19, 20)])
def test_rows_sent_again_are_passed_over(again):
    order = [*range(20), *again, *range(20, 25)]
    found = verdicts([float(i) for i in order], order)
    assert lines_of(found, "row") == [*range(20), *range(20 + len(again), 25 + len(again))]
    assert len(lines_of(found, "repeated")) == len(again)


def test_a_pause_is_told_once():
    """A clock that goes on in ms: one pause is told, and then its step is the usual one."""
    clock = Clock()
    times = [*(0.002 * i for i in range(30)), *(2.0 * i for i in range(30, 60))]
    told = [v for line, now in enumerate(times) for v in clock.take(line, [now]) if v.reason]
    assert [(v.what, v.line) for v in told[:1]] == [("row", 30)]
    assert told[0].reason == "time 60 follows 0.058, a pause of 3e+04 usual steps"
    assert len(told) <= 5  # until the median of nine steps is the new one


def test_a_pause_is_no_fault_and_rows_out_of_order_are_put_right():
    found = verdicts([*map(float, range(10)), *map(float, range(500, 510))])
    assert [kind for kind, _ in found] == ["row"] * 20
    assert lines_of(verdicts([0.0, 1.0, 2.0, 3.0, 4.0, 6.0, 5.0, 7.0, 8.0]), "row") == [0, 1, 2, 3, 4, 6, 5, 7, 8]


@pytest.mark.parametrize("step", [1.25, 1.5, 2.5])
def test_rows_stamped_in_whole_ticks_do_not_pause(step):
    clock = Clock()
    told = [v for k in range(200) for v in clock.take(k, [float(round(step * k)), float(k)])]
    assert [v.line for v in told] == list(range(200))
    assert [v.line for v in told if v.reason][1:] == []  # the first long step may be one
