"""Bad input gets a clear error and loses nothing."""

from __future__ import annotations

import copy
import warnings

import numpy as np
import pandas as pd
import pytest

from whsklearn import (
    DifferentialEvolutionRegressor,
    MILSRegressor,
    MultiInnovationGradientRegressor,
    PEMRegressor,
    RLSRegressor,
    RMILSRegressor,
    WienerHammersteinLags,
)
from whsklearn.checks import state_difference
from whsklearn.datasets import make_wiener_hammerstein

# a record of a dynamic system stands in for rows here
pytestmark = pytest.mark.filterwarnings("ignore:X has one column")

LAGS = WienerHammersteinLags()
MODELS = {
    "RLS on rows": RLSRegressor(),
    "gradient on rows": MultiInnovationGradientRegressor(),
    "RMILS": RMILSRegressor(LAGS, n_starts=2, memory=64, random_state=0),
    "RMILS, pure": RMILSRegressor(LAGS, n_starts=2, memory=0, random_state=0),
    "MILS, published": MILSRegressor(LAGS, gradient="pseudolinear"),
    "PEM": PEMRegressor(n_starts=1, random_state=0),
    "swarm": DifferentialEvolutionRegressor(n_generations=1, random_state=0),
}
STREAMS = [name for name, model in MODELS.items() if hasattr(model, "partial_fit")]
X, Y = make_wiener_hammerstein(90, random_state=0)
GOOD = X[80:], Y[80:]


def with_value(values, at, value):
    out = np.array(values)
    out[at] = value
    return out


BAD = {
    "NaN in X": (with_value(X, 7, np.nan), Y, "X contains NaN, first in row 7, expected finite"),
    "inf in X": (with_value(X, 8, -np.inf), Y, "X contains inf.* row 8, expected finite"),
    "NaN in y": (X, with_value(Y, 9, np.nan), "y contains NaN, first in row 9, expected finite"),
    "inf in y": (X, with_value(Y, 9, np.inf), "y contains inf.* row 9, expected finite"),
    "a huge number": (X, with_value(Y, 9, 1e200), "y holds 1e"),
    "y shorter": (X, Y[:-1], "X has 90 rows and y has 89; expected one output a row"),
    "1-D X": (X[:, 0], Y, r"X has shape \(90,\), expected \(n, columns\)"),
    "3-D X": (X[:, :, None], Y, r"X has shape \(90, 1, 1\), expected \(n, columns\)"),
    "text": (np.full((90, 1), "fast"), Y, "fast.*expected numbers"),
    "complex": (X + 0j, Y, "Complex data not supported, expected real"),
    "two outputs": (X, np.c_[Y, Y], "expected one output a row"),
    "no rows": (X[:0], Y[:0], "0 sample"),
    "groups of another length": (X, Y, r"groups has shape \(3,\), expected \(90,\)"),
    "groups with a gap": (X, Y, "groups has no label in row 40, expected one a row"),
}


def groups_of(name):
    if name == "groups with a gap":
        return {"groups": with_value(np.ones(90), 40, np.nan)}
    return {"groups": [1, 1, 2]} if name.startswith("groups") else {}


def attributes(model):
    """All that a call could leave behind, but for the compiled stream's settings."""
    return {
        k: copy.deepcopy(v)
        for k, v in vars(model).items()
        if k not in ("_stream", "_own_lock") and not hasattr(v, "get_params")
    }


def assert_untouched(model, before):
    after = attributes(model)
    assert after.keys() == before.keys()
    assert state_difference(before, after) == 0.0


def assert_one_sentence(error):
    text = str(error.value)
    assert "\n" not in text
    assert text.rstrip(".").count(". ") == 0, text


@pytest.mark.parametrize("bad", list(BAD))
@pytest.mark.parametrize("name", list(MODELS))
def test_a_refused_fit_is_clear_and_changes_nothing(name, bad):
    bad_X, bad_y, says = BAD[bad]
    model = copy.deepcopy(MODELS[name])
    before = attributes(model)
    with pytest.raises(ValueError, match=says) as error:
        model.fit(bad_X, bad_y, **groups_of(bad))
    assert_one_sentence(error)
    assert_untouched(model, before)


@pytest.mark.parametrize("name", list(MODELS))
def test_a_refused_fit_after_a_good_one_keeps_the_good_one(name):
    model = copy.deepcopy(MODELS[name]).fit(pd.DataFrame(X, columns=["drive"]), Y)
    before, prediction = attributes(model), model.predict(pd.DataFrame(X, columns=["drive"]))
    for bad, (bad_X, bad_y, _) in BAD.items():
        with pytest.raises(ValueError, match=r"."):
            model.fit(bad_X, bad_y, **groups_of(bad))
        assert_untouched(model, before)
    wide = pd.DataFrame(np.full((90, 3), np.nan), columns=["p", "q", "r"])  # other names, other width, and NaN
    with pytest.raises(ValueError, match="NaN"):
        model.fit(wide, Y)
    assert_untouched(model, before)
    assert model.n_features_in_ == 1
    assert list(model.feature_names_in_) == ["drive"]
    np.testing.assert_array_equal(model.predict(pd.DataFrame(X, columns=["drive"])), prediction)


@pytest.mark.parametrize("bad", list(BAD))
@pytest.mark.parametrize("name", STREAMS)
def test_a_refused_partial_fit_leaves_no_trace(name, bad):
    """The first call, a later one, and the stream goes on as if it had not been."""
    bad_X, bad_y, says = BAD[bad]
    model = copy.deepcopy(MODELS[name])
    before = attributes(model)
    with pytest.raises(ValueError, match=says) as error:
        model.partial_fit(bad_X, bad_y, **groups_of(bad))
    assert_one_sentence(error)
    assert_untouched(model, before)
    assert not hasattr(model, "n_features_in_")
    model.partial_fit(X[:80], Y[:80])
    twin = copy.deepcopy(model)
    before = attributes(model)
    with pytest.raises(ValueError, match=says):
        model.partial_fit(bad_X, bad_y, **groups_of(bad))
    assert_untouched(model, before)
    assert state_difference(model.partial_fit(*GOOD).get_state(), twin.partial_fit(*GOOD).get_state()) == 0.0


@pytest.mark.parametrize("name", STREAMS)
def test_one_bad_row_in_a_stream(name):
    model = copy.deepcopy(MODELS[name]).partial_fit(X[:80], Y[:80])
    before = attributes(model)
    for row, value in [([[np.nan]], [0.0]), ([[0.0]], [np.inf]), ([[0.0, 1.0]], [0.0]), ([[1e40]], [0.0])]:
        with pytest.raises(ValueError, match=r"X|y"):
            model.partial_fit(np.array(row), np.array(value))
        assert_untouched(model, before)


@pytest.mark.parametrize("name", list(MODELS))
def test_another_width_is_refused(name):
    model = copy.deepcopy(MODELS[name]).fit(X, Y)
    wide = np.c_[X, X]
    before = attributes(model)
    calls = [lambda: model.predict(wide), lambda: model.predict_ahead(wide, Y)]
    if hasattr(model, "partial_fit"):
        calls.append(lambda: model.partial_fit(wide, Y))
    for call in calls:
        with pytest.raises(
            ValueError, match=r"X has 2 features, but .* is expecting 1 features as input; give"
        ) as error:
            call()
        assert_one_sentence(error)
        assert_untouched(model, before)


@pytest.mark.parametrize("bad", ["NaN in X", "inf in X", "1-D X", "text", "complex", "no rows"])
@pytest.mark.parametrize("name", ["RLS on rows", "RMILS", "PEM"])
def test_a_refused_prediction(name, bad):
    model = copy.deepcopy(MODELS[name]).fit(X, Y)
    before = attributes(model)
    with pytest.raises(ValueError, match=BAD[bad][2]):
        model.predict(BAD[bad][0])
    assert_untouched(model, before)


@pytest.mark.parametrize("horizon", [0, -1, 1.5, True, "far"])
def test_a_horizon_is_a_whole_number_of_samples(horizon):
    model = RLSRegressor().fit(X, Y)
    with pytest.raises(ValueError, match=r"horizon is .* expected a whole number"):
        model.predict_ahead(X, Y, horizon=horizon)


@pytest.mark.parametrize("name", ["RMILS", "RMILS, pure", "MILS, published", "PEM", "swarm"])
def test_fewer_rows_than_lags(name):
    model = copy.deepcopy(MODELS[name])
    with pytest.raises(ValueError, match=r"n_samples=3\), expected at least 4.*give a longer record") as error:
        model.fit(X[:3], Y[:3])
    assert_one_sentence(error)
    assert not hasattr(model, "n_features_in_")


@pytest.mark.parametrize("name", ["RMILS", "RMILS, pure", "MILS, published", "PEM", "swarm"])
def test_experiments_that_are_all_shorter_than_the_lags(name):
    """Labels that alternate made 90 experiments of one row, and a fit that leaves all of the output."""
    model = copy.deepcopy(MODELS[name])
    with pytest.raises(
        ValueError, match=r"longest of 90 experiments has 1 sample, expected at least 4.*one after"
    ) as error:
        model.fit(X, Y, groups=np.arange(90) % 2)
    assert_one_sentence(error)
    assert not hasattr(model, "n_features_in_")


@pytest.mark.parametrize("name", ["RMILS", "RMILS, pure", "MILS, published", "PEM", "swarm"])
def test_a_constant_input_warns_and_is_taken(name):
    model = copy.deepcopy(MODELS[name])
    with pytest.warns(UserWarning, match="input is constant, so the record does not show.*; excite the axis"):
        model.fit(np.ones_like(X), Y)
    assert np.isfinite(model.predict(X)).all()
    assert np.isfinite(model.theta_).all()


@pytest.mark.parametrize("name", ["RMILS", "RMILS, pure", "MILS, published", "PEM"])
def test_of_constant_signals_nothing_else_is_said(name):
    """Any share of a variance of zero is nonsense."""
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        copy.deepcopy(MODELS[name]).fit(np.ones_like(X), np.ones_like(Y))
    told = [str(w.message) for w in said]
    assert any("input is constant" in text for text in told)
    assert not any("free run" in text for text in told)


def test_a_warning_made_an_error_changes_nothing_either():
    model = copy.deepcopy(MODELS["RMILS"]).fit(X, Y)
    before = attributes(model)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(UserWarning, match="constant"):
            model.fit(np.ones((90, 2)), Y)
    assert_untouched(model, before)


SETTINGS = [
    ({"p": 0}, "p is 0, expected a whole number of 1 or more"),
    ({"p": 2.0}, "p is 2.0"),
    ({"p": True}, "p is True"),
    ({"p": None}, "p is None"),
    ({"P0": 0.0}, "P0 is 0.0, expected a positive number"),
    ({"P0": -1.0}, "P0 is -1.0"),
    ({"P0": np.nan}, "P0 is nan"),
    ({"P0": np.inf}, "P0 is inf"),
    ({"P0": "large"}, "P0 is 'large'"),
    ({"forgetting": 0.0}, "forgetting is 0.0, expected a number above 0 and at most 1"),
    ({"forgetting": 1.01}, "forgetting is 1.01"),
    ({"forgetting": np.nan}, "forgetting is nan"),
    ({"gradient": "exact"}, "gradient is 'exact', expected one of 'full', 'pseudolinear'"),
    ({"n_starts": 0}, "n_starts is 0"),
    ({"memory": -1}, "memory is -1"),
    ({"memory": 10.5}, "memory is 10.5"),
    ({"theta0": [1.0, 2.0, 3.0]}, "theta0 has shape"),
    ({"theta0": np.nan}, "theta0"),
    ({"lags": "two"}, "lags is 'two', expected None"),
    ({"lags": WienerHammersteinLags}, "lags is .*expected None"),
    ({"lags": WienerHammersteinLags(law="viscous,glue")}, "glue"),
    ({"lags": WienerHammersteinLags(law=4)}, "law is 4"),
    ({"lags": WienerHammersteinLags(n_a=0)}, "n_a is 0"),
    ({"lags": WienerHammersteinLags(law="coulomb"), "gradient": "pseudolinear"}, "no linear term"),
]


@pytest.mark.parametrize(("settings", "says"), SETTINGS)
@pytest.mark.parametrize("lags", [None, LAGS])
def test_settings_that_cannot_be_are_refused_by_fit_and_change_nothing(settings, says, lags):
    model = RMILSRegressor(lags, n_starts=1).set_params(**settings)
    before = attributes(model)
    for call in (model.fit, model.partial_fit):
        with pytest.raises(ValueError, match=says):
            call(X, Y)
        assert_untouched(model, before)


@pytest.mark.parametrize("lags", ["two", RLSRegressor()])
def test_pem_takes_wiener_hammerstein_lags_only(lags):
    with pytest.raises(ValueError, match="lags is"):
        PEMRegressor(lags).fit(X, Y)


@pytest.mark.parametrize("settings", [{"p": 8}, {"memory": 32}, {"gradient": "pseudolinear"}, {"lags__n_a": 3}])
def test_a_stream_cannot_change_its_sizes_midway(settings):
    """A longer window would write beyond the arrays that the state holds."""
    model = RMILSRegressor(WienerHammersteinLags(), n_starts=2, memory=64, random_state=0).partial_fit(X, Y)
    state, prediction = model.get_state(), model.predict(X)
    model.set_params(**settings)
    other = {"p": "p or order", "memory": "memory"}.get(next(iter(settings)), "structure")
    with pytest.raises(ValueError, match=rf"begun with another {other}: its state has .* use the parameters it was"):
        model.partial_fit(X, Y)
    assert state_difference(state, model.get_state()) == 0.0
    if "lags__n_a" in settings:
        np.testing.assert_array_equal(model.predict(X), prediction)
    assert model.fit(X, Y).theta_.size >= 9


def test_a_stream_may_change_its_forgetting_midway():
    model = RLSRegressor().partial_fit(X, Y).set_params(forgetting=0.9)
    before = model.covariance_[0, 0]
    model.partial_fit(np.zeros((20, 1)), np.zeros(20))
    assert model.state_["ud"][0, 0] > before


def test_lags_that_change_later_change_no_fitted_model():
    lags = WienerHammersteinLags()
    model = PEMRegressor(lags, n_starts=1, random_state=0).fit(X, Y)
    prediction = model.predict(X)
    lags.n_d = 1
    np.testing.assert_array_equal(model.predict(X), prediction)


STATES = [{}, {"theta": np.zeros(9)}, {"n_features_in": 1, "state": {}}, {"n_features_in": 2, "state": {"theta": 1}}, 7]


@pytest.mark.parametrize("state", STATES)
def test_a_state_of_something_else_is_refused(state):
    model = RMILSRegressor(LAGS, n_starts=2, memory=64, random_state=0).fit(X, Y)
    before = attributes(model)
    with pytest.raises(ValueError, match="state"):
        model.set_state(state)
    assert_untouched(model, before)


def test_a_state_of_other_orders_or_another_window_is_refused():
    state = RMILSRegressor(LAGS, p=2, gradient="pseudolinear").fit(X, Y).get_state()
    for other in (
        RMILSRegressor(LAGS, p=3, gradient="pseudolinear"),
        RMILSRegressor(WienerHammersteinLags(n_d=3), p=2, gradient="pseudolinear"),
        RMILSRegressor(LAGS, p=2),
    ):
        with pytest.raises(ValueError, match="use the parameters it was begun with"):
            other.set_state(state)
        assert not hasattr(other, "state_")


# -- lags ------------------------------------------------------------------------------------

LAG_BAD = [name for name in BAD if name != "no rows"]


@pytest.mark.parametrize("bad", LAG_BAD)
def test_lags_refuse_clearly_and_keep_their_state(bad):
    bad_X, bad_y, says = BAD[bad]
    for method in ("fit_transform", "partial_fit_transform"):
        lags = WienerHammersteinLags()
        with pytest.raises(ValueError, match=says if bad != "two outputs" else "y|1d"):
            getattr(lags, method)(bad_X, bad_y, **groups_of(bad))
        assert not hasattr(lags, "n_features_in_")
    lags = WienerHammersteinLags()
    lags.fit_transform(X[:80], Y[:80])
    twin, before = copy.deepcopy(lags), attributes(lags)
    for method in ("fit_transform", "partial_fit_transform", "transform"):
        with pytest.raises(ValueError, match=r"."):
            getattr(lags, method)(bad_X, bad_y, **groups_of(bad))
        assert_untouched(lags, before)
    np.testing.assert_array_equal(lags.partial_fit_transform(*GOOD), twin.partial_fit_transform(*GOOD))


def test_lags_need_the_output_and_the_same_inputs():
    lags = WienerHammersteinLags().fit(X, Y)
    with pytest.raises(ValueError, match=r"y is missing.*call with \(X, y\)"):
        lags.transform(X)
    with pytest.raises(ValueError, match=r"X has 2 features, but WienerHammersteinLags is expecting 1"):
        lags.transform(np.c_[X, X], Y)


# -- numbers that are allowed and hurt ---------------------------------------------------------


@pytest.mark.parametrize("name", STREAMS)
def test_no_inf_and_no_nan_leaves_an_estimator(name):
    """Wild data: large, tiny, steps, and an output that the input has nothing to do with."""
    rng = np.random.default_rng(0)
    wild = [
        (1e12 * rng.standard_normal((300, 1)), 1e-12 * rng.standard_normal(300)),
        (1e-12 * rng.standard_normal((300, 1)), 1e12 * rng.standard_normal(300)),
        (np.sign(rng.standard_normal((300, 1))), np.cumsum(rng.standard_normal(300)) * 1e6),
        (np.zeros((300, 1)), rng.standard_normal(300)),
        (rng.standard_normal((300, 1)), np.full(300, 5.0)),
        (rng.standard_normal((300, 1)), 1.1 ** np.arange(300.0)),
    ]
    for u, y in wild:
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", "The (in|out)put is constant")
            warnings.filterwarnings("ignore", "The rms of [Xy] is")  # said of a pure recursion, and right
            model = copy.deepcopy(MODELS[name]).partial_fit(u, y)
        assert np.isfinite(model.theta_).all()
        assert np.isfinite(model.predict(u)).all()
        assert np.isfinite(model.predict_ahead(u, y)).all()


# -- missing values and degenerate records -----------------------------------------------------


@pytest.mark.parametrize("missing", [None, float("nan"), "nan", pd.NA, pd.NaT], ids=repr)
@pytest.mark.parametrize("name", list(MODELS))
def test_missing_values_among_objects_and_text_are_refused_in_x_and_y(name, missing):
    in_y, in_X = with_value(Y.astype(object), 9, missing), with_value(X.astype(object), 9, missing)
    records = {"y": [(X, in_y), (X, pd.Series(in_y)), (X, in_y.tolist())], "X": [(in_X, Y), (pd.DataFrame(in_X), Y)]}
    if missing is pd.NA:
        records["y"].append((X, pd.Series(in_y, dtype="Float64")))
    if isinstance(missing, str):
        records["y"].append((X, in_y.astype(str)))
    fitted = copy.deepcopy(MODELS[name]).fit(X[:40], Y[:40])
    for column, pairs in records.items():
        for bad_X, bad_y in pairs:
            for method in ("fit", "partial_fit", "predict_ahead"):
                before = attributes(fitted)
                if not hasattr(fitted, method):
                    continue
                with pytest.raises(ValueError, match=f"^{column} contains NaN, first in row 9, expected") as error:
                    getattr(fitted, method)(bad_X, bad_y)
                assert_one_sentence(error)
                assert_untouched(fitted, before)


DEGENERATE = {
    "no input": (np.zeros((90, 1)), Y, "input is constant"),
    "no output": (X, np.zeros(90), "output is constant"),
    "fewer samples than parameters": (X[:8], Y[:8], "8 samples for 9 parameters"),
}


@pytest.mark.parametrize("record", DEGENERATE)
@pytest.mark.parametrize("name", ["RMILS", "RMILS, pure", "MILS, published", "PEM"])
def test_degenerate_records_warn_and_nan_standard_errors_never_come_without_a_word(name, record):
    u, y, says = DEGENERATE[record]
    with pytest.warns(UserWarning, match=says):
        model = copy.deepcopy(MODELS[name]).fit(u, y)
    assert np.isfinite(model.theta_).all()
    for read in (lambda: model.standard_errors_, lambda: np.hstack(list(model.parameter_standard_errors_.values()))):
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always")
            errors = read()
        assert np.isfinite(errors).all() or any("standard errors are NaN" in str(w.message) for w in said)
