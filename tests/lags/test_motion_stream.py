"""Motion of a stream: late by the delay that is told, the same however the rows come, restarted at each group."""

from __future__ import annotations

import numpy as np
import pytest
from sklearn.base import clone

from tests.lags.smooth_axis import RATE, smooth_axis
from whsklearn.effects import DisturbanceTone, LoadFriction
from whsklearn.lags import InverseDynamicsLags


def test_rows_of_a_stream_lag_by_the_delay_that_is_told():
    X, _ = smooth_axis()
    record = InverseDynamicsLags(sample_rate=RATE, cutoff=50).fit(X)
    stream = InverseDynamicsLags(sample_rate=RATE, cutoff=50, causal=True).fit(X)
    d = stream.delay_
    assert d > 0
    late, now = stream.transform(X)[200 + d : -200 + d], record.transform(X)[200:-200]
    assert np.abs(late[:, :2] - now[:, :2]).max() < 2e-3 * np.abs(now[:, :2]).max()
    assert np.mean(late[:, 2] == now[:, 2]) > 0.99


def test_a_stream_s_clock_is_late_as_its_rows_are():
    X, _ = smooth_axis(seconds=2.0)
    lags = InverseDynamicsLags(sample_rate=RATE, causal=True, law="viscous", effects=[DisturbanceTone(1.0, 3.0)]).fit(X)
    rows = np.arange(lags.warmup_, len(X))
    assert lags.transform(X)[rows, 2] == pytest.approx(np.cos(2 * np.pi * 3.0 * (rows - lags.delay_) / RATE))


@pytest.mark.parametrize("piece", [1, 7, 400])
def test_any_cutting_of_a_stream_gives_the_same_rows(piece):
    X, y = smooth_axis(seconds=3.0)
    whole = InverseDynamicsLags(sample_rate=RATE, causal=True, effects=("input_offset", "load_friction"))
    phi, target = whole.rows(X, y)
    cut = clone(whole)
    pieces = [cut.partial_rows(X[i : i + piece], y[i : i + piece]) for i in range(0, len(X), piece)]
    assert np.array_equal(np.concatenate([p for p, _ in pieces]), phi)
    assert np.array_equal(np.concatenate([t for _, t in pieces]), target)


def test_a_new_group_starts_a_new_stream():
    X, y = smooth_axis(seconds=2.0)
    lags = InverseDynamicsLags(sample_rate=RATE, causal=True)
    groups = np.repeat([0, 1], len(X) // 2)
    both = lags.partial_rows(X, y, groups)[0]
    apart = [clone(lags).partial_rows(X[groups == g], y[groups == g])[0] for g in (0, 1)]
    assert np.array_equal(both, np.concatenate(apart))
    assert lags.max_lag == lags.warmup_


def test_a_stream_goes_on_from_a_record_with_a_measured_drive_apart():
    X, y = smooth_axis(seconds=2.0)
    both = np.column_stack([X, 0.5 * y])
    lags = InverseDynamicsLags(sample_rate=RATE, causal=True, effects=[LoadFriction(1.0)])
    whole = lags.rows(both, y)
    first = lags.rows(both[:500], y[:500])
    rest = lags.partial_rows(both[500:], y[500:])
    for a, b, c in zip(whole, first, rest, strict=True):
        assert np.array_equal(a, np.concatenate([b, c]))


def test_a_stream_goes_on_from_its_state():
    X, y = smooth_axis(seconds=2.0)
    lags = InverseDynamicsLags(sample_rate=RATE, causal=True)
    lags.partial_rows(X[:300], y[:300])
    other = clone(lags).set_state(lags.get_state())
    for a, b in zip(lags.partial_rows(X[300:], y[300:]), other.partial_rows(X[300:], y[300:]), strict=True):
        assert np.array_equal(a, b)
    with pytest.raises(ValueError, match="not a state of InverseDynamicsLags"):
        lags.set_state({"seen": 3})
