"""Rows on either side of an alarm are compared once there are as many after as before, whatever the chunks."""

from __future__ import annotations

import threading

import numpy as np
import pytest

from whsklearn.streaming.sides import MOST_ROWS, Sides


def ran(chunk, n=1000, alarms=(601,), margin=50, stop=None, verdict="nothing"):
    """Records of a stream of ``n`` rows in chunks; at row ``stop`` its state goes to another object."""
    told = []

    def compare(before, after):
        return {"verdict": verdict, "sentence": repr([x[1][[0, -1], 0].tolist() for x in (before, after)])}

    sides = Sides(compare, margin)
    for at in range(0, n, chunk):
        rows = np.arange(at + 1.0, min(at + chunk, n) + 1.0)[:, None]
        sides.take(np.zeros(len(rows)), rows)
        for row in alarms:
            if at < row <= at + chunk:
                sides.alarm(row)
        if stop is not None and at <= stop < at + chunk:
            state, sides = sides.get_state(), Sides(compare, margin)
            sides.set_state(state)
        told += sides.done(wait=10.0)
    return told


@pytest.mark.parametrize(("chunk", "stop"), [(1, None), (100, None), (100, 400), (100, 700)])
def test_as_many_rows_after_as_before_whatever_the_chunks(chunk, stop):
    (told,) = ran(chunk, n=1300, stop=stop)
    assert told["before_rows"] == [1, 550]
    assert told["after_rows"] == [601, 1150]
    assert told["row"] == 1150
    assert told["sentence"] == "[[1.0, 550.0], [601.0, 1150.0]]"


def test_an_alarm_soon_after_another_begins_the_second_side_anew():
    (told,) = ran(10, n=2000, alarms=(601, 631))
    assert (told["alarm_row"], told["before_rows"], told["after_rows"]) == (631, [1, 550], [631, 1180])


@pytest.mark.parametrize(("verdict", "begins"), [("nothing", 1), ("moved", 601)])
def test_a_later_alarm_ends_the_second_side_and_a_change_that_was_found_begins_the_next(verdict, begins):
    first, second = ran(100, n=3000, alarms=(601, 901), verdict=verdict)
    assert (first["before_rows"], first["after_rows"]) == ([1, 550], [601, 900])
    assert (second["before_rows"], second["after_rows"]) == ([begins, 850], [901, 1750])


def test_what_is_kept_is_bounded():
    (told,) = ran(1000, n=3 * MOST_ROWS, alarms=(MOST_ROWS + 10_001,))
    assert told["before_rows"] == [10_001 - 50, MOST_ROWS + 10_000 - 50]
    assert told["after_rows"][1] == 2 * MOST_ROWS + 10_000


def test_rows_do_not_wait_for_a_comparison():
    gate = threading.Event()
    sides = Sides(lambda before, after: {"sentence": str(gate.wait(60.0))}, 0)
    sides.take(np.zeros(100), np.zeros((100, 2)))
    sides.alarm(51)
    sides.take(np.zeros(100), np.zeros((100, 2)))  # returns while the comparison waits
    assert sides.done() == []
    gate.set()
    assert sides.done(wait=60.0)[0]["sentence"] == "True"


def test_a_comparison_that_fails_says_why_and_the_stream_goes_on():
    def compare(before, after):
        raise ValueError("No motion.")

    sides = Sides(compare, 0)
    sides.take(np.zeros(100), np.zeros((100, 2)))
    sides.alarm(51)
    sides.take(np.zeros(100), np.zeros((100, 2)))
    (told,) = sides.done(wait=60.0)
    assert (told["verdict"], told["sentence"]) == ("cannot_tell", "It cannot be said what changed. No motion.")


def test_at_the_end_the_rows_so_far_are_compared_and_nothing_is_taken():
    sides = Sides(lambda before, after: {"sentence": f"{len(before[1])} and {len(after[1])}"}, 10)
    sides.take(np.zeros(300), np.zeros((300, 2)))
    assert sides.so_far(20) == ""
    sides.alarm(201)
    assert sides.so_far(200) == ""
    assert sides.so_far(20) == "190 and 100"
    sides.take(np.zeros(90), np.zeros((90, 2)))
    assert sides.done(wait=60.0)[0]["sentence"] == "190 and 190"
