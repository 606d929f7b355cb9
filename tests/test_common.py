"""scikit-learn's own checks: all of them, but for what a dynamic model cannot pass.

An expected failure that passes is a failure too (``xfail_strict`` in pyproject.toml).
"""

from __future__ import annotations

import pytest
from sklearn.base import BaseEstimator
from sklearn.utils.estimator_checks import parametrize_with_checks

import whsklearn
from whsklearn import (
    DifferentialEvolutionRegressor,
    MILSRegressor,
    MultiInnovationGradientRegressor,
    PEMRegressor,
    RLSRegressor,
    RMILSRegressor,
    StreamingPEMRegressor,
    WienerHammersteinLags,
)
from whsklearn.checks import expected_failed_checks

LAGS = WienerHammersteinLags(1, 1, 1, 1)
SMOOTH = WienerHammersteinLags(1, 1, 1, 1, law="polynomial")  # nine tenths of a check on 10 inputs are signs in doubt
ON_ROWS = [
    RLSRegressor(),
    MILSRegressor(),
    RMILSRegressor(),
    MultiInnovationGradientRegressor(),
]
DYNAMIC = [
    RLSRegressor(SMOOTH, n_starts=2),
    MILSRegressor(SMOOTH, n_starts=2),
    RMILSRegressor(LAGS, n_starts=2),
    RMILSRegressor(LAGS, gradient="pseudolinear"),
    MultiInnovationGradientRegressor(LAGS),
    PEMRegressor(LAGS, n_starts=1),
    PEMRegressor(
        WienerHammersteinLags(1, 1, 1, 1, law="polynomial", delays=(0, 0)), criterion="simulation", n_starts=1
    ),
    DifferentialEvolutionRegressor(LAGS, n_generations=2),
    StreamingPEMRegressor(WienerHammersteinLags(1, 1, 1, 1, law="polynomial", delays=(0, 0)), n_start=50),
]


# Without past outputs the lags pass what they cannot pass with them: transform(X) alone.
LAGS_ALONE = [WienerHammersteinLags(), WienerHammersteinLags(n_d=0)]


@parametrize_with_checks(ON_ROWS + DYNAMIC + LAGS_ALONE, expected_failed_checks=expected_failed_checks)
def test_scikit_learn(estimator, check):
    check(estimator)


def test_no_estimator_is_left_out():
    names = (getattr(whsklearn, name) for name in whsklearn.__all__)
    public = {v for v in names if isinstance(v, type) and issubclass(v, BaseEstimator)}
    lags = {WienerHammersteinLags, whsklearn.InverseDynamicsLags, whsklearn.RigidBodyLags}
    checked = {type(e) for e in ON_ROWS + DYNAMIC} | lags
    assert public == checked, "test it here; lags of a motion have tests of their own in tests/lags"


def test_an_expected_failure_that_passes_fails(request: pytest.FixtureRequest):
    assert request.config.getini("xfail_strict")
    assert len(expected_failed_checks(ON_ROWS[0])) == 0
    assert len(expected_failed_checks(DYNAMIC[0])) == 3
    assert len(expected_failed_checks(WienerHammersteinLags(n_d=0))) == 2
