"""Motion of a stream: late by the delay that is told, the same however the rows come, restarted at each group."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from sklearn.base import clone
from sklearn.linear_model import LinearRegression
from sklearn.model_selection import GridSearchCV, TimeSeriesSplit
from sklearn.pipeline import make_pipeline

from tests.lags.smooth_axis import RATE, TRUTH, smooth_axis, solve
from whsklearn.datasets import make_servo_log
from whsklearn.effects import DisturbanceTone, LoadFriction, PreslidingHysteresis
from whsklearn.estimators import MILSRegressor, RLSRegressor, RMILSRegressor
from whsklearn.lags import InverseDynamicsLags


def test_decimation_leaves_the_parameters_where_they_are():
    X, y = smooth_axis(noise=1e-5)
    theta = [solve(*InverseDynamicsLags(sample_rate=RATE, cutoff=30, border=50, decimate=d).rows(X, y)) for d in (1, 8)]
    assert theta[0] == pytest.approx(theta[1], rel=0.02)


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


@pytest.mark.parametrize("estimator", [RLSRegressor, MILSRegressor, RMILSRegressor])
@pytest.mark.parametrize("causal", [False, True])
def test_every_recursive_estimator_identifies_the_axis(estimator, causal):
    X, y = smooth_axis()
    model = estimator(lags=InverseDynamicsLags(sample_rate=RATE, cutoff=50, border=50, causal=causal)).fit(X, y)
    assert model.parameters_ == pytest.approx(TRUTH, rel=0.01)
    assert model.score(X, y) > 0.99  # a stream's rows are late, and judged by their own samples


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
    X, y = smooth_axis(seconds=16.0, noise=1e-6)  # a third of it is the first part: 5 Hz leave 53 independent rows
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


def test_what_cannot_be_is_told():
    X, y = smooth_axis(seconds=2.0)
    lags = InverseDynamicsLags(sample_rate=RATE)
    with pytest.raises(ValueError, match="zero throughout"):
        lags.rows(X, np.zeros_like(y))
    with pytest.raises(ValueError, match="not finite"):
        lags.rows(X, np.where(np.arange(len(y)) == 5, np.nan, y))
    with pytest.raises(ValueError, match="one torque per position"):
        lags.rows(X, y[:-1])
    with pytest.raises(ValueError, match="3 columns"):
        lags.fit(np.zeros((50, 3)))
    with pytest.raises(ValueError, match="zero-phase filter needs the whole record"):
        lags.partial_rows(X, y)
    with pytest.raises(ValueError, match="is not an effect"):
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


def test_a_stream_of_a_noisy_encoder_gives_the_numbers_of_the_axis():
    """Torque that columns and target do not share the filter of had made the friction of an axis 4 to 7 % too small."""
    log, truth = make_servo_log(duration=20.0, noise=5e-5, random_state=3, return_truth=True)
    model = RLSRegressor(InverseDynamicsLags(sample_rate=1000.0, causal=True))
    model.partial_fit(log[["position_rad"]].to_numpy(), log["torque_nm"].to_numpy())
    for name in ("inertia", "viscous", "coulomb"):
        assert model.parameters_[name] == pytest.approx(truth.parameters[name], rel=0.02), name


@pytest.mark.parametrize("rate", [1000.0, 5000.0, 20_000.0])
def test_a_fast_stream_is_not_drowned_in_the_noise_of_its_encoder(rate):
    """With all motion up to a tenth of the rate the inertia was 1 % too small at 5 kHz, and 41 % at 20 kHz."""
    t = np.arange(int(6.0 * rate)) / rate
    w = 2.0 * np.pi * np.array([0.4, 1.1, 3.0])
    size = np.array([0.6, 0.3, 0.1])
    q, v, a = (
        np.sin(np.outer(t, w)) @ size,
        np.cos(np.outer(t, w)) @ (size * w),
        -np.sin(np.outer(t, w)) @ (size * w**2),
    )
    path = q + 1e-5 * np.random.default_rng(0).standard_normal(t.size)
    model = RLSRegressor(InverseDynamicsLags(sample_rate=rate, causal=True))
    model.partial_fit(path[:, None], 0.02 * a + 0.05 * v + 0.3 * np.sign(v))
    for name, value in (("inertia", 0.02), ("viscous", 0.05), ("coulomb", 0.3)):
        assert model.parameters_[name] == pytest.approx(value, rel=0.001), name


AGED = {"effects": "input_offset,input_delay", "causal": True}


@pytest.mark.parametrize("age", [-0.7, 0.0, 0.5, 1.5])  # samples: measured late or at once, held, and computed first
def test_the_age_of_the_drive_is_told_and_bends_no_number_of_a_stream(age):
    X, torque = smooth_axis(seconds=40.0, noise=1e-6)
    late = np.interp(np.arange(len(torque)) + age, np.arange(len(torque)), torque)  # what acts so much later
    models = [RLSRegressor(InverseDynamicsLags(RATE, **s)).partial_fit(X, late) for s in ({"causal": True}, AGED)]
    error = [abs(m.parameters_["viscous"] / TRUTH["viscous"] - 1.0) for m in models]
    assert error[1] < 2e-3
    assert error[0] > 5.0 * error[1] or age == 0.0
    found, spread = (p["input_delay"] * RATE for p in (models[1].parameters_, models[1].parameter_standard_errors_))
    assert found == pytest.approx(age, abs=0.1)
    assert spread < 0.1


@pytest.mark.parametrize(("reference", "seed"), [("rich", 0), ("multisine", 1)])
def test_where_an_axis_turns_it_bends_no_number_of_a_record(reference, seed):
    log, truth = make_servo_log(
        reference=reference, duration=20.0, sample_rate=250.0, random_state=seed, return_truth=True
    )
    lags = InverseDynamicsLags(250.0, effects=AGED["effects"])
    found = RLSRegressor(lags).fit(log[["position_rad"]], log["torque_nm"]).parameters_
    # with rows beside a reversal, where friction is not the sign of a filtered velocity, viscous is 6 to 11 % off
    for name in ("inertia", "viscous", "coulomb"):
        assert found[name] == pytest.approx(truth.parameters[name], rel=5e-3)
    assert found["input_delay"] * 250.0 == pytest.approx(0.5, abs=0.05)  # its controller holds the drive


def test_an_axis_that_turns_too_often_for_its_filter_keeps_its_rows():
    t = np.arange(int(20 * RATE)) / RATE
    w = 2 * np.pi * 2.0
    torque = 0.05 * -(w**2) * np.sin(w * t) + 0.12 * w * np.cos(w * t) + 0.4 * np.sign(np.cos(w * t))
    lags = InverseDynamicsLags(sample_rate=RATE, cutoff=4.0)
    phi, target = lags.rows(np.sin(w * t)[:, None], torque)  # two periods of it are one of the motion
    assert len(target) > 0.9 * len(t)
    assert solve(phi, target)[0] == pytest.approx(0.05, rel=0.1)


def test_a_slow_sine_does_not_tell_the_age_of_its_drive_and_bends_by_less_than_a_sample_does():
    t = np.arange(int(20 * RATE)) / RATE
    w = 2 * np.pi * 0.3
    q, v, a = np.sin(w * t), w * np.cos(w * t), -(w**2) * np.sin(w * t)
    q += 1e-5 * np.random.default_rng(0).normal(size=q.size)
    torque = np.array([a, v, np.sign(v), np.ones(t.size)]).T @ list(TRUTH.values())
    model = RLSRegressor(InverseDynamicsLags(RATE, **AGED)).partial_fit(q[:, None], torque)
    assert abs(model.state_["theta"][-1] * RATE) > 3.0  # rows alone take the encoder's noise for an age
    assert -1.0 < model.parameters_["input_delay"] * RATE < 2.0
    assert model.parameters_["inertia"] == pytest.approx(TRUTH["inertia"], rel=0.02)


def test_what_is_known_of_a_weight_is_told_by_column():
    (known,) = InverseDynamicsLags(RATE, law="viscous", effects="cogging,input_delay").fit(np.ones((9, 1))).prior_
    assert known[0] == 4  # behind inertia, viscous and the two of cogging
    assert InverseDynamicsLags(RATE).fit(np.ones((9, 1))).prior_ == ()


@pytest.mark.parametrize("piece", [1, 7, 500])
def test_the_age_of_a_drive_does_not_depend_on_how_its_stream_is_cut(piece):
    X, y = smooth_axis(seconds=4.0)
    whole = InverseDynamicsLags(RATE, **AGED).fit(X).partial_rows(X, y)
    lags = InverseDynamicsLags(RATE, **AGED).fit(X)
    parts = [lags.partial_rows(X[i : i + piece], y[i : i + piece]) for i in range(0, len(X), piece)]
    for one, other in zip(whole, map(np.concatenate, zip(*parts, strict=True)), strict=True):
        assert np.array_equal(one, other)


def test_an_axis_at_rest_gives_a_stream_no_rows():
    rng, rest = np.random.default_rng(0), np.zeros(2000)
    lags = InverseDynamicsLags(sample_rate=RATE, causal=True)
    for noise in (0.0, 1e-5):
        path = rest + noise * rng.normal(size=rest.size)
        assert len(lags.rows(path[:, None], rest + 0.1)[0]) < 0.02 * rest.size / lags.spacing
    assert len(clone(lags).set_params(standstill=0.0).rows(path[:, None], rest + 0.1)[0]) > 150


def test_errors_of_a_stream_stand_at_the_samples_that_give_its_rows():
    X, y = smooth_axis(seconds=3.0)
    lags = InverseDynamicsLags(sample_rate=RATE, causal=True)
    theta = np.arange(1.0, 5.0)
    errors = np.concatenate([lags.partial_errors(X[i : i + 70], y[i : i + 70], theta) for i in range(0, len(X), 70)])
    phi, target = lags.rows(X, y)
    at = np.flatnonzero(np.isfinite(errors))
    assert np.array_equal(errors[at], target - phi @ theta)
    assert not (at % lags.spacing).any()


def test_a_new_group_starts_a_new_stream():
    X, y = smooth_axis(seconds=2.0)
    lags = InverseDynamicsLags(sample_rate=RATE, causal=True)
    groups = np.repeat([0, 1], len(X) // 2)
    both = lags.partial_rows(X, y, groups)[0]
    apart = [clone(lags).partial_rows(X[groups == g], y[groups == g])[0] for g in (0, 1)]
    assert np.array_equal(both, np.concatenate(apart))
    assert lags.max_lag == lags.warmup_ + 2 * lags.spacing


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
    state = lags.get_state()
    with pytest.raises(ValueError, match="of an earlier version"):
        lags.set_state(state | {"drive": state["drive"][1:]})


WRONG = [
    *[("sample_rate", x) for x in ("a", None, [1], 0, True, np.nan)],
    *[("cutoff", x) for x in ("a", [1], -1.0, np.nan)],
    *[(name, x) for name in ("order", "border", "degree", "decimate", "window") for x in ("a", [1], -1, 1.5)],
    *[("law", x) for x in (-1, True)],
    *[("effects", x) for x in (-1, None, 1.5)],
]


@pytest.mark.parametrize(("name", "value"), WRONG)
def test_a_setting_of_the_wrong_kind_is_refused_in_one_sentence(name, value):
    with pytest.raises(ValueError, match=rf"^{name} is .*, expected .*\.$"):
        InverseDynamicsLags(**{name: value}).fit(np.linspace(0.0, 1.0, 200)[:, None])
