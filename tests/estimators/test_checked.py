"""Input that is refused, and what stays as it was."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

from whsklearn import PEMRegressor, RLSRegressor, RMILSRegressor, WienerHammersteinLags
from whsklearn.datasets import make_wiener_hammerstein
from whsklearn.estimators._checked import warn


def test_a_record_that_does_not_fill_the_lags_is_refused_and_changes_nothing():
    X, y = make_wiener_hammerstein(200, snr_db=30, random_state=0)
    model = RMILSRegressor(WienerHammersteinLags(), n_starts=2, random_state=0).fit(X, y)
    before = model.theta_
    with pytest.raises(ValueError, match=r"Found 2 samples .* expected at least 4"):
        model.fit(X[:2], y[:2])
    np.testing.assert_array_equal(model.theta_, before)


@pytest.mark.parametrize("bad", [np.nan, np.inf, 1e31])
def test_numbers_that_no_log_holds_are_refused_by_every_kind_of_fit(bad):
    X, y = make_wiener_hammerstein(200, snr_db=30, random_state=0)
    wrong = y.copy()
    wrong[7] = bad
    for model in (RMILSRegressor(WienerHammersteinLags(), n_starts=1), PEMRegressor(n_starts=1), RLSRegressor()):
        with pytest.raises(ValueError, match=r"^y (contains|holds)"):
            model.fit(X, wrong)
        assert not hasattr(model, "state_")


def test_more_parameters_than_samples_are_told():
    X, y = make_wiener_hammerstein(8, snr_db=30, random_state=0)
    with pytest.warns(UserWarning, match="8 samples for 9 parameters"):
        RMILSRegressor(WienerHammersteinLags(), n_starts=1, random_state=0).fit(X, y)


def test_nothing_is_no_warning():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warn(None)
    with pytest.warns(UserWarning, match="^told$"):
        warn("told")


@pytest.mark.parametrize(
    "act",
    [
        lambda X, y: RMILSRegressor(WienerHammersteinLags(), n_starts=1, random_state=0).fit(X[:8], y[:8]),
        lambda X, y: PEMRegressor(n_starts=1, random_state=0).fit(X[:8], y[:8]),
        lambda X, y: RLSRegressor().fit(X, y),
        lambda X, y: RLSRegressor().fit(X, y).score(X, -9.0 * y),
    ],
    ids=["recursive", "batch", "rows", "score"],
)
def test_a_warning_is_at_the_line_that_led_to_it(act):
    X, y = make_wiener_hammerstein(200, snr_db=30, random_state=0)
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        act(X, y)
    assert {w.filename for w in told} == {__file__}
