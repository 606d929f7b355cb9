"""Readings of the position that no motion can have made."""

from __future__ import annotations

import numpy as np
import pytest

from tests.streaming.test_freeze import RATE, axis, streamed
from whsklearn.streaming.jumps import Jumps

TRUE = [0.02, 0.05, 0.3]


def passed(path):
    """Numbers of the rows that go on, and those that are told."""
    jumps = Jumps()
    out = [one for k, q in enumerate(path) for one in jumps.take([k, [q, 0.0]], 0, 1)]
    return [one.row[0] for one in out], [one.row[0] for one in out if one.told], jumps


@pytest.mark.parametrize(("wrong", "speed"), [(65535.0, "full speed"), (-0.5, "a reversal")])
def test_one_wrong_reading_is_told_and_changes_no_estimate(wrong, speed):
    t, q, u, v = axis(6000)
    fast = np.abs(v[4000:4500])
    at = 4000 + int(np.argmax(fast) if speed == "full speed" else np.argmin(fast))
    q[at] = wrong
    monitor, told = streamed(np.column_stack([t, q, u]))
    [alarm] = [r for r in told if r["kind"] == "alarm"]
    assert (alarm["cause"], alarm["line"]) == ("jump", at + 1)
    assert list(monitor.model.theta_[:3]) == pytest.approx(TRUE, rel=0.03)
    assert monitor.carried.experiment == 0


@pytest.mark.parametrize("also", ["", "position"])
def test_one_wrong_reading_of_the_drive_is_told_and_changes_no_estimate(also):
    t, q, u, _ = axis(6000)
    sound, none = streamed(np.column_stack([t, q, u]))
    u[4000] = 1e9
    q[4000] += 50.0 if also else 0.0
    monitor, told = streamed(np.column_stack([t, q, u]))
    [alarm] = [r for r in told if r["kind"] == "alarm"]
    assert (alarm["cause"], alarm["line"]) == ("jump", 4001)
    assert "the drive is 1e+09 in one row" in alarm["reason"]
    assert not [r for r in none if r["kind"] == "alarm"]
    np.testing.assert_allclose(monitor.model.theta_[:3], sound.model.theta_[:3], rtol=1e-4)


def test_a_drive_that_moves_the_axis_is_learnt_however_large_it_is():
    t, q, u, _ = axis(6000)
    u[4000] += 60.0  # for one sample: 60 / 0.02 / 500 rad/s from there on, which friction takes away unseen here
    q[4001:] += 60.0 / 0.02 / RATE * (t[4001:] - t[4000])
    _, told = streamed(np.column_stack([t, q, u]))
    assert "drive" not in "".join(r["reason"] for r in told if r["kind"] == "alarm")


def test_an_encoder_that_is_reset_begins_a_new_experiment():
    t, q, u, _ = axis(6000)
    q[4000:] -= 0.7
    monitor, told = streamed(np.column_stack([t, q, u]))
    [alarm] = [r for r in told if r["kind"] == "alarm"]
    assert "jumps by -0.7 and goes on as before" in alarm["reason"]
    assert monitor.carried.experiment == 1
    assert list(monitor.model.theta_[:3]) == pytest.approx(TRUE, rel=0.03)


def test_no_cutting_and_no_restart_changes_what_is_told():
    t, q, u, _ = axis(3000)
    q[1000], q[2000:] = 5.0, q[2000:] + 1.0
    table = np.column_stack([t, q, u])
    (one, first), (other, again) = (streamed(table, cut) for cut in (3000, 7))
    assert first == again
    np.testing.assert_array_equal(one.model.theta_, other.model.theta_)
    before, early = streamed(table[:1002])  # two rows after the wrong one it waits
    rest, late = streamed(table[:1])
    rest.set_state(before.get_state())
    late.clear()
    rest.take(table[1002:], first=1003)
    assert early + late == first
    np.testing.assert_array_equal(rest.model.theta_, one.model.theta_)


def test_rows_that_wait_at_a_pause_are_learnt_as_they_are():
    t, q, u, _ = axis(3000)
    q[1499:1500] += 0.5
    t[1500:] += 1.0
    monitor, told = streamed(np.column_stack([t, q, u]))
    assert [r["cause"] for r in told if r["kind"] == "alarm"] == ["pause"]
    assert monitor.carried.rows == 3000


@pytest.mark.parametrize("step", [0.0, 1e-4, 2e-2])
@pytest.mark.parametrize("kind", ["from rest", "against a wall", "slips", "every seventh row"])
def test_a_motion_is_no_jump(kind, step):
    t = np.arange(6000) / RATE
    s = np.clip(t % 2.0, 0.0, 1.0)
    path = np.floor(t / 2.0) % 2 + np.where(np.floor(t / 2.0) % 2, -1, 1) * (10 * s**3 - 15 * s**4 + 6 * s**5)
    if kind == "against a wall":  # full speed, and none in the next sample
        path = np.minimum(np.sin(2.0 * t), 0.3)
    if kind == "slips":  # it sticks, and a slip is shorter than a sample
        path = np.cumsum(np.where(np.arange(t.size) % 40 == 0, np.sin(2.0 * t), 0.0))
    if kind == "every seventh row":
        path = path[::7]
    path = np.round(path / step) * step if step else path
    rows, told, jumps = passed(path.tolist())
    assert told == []
    assert [*rows, *(k for k, _ in jumps.end())] == list(range(path.size))


@pytest.mark.parametrize("after", [slice(600, 601), slice(600, None)])
def test_an_axis_at_rest_jumps_too(after):
    path = np.sin(np.minimum(np.arange(900) / 100.0, 1.5 * np.pi))  # at rest from row 471
    path[after] += 3.0
    rows, told, _ = passed(path.tolist())
    assert told == [600]
    assert rows == list(range(900))
