"""Recursive least squares on given rows."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

from whsklearn import (
    MILSRegressor,
    MultiInnovationGradientRegressor,
    RLSRegressor,
    RMILSRegressor,
    WienerHammersteinLags,
    WienerHammersteinSystem,
)
from whsklearn.datasets import make_wiener_hammerstein
from whsklearn.effects import Coulomb
from whsklearn.effects.law import piecewise_linear_law, polynomial_law, smooth_law
from whsklearn.metrics import nmse
from whsklearn.recursion.memory.multistart import posterior


def test_it_is_batch_least_squares():
    rng = np.random.default_rng(0)
    X = rng.standard_normal((100, 3))
    y = X @ [1.0, -2.0, 0.5] + 0.1 * rng.standard_normal(100)
    model = RLSRegressor(P0=1e9).fit(X, y)
    theta, rss = np.linalg.lstsq(X, y, rcond=None)[:2]
    np.testing.assert_allclose(model.theta_, theta, rtol=1e-7)
    np.testing.assert_allclose(model.covariance_, rss[0] / 97 * np.linalg.inv(X.T @ X), rtol=1e-6)
    np.testing.assert_array_equal(model.predict(X), X @ model.theta_)


def test_on_the_true_regressors_it_finds_the_truth():
    X, y, truth = make_wiener_hammerstein(300, snr_db=None, random_state=1, return_truth=True)
    rows = WienerHammersteinLags(theta=truth.theta).fit_transform(X, y)
    np.testing.assert_allclose(RLSRegressor(P0=1e10).fit(rows, y).theta_, truth.theta, rtol=1e-6)


@pytest.mark.parametrize("model", [RLSRegressor(P0=1e8), MILSRegressor(p=4, P0=1e8)])
def test_intervals_cover_the_truth(model):
    """95 % intervals on known regressors over 200 seeds; 9 x 200 draws scatter by about 1 %."""
    hits = []
    for seed in range(200):
        X, y, truth = make_wiener_hammerstein(300, random_state=seed, return_truth=True)
        rows = WienerHammersteinLags(theta=truth.theta).fit_transform(X, y)
        model.fit(rows, y)
        hits.append(np.abs(model.theta_ - truth.theta) < 1.96 * model.standard_errors_)
    assert 0.92 <= np.mean(hits) <= 0.98


def test_forgetting_tracks_a_parameter_that_changes():
    rng = np.random.default_rng(2)
    X = rng.standard_normal((1000, 2))
    y = X @ [1.0, -1.0]
    y[500:] = X[500:] @ [3.0, -1.0]
    errors = {f: abs(RLSRegressor(forgetting=f).fit(X, y).theta_[0] - 3.0) for f in (1.0, 0.95)}
    assert errors[0.95] < 1e-6 < 0.5 < errors[1.0]


def test_theta0_and_p0_are_a_prior():
    X, y = np.array([[1.0]]), np.array([4.0])
    model = RLSRegressor(P0=3.0, theta0=[2.0]).fit(X, y)
    assert model.theta_[0] == pytest.approx((3.0 * 4.0 + 2.0) / 4.0)


def test_without_degrees_of_freedom_there_is_no_standard_error():
    model = RLSRegressor().fit(np.ones((1, 2)), [1.0])
    with pytest.warns(UserWarning, match="standard errors are NaN"):
        assert np.isnan(model.standard_errors_).all()


@pytest.mark.parametrize("n", [1, 50])
def test_an_axis_at_rest_does_not_wind_up(n):
    rng = np.random.default_rng(3)
    X = rng.standard_normal((200, 2))
    y = X @ [1.0, -2.0]
    model = RLSRegressor(forgetting=0.9).fit(X, y)
    for _ in range(10_000 // n):
        model.partial_fit(np.zeros((n, 2)), np.zeros(n))
    assert np.isfinite(model.state_["ud"]).all()
    np.testing.assert_allclose(model.theta_, [1.0, -2.0], rtol=1e-6)
    model.partial_fit(X, X @ [5.0, 1.0])
    np.testing.assert_allclose(model.theta_, [5.0, 1.0], rtol=1e-3)


HAMMERSTEIN = WienerHammersteinSystem([1.0], [], [1.0], [0.3], polynomial_law([0.0, 1.0, 0.5]))
LAGS = WienerHammersteinLags(1, 0, 1, 1, law=polynomial_law([0.0, 1.0, 0.5]))


@pytest.mark.parametrize("gradient", ["full", "pseudolinear"])
def test_one_innovation_is_recursive_least_squares(gradient):
    X, y = make_wiener_hammerstein(120, random_state=0)
    a, b = (
        kind(WienerHammersteinLags(), gradient=gradient, n_starts=2, memory=0, random_state=0).fit(X, y)
        for kind in (lambda *v, **k: MILSRegressor(*v, p=1, **k), RLSRegressor)
    )
    np.testing.assert_array_equal(a.theta_, b.theta_)


@pytest.mark.parametrize("gradient", ["full", "pseudolinear"])
def test_block_and_sub_innovations_are_one_where_rows_do_not_depend_on_theta(gradient):
    """A static x and no c: the difference of MILS and RMILS is in rebuilt rows and nowhere else."""
    X, y = make_wiener_hammerstein(150, snr_db=20, random_state=1, system=HAMMERSTEIN)
    settings = {"lags": LAGS, "p": 4, "gradient": gradient, "memory": 0, "n_starts": 1, "random_state": 0}
    block, sub = (kind(**settings).fit(X, y) for kind in (MILSRegressor, RMILSRegressor))
    np.testing.assert_allclose(block.theta_, sub.theta_, rtol=1e-9)
    np.testing.assert_allclose(block.covariance_, sub.covariance_, rtol=1e-7)


def test_where_they_do_the_two_differ():
    X, y = make_wiener_hammerstein(150, random_state=2)
    settings = {"lags": WienerHammersteinLags(), "p": 4, "gradient": "pseudolinear"}
    assert not np.allclose(MILSRegressor(**settings).fit(X, y).theta_, RMILSRegressor(**settings).fit(X, y).theta_)


def test_to_the_letter_p_is_about_p_times_too_small():
    """As published, each sample counts in p windows; the default counts it once."""
    X, y = make_wiener_hammerstein(300, snr_db=20, random_state=3, system=HAMMERSTEIN)
    letter = [MILSRegressor(LAGS, p=p, gradient="pseudolinear").fit(X, y).covariance_[0, 0] for p in (1, 5)]
    once = [MILSRegressor(LAGS, p=p, random_state=0, n_starts=2).fit(X, y).covariance_[0, 0] for p in (1, 5)]
    assert letter[0] / letter[1] == pytest.approx(5.0, rel=0.1)
    assert once[0] / once[1] == pytest.approx(1.0, rel=0.1)


SYSTEMS = {
    "law (4)": WienerHammersteinSystem.example(),
    "law (3)": WienerHammersteinSystem([1.0, 0.4], [-0.5], [1.0], [0.3], smooth_law([0.8, 2.0, 0.5, 0.7, 1.0, 0.3])),
    "hammerstein": WienerHammersteinSystem([1.0], [], [1.0, 0.4], [-0.5], polynomial_law([0.0, 1.0, 0.5])),
    "wiener": WienerHammersteinSystem([1.0, 0.4], [-0.5], [1.0], [], polynomial_law([0.0, 1.0, 0.5])),
    "piecewise linear": WienerHammersteinSystem(
        [1.0], [-0.5], [1.0], [0.3], piecewise_linear_law([-0.5, 0.5], [1.0, 0.2, 1.0])
    ),
    "no linear term": WienerHammersteinSystem([1.0, 0.5], [-0.4], [1.0, 0.2], [0.3], [Coulomb(0.8)]),
}


def lags_of(system):
    return WienerHammersteinLags(system.a.size, system.b.size, system.c.size, system.d.size, law=system.law)


@pytest.mark.parametrize("name", list(SYSTEMS))
def test_without_noise_it_finds_the_system(name):
    system = SYSTEMS[name]
    X, y = make_wiener_hammerstein(500, snr_db=None, random_state=0, system=system)
    model = RMILSRegressor(lags_of(system), n_starts=12, random_state=0).fit(X, y)
    X2, y2 = make_wiener_hammerstein(500, snr_db=None, random_state=1, system=system)
    signs = name in ("law (4)", "no linear term")  # a flipped sign costs some 1e-3 each, see the reproduction report
    assert nmse(y2, model.predict(X2)) < (0.02 if signs else 1e-4)
    named = model.parameters_
    for block in ("b", "d"):
        np.testing.assert_allclose(named[block], getattr(system, block), atol=0.05)
    for label, weight in zip(system.law.labels, system.law.weights, strict=True):
        assert named[label] == pytest.approx(weight, abs=0.15)


def test_several_inputs():
    """Two inputs share the denominator of L1; the second one's gain is a[0, 1]."""
    rng = np.random.default_rng(0)
    U = rng.standard_normal((500, 2))
    law = polynomial_law([0.0, 1.0, 0.3])
    system = WienerHammersteinSystem([1.0], [-0.5], [1.0], [0.3], law)
    y = system.simulate(U[:, 0] + 0.6 * U[:, 1])
    model = RMILSRegressor(WienerHammersteinLags(1, 1, 1, 1, law=law), n_starts=8, random_state=0).fit(U, y)
    np.testing.assert_allclose(model.parameters_["a"], [[1.0, 0.6]], atol=1e-3)
    assert model.score(U, y) > 0.9999
    assert model.predict_ahead(U, y).shape == (500,)


@pytest.mark.parametrize("seed", [46, 1940, 2016, 2967, 3009, 4667])
def test_a_stream_does_not_stand_in_a_wrong_minimum(seed):
    """Starts were tried on too few samples: one of these seeds or another ended at 1.6 to 2.1 times the noise."""
    X, y = make_wiener_hammerstein(1000, snr_db=7.462, random_state=seed)
    noise = np.var(WienerHammersteinSystem.example().simulate(X)) / 10**0.7462
    model = RMILSRegressor(WienerHammersteinLags(), random_state=seed).partial_fit(X, y)
    assert model.innovation_variance_ < 1.4 * noise


def test_the_published_order_of_theta():
    """[g a1, g a2, g b1 + g, g b2, beta1, beta2, c2, d1, d2], as (6) has it."""
    X, y = make_wiener_hammerstein(600, snr_db=40, random_state=2)
    model = RMILSRegressor(WienerHammersteinLags(), n_starts=12, random_state=0).fit(X, y)
    named = model.parameters_
    g, a, b = named["viscous"], named["a"], named["b"]
    expected = [g, g * a[1], g * b[0] + g, g * b[1], named["coulomb"], named["stribeck"], named["c"][1], *named["d"]]
    np.testing.assert_allclose(model.theta_, expected, rtol=1e-9)
    np.testing.assert_allclose(model.theta_, WienerHammersteinSystem.example().theta, atol=0.06)


def test_standard_errors_are_calibrated_where_the_model_is_linear():
    system = WienerHammersteinSystem([1.0], [], [1.0], [0.3, -0.2], polynomial_law([0.0, 1.0, 0.5]))
    truth = np.concatenate([system.law.weights, system.d])
    hits = []
    for seed in range(120):
        X, y = make_wiener_hammerstein(200, snr_db=10, random_state=seed, system=system)
        model = RMILSRegressor(lags_of(system), n_starts=1, random_state=0).fit(X, y)
        named, errors = model.parameters_, model.parameter_standard_errors_
        estimate = np.r_[named["x1"], named["x2"], named["d"]]
        error = np.r_[errors["x1"], errors["x2"], errors["d"]]
        hits.append(np.abs(estimate - truth) < 1.96 * error)
    assert 0.91 <= np.mean(hits) <= 0.98  # 480 draws scatter by 1 %


def test_the_published_reading_does_not_converge_on_the_paper_s_example():
    """A measured fact, not a wish: 8 seeds, and delta stays far above what the paper's Fig. 2d shows."""
    truth = WienerHammersteinSystem.example().theta
    deltas, runs = [], []
    for seed in range(8):
        X, y = make_wiener_hammerstein(1000, random_state=seed)
        model = RMILSRegressor(WienerHammersteinLags(), gradient="pseudolinear", P0=1e6).fit(X, y)
        deltas.append(np.linalg.norm(model.theta_ - truth) / np.linalg.norm(truth))
        X2, y2 = make_wiener_hammerstein(1000, snr_db=None, random_state=[seed, 1])
        runs.append(nmse(y2, model.predict(X2)))
    assert min(deltas) > 0.3
    assert np.median(runs) > 0.15


def test_forgetting_tracks_an_axis_that_changes():
    before = WienerHammersteinSystem([1.0], [], [1.0], [0.3], polynomial_law([0.0, 1.0, 0.5]))
    after = WienerHammersteinSystem([1.0], [], [1.0], [-0.4], polynomial_law([0.0, 2.0, 0.5]))
    X, y = make_wiener_hammerstein(800, snr_db=30, random_state=3, system=before)
    X2, y2 = make_wiener_hammerstein(800, snr_db=30, random_state=4, system=after)
    errors = {}
    for forgetting in (1.0, 0.98):
        for memory in (0, 256):
            model = RMILSRegressor(
                lags_of(before), forgetting=forgetting, memory=memory, n_starts=2, random_state=0
            ).partial_fit(X, y)
            model.partial_fit(X2, y2)
            errors[forgetting, memory] = abs(model.parameters_["x1"] - 2.0)
    assert max(errors[0.98, 0], errors[0.98, 256]) < 0.1
    assert errors[1.0, 256] > 0.3


def test_a_known_theta_helps_as_one_more_start():
    X, y = make_wiener_hammerstein(300, snr_db=30, random_state=5)
    truth = WienerHammersteinSystem.example().theta
    alone = RMILSRegressor(WienerHammersteinLags(), n_starts=1, random_state=3).fit(X, y)
    told = RMILSRegressor(WienerHammersteinLags(), n_starts=1, theta0=truth, random_state=3).fit(X, y)
    assert told.score(X, y) >= alone.score(X, y) - 1e-9
    assert told.score(X, y) > 0.97


@pytest.mark.parametrize("n", [60, 200, 400])
def test_a_stream_whose_first_models_have_not_taken_over_answers_as_fit_does(n):
    """The recursion that runs until then begins from nothing, and its parameters were told as they stood."""
    X, y = make_wiener_hammerstein(n_samples=n, snr_db=7.462, random_state=1)
    stream = RMILSRegressor(WienerHammersteinLags(), p=4, random_state=0)
    for rows in np.array_split(np.arange(n), 3):
        stream.partial_fit(X[rows], y[rows])
    whole = RMILSRegressor(WienerHammersteinLags(), p=4, random_state=0).fit(X, y)
    np.testing.assert_array_equal(stream.theta_, whole.theta_)
    np.testing.assert_array_equal(stream.predict(X), whole.predict(X))


def test_an_answer_is_worked_out_once_for_a_state(tmp_path, monkeypatch):
    """Of a stream, of one that was loaded, and again when it has learnt or its parameters are others."""
    asked = []

    def counted(*arguments):
        asked.append(1)
        return posterior(*arguments)

    monkeypatch.setattr("whsklearn.estimators._streams.posterior", counted)
    X, y = make_wiener_hammerstein(600, snr_db=20, random_state=0)
    model = RMILSRegressor(WienerHammersteinLags(), n_starts=4, memory=256, random_state=0)
    model.partial_fit(X[:550], y[:550]).save(tmp_path / "model.whs")
    loaded, unpickled = RMILSRegressor.load(tmp_path / "model.whs"), pickle.loads(pickle.dumps(model))
    theta = model.theta_
    for m in (loaded, unpickled):
        asked.clear()
        np.testing.assert_array_equal(m.theta_, theta)
        assert np.isfinite([m.predict(X).sum(), m.standard_errors_.sum(), m.parameters_["b"].sum()]).all()
        assert len(asked) == 1
        m.partial_fit(X[550:], y[550:])
        assert not np.array_equal(m.theta_, theta)
        assert len(asked) == 2
    loaded.set_params(p=2).predict(X)
    assert len(asked) == 3


def test_the_first_step_is_the_written_one():
    X, y = np.array([[1.0, 2.0]]), np.array([5.0])
    model = MultiInnovationGradientRegressor(p=3).fit(X, y)
    np.testing.assert_allclose(model.theta_, X[0] * 5.0 / 5.0)


def test_more_innovations_come_closer_in_one_pass():
    rng = np.random.default_rng(0)
    X = rng.standard_normal((1500, 3))
    truth = np.array([1.0, -2.0, 0.5])
    miss = [np.linalg.norm(MultiInnovationGradientRegressor(p=p).fit(X, X @ truth).theta_ - truth) for p in (1, 4, 16)]
    assert miss[0] > 2 * miss[1] > 4 * miss[2]


def test_it_has_no_standard_errors():
    model = MultiInnovationGradientRegressor().fit(np.eye(3), np.ones(3))
    assert np.isnan(model.standard_errors_).all()
    assert np.isnan(model.covariance_).all()


def test_it_runs_on_the_paper_s_rows_and_stays_finite():
    X, y = make_wiener_hammerstein(500, random_state=1)
    model = MultiInnovationGradientRegressor(WienerHammersteinLags(), p=8, forgetting=0.7).fit(X, y)
    assert np.isfinite(model.theta_).all()
    assert np.isfinite(model.predict(X)).all()
