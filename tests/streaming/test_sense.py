"""What a stream of an axis says of numbers that none has, and of an alarm that is not ready."""

from __future__ import annotations

import re

import numpy as np
import pytest

from tests.streaming.moving_axis import RATE, axis, streamed


@pytest.mark.parametrize(
    ("sign", "moves", "cause", "said"),
    [(-1.0, 1.0, "negative_inertia", "change the sign of one"), (0.0, 1.0, "no_drive", "the drive is zero in all rows"),
     (1.0, 0.0, "", "the axis has not moved yet")],
)  # fmt: skip
def test_numbers_that_no_axis_has_are_told_once(sign, moves, cause, said):
    t, q, u, _ = axis(3000)
    monitor, told = streamed(np.column_stack([t, moves * q, sign * u]))
    alarms = [r for r in told if r["kind"] == "alarm"]
    assert [r["cause"] for r in alarms] == [cause] * bool(cause)
    assert all(said in r["reason"] for r in alarms)
    assert [said in end for end in monitor.at_the_end()] == [True] * (not cause)
    early, _ = streamed(np.column_stack([t, moves * q, sign * u])[:700])  # none of its rows was due an estimate
    assert [said in end for end in early.at_the_end()] == [True]
    sound, none = streamed(np.column_stack([t, q, u]))
    assert not sound.at_the_end()
    sound.carried.senseless = cause  # at an estimate before the last rows
    assert not sound.at_the_end()
    assert not [r for r in none if r["kind"] == "alarm"]


def test_noise_for_a_position_is_no_axis_that_has_not_moved():
    """As where drive and position are exchanged: it moves in every row."""
    t, q, _, _ = axis(3000)
    monitor, _ = streamed(np.column_stack([t, np.random.default_rng(1).normal(size=3000), q]))
    [said] = monitor.at_the_end()
    assert "the position stops or turns in every average, as noise does" in said


def test_until_the_alarm_watches_it_is_said_how_much_is_lacking():
    t, q, u, _ = axis(2000)
    monitor, _ = streamed(np.column_stack([t, q, u]))
    [alarm] = monitor.alarms
    assert not alarm.watching_
    assert alarm.lacking_ < alarm.n_settle + alarm.n_reference // 2
    assert monitor.lacking() == f"no change can be told before {alarm.lacking_} more averages over motion"
    alarm.update(np.random.default_rng(0).normal(size=alarm.lacking_))
    assert alarm.watching_
    assert monitor.lacking() == ""


@pytest.mark.parametrize("at", [3.0, 7.0, 13.0])
def test_a_change_while_the_normal_is_learnt_is_followed_and_told_in_full(at):
    """The alarm is blind until then, so the drift tells it: the numbers had kept a mean of both, up to 3 % off."""
    t, q, u, _ = axis(25000)
    u[t > at] *= 1.25
    monitor, told = streamed(np.column_stack([t, q, u]))
    assert monitor.model.parameters_["inertia"] == pytest.approx(1.25 * 0.02, rel=0.005)
    *_, last = [r for r in told if r["kind"] == "change"]
    assert last["alarm_row"] > at * RATE
    [inertia] = [c for c in last["changes"] if c.startswith("inertia rose")]
    assert float(re.search(r" to ([\d.e-]+)", inertia)[1]) == pytest.approx(1.25 * 0.02, rel=0.01)
    none = streamed(np.column_stack(axis(25000, seed=1)[:3]))[1]
    assert not [r for r in none if r["kind"] == "change"]
