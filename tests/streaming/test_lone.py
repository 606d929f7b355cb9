"""One value of a chain's stream that no signal of it comes near."""

from __future__ import annotations

import numpy as np
import pytest

from whsklearn import RLSRegressor
from whsklearn.change import ChangeAlarm
from whsklearn.streaming import Options, StreamMonitor

RNG = np.random.default_rng(0)
X = RNG.normal(size=(600, 2))
ROWS = np.column_stack([X, X @ [1.0, -2.0] + 0.1 * RNG.normal(size=600)])


def streamed(rows, cut=600, **options):
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
    monitor, [bad] = streamed(spoilt, restart_after_hole=restart)
    other, _ = streamed(np.delete(ROWS, 300, axis=0) if restart else sound)
    assert (bad["line"], monitor.carried.bad, monitor.carried.experiment) == (301, 1, int(restart))
    np.testing.assert_allclose(monitor.model.theta_, other.model.theta_, rtol=1e-12)
    again, _ = streamed(spoilt, cut=1, restart_after_hole=restart)
    np.testing.assert_allclose(again.model.theta_, monitor.model.theta_, rtol=1e-12)
    half, _ = streamed(spoilt[:301], restart_after_hole=restart)  # it waits
    rest, _ = streamed(spoilt[:1], restart_after_hole=restart)
    rest.set_state(half.get_state())
    rest.take(spoilt[301:].tolist(), first=302)
    np.testing.assert_array_equal(rest.model.theta_, monitor.model.theta_)


def test_what_stays_or_is_less_than_a_thousand_times_is_learnt():
    for rows in (slice(300, 304), slice(300, None)):
        changed = ROWS.copy()
        changed[rows] *= 1e4
        monitor, bad = streamed(changed)
        assert bad == []
        assert monitor.carried.rows == 600
    kicked = ROWS.copy()
    kicked[300] *= 100.0
    assert streamed(kicked)[1] == []
