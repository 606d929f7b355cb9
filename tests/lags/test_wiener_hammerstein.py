"""The regressors of (6) and the state that they carry."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from sklearn.base import clone
from sklearn.exceptions import NotFittedError
from sklearn.pipeline import make_union
from sklearn.preprocessing import StandardScaler

from whsklearn import InverseDynamicsLags, WienerHammersteinLags, WienerHammersteinSystem
from whsklearn.datasets import make_wiener_hammerstein
from whsklearn.effects import Coulomb, FrictionLaw, Viscous
from whsklearn.effects.law import piecewise_linear_law, polynomial_law, smooth_law
from whsklearn.recursion.memory.starts import random_stable

LAWS = {
    "reduced": None,
    "smooth": smooth_law([0.5, 3.0, 0.6, 0.8, 2.0, 0.1]),
    "key last": FrictionLaw([Coulomb(0.5), Viscous(0.3)]),
    "polynomial": polynomial_law([0.2, 1.0, 0.3]),
    "piecewise linear": piecewise_linear_law([-0.5, 0.7], [0.5, 1.0, 0.2]),
}


@pytest.fixture(scope="module")
def record():
    return make_wiener_hammerstein(n_samples=80, random_state=0, return_truth=True)


@pytest.mark.parametrize("orders", [(2, 2, 2, 2), (1, 0, 2, 1), (3, 1, 1, 0), (1, 3, 3, 3), (2, 0, 2, 2)])
@pytest.mark.parametrize("law", list(LAWS))
def test_at_the_truth_the_rows_times_theta_are_the_output(law, orders):
    """(6) with d(t): holds for every order and law, so the rows are the ones of the paper."""
    na, nb, nc, nd = orders
    rng = np.random.default_rng(1)
    system = WienerHammersteinSystem(
        np.r_[1.0, rng.normal(size=na - 1)], random_stable(nb, rng), np.r_[1.0, rng.normal(size=nc - 1)],
        random_stable(nd, rng), LAWS[law],
    )  # fmt: skip
    X, y, truth = make_wiener_hammerstein(100, snr_db=10, random_state=2, system=system, return_truth=True)
    lags = WienerHammersteinLags(*orders, law=LAWS[law], theta=truth.theta)
    rows = lags.fit_transform(X, y)
    # row 0 has no past: there v(0) = 0 by (1) and (2), whatever the law is at rest
    np.testing.assert_allclose((rows @ truth.theta + truth.d)[1:], y[1:], atol=1e-9)
    assert rows.shape == (100, lags.n_parameters) == (100, len(lags.get_feature_names_out()))


def test_columns_are_what_their_names_say(record):
    X, y, truth = record
    rows = pd.DataFrame(WienerHammersteinLags(theta=truth.theta).fit_transform(X, y))
    rows.columns = WienerHammersteinLags().get_feature_names_out()
    u, x, v = truth.u, truth.x, truth.system.simulate  # v of the true noise-free chain
    assert list(rows) == [
        "u(k-2)", "u(k-3)", "-x_hat(k-2)", "-x_hat(k-3)", "coulomb(k-1)", "stribeck(k-1)", "v_hat(k-2)", "-y(k-1)",
        "-y(k-2)",
    ]  # fmt: skip
    v = truth.v
    dx = np.diff(x, prepend=0.0)
    for name, signal, lag in [
        ("u(k-2)", u, 2), ("u(k-3)", u, 3), ("-x_hat(k-2)", -x, 2), ("-x_hat(k-3)", -x, 3),
        ("coulomb(k-1)", np.sign(dx), 1), ("stribeck(k-1)", -np.tanh(dx), 1), ("v_hat(k-2)", v, 2),
        ("-y(k-1)", -y, 1), ("-y(k-2)", -y, 2),
    ]:  # fmt: skip
        np.testing.assert_allclose(rows[name][lag:], signal[:-lag], atol=1e-12, err_msg=name)
        assert not rows[name][:lag].any(), f"{name}: zeros before the start"


def test_several_inputs_have_their_own_columns():
    X, y = np.random.default_rng(0).standard_normal((40, 2)), np.arange(40.0)
    lags = WienerHammersteinLags(2, 1, 1, 1)
    rows = lags.fit_transform(X, y)
    names = list(lags.get_feature_names_out())
    assert names[:4] == ["u1(k-2)", "u2(k-2)", "u1(k-3)", "u2(k-3)"]
    assert rows.shape[1] == len(names)
    np.testing.assert_array_equal(rows[3:, :4], np.c_[X[1:-2], X[:-3]])


@pytest.mark.parametrize("cuts", [[40], [1, 2, 3, 50], list(range(1, 80))])
def test_pieces_make_the_rows_of_the_whole(record, cuts):
    X, y, _ = record
    whole = WienerHammersteinLags().fit_transform(X, y)
    stream = WienerHammersteinLags()
    parts = [stream.partial_fit_transform(X[i:j], y[i:j]) for i, j in zip([0, *cuts], [*cuts, len(y)], strict=True)]
    np.testing.assert_array_equal(np.vstack(parts), whole)


def test_transform_reads_and_fit_transform_starts_clean(record):
    X, y, _ = record
    lags = WienerHammersteinLags()
    first = lags.fit_transform(X[:40], y[:40])
    np.testing.assert_array_equal(lags.transform(X[:40], y[:40]), first)
    lags.transform(X, y)
    rest = lags.partial_fit_transform(X[40:], y[40:])
    np.testing.assert_array_equal(np.vstack([first, rest]), WienerHammersteinLags().fit_transform(X, y))
    np.testing.assert_array_equal(lags.fit_transform(X[:40], y[:40]), first)


def test_groups_restart_the_state(record):
    X, y, _ = record
    groups = np.repeat(["a", "b"], 40)
    together = WienerHammersteinLags().fit_transform(X, y, groups=groups)
    apart = [WienerHammersteinLags().fit_transform(X[s], y[s]) for s in (slice(40), slice(40, None))]
    np.testing.assert_array_equal(together, np.vstack(apart))


def test_set_output_names_the_columns(record):
    X, y, _ = record
    frame = WienerHammersteinLags().set_output(transform="pandas").fit_transform(X, y)
    assert isinstance(frame, pd.DataFrame)
    assert list(frame) == list(WienerHammersteinLags().get_feature_names_out())
    np.testing.assert_array_equal(frame, WienerHammersteinLags().fit_transform(X, y))


def test_clone_and_parameters():
    lags = WienerHammersteinLags(n_a=3, law="viscous,coulomb")
    assert clone(lags).get_params() == lags.get_params()
    assert lags.set_params(n_d=4).max_lag == 4
    assert WienerHammersteinLags(3, 1, 1, 1).max_lag == 4
    assert list(lags.dims()) == [3, 2, 2, 4, 2]


def test_the_default_theta_is_that_of_the_paper(record):
    X, y, _ = record
    np.testing.assert_array_equal(
        WienerHammersteinLags().fit_transform(X, y), WienerHammersteinLags(theta=np.full(9, 0.01)).fit_transform(X, y)
    )


@pytest.mark.parametrize(
    ("settings", "says"),
    [
        ({"n_a": 0}, "n_a is 0, expected a whole number of 1 or more"),
        ({"n_c": 0}, "n_c is 0"),
        ({"n_b": -1}, "n_b is -1, expected a whole number of 0 or more"),
        ({"n_d": 1.5}, "n_d is 1.5"),
        ({"n_a": True}, "n_a is True"),
        ({"law": "viscous,glue"}, "glue"),
        ({"law": 3}, "law is 3"),
        ({"law": "coulomb"}, "no linear term"),
        ({"theta": [1.0, 2.0]}, r"theta has shape \(2,\), expected \(9,\)"),
    ],
)
def test_settings_that_cannot_be_are_refused(record, settings, says):
    X, y, _ = record
    with pytest.raises(ValueError, match=says):
        WienerHammersteinLags(**settings).fit_transform(X, y)


def test_inputs_are_known_by_their_names(record):
    X, y, _ = record
    lags = WienerHammersteinLags().fit(pd.DataFrame(X, columns=["torque"]), y)
    assert list(lags.feature_names_in_) == ["torque"]
    assert lags.transform(pd.DataFrame(X, columns=["torque"]), y).shape[0] == len(X)
    with pytest.raises(ValueError, match="feature names"):
        lags.transform(pd.DataFrame(X, columns=["speed"]), y)


def test_nothing_before_fit(record):
    X, y, _ = record
    with pytest.raises(NotFittedError):
        WienerHammersteinLags().transform(X, y)


def test_it_stands_in_a_union_where_it_needs_no_output_and_says_so_where_it_does(record):
    X, y, _ = record
    moving = WienerHammersteinLags(2, 1, 2, 0)
    union = make_union(moving, StandardScaler())
    rows = union.fit_transform(X, y)
    np.testing.assert_array_equal(union.transform(X), rows)
    np.testing.assert_array_equal(rows[:, :-1], moving.fit_transform(X, y))
    with pytest.raises(ValueError, match="a Pipeline or FeatureUnion transforms X alone"):
        make_union(WienerHammersteinLags()).fit(X, y).transform(X)


def test_the_rows_of_an_axis_stand_in_a_union(record):
    X = np.cumsum(record[0], axis=0)
    lags = InverseDynamicsLags(100.0)
    union = make_union(lags, "passthrough")
    rows = union.fit_transform(X)
    np.testing.assert_array_equal(rows[:, :-1], lags.fit_transform(X))
