"""Rows in which an encoder repeats its last reading while the axis moves on."""

from __future__ import annotations

import numpy as np
import pytest

from whsklearn import InverseDynamicsLags, RLSRegressor
from whsklearn.streaming import Options, StreamMonitor
from whsklearn.streaming.freeze import MOST_WAITING, Freeze
from whsklearn.streaming.monitor import alarm_of_averages

RATE = 500.0


def axis(n, seed=0):
    """Time, position and drive of an axis with an inertia of 0.02 kg m2, 0.05 Nm s/rad and 0.3 Nm."""
    t = np.arange(n) / RATE
    parts = [(0.5, 3.0), (0.3, 8.2)]
    q, v, a = (sum(A * w**k * np.sin(w * t + k * np.pi / 2) for A, w in parts) for k in range(3))
    rng = np.random.default_rng(seed)
    u = 0.02 * a + 0.05 * v + 0.3 * np.sign(v) + rng.normal(0, 1e-3, n)
    return t, q + rng.normal(0, 1e-6, n), u, v


def monitor_of(turns=()):
    told = []
    options = Options(
        timed=True, max_step=2.5 / RATE, step=1.0 / RATE, positions=(1,), turns=turns, restart_after_hole=True
    )
    model = RLSRegressor(InverseDynamicsLags(RATE, causal=True))
    return StreamMonitor(model, alarm_of_averages(), options, told.append), told


def streamed(table, cut=1000, turns=()):
    monitor, told = monitor_of(turns)
    for k in range(0, len(table), cut):
        monitor.take(table[k : k + cut], first=k + 1)
    return monitor, told


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


def test_no_cutting_changes_what_is_told():
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
        rows, told, anew = freeze.take([k], place)
        assert not told
        out += [*rows, *anew]
    assert [*out, *freeze.end()] == [[k] for k in range(t.size)]


def test_a_reading_that_stays_for_good_is_told_once_unless_the_axis_was_slow():
    path = np.cumsum([*np.linspace(0.0, 0.1, 100), *[0.1] * 50, *[0.0] * 2 * MOST_WAITING])
    for count, times in ((1e-6, 1), (0.1, 0)):
        freeze = Freeze()
        taken = [freeze.take([k], q) for k, q in enumerate(count * np.round(path / count))]
        said = [told for _, told, _ in taken if told]
        assert sum(len(anew) > 0 for *_, anew in taken) == 1
        assert len(said) == times
        assert all(f"stopped within one row and repeats for {MOST_WAITING + 1} rows" in one for one in said)


@pytest.mark.parametrize("cut", [1.3, 3.15])
def test_a_checkpoint_of_before_there_were_arms_is_taken(cut):
    """Its turns, jumps and repeated readings were those of one axis; at the second cut some rows wait."""
    t, q, u, _ = axis(3000)
    q[300:360], q[1500:1600] = q[299], q[1499]
    table = np.column_stack([t, (q + 0.2) % 0.9, u])
    whole, told = streamed(table, 3000, turns=((0.9,),))
    monitor, first = streamed(table[: int(cut * RATE)], 3000, turns=((0.9,),))
    state = monitor.get_state()
    experiment = state["carried"].pop("held_back")
    assert experiment == 1
    for name in ("turns", "jumps", "freeze"):
        [state[name]] = state[name]
    state["freeze"]["experiment"] = state["jumps"]["experiment"] = experiment
    assert bool(state["freeze"]["waiting"]) == (cut > 3.0)
    after, then = monitor_of(turns=((0.9,),))
    after.set_state(state)
    after.take(table[int(cut * RATE) :], first=int(cut * RATE) + 1)
    assert first + then == told
    assert {"wrap", "held_rows"} <= {r.get("cause") for r in told}
    np.testing.assert_array_equal(after.model.theta_, whole.model.theta_)


def test_rows_that_wait_are_bounded_and_come_out_in_order():
    freeze, out = Freeze(), []
    for k in range(MOST_WAITING + 100):
        rows, _, anew = freeze.take([k], min(0.1 * k, 1.0))
        out += [*rows, *anew]
    assert out == [[k] for k in range(MOST_WAITING + 100)]
