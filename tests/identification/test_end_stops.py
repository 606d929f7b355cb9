"""Contact with the ends of the travel."""

from __future__ import annotations

import numpy as np
import pytest

from tests.identification.test_stopped_axis import BOTH, UPPER, driven
from whsklearn.identification.drive_lead import moved, skew
from whsklearn.identification.end_stops import contacts, struck, struck_before
from whsklearn.identification.view import view


def test_events_in_the_middle_of_the_travel_or_to_both_sides_are_no_stop():
    rng = np.random.default_rng(0)
    q, x = np.sin(np.arange(2000) / 60.0), rng.standard_normal((2000, 3))
    y = x @ [1.0, 2.0, 3.0] + 0.01 * rng.standard_normal(2000)
    assert [r.side for r in struck(x, y + np.where(q > 0.9, 5.0, 0.0), q)] == [1]
    assert [r.side for r in struck(x, y + np.where(np.abs(q) > 0.9, 5.0 * np.sign(q), 0.0), q)] == [1, -1]
    assert struck(x, y, q) == []
    assert struck(x, y + np.where(np.abs(q) < 0.1, 5.0, 0.0), q) == []
    assert struck(x, y - np.where(q > 0.9, 5.0, 0.0), q) == []  # it would pull


@pytest.mark.parametrize("stop", [UPPER, BOTH], ids=["upper", "both"])
def test_all_of_the_contact_is_left_out_and_little_else(stop):
    record = view(*driven(stop), 0.002, "position")
    found = contacts(record, hangs=False)
    inside = (record.y > stop.ends[0]) & (record.y < stop.ends[1])
    between = found.between(record)
    assert between.y.min() > stop.ends[0] - 1e-6
    assert between.y.max() < stop.ends[1] + 1e-6
    assert between.y.size > 0.9 * inside.sum()


def test_an_end_that_is_hardly_struck_is_found_once_the_one_that_is_struck_often_is_left_out():
    u, y = driven(BOTH)
    begun = int(np.argmax(y < BOTH.ends[0])) + 10
    assert sorted(contacts(view(u[:begun], y[:begun], 0.002, "position"), hangs=False).ends) == [-1, 1]


@pytest.mark.parametrize("lead", [0, 4, -3])
def test_the_age_of_the_drive_is_that_of_the_motion_between_the_stops(lead):
    """Of the whole record it was found up to 50 ms late."""
    record = view(*driven(BOTH), 0.002, "position")
    assert skew(moved(record, -lead)) == lead


def test_an_end_that_is_struck_first_in_the_held_out_part_is_fitted_if_enough_is_left():
    record = view(*driven(BOTH), 0.002, "position")
    first = int(np.argmax(record.y < BOTH.ends[0]))  # the other end is struck before
    last = first + int(np.argmax(record.y[first:] > BOTH.ends[0]))
    assert last < struck_before(record, first - 5) < last + 100
    assert struck_before(record, last + 200) == last + 200
    assert struck_before(record.part(0, last + 20), first - 5) == first - 5
