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

ORDER = {
    "check_methods_sample_order_invariance": "samples of a dynamic system have an order",
    "check_methods_subset_invariance": "a sample's output depends on the ones before it",
}
PAST = dict.fromkeys(
    (
        "check_dict_unchanged", "check_dtype_object", "check_estimators_dtypes", "check_estimators_pickle",
        "check_f_contiguous_array_estimator", "check_fit_idempotent", "check_methods_sample_order_invariance",
        "check_methods_subset_invariance", "check_transformer_data_not_an_array", "check_transformer_general",
        "check_transformer_preserve_dtypes",
    ),
    "transform(X) alone cannot be: the regressors hold past outputs",
)  # fmt: skip

LAGS = WienerHammersteinLags(1, 1, 1, 1)
ON_ROWS = [
    RLSRegressor(),
    MILSRegressor(),
    RMILSRegressor(),
    MultiInnovationGradientRegressor(),
]
DYNAMIC = [
    RLSRegressor(LAGS, n_starts=2),
    MILSRegressor(LAGS, n_starts=2),
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


WEIGHTS = "check_sample_weight_equivalence_on_dense_data"


def expected(estimator):
    """Checks that this estimator must fail, with the reason."""
    if isinstance(estimator, WienerHammersteinLags):
        return PAST
    if estimator.lags is not None:
        return ORDER | {WEIGHTS: "a sample of weight zero drives the state, one that is left out does not"}
    if isinstance(estimator, MultiInnovationGradientRegressor):
        return {WEIGHTS: "a step for a row of weight two is not two steps"}
    if isinstance(estimator, MILSRegressor):
        return {WEIGHTS: "the last p - 1 rows have not been in all their windows, and repeated rows fill them sooner"}
    return {}


@parametrize_with_checks(ON_ROWS + DYNAMIC + [WienerHammersteinLags()], expected_failed_checks=expected)
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
    assert len(ORDER) == 2
