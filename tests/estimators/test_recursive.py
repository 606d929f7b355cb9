"""fit and partial_fit: streams, experiments, and the paths that they take."""

from __future__ import annotations

import copy

import numpy as np
import pytest
from scipy.signal import lfilter
from sklearn.base import clone

from whsklearn import (
    MILSRegressor,
    MultiInnovationGradientRegressor,
    RLSRegressor,
    RMILSRegressor,
    WienerHammersteinLags,
)
from whsklearn.checks import state_difference
from whsklearn.datasets import make_wiener_hammerstein
from whsklearn.effects import as_law
from whsklearn.metrics import nmse

# a record of a dynamic system stands in for rows here
pytestmark = pytest.mark.filterwarnings("ignore:X has one column")

DYNAMIC = RMILSRegressor(WienerHammersteinLags(), n_starts=2, memory=64, random_state=0)


@pytest.fixture(scope="module")
def record():
    return make_wiener_hammerstein(200, random_state=0)


@pytest.mark.parametrize("model", [RLSRegressor(), MILSRegressor(p=3), RMILSRegressor(p=3, forgetting=0.98), DYNAMIC])
def test_the_fast_path_is_the_checked_one(record, model):
    """Arrays as they come, and lists that go through every check, row by row."""
    X, y = record
    fast, checked = clone(model), clone(model)
    for t in range(0, 90):
        fast.partial_fit(X[t : t + 1], y[t : t + 1])
        checked.partial_fit(X[t : t + 1].tolist(), y[t : t + 1].tolist())
    assert state_difference(fast.get_state(), checked.get_state()) == 0.0


@pytest.mark.parametrize("kind", ["float32", "int", "fortran", "read-only", "strided"])
def test_other_arrays_are_taken_by_value(kind):
    rng = np.random.default_rng(0)
    X, y = np.round(rng.standard_normal((60, 2)) * 8), np.round(rng.standard_normal(60) * 8)
    expected = RMILSRegressor().partial_fit(X, y).partial_fit(X, y).theta_
    if kind == "float32":
        X, y = X.astype(np.float32), y.astype(np.float32)
    elif kind == "int":
        X, y = X.astype(int), y.astype(int)
    elif kind == "fortran":
        X = np.asfortranarray(X)
    elif kind == "read-only":
        X.flags.writeable = y.flags.writeable = False
    else:
        X, y = np.repeat(X, 2, axis=0)[::2], np.repeat(y, 2)[::2]
    np.testing.assert_array_equal(RMILSRegressor().partial_fit(X, y).partial_fit(X, y).theta_, expected)


def test_fit_forgets_and_partial_fit_goes_on(record):
    X, y = record
    model = clone(DYNAMIC).fit(X, y)
    again = clone(DYNAMIC).fit(X[50:], y[50:]).fit(X, y)
    assert state_difference(model.get_state(), again.get_state()) == 0.0
    seen = model.state_["seen"]
    model.partial_fit(X[:30], y[:30])
    assert model.state_["seen"] == seen + 30


def test_fit_is_a_stream_and_one_last_look_at_the_memory(record):
    X, y = record
    fitted, stream = clone(DYNAMIC).fit(X, y), clone(DYNAMIC).partial_fit(X, y)
    assert state_difference(fitted.get_state(), stream.consolidate().get_state()) == 0.0


def test_experiments_of_one_array_and_one_by_one(record):
    X, y = record
    groups = np.repeat([3, 1, 2], [70, 60, 70])
    together = clone(DYNAMIC).partial_fit(X, y, groups=groups)
    apart = clone(DYNAMIC)
    for g in (3, 1, 2):
        apart.partial_fit(X[groups == g], y[groups == g], groups=groups[groups == g])
    assert state_difference(together.get_state(), apart.get_state()) == 0.0
    split = clone(DYNAMIC).partial_fit(X[:100], y[:100], groups=groups[:100])
    split.partial_fit(X[100:130], y[100:130])  # no groups: the experiment goes on
    split.partial_fit(X[130:], y[130:], groups=groups[130:])
    assert state_difference(together.get_state(), split.get_state()) == 0.0
    glued = clone(DYNAMIC).partial_fit(X, y)
    assert state_difference(together.get_state(), glued.get_state()) > 0.0


def test_an_experiment_begins_at_rest(record):
    """After a restart the window and the auxiliary state hold nothing of the experiment before."""
    X, y = record
    for gradient in ("full", "pseudolinear"):
        model = clone(DYNAMIC).set_params(gradient=gradient, memory=0)
        model.partial_fit(1e3 * X[:100], 1e3 * y[:100], groups=np.zeros(100))
        model.partial_fit(X[100:103], y[100:103], groups=np.ones(3))
        assert model.state_["since"] == 3
        recent = model.state_["recent_y"]
        np.testing.assert_array_equal(recent[:3], y[100:103][::-1])
        assert not recent[3:].any()
        assert np.abs(model.state_["before"]).max() < 1e2


@pytest.mark.parametrize(
    "model", [RLSRegressor(), DYNAMIC, RMILSRegressor(WienerHammersteinLags(), memory=0, n_starts=2)]
)
def test_the_innovation_variance_is_that_of_the_latest_errors(record, model):
    X, y = record
    variance = clone(model).fit(X, y).innovation_variance_
    assert 0.0 < variance < 2 * np.var(y)


def test_the_seed_decides(record):
    X, y = record
    a, b, c = (clone(DYNAMIC).set_params(random_state=s, memory=0).fit(X, y).theta_ for s in (1, 1, 2))
    np.testing.assert_array_equal(a, b)
    assert not np.array_equal(a, c)


def test_states_are_of_one_size(record):
    X, y = record
    long_X, long_y = np.tile(X, (12, 1)), np.tile(y, 12)
    for memory in (0, 64):
        model = clone(DYNAMIC).set_params(memory=memory)
        early = {k: np.shape(v) for k, v in model.partial_fit(long_X[:1200], long_y[:1200]).state_.items()}
        late = {k: np.shape(v) for k, v in model.partial_fit(long_X[1200:], long_y[1200:]).state_.items()}
        assert early == late


@pytest.mark.parametrize("memory", [1, 5, 64])
def test_any_length_of_memory_runs(record, memory):
    X, y = record
    model = clone(DYNAMIC).set_params(memory=memory).fit(X, y)
    assert np.isfinite(model.theta_).all()
    assert np.isfinite(model.predict(X)).all()


def test_a_short_record_is_fitted_as_far_as_it_goes():
    X, y = make_wiener_hammerstein(4, random_state=0)
    with pytest.warns(UserWarning, match="4 samples for 9 parameters"):
        model = clone(DYNAMIC).fit(X, y)
    assert np.isfinite(model.theta_).all()
    assert clone(DYNAMIC).partial_fit(X[:1], y[:1]).predict(X).shape == (4,)


def test_a_fit_does_not_end_with_the_resonance_of_l2_in_l1():
    """Both blocks ring, L1 slowly, and its poles are further out than those of any random start."""
    rng = np.random.default_rng(7116)
    first, second = (np.real(np.poly([p, p.conjugate()])) for p in (0.9655 * np.exp(0.164j), 0.709 + 0.571j))
    u = rng.standard_normal((2000, 1))
    dx = np.diff(lfilter([0.0, 1.0, 0.5], first, u[:, 0]), prepend=0.0)
    clean = lfilter([0.0, 1.0, 0.3], second, dx + 0.8 * dx.std() * np.sign(dx))
    noise = lfilter([1.0], second, rng.standard_normal(2000))
    scale = 0.04 * clean.std() / noise.std()
    model = RMILSRegressor(WienerHammersteinLags(2, 2, 2, 2, law="viscous,coulomb"), random_state=0)
    model.fit(u, clean + scale * noise)
    assert model.innovation_variance_ < 1.3 * scale**2


@pytest.mark.parametrize("seed", range(3))
def test_a_stream_of_a_law_in_x_reads_as_well_as_its_fit(seed):
    """No sign is in doubt, so no posterior corrects what strays between two re-runs."""
    rng = np.random.default_rng(seed)
    first = np.real(np.poly([0.98, 0.6, 0.8 * np.exp(0.9j), 0.8 * np.exp(-0.9j)]))
    u = rng.standard_normal((3000, 1))
    x = lfilter(np.r_[0.0, 1.0, rng.uniform(-0.9, 0.9, 3)], first, u[:, 0])
    z = x / x.std()
    clean = lfilter([0.0, 1.0, 0.4], [1.0, -0.8], z - np.clip(z, -0.4, 0.5))
    y = clean + 0.05 * clean.std() * rng.standard_normal(3000)
    model = RMILSRegressor(WienerHammersteinLags(4, 4, 2, 1, law=as_law("cubic_spline")), random_state=0)
    read, fitted = model.partial_fit(u[:1000] / x.std(), y[:1000]), clone(model).fit(u[:1000] / x.std(), y[:1000])
    left = [nmse(clean[1000:], m.predict(u / x.std())[1000:]) for m in (read, fitted)]
    assert left[0] < 2.0 * left[1]


@pytest.mark.parametrize("kind", [RLSRegressor, MILSRegressor, RMILSRegressor, MultiInnovationGradientRegressor])
def test_a_parameter_that_there_is_not_is_told_of_the_class_that_was_called(kind):
    with pytest.raises(TypeError, match=rf"{kind.__name__}.__init__\(\) got an unexpected keyword argument 'foo'"):
        kind(foo=1)
    assert clone(kind(forgetting=0.9)).forgetting == 0.9


@pytest.mark.parametrize("law", ["cubic_spline:8", "piecewise_linear:8"])
def test_a_fit_under_a_law_given_by_name_is_the_same_in_any_unit(law, tmp_path):
    """Its knots are placed where x is; those for an x of unit deviation left a hundred times as much."""
    rng = np.random.default_rng(3)
    u = rng.standard_normal((1600, 1))
    x = lfilter([0.0, 1.0, 0.4], [1.0, -0.9, 0.3], u[:, 0])
    y = lfilter([0.0, 1.0], [1.0, -0.6], np.tanh(1.5 * x / x.std())) + 0.02 * rng.standard_normal(1600)
    lags, runs = WienerHammersteinLags(2, 2, 1, 1, law=law), []
    for by, far in ((1.0, 1.0), (0.01, 100.0), (100.0, 1.0)):
        model = RMILSRegressor(lags, n_starts=4, random_state=0).fit(by * u[:800], far * y[:800])
        runs.append(model.predict(by * u) / far)
        again = model.fit(u, y).fit(by * u[:800], far * y[:800])  # keeps no knots of an earlier fit
        assert np.array_equal(again.predict(by * u) / far, runs[-1])
    assert nmse(y[800:], runs[0][800:]) < 0.01
    for run in runs[1:]:
        assert nmse(runs[0], run) < 1e-4
    model.save(tmp_path / "chain.whs")
    for kept in (RMILSRegressor.load(tmp_path / "chain.whs"), clone(model).set_state(model.get_state())):
        assert np.array_equal(kept.predict(by * u), model.predict(by * u))
        kept.partial_fit(by * u[800:], y[800:])  # under the knots that the fit placed
        assert (
            state_difference(kept.get_state(), copy.deepcopy(model).partial_fit(by * u[800:], y[800:]).get_state()) == 0
        )
