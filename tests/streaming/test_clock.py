"""Stamps of a stream: one wrong one, a restart, rows sent again, a pause, rows out of order, another rate."""

from __future__ import annotations

import numpy as np
import pytest

from tests.streaming.moving_axis import RATE, TRUE, axis, streamed
from whsklearn.streaming.clock import ROWS, Clock, Pace


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


# --- rows that are lost, or come at another rate ----------------------------------------------------------------------
def alarms(told):
    return [r for r in told if r["kind"] == "alarm"]


@pytest.mark.parametrize("how", ["lost", "unreadable"])
def test_rows_that_are_missing_alone_change_no_estimate_of_an_axis(how):
    t, q, u, _ = axis(12000)
    table = np.column_stack([t, q, u])
    gone = np.arange(50, 11000, 67)
    if how == "unreadable":
        table[gone, 2] = np.nan
    else:
        table = np.delete(table, gone, axis=0)
    monitor, told = streamed(table)
    assert list(monitor.model.theta_[:3]) == pytest.approx(TRUE, rel=0.02)
    assert monitor.carried.experiment == 0
    assert monitor.carried.rows > 12000 - 0.1 * gone.size  # where the axis hardly moves a loss cannot be told
    assert {r["cause"] for r in alarms(told)} <= {"pause"}


def test_a_row_whose_stamp_alone_is_late_is_not_one_behind_a_lost_row():
    t, q, u, _ = axis(6000)
    t[50::67] += 0.9 / RATE
    monitor, told = streamed(np.column_stack([t, q, u]))
    assert "taken as neighbours" in alarms(told)[0]["reason"]
    assert monitor.carried.rows < 6000 + 10
    assert list(monitor.model.theta_[:3]) == pytest.approx(TRUE, rel=0.02)


@pytest.mark.parametrize("rate", [4 * RATE, RATE / 4])
def test_rows_at_another_rate_are_told_and_not_learnt(rate):
    t, q, u, _ = axis(8000)
    table = np.column_stack([t, q, u])
    first, then = (table[:4000:4], table[4000:]) if rate > RATE else (table[:4000], table[4000::4])
    table = np.concatenate([first, then])
    table[:, 0] *= 4 if rate > RATE else 1  # the first rows come at RATE
    (monitor, told), (_, again) = (streamed(table, cut) for cut in (1000, 7))
    assert told == again
    assert [r["cause"] for r in alarms(told)].count("rate") == 1
    assert monitor.carried.rows <= len(first) + 2 * ROWS
    assert monitor.carried.rows + monitor.carried.bad == len(table)


@pytest.mark.parametrize("stamps", ["whole ms", "25 rows at once", "every tenth row lost", "jitter"])
def test_rows_at_their_rate_are_in_pace_however_their_stamps_are(stamps):
    rng = np.random.default_rng(3)
    t = np.arange(4000) / 600.0
    if stamps == "whole ms":
        t = np.round(t, 3)
    if stamps == "25 rows at once":
        t = np.floor(t * 24.0) / 24.0 + 1e-5 * (np.arange(4000) % 25)
    if stamps == "every tenth row lost":
        t = t[rng.random(4000) > 0.05]
    if stamps == "jitter":
        t = t + rng.uniform(0.0, 0.9 / 600.0, 4000)
    pace = Pace()
    assert not any(pace.take(step, 1.0 / 600.0) for step in np.diff(t))
