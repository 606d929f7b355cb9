"""Readings of a stream that no axis can have made: wrapped, wrong, repeated, or beyond all others."""

from __future__ import annotations

import numpy as np
import pytest

from tests.streaming.moving_axis import RATE, TRUE, axis, monitor_of, streamed
from whsklearn import InverseDynamicsLags, RLSRegressor
from whsklearn.change import ChangeAlarm
from whsklearn.logs.mend import turns_of
from whsklearn.streaming import Options, StreamMonitor
from whsklearn.streaming.monitor import alarm_of_averages
from whsklearn.streaming.readings import MOST_WAITING, Freeze, Jumps, Turns


# --- positions that are wrapped ---------------------------------------------------------------------------------------
def wrapping(path, t, u, unit, cut=1000):
    told = []
    options = Options(timed=True, max_step=2.5 / RATE, positions=(1,), turns=(tuple(turns_of(unit)),))
    lags = InverseDynamicsLags(RATE, causal=True)
    monitor = StreamMonitor(RLSRegressor(lags), alarm_of_averages(), options, told.append)
    table = np.column_stack([t, path, u])
    for k in range(0, len(table), cut):
        monitor.take(table[k : k + cut], first=k + 1)
    return monitor, [r for r in told if r["kind"] == "alarm"]


@pytest.mark.parametrize(
    ("unit", "turn", "origin"),
    [("deg", 360.0, 0.0), ("deg", 360.0, 200.0), ("counts", 65536.0, 3.0), ("rad", 2 * np.pi, 1.0)],
)
def test_a_wrapped_axis_is_learnt_as_one_that_counts_its_turns(unit, turn, origin):
    t, q, u, _ = axis(3000)
    path = (q - q[0]) * turn / 0.9 + origin  # it begins beside the wrap, or away from it, and passes it again and again
    path = np.round(path) if unit == "counts" else path
    whole, none = wrapping(path, t, u, "m")
    wrapped, [told] = wrapping(path % turn, t, u, unit)
    assert not none
    assert told["cause"] == "wrap"
    assert wrapped.carried.experiment == 0
    np.testing.assert_allclose(wrapped.model.theta_, whole.model.theta_, rtol=1e-5)


def test_no_cutting_and_no_restart_changes_what_is_learnt_of_a_wrapped_axis():
    t, q, u, _ = axis(1500)
    path = (400.0 * q) % 360.0
    (one, first), (other, again) = (wrapping(path, t, u, "deg", cut) for cut in (1500, 7))
    assert first == again
    np.testing.assert_array_equal(one.model.theta_, other.model.theta_)
    before, _ = wrapping(path[:800], t[:800], u[:800], "deg")
    rest, _ = wrapping(path[:1], t[:1], u[:1], "deg")
    rest.set_state(before.get_state())
    rest.take(np.column_stack([t, path, u])[800:], first=801)
    np.testing.assert_array_equal(rest.model.theta_, one.model.theta_)


@pytest.mark.parametrize("unit", ["deg", "counts", "as logged"])
def test_a_motion_over_many_turns_and_a_wrong_reading_have_no_wrap(unit):
    k = np.arange(2000.0)
    fast = np.cumsum(270.0 * np.sin(np.minimum(k / 400.0, np.pi / 2)))  # up to three quarters of a turn in a row
    fast[700] = 1e6
    turns = Turns()
    assert [turns.take(q, turns_of(unit))[0] for q in np.round(fast)] == np.round(fast).tolist()


# --- one wrong reading ------------------------------------------------------------------------------------------------
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


def test_a_drive_that_rises_from_nothing_is_no_wrong_reading():
    """Before the first motion the drive is noise around zero, of which the next value may be any multiple."""
    t, q, u, _ = axis(6000)
    q[:200], u[:200] = q[200], 1e-6
    u[100:200:7] = 1e-3
    _, told = streamed(np.column_stack([t, q, u]))
    assert not [r for r in told if r["kind"] == "alarm"]


def test_an_encoder_that_is_reset_begins_a_new_experiment():
    t, q, u, _ = axis(6000)
    q[4000:] -= 0.7
    monitor, told = streamed(np.column_stack([t, q, u]))
    [alarm] = [r for r in told if r["kind"] == "alarm"]
    assert "jumps by -0.7 and goes on as before" in alarm["reason"]
    assert monitor.carried.experiment == 1
    assert list(monitor.model.theta_[:3]) == pytest.approx(TRUE, rel=0.03)


def test_no_cutting_and_no_restart_changes_what_is_told_of_jumps():
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


def test_a_new_experiment_is_told_behind_the_rows_before_it():
    """Some of them wait, because the position repeats before and behind its jump."""
    t, q, u, _ = axis(2000)
    q[1000:1060] = q[999]
    q[1060:1070] = q[999] + 9.0
    q[1070:] += 9.0
    _, told = streamed(np.column_stack([t, q, u]))
    alarm = next(r for r in told if r["kind"] == "alarm")
    assert (alarm["cause"], alarm["line"], alarm["row"]) == ("jump", 1061, 1060)


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


# --- a reading that repeats -------------------------------------------------------------------------------------------
@pytest.mark.parametrize("speed", ["full speed", "a reversal"])
def test_a_frozen_encoder_is_told_and_changes_no_estimate(speed):
    t, q, u, v = axis(20000)
    fast = np.abs(v[15000:15500])
    first = 15000 + int(np.argmax(fast) if speed == "full speed" else np.argmin(fast))
    last = first + 50 + int(np.argmax(np.abs(v[first + 50 : first + 800])))
    q[first:last] = q[first - 1]
    monitor, told = streamed(np.column_stack([t, q, u]))
    [alarm] = [r for r in told if r["kind"] == "alarm"]
    assert alarm["cause"] == "held_rows"
    assert f"repeats for {last - first} rows" in alarm["reason"]
    assert list(monitor.model.theta_[:3]) == pytest.approx([0.02, 0.05, 0.3], rel=0.02)


def test_an_axis_beyond_the_range_of_its_sensor_is_told_and_changes_no_estimate():
    """Its velocity ends and begins within a row there; such averages had taken two fifths off an inertia."""
    t, q, u, _ = axis(20000)
    monitor, told = streamed(np.column_stack([t, np.clip(q, -0.4, 0.5), u]))
    alarms = [r for r in told if r["kind"] == "alarm"]
    assert {r["cause"] for r in alarms} == {"held_rows"}
    assert all("as at an end of the range of its sensor" in r["reason"] for r in alarms)
    assert list(monitor.model.theta_[:3]) == pytest.approx([0.02, 0.05, 0.3], rel=0.02)


def test_a_frozen_encoder_of_a_slow_axis_is_told_once_it_leaps_on():
    """Some rows of a slow motion show the same count, and between two of them nothing shows that it is frozen."""
    t, q, u, v = axis(20000)
    count = 1e-2
    q = np.round(q / count) * count
    sound, none = streamed(np.column_stack([t, q, u]))
    assert max(np.abs(v[[15137, 15537]])) < count * RATE
    q[15137:15537] = q[15136]
    monitor, told = streamed(np.column_stack([t, q, u]))
    assert not [r for r in none if r["kind"] == "alarm"]
    assert [r["cause"] for r in told if r["kind"] == "alarm"] == ["held_rows"]
    np.testing.assert_allclose(monitor.model.theta_[:3], sound.model.theta_[:3], rtol=0.02)


@pytest.mark.parametrize("drive", ["goes on", "holds", "is off"])
def test_a_dead_encoder_of_a_slow_axis_is_told_by_the_drive(drive):
    t, q, u, _ = axis(20000)
    q = np.round(q / 1e-2) * 1e-2
    q[12000:] = q[11999]
    if drive != "goes on":
        u[12000:] = (0.2 if drive == "holds" else 0.0) + np.random.default_rng(1).normal(0.0, 1e-3, 8000)
    monitor, told = streamed(np.column_stack([t, q, u]))
    alarms = [r for r in told if r["kind"] == "alarm"]
    assert [r["cause"] for r in alarms] == ["held_rows"] * (drive == "goes on")
    assert all("while the drive goes on as in motion" in r["reason"] for r in alarms)
    sound, _ = streamed(np.column_stack([t, q, u])[:12000])
    np.testing.assert_allclose(monitor.model.theta_[:3], sound.model.theta_[:3], rtol=0.02)


def test_no_cutting_changes_what_is_told_of_repeated_readings():
    t, q, u, _ = axis(3000)
    q[1000:1400] = q[999]
    (one, first), (other, again) = (streamed(np.column_stack([t, q, u]), cut) for cut in (3000, 7))
    assert first == again
    np.testing.assert_array_equal(one.model.theta_, other.model.theta_)


@pytest.mark.parametrize("step", [0.0, 1e-4, 2e-3, 2e-2])
def test_an_axis_that_stops_and_goes_is_not_frozen(step):
    """It moves from place to place and stands; its encoder, of any step, repeats there."""
    t = np.arange(6000) / RATE
    s = np.clip(t % 2.0, 0.0, 1.0)
    q = np.floor(t / 2.0) % 2 + np.where(np.floor(t / 2.0) % 2, -1, 1) * (10 * s**3 - 15 * s**4 + 6 * s**5)
    q = np.round(q / step) * step if step else q
    freeze, out = Freeze(), []
    for k, place in enumerate(q.tolist()):
        passed = freeze.take([k, [place, 0.0]], 0, 1)
        assert not any(one.told for one in passed)
        out += [one.row[0] for one in passed]
    assert [*out, *(k for k, _ in freeze.end())] == list(range(t.size))


def test_a_reading_that_stays_for_good_is_told_once_unless_the_axis_was_slow():
    path = np.cumsum([*np.linspace(0.0, 0.1, 100), *[0.1] * 50, *[0.0] * 2 * MOST_WAITING])
    for count, times in ((1e-6, 1), (0.1, 0)):
        freeze = Freeze()
        taken = [one for k, q in enumerate(count * np.round(path / count)) for one in freeze.take([k, [q, 0.0]], 0, 1)]
        said = [one.told for one in taken if one.told]
        assert sum(one.anew for one in taken) == 1
        assert len(said) == times
        assert all(f"stopped within one row and repeats for {MOST_WAITING + 1} rows" in one for one in said)


def test_a_checkpoint_of_an_earlier_version_is_refused_in_one_sentence():
    state = streamed(np.column_stack(axis(3000)[:3]))[0].get_state()
    for change in ({"freeze": {"path": []}}, {"carried": state["carried"] | {"other": 1}}):
        with pytest.raises(ValueError, match="of an earlier version; begin the stream anew, with --fresh"):
            monitor_of()[0].set_state(state | change)


def test_rows_that_wait_are_bounded_and_come_out_in_order():
    freeze, out = Freeze(), []
    for k in range(MOST_WAITING + 100):
        out += [one.row[0] for one in freeze.take([k, [min(0.1 * k, 1.0), 0.0]], 0, 1)]
    assert out == list(range(MOST_WAITING + 100))


# --- one value of a chain beyond all others ---------------------------------------------------------------------------
RNG = np.random.default_rng(0)
X = RNG.normal(size=(600, 2))
ROWS = np.column_stack([X, X @ [1.0, -2.0] + 0.1 * RNG.normal(size=600)])


def learnt(rows, cut=600, **options):
    told = []
    monitor = StreamMonitor(RLSRegressor(), ChangeAlarm(), Options(**options), told.append)
    for k in range(0, len(rows), cut):
        monitor.take(rows[k : k + cut].tolist(), first=k + 1)
    return monitor, [r for r in told if r["kind"] == "bad_row"]


@pytest.mark.parametrize("column", [0, 2])
@pytest.mark.parametrize("restart", [False, True])
def test_a_value_that_stands_alone_is_a_bad_row_whatever_the_chunks(column, restart):
    spoilt = ROWS.copy()
    spoilt[300, column] = -1e9
    sound = ROWS.copy()
    sound[300] = ROWS[299]
    monitor, [bad] = learnt(spoilt, restart_after_hole=restart)
    other, _ = learnt(np.delete(ROWS, 300, axis=0) if restart else sound)
    assert (bad["line"], monitor.carried.bad, monitor.carried.experiment) == (301, 1, int(restart))
    np.testing.assert_allclose(monitor.model.theta_, other.model.theta_, rtol=1e-12)
    again, _ = learnt(spoilt, cut=1, restart_after_hole=restart)
    np.testing.assert_allclose(again.model.theta_, monitor.model.theta_, rtol=1e-12)
    half, _ = learnt(spoilt[:301], restart_after_hole=restart)  # it waits
    rest, _ = learnt(spoilt[:1], restart_after_hole=restart)
    rest.set_state(half.get_state())
    rest.take(spoilt[301:].tolist(), first=302)
    np.testing.assert_array_equal(rest.model.theta_, monitor.model.theta_)


def test_what_stays_or_is_less_than_a_thousand_times_is_learnt():
    for rows in (slice(300, 304), slice(300, None)):
        changed = ROWS.copy()
        changed[rows] *= 1e4
        monitor, bad = learnt(changed)
        assert bad == []
        assert monitor.carried.rows == 600
    kicked = ROWS.copy()
    kicked[300] *= 100.0
    assert learnt(kicked)[1] == []
