"""The checks pass for what is sound and fail for what is not: each is shown an estimator broken in its way."""

from __future__ import annotations

import numpy as np
import pytest

from whsklearn import RLSRegressor, RMILSRegressor, WienerHammersteinLags
from whsklearn.checks import check_streaming, state_difference, streaming_checks
from whsklearn.datasets import make_wiener_hammerstein


@pytest.fixture(scope="module")
def rows():
    rng = np.random.default_rng(0)
    X = rng.normal(size=(80, 2))
    return X, X @ [1.0, 2.0] + 0.1 * rng.normal(size=80)


def test_a_sound_estimator_passes_all_and_stays_untouched(rows):
    model = RLSRegressor()
    assert check_streaming(model, *rows) == [name for name, _ in streaming_checks()]
    assert not hasattr(model, "state_")
    assert "chunking" not in check_streaming(model, *rows, skip=("chunking",))


def partial_fit_twice_a_call(self, X, y, groups=None):
    super(type(self), self).partial_fit(X, y, groups)
    return super(type(self), self).partial_fit(X[-1:], y[-1:])


def predict_that_learns(self, X, groups=None):
    y = super(type(self), self).predict(X)
    self.partial_fit(np.asarray(X)[:1], y[:1])
    return y


def partial_fit_that_scales_its_input(self, X, y, groups=None):
    if isinstance(X, np.ndarray) and X.flags.writeable:
        X *= 1.0 + 1e-9
    return super(type(self), self).partial_fit(X, y, groups)


def get_state_that_shares(self):
    return {"n_features_in": self.n_features_in_, "state": self.state_}


def partial_fit_at_random(self, X, y, groups=None):
    return super(type(self), self).partial_fit(X, y * (1 + 1e-9 * np.random.default_rng().normal()), groups)


def fit_that_goes_on(self, X, y, groups=None):
    return self.partial_fit(X, y, groups)


def getstate_that_forgets(self):
    state = super(type(self), self).__getstate__()
    return state | {"state_": state["state_"] | {"theta": state["state_"]["theta"] * 0}} if "state_" in state else state


def set_state_that_rounds(self, state):
    super(type(self), self).set_state(state)
    self.state_["theta"] = self.state_["theta"].round(6)
    return self


def partial_fit_that_takes_anything(self, X, y, groups=None):
    try:
        return super(type(self), self).partial_fit(X, y, groups)
    except ValueError:
        return self


def partial_fit_that_counts_first(self, X, y, groups=None):
    if hasattr(self, "state_"):
        self.state_["seen"] += len(X)
    return super(type(self), self).partial_fit(X, y, groups)


@pytest.mark.parametrize(
    ("method", "broken", "check"),
    [
        ("partial_fit", partial_fit_twice_a_call, "chunking"),
        ("predict", predict_that_learns, "predict_changes_nothing"),
        ("partial_fit", partial_fit_that_scales_its_input, "input_is_not_mutated"),
        ("get_state", get_state_that_shares, "state_is_a_copy"),
        ("partial_fit", partial_fit_at_random, "same_seed_same_bits"),
        ("fit", fit_that_goes_on, "clone_starts_clean"),
        ("__getstate__", getstate_that_forgets, "pickle_goes_on"),
        ("set_state", set_state_that_rounds, "state_goes_on"),
        ("set_state", set_state_that_rounds, "saved_goes_on"),
        ("partial_fit", partial_fit_that_takes_anything, "refused_call_changes_nothing"),
        ("partial_fit", partial_fit_that_counts_first, "refused_call_changes_nothing"),
    ],
)
def test_each_check_finds_its_fault(rows, method, broken, check, monkeypatch):
    fault = type("Fault", (RLSRegressor,), {method: broken, "__module__": __name__, "__init__": RLSRegressor.__init__})
    monkeypatch.setitem(globals(), "Fault", fault)  # so that it can be pickled
    with pytest.raises(AssertionError, match=check):
        dict(streaming_checks())[check](fault(), *rows)


def test_groups_that_are_ignored_are_found():
    class Deaf(RMILSRegressor):
        def partial_fit(self, X, y, groups=None):
            return super().partial_fit(X, y)

    X, y = make_wiener_hammerstein(n_samples=100, snr_db=20, random_state=0)
    model = Deaf(WienerHammersteinLags(), gradient="pseudolinear")
    with pytest.raises(AssertionError, match="groups made no difference"):
        dict(streaming_checks())["groups_restart_the_state"](model, X, y)


@pytest.mark.parametrize(
    ("a", "b", "difference"),
    [
        ({"x": np.ones(3)}, {"x": np.ones(3)}, 0.0),
        ({"x": np.array([1.0, np.nan, np.inf])}, {"x": np.array([1.0, np.nan, np.inf])}, 0.0),
        ({"x": np.array([1.0, 4.0])}, {"x": np.array([2.0, 4.0])}, 0.5),
        ({"x": 1e-300}, {"x": 0.0}, 1.0),
        ({"x": [1.0, {"y": 2}]}, {"x": [1.0, {"y": 2}]}, 0.0),
        ({"x": 1.0}, {"y": 1.0}, np.inf),
        ({"x": np.ones(3)}, {"x": np.ones(2)}, np.inf),
        ({"x": "a"}, {"x": "b"}, np.inf),
        ({"x": None}, {"x": 0.0}, np.inf),
        ({"x": np.nan}, {"x": 0.0}, np.inf),
    ],
)
def test_state_difference(a, b, difference):
    assert state_difference(a, b) == pytest.approx(difference)
    assert state_difference(b, a) == pytest.approx(difference)


def test_a_record_that_is_too_short_is_refused():
    with pytest.raises(ValueError, match="n >= 60"):
        check_streaming(RLSRegressor(), np.ones((10, 1)), np.ones(10))
