"""What is said of a record that cannot give what is asked of it."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

from whsklearn import PEMRegressor, RMILSRegressor, WienerHammersteinLags
from whsklearn.datasets import make_wiener_hammerstein
from whsklearn.effects import as_law
from whsklearn.estimators import _advice
from whsklearn.metrics import nmse

LAW = as_law(None)


@pytest.fixture(scope="module")
def record():
    return make_wiener_hammerstein(n_samples=1000, snr_db=20, random_state=0)


def fitted(X, y, law=None):
    return RMILSRegressor(WienerHammersteinLags(law=law), random_state=0).fit(X, y)


def test_a_constant_that_no_odd_law_gives_is_said_with_what_to_do(record):
    X, y = record
    with pytest.warns(UserWarning, match=r"lies 2\b.* off .* has a constant; subtract it .* add offset"):
        fitted(X, y + 2.0)
    with pytest.warns(UserWarning, match="subtract it"):
        PEMRegressor(WienerHammersteinLags(), random_state=0, n_starts=1).fit(X, y + 2.0)


@pytest.mark.parametrize("seed", range(8))
def test_nothing_is_said_of_a_record_about_zero(seed):
    rng = np.random.default_rng(seed)
    X, y = make_wiener_hammerstein(n_samples=1000, snr_db=[None, 20, 7.5, 0][seed % 4], random_state=seed)
    assert _advice.of_a_constant(LAW, X, y) is None
    assert _advice.of_a_constant(LAW, X, y + 0.05 * y.std() * rng.choice([-1, 1])) is None


def test_nothing_is_said_where_the_model_can_have_the_constant_or_the_input_stands_on_a_level(record):
    X, y = record
    for law in ("reduced,offset", "polynomial", "cubic_spline"):
        assert _advice.of_a_constant(as_law(law), X, y + 2.0) is None
    assert _advice.of_a_constant(LAW, X + 3.0, y + 2.0) is None
    assert _advice.of_a_constant(LAW, X, y + 2.0) is not None
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        PEMRegressor(WienerHammersteinLags(law="linear"), criterion="simulation", n_starts=1).fit(X, y + 2.0)


def test_what_is_advised_helps(record):
    X, y = record
    fresh, truth = make_wiener_hammerstein(n_samples=1000, snr_db=None, random_state=100)
    with pytest.warns(UserWarning, match="subtract it"):
        bare = nmse(truth, fitted(X, y + 2.0).predict(fresh) - 2.0)
    subtracted = nmse(truth, fitted(X, y + 2.0 - np.mean(y + 2.0)).predict(fresh))
    within = nmse(truth[50:], fitted(X, y + 2.0, "reduced,offset").predict(fresh)[50:] - 2.0)
    assert max(subtracted, within) < 0.01
    assert bare > 30 * max(subtracted, within)
