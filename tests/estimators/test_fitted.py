"""What was learnt, by its names."""

from __future__ import annotations

import re

import numpy as np
import pandas as pd
import pytest
from scipy.signal import dlsim
from sklearn.base import clone
from sklearn.exceptions import NotFittedError

from tests.estimators.fitted_models import MODELS
from whsklearn import (
    DifferentialEvolutionRegressor,
    PEMRegressor,
    RLSRegressor,
    RMILSRegressor,
    StreamingPEMRegressor,
    WienerHammersteinLags,
)
from whsklearn.datasets import make_wiener_hammerstein

OPEN = WienerHammersteinLags(2, 1, 2, 1, law="polynomial", delays=(0, 0))


@pytest.fixture(scope="module")
def short_record():
    return make_wiener_hammerstein(400, snr_db=30, random_state=0)


@pytest.mark.parametrize(
    "model",
    [
        RMILSRegressor(WienerHammersteinLags(), n_starts=4, memory=128, random_state=0),
        PEMRegressor(n_starts=2, random_state=0),
        PEMRegressor(OPEN, criterion="simulation"),
        StreamingPEMRegressor(OPEN, n_start=100, block=50),
        DifferentialEvolutionRegressor(n_generations=1, random_state=0),
        RMILSRegressor(WienerHammersteinLags(), gradient="pseudolinear"),
    ],
    ids=["RMILS", "PEM", "simulation", "one pass", "swarm", "published"],
)
def test_the_table_is_parameters_and_errors(short_record, model):
    X, y = short_record
    summary = model.fit(X, y).summary()
    named = model.parameters_
    table = summary.table
    assert list(table) == ["value", "standard_error", "low", "high"]
    for letter in "bd":
        np.testing.assert_array_equal(table.loc[[i for i in table.index if re.fullmatch(rf"{letter}\d+", i)], "value"],
                                      named[letter])  # fmt: skip
    assert "a1" not in table.index  # one by definition
    assert table.loc["a2", "value"] == named["a"][1]
    known = table.dropna()
    np.testing.assert_allclose((known.high - known.low) / known.standard_error, 2 * 1.959964, rtol=1e-5)
    text = str(summary)
    assert text.startswith(type(model).__name__)
    assert "samples  400" in text
    assert "pole" in summary.facts["L1"]
    assert max(map(len, text.splitlines())) < 130
    assert "<table" in summary._repr_html_()


def test_rows_and_several_inputs_have_one_too():
    rng = np.random.default_rng(0)
    X = rng.standard_normal((200, 2))
    rows = RLSRegressor().fit(X, X @ [1.0, -2.0] + 0.1 * rng.standard_normal(200)).summary()
    assert rows.table.index.tolist() == ["x0", "x1"]
    assert float(rows.facts["noise"].split()[0]) == pytest.approx(0.1, rel=0.15)
    y = np.r_[0.0, 0.0, (X[:-2] @ [1.0, 0.5])] + 0.01 * rng.standard_normal(200)
    chain = PEMRegressor(WienerHammersteinLags(1, 0, 1, 0, law="linear"), n_starts=2, random_state=0).fit(X, y)
    assert chain.summary().table.index[0] == "a1_2"
    assert chain.summary().table.loc["a1_2", "value"] == pytest.approx(0.5, abs=0.02)


@pytest.mark.parametrize("delays", [(1, 1), (0, 0), (0, 2)])
def test_the_blocks_and_the_law_are_the_free_run(delays):
    rng = np.random.default_rng(1)
    u = rng.standard_normal((300, 1))
    lags = WienerHammersteinLags(2, 1, 2, 2, law="polynomial", delays=delays)
    x = np.convolve(u[:, 0], 0.6 ** np.arange(30))[:300]
    y = np.convolve(x + 0.3 * x**2, [0.0] * sum(delays) + [1.0, 0.4])[:300]
    model = PEMRegressor(lags, criterion="simulation").fit(u, y)
    first, second = model.to_dlti(dt=0.01)
    assert first.dt == second.dt == 0.01
    x_hat = dlsim(first, u)[1]
    law = model.structure_.law
    v = law.regressors(x_hat[:, 0], 0.0) @ law.weights
    np.testing.assert_allclose(dlsim(second, v)[1][:, 0], model.predict(u), atol=1e-6)


def test_several_inputs_give_a_system_each(record):
    rng = np.random.default_rng(0)
    X = rng.standard_normal((200, 2))
    y = np.r_[0.0, 0.0, (X[:-2] @ [1.0, 0.5])]
    model = PEMRegressor(WienerHammersteinLags(1, 0, 1, 0, law="linear"), n_starts=2, random_state=0).fit(X, y)
    first, _ = model.to_dlti()
    assert [float(s.num[0]) for s in first] == pytest.approx([1.0, 0.5], abs=1e-3)


def test_rows_have_no_blocks_and_a_clock_must_run():
    X = np.random.default_rng(0).standard_normal((50, 2))
    model = RLSRegressor().fit(X, X @ [1.0, 2.0])
    with pytest.raises(ValueError, match="has no linear blocks"):
        model.to_dlti()
    X, y = make_wiener_hammerstein(60, random_state=0)
    with pytest.raises(ValueError, match="expected a positive number"):
        PEMRegressor(n_starts=1, random_state=0).fit(X, y).to_dlti(dt=0.0)


@pytest.mark.parametrize("name", list(MODELS))
def test_parameters_and_theta_are_one_model(fitted, name):
    """The paper's products undone are the named parameters."""
    model = fitted[name]
    named, theta = model.parameters_, model.theta_
    law = [k for k in named if k not in "abcd"]
    g = named[law[0]] if name != "polynomial" else named["x1"]
    np.testing.assert_allclose(theta[: len(named["a"])], g * named["a"], rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(theta[len(theta) - len(named["d"]) :], named["d"])
    assert named["a"][0] == named["c"][0] == 1.0
    assert {k: np.shape(v) for k, v in model.parameter_standard_errors_.items()} == {
        k: np.shape(v) for k, v in named.items()
    }
    assert model.covariance_.shape == (theta.size, theta.size)


def test_names_of_given_rows():
    frame = pd.DataFrame(np.random.default_rng(0).standard_normal((30, 2)), columns=["mass", "drag"])
    model = RLSRegressor().fit(frame, frame @ [1.0, 2.0])
    assert model.parameters_ == pytest.approx({"mass": 1.0, "drag": 2.0}, rel=1e-4)
    assert list(model.parameter_standard_errors_) == ["mass", "drag"]
    assert list(RLSRegressor().fit(frame.to_numpy(), np.ones(30)).parameters_) == ["x0", "x1"]


@pytest.mark.parametrize("attribute", ["theta_", "covariance_", "standard_errors_", "parameters_"])
def test_nothing_before_fit(attribute, record):
    model = clone(MODELS["RMILS"])
    with pytest.raises(NotFittedError):
        getattr(model, attribute)
    for call in (model.predict, model.get_state, lambda X: model.predict_ahead(X, record[1])):
        with pytest.raises(NotFittedError):
            call(record[0]) if call != model.get_state else call()
