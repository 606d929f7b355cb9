"""The checks of scikit-learn that cannot hold are named; `tests/test_common.py` runs all of them on every estimator."""

from __future__ import annotations

import pytest

import whsklearn
from whsklearn import InverseDynamicsLags, RLSRegressor, RMILSRegressor, WienerHammersteinLags
from whsklearn.checks import expected_failed_checks


@pytest.mark.parametrize("estimator", [RLSRegressor(), RMILSRegressor(), RMILSRegressor(WienerHammersteinLags())])
def test_every_failure_has_a_reason_in_words(estimator):
    assert all(len(reason.split()) > 5 for reason in expected_failed_checks(estimator).values())


def test_lags_of_measured_positions_are_not_for_these_checks():
    with pytest.raises(TypeError, match="InverseDynamicsLags takes the positions of an axis or an arm"):
        expected_failed_checks(InverseDynamicsLags())
    assert expected_failed_checks(WienerHammersteinLags(n_d=0))


def test_the_package_shows_its_own_names_only():
    shown = {name for name in dir(whsklearn) if not name.startswith("_")}
    assert set(whsklearn.__all__) <= shown
    assert not shown & {"Any", "TYPE_CHECKING", "typing"}
    assert not hasattr(whsklearn, "Any")
