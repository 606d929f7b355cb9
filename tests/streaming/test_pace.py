"""Rows of a stream that come at another rate, and one of them that does not come at all."""

from __future__ import annotations

import numpy as np
import pytest

from tests.streaming.test_freeze import RATE, axis, streamed
from whsklearn.streaming.pace import ROWS, Pace

TRUE = [0.02, 0.05, 0.3]


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
