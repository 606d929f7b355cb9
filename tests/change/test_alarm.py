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
from whsklearn.change import ChangeAlarm, forgetting_after, set_forgetting
from whsklearn.change.alarm import LEVELS, N_BETS, tilts, watch

NOISES = {
    "normal": lambda rng, n: rng.normal(size=n),
    "laplace": lambda rng, n: rng.laplace(size=n),
    "uniform": lambda rng, n: rng.uniform(-1, 1, size=n),
    "student": lambda rng, n: rng.standard_t(3, size=n),
    "coloured": lambda rng, n: lfilter([1.0], [1.0, -0.7], rng.normal(size=n)),
    "offset": lambda rng, n: 1e-9 * rng.normal(size=n) + 5e-9,
    # what a model lacks comes in spells, as the motion does
    "spells": lambda rng, n: (
        rng.normal(size=n) * np.repeat(rng.choice([1.0, 2.0], p=[0.8, 0.2], size=n // 30 + 1), 30)[:n]
    ),
}


@pytest.mark.parametrize("noise", sorted(NOISES))
def test_false_alarms_are_no_more_frequent_than_stated(noise):
    interval, times = 3e3, []
    alarm = ChangeAlarm(interval=interval)
    begins = alarm.lacking_  # half of the reference is not known yet: the other half is watched
    for seed in range(60):
        fired = clone(alarm).update(NOISES[noise](np.random.default_rng(seed), begins + 9000))
        times.append(fired[0] - begins if fired.size else 9000)
    # censored at 3 intervals, so the mean is an underestimate, by 5 %; 3 standard errors of 60 exponential times
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


@pytest.mark.parametrize("change", [lambda e: 3.0 * e, lambda e: e + 2.0])
def test_a_change_before_the_reference_is_full_is_told(change):
    """It was a part of what is normal, and no alarm came however large it was."""
    for seed in range(10):
        e = np.random.default_rng(seed).normal(size=6000)
        e[2400:] = change(e[2400:])
        fired = ChangeAlarm(interval=1e6).update(e)
        assert fired.size == 1
        assert 2400 <= fired[0] < 2600


def test_an_outlier_and_its_ringing_count_once():
    """A wrong sign of dx rings in the linear block behind it; each such sample used to count tenfold."""
    ringing = 100.0 * 0.5 ** np.arange(5)
    fired = []
    for seed in range(20):
        e = np.random.default_rng(seed).normal(size=6000)
        e[5000:5005] += ringing
        fired += ChangeAlarm(interval=1e5).update(e).tolist()
    assert not fired


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
@settings(max_examples=25)
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


@pytest.mark.parametrize("changed", [{"n_reference": 900}, {"n_reference": 200}, {"n_settle": 100}, {"n_settle": 2000}])
@pytest.mark.parametrize("seen", [700, 1100])
def test_a_length_that_changes_while_it_learns_loses_no_sample_and_takes_none_twice(changed, seen):
    e = np.random.default_rng(3).normal(size=4000)
    alarm = ChangeAlarm(n_reference=300, order=0, n_settle=1000)
    alarm.update(e[:seen])
    alarm.set_params(**changed)
    skipped = max(alarm.n_settle, seen) if seen < 1000 else 1000
    left = alarm.lacking_
    alarm.update(e[seen : seen + left - 1])
    assert not alarm.watching_
    assert alarm.lacking_ == 1
    alarm.update(e[seen + left - 1 : seen + left])
    assert alarm.watching_
    assert seen + left == skipped + 150
    alarm.begin()
    assert alarm.lacking_ == alarm.n_settle + alarm.n_reference // 2


@pytest.mark.parametrize(
    "params",
    [{"interval": 1.0}, {"n_reference": 10}, {"n_reference": 500.5}, {"order": -1}, {"order": 2.5}, {"n_settle": -1}],
)
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


def test_cells_part_the_line_and_are_finest_in_the_tails():
    widths = np.diff(np.r_[0.0, LEVELS, 1.0])
    assert np.all(widths > 0)
    np.testing.assert_allclose(widths, widths[::-1], atol=1e-12)
    assert widths[0] == widths.min()


def test_every_bet_pays_no_more_than_its_stake_under_the_nominal_law():
    widths = np.diff(np.r_[0.0, LEVELS, 1.0])
    expected = tilts() @ widths
    assert tilts().shape == (N_BETS, widths.size)
    assert np.all(expected <= 1.0 + 1e-12)  # less than one where the largest odds were cut
    np.testing.assert_allclose(expected[tilts().max(axis=1) < 10.0], 1.0, atol=1e-12)


def test_bets_on_spread_pay_in_the_tails_and_bets_on_a_shift_on_one_side():
    odds = tilts()
    assert np.all(odds[:3, [0, -1]] > 1.0)
    assert np.all(odds[:3, odds.shape[1] // 2] < 1.0)
    np.testing.assert_allclose(odds[3], odds[4][::-1], rtol=1e-9)  # a shift up and the same down are mirror images


def begun():
    return np.zeros(2), np.full(LEVELS.size + 1, 50.0), np.zeros(N_BETS), np.zeros(1, dtype=np.int64)


def test_evidence_is_that_of_the_recursion_written_out():
    edges = np.linspace(-2, 2, LEVELS.size)
    e, ar = np.random.default_rng(0).normal(size=40), np.array([0.5, -0.2])
    past, counts, evidence, rest = begun()
    assert watch(e, 0, past, ar, edges, tilts(), counts, evidence, rest, 1.0, 1e12, 1e9) == -1
    by_hand, seen, spoilt = np.zeros(N_BETS), np.full(LEVELS.size + 1, 50.0), 0
    for t in range(e.size):
        w = e[t] - sum(ar[i] * e[t - 1 - i] for i in range(2) if t - 1 - i >= 0)
        cell = np.searchsorted(edges, w)
        if spoilt:  # by an outlier that the filter still holds
            spoilt -= 1
            continue
        spoilt = 2 * (abs(w) > 2)
        by_hand = (1.0 + by_hand) * tilts()[:, cell] / (tilts() @ (seen / seen.sum()))
        seen[cell] += 1
    np.testing.assert_allclose(evidence, by_hand, rtol=1e-10)
    np.testing.assert_array_equal(counts, seen)


def test_it_stops_at_the_sample_that_raised_the_alarm_and_goes_on_behind_it():
    edges = np.linspace(-2, 2, LEVELS.size)
    e = np.r_[np.zeros(5), np.full(60, 9.0)]
    past, counts, evidence, rest = begun()
    at = watch(e, 0, past, np.empty(0), edges, tilts(), counts, evidence, rest, 1.0, 50.0, 1e9)
    assert 5 <= at < e.size
    assert counts.sum() == 50.0 * (LEVELS.size + 1) + at + 1


def test_old_counts_fade_when_there_are_many():
    past, counts, evidence, rest = begun()
    edges = np.linspace(-2, 2, LEVELS.size)
    watch(np.zeros(10), 0, past, np.empty(0), edges, tilts(), counts, evidence, rest, 1.0, 1e12, 905.0)
    assert counts.sum() < 905.0


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


def test_forgetting_set_in_mid_stream_is_that_of_a_stream_from_there_on():
    X = np.random.default_rng(0).normal(size=(400, 2))
    y = X @ [1.0, -2.0] + 0.1 * np.random.default_rng(1).normal(size=400)
    y[200:] += X[200:, 0]
    kept, let = RLSRegressor().fit(X[:200], y[:200]), RLSRegressor().fit(X[:200], y[:200])
    set_forgetting(let, 0.95)
    np.testing.assert_array_equal(let.theta_, kept.theta_)  # what was learnt stays
    assert abs(let.partial_fit(X[200:], y[200:]).theta_[0] - 2.0) < 0.1
    assert abs(kept.partial_fit(X[200:], y[200:]).theta_[0] - 1.5) < 0.2
    with pytest.raises(ValueError, match="forgetting"):
        set_forgetting(let, 1.5)
