"""Which of scikit-learn's own checks an estimator cannot pass, each with its reason."""

from __future__ import annotations

from typing import Any

from whsklearn.estimators import MILSRegressor, MultiInnovationGradientRegressor

_WEIGHTS = "check_sample_weight_equivalence_on_dense_data"
_ORDER = {
    "check_methods_sample_order_invariance": "samples of a dynamic system have an order",
    "check_methods_subset_invariance": "a sample's output depends on the ones before it",
}
_NEEDS_Y = (
    "check_dict_unchanged", "check_dtype_object", "check_estimators_dtypes", "check_estimators_pickle",
    "check_f_contiguous_array_estimator", "check_fit_idempotent", "check_methods_sample_order_invariance",
    "check_methods_subset_invariance", "check_transformer_data_not_an_array", "check_transformer_general",
    "check_transformer_preserve_dtypes",
)  # fmt: skip


def expected_failed_checks(estimator: Any) -> dict[str, str]:
    """Names of the checks that `estimator` cannot pass, and why; hand them to scikit-learn's ``check_estimator``.

    On given rows (``lags=None``) `RLSRegressor` passes all of them. `MILSRegressor` and `RMILSRegressor` pass all but
    the equivalence of a weight with repeated rows: a row takes part in p windows, so the last p - 1 rows have been in
    fewer than that, and repeated rows fill the windows sooner. With lags, samples have an order.

    ``estimator``: of this package, or `WienerHammersteinLags`. Raises TypeError for lags of measured positions.

    References
    ----------
    scikit-learn, Developing scikit-learn estimators, ``sklearn.utils.estimator_checks.check_estimator``.

    Examples
    --------
    >>> from sklearn.utils.estimator_checks import check_estimator
    >>> from whsklearn import RLSRegressor, RMILSRegressor
    >>> expected_failed_checks(RLSRegressor())
    {}
    >>> list(expected_failed_checks(RMILSRegressor()))
    ['check_sample_weight_equivalence_on_dense_data']
    >>> model = RMILSRegressor()
    >>> done = check_estimator(model, expected_failed_checks=expected_failed_checks(model), on_skip=None)
    >>> sorted({d["status"] for d in done} - {"skipped"})
    ['passed', 'xfail']
    """
    if not hasattr(estimator, "predict"):
        if not hasattr(estimator, "n_d"):
            raise TypeError(
                f"scikit-learn's checks are of any table, and {type(estimator).__name__} takes the positions of an "
                "axis or an arm; give an estimator, or WienerHammersteinLags."
            )
        if estimator.n_d == 0:  # then X is enough
            return _ORDER
        return dict.fromkeys(_NEEDS_Y, "transform(X) alone cannot be: the regressors hold past outputs")
    if estimator.lags is not None:
        return _ORDER | {_WEIGHTS: "a sample of weight zero drives the state, one that is left out does not"}
    if isinstance(estimator, MultiInnovationGradientRegressor):
        return {_WEIGHTS: "a step for a row of weight two is not two steps"}
    if isinstance(estimator, MILSRegressor):
        return {_WEIGHTS: "the last p - 1 rows have not been in all their windows, and repeated rows fill them sooner"}
    return {}
