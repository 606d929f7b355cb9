"""What is said of a record that cannot give what is asked of it."""

from __future__ import annotations

import warnings

import numpy as np
import pandas as pd
import pytest
from scipy.signal import lfilter
from sklearn.base import clone
from sklearn.model_selection import KFold, TimeSeriesSplit, cross_val_score, train_test_split

from whsklearn import InverseDynamicsLags, PEMRegressor, RLSRegressor, RMILSRegressor, WienerHammersteinLags
from whsklearn.datasets import make_servo_log, make_wiener_hammerstein
from whsklearn.effects import Coulomb, ReducedStribeck, Viscous, as_law
from whsklearn.estimators import _advice, _checked
from whsklearn.metrics import nmse

LAW = as_law(None)


@pytest.fixture(scope="module")
def record():
    return make_wiener_hammerstein(n_samples=1000, snr_db=20, random_state=0)


def fitted(X, y, law=None):
    return RMILSRegressor(WienerHammersteinLags(law=law), random_state=0).fit(X, y)


def test_a_constant_that_no_odd_law_gives_is_said_with_what_to_do(record):
    X, y = record
    with pytest.warns(UserWarning, match=r"offset by 2\b.* from .* has a constant; subtract it .* add offset"):
        fitted(X, y + 2.0)
    with pytest.warns(UserWarning, match="subtract it"):
        PEMRegressor(WienerHammersteinLags(), random_state=0, n_starts=1).fit(X, y + 2.0)


@pytest.mark.parametrize("seed", range(8))
def test_nothing_is_said_of_a_record_about_zero(seed):
    rng = np.random.default_rng(seed)
    X, y = make_wiener_hammerstein(n_samples=1000, snr_db=[None, 20, 7.5, 0][seed % 4], random_state=seed)
    assert _advice.of_a_constant(LAW, X, y) is None
    assert _advice.of_a_constant(LAW, X, y + 0.05 * y.std() * rng.choice([-1, 1])) is None


def test_nothing_is_said_of_records_about_zero_behind_slow_blocks():
    """Their residuals vary as slowly as the blocks do: six of 60 were told to be offset."""
    told = 0
    for seed in range(60):
        rng = np.random.default_rng(seed)
        x = lfilter([0.0, 1.0], [1.0, -0.9], rng.standard_normal(500))
        y = lfilter([0.0, 1.0], [1.0, -1.7, 0.75], np.sign(np.diff(x, prepend=0.0)))
        u = lfilter([1.0, -0.9], [1.0], np.append(x[1:], 0.0))
        told += _advice.of_a_constant(LAW, u[:, None], y) is not None
    assert told == 0


def test_nothing_is_said_where_the_model_can_have_the_constant_or_the_input_stands_on_a_level(record):
    X, y = record
    for law in ("reduced,offset", "polynomial", "cubic_spline"):
        assert _advice.of_a_constant(as_law(law), X, y + 2.0) is None
    assert _advice.of_a_constant(LAW, X + 3.0, y + 2.0) is None
    assert _advice.of_a_constant(LAW, X, y + 2.0) is not None
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        PEMRegressor(WienerHammersteinLags(law="linear,offset"), criterion="simulation", n_starts=1).fit(X, y + 2.0)
    with pytest.warns(UserWarning, match="subtract it"):  # its free run would lack the constant
        PEMRegressor(WienerHammersteinLags(law="linear"), criterion="simulation", n_starts=1).fit(X, y + 2.0)


@pytest.mark.parametrize(
    "model",
    [
        RMILSRegressor(WienerHammersteinLags(law="polynomial"), random_state=0),
        PEMRegressor(WienerHammersteinLags(), n_starts=1, random_state=0),
        PEMRegressor(WienerHammersteinLags(1, 1, 1, 0, law="linear"), criterion="simulation"),
    ],
)
def test_a_free_run_that_leaves_more_than_it_explains_is_told(model):
    rng = np.random.default_rng(0)
    u, noise = rng.standard_normal((2, 1000))
    y = 0.3 * lfilter([0.0, 0.0, 1.0], [1.0, -0.5], u) + lfilter([1.0], [1.0, -0.5], noise)
    with pytest.warns(UserWarning, match=r"free run of this fit leaves [89]\d.* of the variance of its own record"):
        model.fit(u[:, None], y)
    with warnings.catch_warnings():
        warnings.filterwarnings("error", "The free run of this fit leaves .*noise that L2 carries on")
        clone(model).fit(u[:, None], y - 0.95 * lfilter([1.0], [1.0, -0.5], noise))


def test_what_is_advised_helps(record):
    X, y = record
    fresh, truth = make_wiener_hammerstein(n_samples=1000, snr_db=None, random_state=100)
    with pytest.warns(UserWarning, match="subtract it"):
        bare = nmse(truth, fitted(X, y + 2.0).predict(fresh) - 2.0)
    subtracted = nmse(truth, fitted(X, y + 2.0 - np.mean(y + 2.0)).predict(fresh))
    within = nmse(truth[50:], fitted(X, y + 2.0, "reduced,offset").predict(fresh)[50:] - 2.0)
    assert max(subtracted, within) < 0.01
    assert bare > 30 * max(subtracted, within)


@pytest.fixture(scope="module")
def axis():
    log = make_servo_log([], duration=12.0, random_state=0)
    return log["position_rad"].to_numpy(), log["torque_nm"].to_numpy()


@pytest.mark.parametrize(
    ("mistake", "told"),
    [
        (
            lambda q, u: (q[:200], u[:200]),
            r"leave \d+ independent rows for 4 parameters, expected 40 or more; give a longer record",
        ),
        (lambda q, u: (q[7000:8000], u[7000:8000]), "leave .* independent rows"),
        (lambda q, u: (u, q), "check that X is the position and y the drive"),
        (lambda q, u: (-q, u), "fitted inertia is -0.05.* both with the same positive direction"),
        (lambda q, u: (np.rad2deg(20 * q) % 360.0, u), r"leaps by 360, .* np.unwrap\(position, period=360\)"),
        (lambda q, u: (20 * q % (2 * np.pi), u), "leaps by 6.28319"),
    ],
)
def test_numbers_that_no_axis_has_are_told_with_the_likely_mistake(axis, mistake, told):
    q, u = mistake(*axis)
    with pytest.warns(UserWarning, match=told):
        RLSRegressor(InverseDynamicsLags()).fit(q[:, None], u)


@pytest.mark.parametrize("start", [0, 3000, 7000])
def test_a_causal_filter_says_that_200_rows_are_too_few(axis, start):
    q, u = (signal[start : start + 200] for signal in axis)
    with pytest.warns(UserWarning, match=r"leave \d+ independent rows for 4 parameters, .* give a longer record"):
        RLSRegressor(InverseDynamicsLags(causal=True)).fit(q[:, None], u)


def test_an_axis_that_moves_in_one_direction_shows_no_coulomb_friction_beside_an_offset(axis):
    q, u = axis
    moving = np.flatnonzero(np.diff(np.sign(np.gradient(np.convolve(q, np.ones(50) / 50, "same")))))
    longest = np.argmax(np.diff(moving))
    one_way = slice(moving[longest] + 100, moving[longest + 1] - 100)
    with pytest.warns(UserWarning, match="coulomb and input_offset cannot be separated.* moves in both directions"):
        RLSRegressor(InverseDynamicsLags(causal=True)).fit(q[one_way, None], u[one_way])


def test_nothing_is_said_of_a_sound_causal_axis(axis):
    q, u = axis
    RLSRegressor(InverseDynamicsLags(causal=True)).fit(q[:, None], u)


def test_nothing_is_said_of_a_sound_axis(axis):
    q, u = axis
    for scale in (1.0, 1e3):  # a torque in mNm is as good
        RLSRegressor(InverseDynamicsLags()).fit(q[:, None], scale * u)


@pytest.mark.parametrize("scale", [1e-9, 1e9])
def test_a_pure_recursion_says_that_it_does_not_reach_the_scale(record, scale):
    X, y = record
    pure = RMILSRegressor(WienerHammersteinLags(), memory=0, n_starts=4, random_state=0)
    for method in ("fit", "partial_fit"):
        with pytest.warns(UserWarning, match=r"rms of y is 7.*: divide y by 7e.*, or give memory=4096"):
            getattr(pure, method)(X, y * scale)
        pure = clone(pure)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert fitted(X, y * scale).score(X, y * scale) > 0.9  # a memory finds it by itself
    bad = RMILSRegressor(WienerHammersteinLags(), gradient="pseudolinear").fit(X[:50], y[:50])
    with pytest.warns(UserWarning, match=r"worse than the mean of the output \(NMSE"):
        bad.score(X, 10.0 - 30.0 * y)


def test_shuffled_samples_are_told_once(record, monkeypatch):
    X, y = (part[:300] for part in record)
    model = RMILSRegressor(WienerHammersteinLags(law="polynomial"), n_starts=2, memory=64, random_state=0)
    monkeypatch.setattr(_checked, "TOLD", set())
    for folds in (KFold(3), TimeSeriesSplit(3)):
        cross_val_score(model, X, y, cv=folds)
    with pytest.warns(UserWarning, match="not in time order") as told:
        cross_val_score(model, X, y, cv=KFold(3, shuffle=True, random_state=0))
    assert len(told) == 1
    monkeypatch.setattr(_checked, "TOLD", set())
    frame = pd.DataFrame(X, columns=["u"])
    model.fit(frame[::2], y[::2])
    part, _, target, _ = train_test_split(frame, y, random_state=0)
    with pytest.warns(UserWarning, match="use whsklearn.validation.time_series_split"):
        model.fit(part, target)


LAWS = {
    "x": lambda x, dx: 1.5 * x - 0.25 * x**3,
    "dx": lambda x, dx: dx + 0.8 * np.sign(dx),
    "both": lambda x, dx: x + 0.8 * np.sign(dx),
}


def two_blocks(kind, seed, n=2000):
    rng = np.random.default_rng(seed)
    u = rng.standard_normal(n)
    x = lfilter([0.0, 1.0, 0.5], [1.0, -0.8, 0.3], u)
    y = lfilter([0.0, 1.0, 0.3], [1.0, -0.5, 0.2], LAWS[kind](x, np.diff(x, prepend=0.0)))
    return u[:, None], y + 0.02 * y.std() * rng.standard_normal(n)


@pytest.mark.parametrize(
    ("kind", "law", "told"),
    [
        ("x", None, True), ("both", None, True), ("x", "polynomial", False), ("dx", None, False),
        ("both", "linear,coulomb", False), ("dx", "polynomial", True),
    ],
)  # fmt: skip
def test_a_law_that_is_not_that_of_the_record_is_told(kind, law, told):
    X, y = two_blocks(kind, 0)
    model = RMILSRegressor(WienerHammersteinLags(law=law), random_state=0)
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        model.fit(X, y)
        error = nmse(y, model.predict(X))
    assert any("its law or its orders are not those" in str(w.message) for w in said) is told
    assert (error > 0.01) is told  # 0.02^2 is the noise


def test_a_search_is_not_told_of_each_wrong_law():
    X, y = two_blocks("x", 0)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        cross_val_score(RMILSRegressor(WienerHammersteinLags(), random_state=0), X, y, cv=TimeSeriesSplit(2))


def test_rows_too_small_for_the_default_start_are_told_with_what_helps():
    rng = np.random.default_rng(3)
    X = rng.standard_normal((300, 3))
    y = X @ [1.0, 2.0, -1.0] + 0.1 * rng.standard_normal(300)
    with pytest.warns(UserWarning, match=r"P0=1e.06 holds .* start: multiply X by 1e.04, or give P0=3e"):
        held = RLSRegressor().fit(1e-4 * X, y)
    assert nmse(y, 1e-4 * X @ held.theta_) > 0.02
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for model, rows in ((RLSRegressor(), X), (RLSRegressor(), 1e-3 * X), (RLSRegressor(P0=3e11), 1e-4 * X)):
            assert nmse(y, rows @ model.fit(rows, y).theta_) < 0.002
        RLSRegressor(P0=1e-3).fit(X, y)  # somebody chose it
        RLSRegressor().fit(0.0 * X, y)


def test_a_batch_fit_too_says_that_its_law_is_not_that_of_the_record():
    rng = np.random.default_rng(5)
    u = rng.standard_normal((1500, 1))
    x = lfilter([0.0, 1.0, 0.5], [1.0, -0.8, 0.3], u[:, 0])
    dx = np.diff(x, prepend=0.0)
    noise = lfilter([1.0], [1.0, -0.5, 0.2], 0.02 * rng.standard_normal(1500))
    of_x, of_dx = (lfilter([0.0, 1.0, 0.3], [1.0, -0.5, 0.2], v) + noise for v in (np.tanh(x), dx + 0.8 * np.sign(dx)))
    model = PEMRegressor(WienerHammersteinLags(2, 2, 2, 2, law="viscous,coulomb"), n_starts=4, random_state=0)
    with pytest.warns(UserWarning, match=r"Functions of the input explain \d+ % .* law in x"):
        model.fit(u, of_x)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        model.fit(u, of_dx)


@pytest.mark.parametrize(("scale", "named"), [(1e-9, "viscous and stribeck"), (1e9, "coulomb and stribeck")])
def test_a_law_whose_velocity_is_of_another_scale_than_the_record_is_told_as_such(scale, named):
    X, y = make_wiener_hammerstein(n_samples=1500, snr_db=20, random_state=9000)
    with pytest.warns(UserWarning, match=rf"terms {named} .* same over this record .*ReducedStribeck\(velocity"):
        fitted(scale * X, scale * y)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        told = fitted(scale * X, scale * y, [Viscous(), Coulomb(), ReducedStribeck(velocity=scale)])
    assert nmse(y, told.predict(scale * X) / scale) < 1.1 * nmse(y, fitted(X, y).predict(X))


@pytest.mark.parametrize("scale", [1e-6, 1e6])
def test_knots_that_are_not_where_x_is_are_told_with_the_law_that_places_them(scale):
    u, y = sigmoid(scale)
    lags = WienerHammersteinLags(1, 1, 1, 1, law=as_law("cubic_spline:6"))
    with pytest.warns(UserWarning, match=r"same over this record .* law='cubic_spline'"):
        left = nmse(y, RMILSRegressor(lags, random_state=0).fit(u, y).predict(u))
    lags = lags.set_params(law="cubic_spline:6")
    assert nmse(y, RMILSRegressor(lags, random_state=0).fit(u, y).predict(u)) < min(0.1 * left, 1e-3)


def test_a_stream_under_a_law_whose_knots_are_open_says_so_unless_a_fit_has_placed_them():
    u, y = sigmoid(0.01)
    model = RMILSRegressor(WienerHammersteinLags(1, 1, 1, 1, law="cubic_spline:6"), n_starts=2, random_state=0)
    with pytest.warns(UserWarning, match="give a first record to fit, whose knots partial_fit keeps"):
        clone(model).partial_fit(u[:10], y[:10])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        model.fit(u[:1000], y[:1000]).partial_fit(u[1000:], y[1000:])
    assert nmse(y, model.predict(u)) < 1e-3


def sigmoid(scale):
    """Input and output of a chain about a sigmoid of an x of this scale."""
    u = scale * np.random.default_rng(0).standard_normal((1500, 1))
    y = lfilter([0.0, 1.0], [1.0, -0.5], np.tanh(lfilter([0.0, 1.0 / scale], [1.0, -0.8], u[:, 0])))
    y += lfilter([1.0], [1.0, -0.5], 0.01 * np.std(y) * np.random.default_rng(1).standard_normal(1500))
    return u, y


@pytest.mark.parametrize("seed", [0, 1])
def test_a_chain_whose_free_run_a_linear_filter_beats_is_told_with_the_fit_that_helps(seed):
    rng = np.random.default_rng(seed)
    u = rng.standard_normal((3000, 1))
    resonance = np.poly(0.95 * np.exp([0.3j, -0.3j])).real
    clean = lfilter([0.0, 1.0], resonance, np.tanh(lfilter([0.0, 1.0], [1.0, -0.5], u[:, 0])))
    y = clean / clean.std() + 0.1 * rng.standard_normal(3000)
    lags = WienerHammersteinLags(1, 1, 1, 2, law="polynomial")
    with pytest.warns(UserWarning, match=r"free run of this fit leaves .* a linear filter only .*'simulation'"):
        left = nmse(clean / clean.std(), RMILSRegressor(lags, random_state=0).fit(u, y).predict(u))
    advised = PEMRegressor(lags, criterion="simulation").fit(u, y)
    assert nmse(clean / clean.std(), advised.predict(u)) < 0.1 * left


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("at_output", [True, False])
def test_noise_of_the_output_is_told_and_noise_within_the_second_block_is_not(seed, at_output):
    rng = np.random.default_rng(seed)
    u, white = rng.standard_normal((2, 3000))
    x = lfilter([0.0, 1.0, 0.5], [1.0, -0.8, 0.3], u)
    y = lfilter([0.0, 1.0, 0.3], [1.0, -1.2, 0.5], x + 0.3 * x**3)
    noise = white if at_output else lfilter([1.0], [1.0, -1.2, 0.5], white)
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        fitted(u[:, None], y + 0.05 * np.std(y) / np.std(noise) * noise, "polynomial")
    assert [str(w.message)[:60] for w in said if "follows its own past" in str(w.message)] == [
        "What this chain leaves one step ahead follows its own past (" for _ in range(at_output)
    ]
