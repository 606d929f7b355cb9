"""Positions that an encoder wraps at a turn."""

from __future__ import annotations

import numpy as np
import pytest

from tests.streaming.test_freeze import RATE, axis
from whsklearn import InverseDynamicsLags, RLSRegressor
from whsklearn.logs.mend import turns_of
from whsklearn.streaming import Options, StreamMonitor
from whsklearn.streaming.monitor import alarm_of_averages
from whsklearn.streaming.turns import Turns


def streamed(path, t, u, unit, cut=1000):
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
    whole, none = streamed(path, t, u, "m")
    wrapped, [told] = streamed(path % turn, t, u, unit)
    assert not none
    assert told["cause"] == "wrap"
    assert wrapped.carried.experiment == 0
    np.testing.assert_allclose(wrapped.model.theta_, whole.model.theta_, rtol=1e-5)


def test_no_cutting_and_no_restart_changes_what_is_learnt():
    t, q, u, _ = axis(1500)
    path = (400.0 * q) % 360.0
    (one, first), (other, again) = (streamed(path, t, u, "deg", cut) for cut in (1500, 7))
    assert first == again
    np.testing.assert_array_equal(one.model.theta_, other.model.theta_)
    before, _ = streamed(path[:800], t[:800], u[:800], "deg")
    rest, _ = streamed(path[:1], t[:1], u[:1], "deg")
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
