"""The alarm keeps its false-alarm rate whatever the noise, and sees changes soon."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import lfilter
from sklearn.base import clone

from whsklearn import RLSRegressor
from whsklearn.change import ChangeAlarm, compare_parameters, forgetting_after

NOISES = {
    "normal": lambda rng, n: rng.normal(size=n),
    "laplace": lambda rng, n: rng.laplace(size=n),
    "uniform": lambda rng, n: rng.uniform(-1, 1, size=n),
    "student": lambda rng, n: rng.standard_t(3, size=n),
    "coloured": lambda rng, n: lfilter([1.0], [1.0, -0.7], rng.normal(size=n)),
    "offset": lambda rng, n: 1e-9 * rng.normal(size=n) + 5e-9,
}


@pytest.mark.parametrize("noise", sorted(NOISES))
def test_false_alarms_are_no_more_frequent_than_stated(noise):
    interval, times = 1e4, []
    for seed in range(60):
        rng = np.random.default_rng(seed)
        alarm = ChangeAlarm(interval=interval)
        assert alarm.update(NOISES[noise](rng, 3000)).size == 0
        fired = alarm.update(NOISES[noise](rng, 60_000))
        times.append(fired[0] if fired.size else 60_000)
    # censored at 6 intervals, so the mean is an underestimate; 3 standard errors of 60 exponential times
    assert np.mean(times) > interval * (1 - 3 / 60**0.5)


@pytest.mark.parametrize(
    ("change", "within"), [(lambda e: 2.0 * e, 60), (lambda e: 1.5 * e, 250), (lambda e: e + 1.0, 90)]
)
def test_changes_are_seen_soon_and_after_they_happened(change, within):
    delays = []
    for seed in range(20):
        rng = np.random.default_rng(seed)
        alarm = ChangeAlarm(interval=1e6)
        assert alarm.update(rng.normal(size=10_000)).size == 0
        fired = alarm.update(change(rng.normal(size=2000)))
        assert fired.size == 1
        delays.append(fired[0])
    assert np.median(delays) < within


def test_less_surprise_is_no_alarm():
    rng = np.random.default_rng(0)
    alarm = ChangeAlarm(interval=1e4)
    alarm.update(rng.normal(size=5000))
    assert alarm.update(0.3 * rng.normal(size=20_000)).size == 0


def test_after_an_alarm_the_new_normal_is_learnt():
    rng = np.random.default_rng(1)
    alarm = ChangeAlarm(interval=1e6)
    first = alarm.update(np.r_[rng.normal(size=5000), 3 * rng.normal(size=20_000), 9 * rng.normal(size=2000)])
    assert first.size == 2
    assert 5000 <= first[0] < 5050
    assert 25_000 <= first[1] < 25_050
    assert alarm.n_alarms_ == 2


@given(st.lists(st.integers(1, 700), min_size=1, max_size=30), st.integers(0, 1000))
@settings(max_examples=25, deadline=None)
def test_chunks_pickles_and_states_make_no_difference(cuts, seed):
    e = np.random.default_rng(seed).normal(size=6000)
    e[4500:] *= 4
    settings_ = {"interval": 1e3, "n_reference": 300, "n_settle": 50}
    whole, parts = ChangeAlarm(**settings_), ChangeAlarm(**settings_)
    expected = whole.update(e)
    found, start = [], 0
    for i, cut in enumerate([*cuts, e.size]):
        found.extend(parts.update(e[start : start + cut]) + start)
        start = min(start + cut, e.size)
        if i % 3 == 0:
            parts = pickle.loads(pickle.dumps(parts))
        elif i % 3 == 1:
            parts = clone(parts).set_state(parts.get_state())
    assert found == expected.tolist()
    assert parts.evidence_ == whole.evidence_
    assert parts.n_samples_ == whole.n_samples_ == e.size


def test_a_refused_call_changes_nothing():
    rng = np.random.default_rng(2)
    alarm = ChangeAlarm(n_reference=300)
    alarm.update(rng.normal(size=2000))
    before = pickle.dumps(alarm)
    for bad in ([np.nan], [[1.0]], [1.0, np.inf]):
        with pytest.raises(ValueError, match="finite"):
            alarm.update(bad)
    assert pickle.dumps(alarm) == before


@pytest.mark.parametrize("params", [{"interval": 1.0}, {"n_reference": 10}, {"order": -1}, {"n_settle": -1}])
def test_parameters_out_of_range_are_refused(params):
    with pytest.raises(ValueError, match=next(iter(params))):
        ChangeAlarm(**params).update([0.0])


def test_idling_neither_alarms_nor_blurs_what_is_normal():
    rng = np.random.default_rng(4)
    alarm = ChangeAlarm(interval=1e5)
    idle = np.zeros(200_000)
    assert alarm.update(idle).size == 0
    assert alarm.update(np.r_[rng.normal(size=5000), idle, rng.normal(size=5000)]).size == 0
    fired = alarm.update(np.r_[idle, 3 * rng.normal(size=100)])
    assert fired.size == 1
    assert fired[0] > idle.size


def test_a_constant_innovation_does_not_fail():
    alarm = ChangeAlarm(n_reference=300, interval=1e6)
    assert alarm.update(np.full(20_000, 0.1)).size == 0
    assert np.isfinite(alarm.evidence_)


def test_what_changed_is_named_at_the_stated_level():
    rng = np.random.default_rng(3)
    names, theta, se = list("abcdefghi"), np.linspace(-1, 1, 9), 0.01
    false = 0
    for _ in range(1000):
        before, after = theta + se * rng.normal(size=(2, 9))
        false += any(c.significant for c in compare_parameters(names, before, [se**2] * 9, after, [se**2] * 9, 0.05))
    assert false / 1000 == pytest.approx(0.05, abs=0.021)


def test_the_surest_change_comes_first_and_reads_as_a_sentence():
    changes = compare_parameters(
        ["coulomb", "viscous", "d1"],
        [0.7, 0.05, 0.1],
        np.diag([1e-4, 1e-8, 1e-6]),
        [0.84, 0.06, -0.1],
        [1e-4, 1e-8, 1e-6],
    )
    assert [c.name for c in changes] == ["d1", "viscous", "coulomb"]
    assert [str(c).split(" (")[0] for c in changes] == ["d1 changed sign", "viscous rose 20 %", "coulomb rose 20 %"]


def test_exact_estimates_and_wrong_sizes():
    same, moved = compare_parameters(["a", "b"], [1, 0], [0, 0], [1, 2], [0, 0])[::-1]
    assert (same.significant, moved.significant) == (False, True)
    assert moved.percent == np.inf
    with pytest.raises(ValueError, match="2 names"):
        compare_parameters(["a", "b"], [1], [1], [1], [1])
    with pytest.raises(ValueError, match="variances >= 0"):
        compare_parameters(["a"], [1], [-1], [1], [0])


@pytest.mark.parametrize("samples", [50.0, 1e9])
def test_the_past_is_let_go_as_a_shorter_stream_would_know_it(samples):
    """After 20,000 rows, fifty at the most: a jump is followed as fast as after fifty."""
    rng = np.random.default_rng(0)
    X = rng.normal(size=(20_300, 2))
    y = X @ [1.0, -2.0] + 0.1 * rng.normal(size=len(X))
    y[20_000:] += X[20_000:] @ [0.5, 0.0]
    model = RLSRegressor().fit(X[:20_000], y[:20_000])
    theta, spread = model.theta_, model.standard_errors_
    model.forget_past(samples)
    np.testing.assert_array_equal(model.theta_, theta)
    np.testing.assert_allclose(model.standard_errors_, spread * max(1.0, np.sqrt(20_000 / samples)), rtol=0.05)
    model.partial_fit(X[20_000:], y[20_000:])
    assert model.theta_[0] == pytest.approx(1.5 if samples == 50.0 else 1.0, abs=0.12)


@pytest.mark.parametrize("samples", [0.0, -1.0, np.inf, np.nan])
def test_the_past_counts_for_a_positive_number_of_samples(samples):
    with pytest.raises(ValueError, match="samples is"):
        RLSRegressor().fit([[1.0], [2.0]], [1.0, 2.0]).forget_past(samples)


def test_forgetting_settles_after_a_change():
    factors = [forgetting_after(n, 0.9999) for n in range(0, 30_000, 100)]
    assert factors[0] == pytest.approx(0.995)
    assert np.all(np.diff(factors) >= 0)
    assert factors[-1] == 0.9999
    # what came first weighs less than what comes now, and no sample more than the next
    assert np.prod([forgetting_after(n) for n in range(1800)]) == pytest.approx(0.1, rel=0.01)
