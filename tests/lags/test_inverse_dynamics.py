from __future__ import annotations

import pickle

import numpy as np
import pytest
from sklearn.base import clone
from sklearn.linear_model import LinearRegression
from sklearn.model_selection import GridSearchCV, TimeSeriesSplit
from sklearn.pipeline import make_pipeline

from whsklearn.datasets import make_servo_log
from whsklearn.effects import Cogging, Coulomb, DisturbanceTone, LoadFriction, PreslidingHysteresis, Saturation, Viscous
from whsklearn.estimators import MILSRegressor, RLSRegressor, RMILSRegressor
from whsklearn.lags import InverseDynamicsLags

RATE = 500.0
TRUTH = {"inertia": 0.05, "viscous": 0.12, "coulomb": 0.4, "input_offset": -0.07}


def smooth_axis(seconds=12.0, noise=0.0, seed=0):
    """Position and torque of an axis on a smooth path, exact by its inverse dynamics."""
    t = np.arange(int(seconds * RATE)) / RATE
    frequencies, amplitudes = np.array([0.21, 0.5, 1.3]), np.array([1.0, 0.6, 0.15])
    w = 2 * np.pi * frequencies
    q = np.sin(np.outer(t, w)) @ amplitudes
    v = np.cos(np.outer(t, w)) @ (amplitudes * w)
    a = -np.sin(np.outer(t, w)) @ (amplitudes * w**2)
    torque = 0.05 * a + 0.12 * v + 0.4 * np.sign(v) - 0.07
    rng = np.random.default_rng(seed)
    return (q + noise * rng.normal(size=q.size))[:, None], torque


def solve(phi, target):
    return np.linalg.lstsq(phi, target, rcond=None)[0]


@pytest.mark.parametrize("causal", [False, True])
def test_rows_give_back_the_axis(causal):
    X, y = smooth_axis()
    lags = InverseDynamicsLags(sample_rate=RATE, cutoff=50, border=50, causal=causal)
    theta = dict(zip(lags.fit(X).get_feature_names_out(), solve(*lags.rows(X, y)), strict=True))
    assert theta == pytest.approx(TRUTH, rel=0.01)


def test_decimation_leaves_the_parameters_where_they_are():
    X, y = smooth_axis(noise=1e-5)
    theta = [solve(*InverseDynamicsLags(sample_rate=RATE, cutoff=30, border=50, decimate=d).rows(X, y)) for d in (1, 8)]
    assert theta[0] == pytest.approx(theta[1], rel=0.02)


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


def test_the_state_contract():
    X, _ = smooth_axis(seconds=3.0)
    lags = InverseDynamicsLags(sample_rate=RATE, causal=True)
    whole = lags.fit_transform(X)
    assert np.array_equal(lags.transform(X), whole)
    half = len(X) // 2
    first = lags.fit_transform(X[:half])
    lags.transform(X)  # reads only
    rest = lags.partial_fit_transform(X[half:])
    assert np.array_equal(np.concatenate([first, rest]), whole)
    assert np.array_equal(lags.fit_transform(X), whole)  # starts clean


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
    with pytest.raises(ValueError, match="no state of an InverseDynamicsLags"):
        lags.set_state({"seen": 3})


@pytest.mark.parametrize("estimator", [RLSRegressor, MILSRegressor, RMILSRegressor])
@pytest.mark.parametrize("causal", [False, True])
def test_every_recursive_estimator_identifies_the_axis(estimator, causal):
    X, y = smooth_axis()
    model = estimator(lags=InverseDynamicsLags(sample_rate=RATE, cutoff=50, border=50, causal=causal)).fit(X, y)
    assert model.parameters_ == pytest.approx(TRUTH, rel=0.01)
    assert model.score(X, y) > (0.9 if causal else 0.99)  # a stream's answer is late


def test_an_axis_is_identified_sample_by_sample_and_saved_in_between(tmp_path):
    X, y = smooth_axis(seconds=4.0)
    lags = InverseDynamicsLags(sample_rate=RATE, cutoff=50, causal=True)
    whole = RMILSRegressor(lags=lags, p=4).partial_fit(X, y)
    piecewise = RMILSRegressor(lags=lags, p=4)
    for i in range(0, 1000, 250):
        piecewise.partial_fit(X[i : i + 250], y[i : i + 250])
    piecewise.save(tmp_path / "axis.state")
    later = RMILSRegressor.load(tmp_path / "axis.state").partial_fit(X[1000:], y[1000:])
    assert later.theta_ == pytest.approx(whole.theta_, rel=1e-10)


def test_a_grid_search_reaches_the_filter():
    X, y = smooth_axis(seconds=4.0, noise=1e-6)
    model = RLSRegressor(lags=InverseDynamicsLags(sample_rate=RATE))
    search = GridSearchCV(model, {"lags__cutoff": [5.0, 50.0]}, cv=TimeSeriesSplit(2)).fit(X, y)
    assert set(search.cv_results_["param_lags__cutoff"]) == {5.0, 50.0}
    assert search.best_score_ > 0.95


def test_same_length_zeros_before_the_start_and_names():
    X, _ = smooth_axis(seconds=2.0)
    lags = InverseDynamicsLags(sample_rate=RATE, causal=True).fit(X)
    phi = lags.transform(X)
    assert len(phi) == len(X)
    assert not phi[: lags.warmup_].any()
    assert phi[lags.warmup_ :, 3].all()
    lags.set_output(transform="pandas")
    assert list(lags.transform(X).columns) == list(TRUTH)
    X, y = smooth_axis(seconds=2.0)
    assert isinstance(lags.rows(X, y)[0], np.ndarray)


def test_each_group_is_a_record_of_its_own():
    X, _ = smooth_axis(seconds=4.0)
    groups = np.repeat([0, 1], len(X) // 2)
    for causal in (False, True):
        lags = InverseDynamicsLags(sample_rate=RATE, causal=causal).fit(X)
        apart = np.concatenate([lags.transform(X[groups == g]) for g in (0, 1)])
        assert np.array_equal(lags.transform(X, groups=groups), apart)


def test_a_record_is_turned_into_the_effects_of_the_catalogue():
    X, y = smooth_axis()
    ripple = Cogging(0.05, 6.0, 0.4)
    phi_names = InverseDynamicsLags(
        sample_rate=RATE, cutoff=50, border=50, effects=("input_offset", Cogging(1.0, 6.0)), law=[Viscous(), Coulomb()]
    )
    y = y + 0.05 * np.cos(6.0 * X[:, 0] + 0.4)
    theta = solve(*phi_names.rows(X, y))
    inertia, effects = phi_names.interpret(theta)
    found = {e.name: e for e in effects}
    assert inertia == pytest.approx(TRUTH["inertia"], rel=0.01)
    assert found["coulomb"].torque == pytest.approx(0.4, rel=0.01)
    assert found["cogging"].amplitude == pytest.approx(ripple.amplitude, rel=0.02)
    assert found["cogging"].phase == pytest.approx(ripple.phase, abs=0.02)
    assert list(phi_names.get_feature_names_out())[-2:] == ["cogging_cos", "cogging_sin"]


def test_effects_of_the_drive_take_it_from_x_or_from_y():
    X, y = smooth_axis(seconds=2.0)
    lags = InverseDynamicsLags(sample_rate=RATE, effects=[LoadFriction(1.0)]).fit(X)
    two = clone(lags).fit(np.column_stack([X, y]))
    assert np.array_equal(lags.transform(X, y), two.transform(np.column_stack([X, y])))
    with pytest.raises(ValueError, match="load_friction is a function of the drive"):
        lags.transform(X)


@pytest.mark.parametrize("reference", ["rich", "multisine", "sweep"])
def test_an_axis_is_identified_from_its_simulated_log(reference):
    log, truth = make_servo_log(reference=reference, duration=20.0, return_truth=True)
    lags = InverseDynamicsLags(sample_rate=1000.0, cutoff=50.0, decimate=10, border=100)
    X, y = log[["position_rad"]].to_numpy(), log["torque_nm"].to_numpy()
    model = RMILSRegressor(lags=lags).fit(X, y)
    expected = {k: truth.parameters[k] for k in ("inertia", "viscous", "coulomb")}
    assert {k: model.parameters_[k] for k in expected} == pytest.approx(expected, rel=0.03)
    at_rest = RMILSRegressor(lags=clone(lags).set_params(standstill=0.0)).fit(X, y).parameters_
    bias = [abs(found["viscous"] / expected["viscous"] - 1) for found in (at_rest, model.parameters_)]
    assert bias[0] > bias[1]


def test_standstill_leaves_out_slow_rows_of_records_and_streams():
    X, y = smooth_axis(seconds=4.0)
    for causal in (False, True):
        lags = InverseDynamicsLags(sample_rate=RATE, causal=causal, standstill=0.5)
        phi, _ = lags.rows(X, y)
        assert np.abs(phi[:, 1]).min() >= 0.5
        assert len(phi) < len(X)
    pieces = [clone(lags).partial_rows(X, y)[0]]
    piecewise = clone(lags)
    pieces.append(
        np.concatenate([piecewise.partial_rows(X[i : i + 100], y[i : i + 100])[0] for i in range(0, 2000, 100)])
    )
    for p in pieces:
        assert np.array_equal(p, phi)


def test_what_cannot_be_is_told():
    X, y = smooth_axis(seconds=2.0)
    lags = InverseDynamicsLags(sample_rate=RATE)
    with pytest.raises(ValueError, match="zero throughout"):
        lags.rows(X, np.zeros_like(y))
    with pytest.raises(ValueError, match="not finite"):
        lags.rows(X, np.where(np.arange(len(y)) == 5, np.nan, y))
    with pytest.raises(ValueError, match="one torque a position"):
        lags.rows(X, y[:-1])
    with pytest.raises(ValueError, match="3 columns"):
        lags.fit(np.zeros((50, 3)))
    with pytest.raises(ValueError, match="zero-phase filter needs the whole record"):
        lags.partial_rows(X, y)
    with pytest.raises(ValueError, match="is no effect"):
        InverseDynamicsLags(effects=[3.0]).fit(X)
    with pytest.raises(ValueError, match="backlash has no columns"):
        InverseDynamicsLags(effects="backlash").fit(X)
    with pytest.raises(ValueError, match="presliding_hysteresis needs the whole record"):
        InverseDynamicsLags(causal=True, effects=[PreslidingHysteresis()]).partial_rows(X, y)
    with pytest.raises(ValueError, match=r"inertia is -0\.05"):
        lags.fit(X).interpret([-0.05, 1.0, 1.0, 0.0])
    with pytest.raises(ValueError, match="3 weights, expected 4"):
        lags.interpret([0.05, 1.0, 1.0])


def test_a_refused_call_changes_nothing():
    X, y = smooth_axis(seconds=2.0)
    lags = InverseDynamicsLags(sample_rate=RATE, causal=True)
    lags.rows(X[:400], y[:400])
    before = lags._stream
    with pytest.raises(ValueError, match="NaN"):
        lags.partial_rows(np.full((3, 1), np.nan), np.ones(3))
    assert lags._stream is before


def test_saturation_has_a_column_too():
    X, y = smooth_axis(seconds=2.0)
    lags = InverseDynamicsLags(sample_rate=RATE, effects=[Saturation(0.3)])
    assert np.isfinite(lags.fit(X).transform(X, y)).all()


def test_it_is_a_pipeline_step_too():
    X, y = smooth_axis(seconds=6.0)
    pipeline = make_pipeline(InverseDynamicsLags(sample_rate=RATE, cutoff=50), LinearRegression(fit_intercept=False))
    assert pipeline.fit(X, y).score(X, y) > 0.99  # the borders are in it
    assert pipeline[-1].coef_ == pytest.approx(list(TRUTH.values()), rel=0.05)


def test_a_pickle_in_mid_stream_goes_on_and_no_input_is_changed():
    X, y = smooth_axis(seconds=2.0)
    X_before, y_before = X.copy(), y.copy()
    lags = InverseDynamicsLags(sample_rate=RATE, causal=True)
    lags.partial_rows(X[:300], y[:300])
    other = pickle.loads(pickle.dumps(lags))
    assert np.array_equal(lags.partial_rows(X[300:], y[300:])[0], other.partial_rows(X[300:], y[300:])[0])
    assert np.array_equal(X, X_before)
    assert np.array_equal(y, y_before)
