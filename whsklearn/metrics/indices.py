"""Indices of section 5.1 and the scorers that scikit-learn takes by name.

All indices are of the error e = y - y_hat.  Given a free run (`predict`) they judge the
simulation; given `predict_ahead` they judge the prediction.  ``skip`` leaves out the
first samples, where the run still remembers that it started from rest.

Importing this module enters ``neg_nmse``, ``neg_rmse`` and ``neg_abs_mu_e`` among
scikit-learn's scorer names, so ``GridSearchCV(model, grid, scoring="neg_nmse")`` works.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.metrics import _scorer, make_scorer

from whsklearn._inputs import real_array

# --- scorers under a name --------------------------------------------------------------------------------------------
# scikit-learn (1.5 to 1.9) has no public call for this.  ``get_scorer`` looks names up in a dict, and every estimator
# or function with a ``scoring`` parameter froze the set of valid names when its module was imported.  Both are
# extended here; if a later version moves them, names stop working and ``scoring=free_run_scorer(nmse)`` still does.
_KNOWN = "neg_mean_squared_error"


def register_scorers(scorers: dict[str, Any]) -> None:
    """Make ``scoring=name`` valid everywhere; a name of scikit-learn's own is never replaced."""
    registry = getattr(_scorer, "_SCORERS", {})
    ours = {name: scorer for name, scorer in scorers.items() if name not in registry}
    registry.update(ours)
    for options in _scoring_options():
        options.update(ours)


def _scoring_options() -> Iterator[set[str]]:
    """The name sets that modules of scikit-learn already imported have frozen."""
    modules = [m for name, m in list(sys.modules.items()) if name.startswith("sklearn.") and m is not None]
    for value in (value for module in modules for value in list(vars(module).values())):
        for attribute in ("_parameter_constraints", "_skl_parameter_constraints"):
            constraints = getattr(value, "__dict__", {}).get(attribute)
            for constraint in constraints.get("scoring", ()) if isinstance(constraints, dict) else ():
                options = getattr(constraint, "options", None)
                if isinstance(options, set) and _KNOWN in options:
                    yield options


# --- indices ---------------------------------------------------------------------------------------------------------
def nmse(y: ArrayLike, y_hat: ArrayLike, skip: int = 0) -> float:
    """Normalised mean squared error, sum (y - y_hat)^2 / (N' sigma_y^2).

    Parameters
    ----------
    y, y_hat : array-like of shape (n,)
        Measured and simulated output, in the unit of the log.
    skip : int, default=0
        Samples at the start that are left out, of the error and of sigma_y^2.

    Returns
    -------
    float
        0 for a perfect run, 1 for a model that only knows the mean.

    Raises
    ------
    ValueError
        If lengths differ, a value is not finite, ``skip`` leaves nothing or y is constant.

    Notes
    -----
    Index (1) of section 5.1; sigma_y^2 is the variance with divisor N'.

    Examples
    --------
    >>> from whsklearn.metrics.indices import nmse
    >>> nmse([0.0, 1.0, 2.0, 3.0], [0.0, 1.0, 2.0, 2.0])
    0.2
    """
    y, e = _output_and_error(y, y_hat, skip)
    # In units of the power of two at the largest output, so that no square overflows where the ratio does not.
    exponent = -int(np.frexp(np.max(np.abs(y)))[1])
    with np.errstate(over="ignore"):
        y, e = np.ldexp(y, exponent), np.ldexp(e, exponent)
    variance = float(np.var(y))
    # A constant has a variance of rounding error only: eps * |y|, squared.
    if variance <= (4 * np.finfo(float).eps * float(np.max(np.abs(y)))) ** 2:
        raise ValueError(f"nmse: y is constant over the {y.size} samples compared; give a record that moves.")
    return _mean_square(e) / variance


def mu_e(y: ArrayLike, y_hat: ArrayLike, skip: int = 0) -> float:
    """Mean of the error y - y_hat, in the unit of y (index (2) of section 5.1).

    ``y``, ``y_hat``, ``skip``: as for `nmse`, but y may be constant.

    Examples
    --------
    >>> from whsklearn.metrics.indices import mu_e
    >>> mu_e([1.0, 2.0], [0.5, 2.0])
    0.25
    """
    return float(np.mean(_output_and_error(y, y_hat, skip)[1]))


def abs_mu_e(y: ArrayLike, y_hat: ArrayLike, skip: int = 0) -> float:
    """Absolute value of `mu_e`: how far the run is off on average, whichever way.

    ``y``, ``y_hat``, ``skip``: as for `mu_e`.

    Examples
    --------
    >>> from whsklearn.metrics import abs_mu_e
    >>> abs_mu_e([0.0, 1.0], [0.5, 1.5])
    0.5
    """
    return abs(mu_e(y, y_hat, skip))


def rmse(y: ArrayLike, y_hat: ArrayLike, skip: int = 0) -> float:
    """Root mean square of the error y - y_hat, in the unit of y (index (3) of section 5.1).

    ``y``, ``y_hat``, ``skip``: as for `nmse`, but y may be constant.

    Examples
    --------
    >>> from whsklearn.metrics.indices import rmse
    >>> rmse([3.0, 4.0], [0.0, 0.0], skip=1)
    4.0
    """
    e = _output_and_error(y, y_hat, skip)[1]
    return math.sqrt(_mean_square(e))


def parameter_error(theta_hat: ArrayLike, theta: ArrayLike) -> float:
    """Relative parameter error, delta = norm(theta_hat - theta) / norm(theta) of section 5.1 and Fig. 2d.

    ``theta_hat``, ``theta`` (n_params,): estimated and true parameters in the same order. Raises ValueError if lengths
    differ, a value is not finite or theta is zero.

    Examples
    --------
    >>> from whsklearn.metrics.indices import parameter_error
    >>> parameter_error([3.0, 4.5], [3.0, 4.0])
    0.1
    """
    estimate, truth = _vector(theta_hat, "theta_hat"), _vector(theta, "theta")
    if estimate.size != truth.size:
        raise ValueError(
            f"parameter_error: theta_hat has {estimate.size} values and theta {truth.size}; give both in one order."
        )
    scale = float(np.abs(truth).max(initial=0.0))
    if scale == 0.0:
        raise ValueError("parameter_error: theta is zero, so an error relative to it is undefined; compare theta_hat.")
    # in units of the largest entry, so that no square overflows where the ratio does not
    return float(np.linalg.norm(estimate / scale - truth / scale) / np.linalg.norm(truth / scale))


def free_run_scorer(metric: Callable[..., float], skip: int = 0, **kwargs: Any) -> Any:
    """A scorer (greater is better) of minus an index of the free run.

    Parameters
    ----------
    metric : callable
        `nmse`, `rmse`, `abs_mu_e` or any ``metric(y, y_hat, skip=)`` whose best value is 0.
    skip : int, default=0
        Samples at the start of every run scored that are left out.  A fold that begins in
        the middle of a record starts from rest and needs as many as the system remembers.
    **kwargs : dict
        Further arguments of the metric.

    Examples
    --------
    >>> from sklearn.dummy import DummyRegressor
    >>> from whsklearn.metrics.indices import free_run_scorer, rmse
    >>> model = DummyRegressor(strategy="constant", constant=1.0).fit([[0.0]], [1.0])
    >>> free_run_scorer(rmse, skip=1)(model, [[0.0], [0.0]], [9.0, 3.0])
    -2.0
    """
    return make_scorer(metric, greater_is_better=False, skip=skip, **kwargs)


SCORER_NAMES = {"neg_nmse": nmse, "neg_rmse": rmse, "neg_abs_mu_e": abs_mu_e}
register_scorers({name: free_run_scorer(metric) for name, metric in SCORER_NAMES.items()})


def _vector(values: ArrayLike, name: str) -> NDArray[np.float64]:
    """A finite float vector, from shape (n,) or (n, 1)."""
    array = real_array(values, name)
    if array.ndim == 2 and array.shape[1] == 1:
        array = array[:, 0]
    if array.ndim != 1 or array.size == 0:
        raise ValueError(f"{name} has shape {array.shape}; expected (n,) with n >= 1.")
    bad = np.flatnonzero(~np.isfinite(array))
    if bad.size:
        raise ValueError(
            f"{name} holds {bad.size} NaN or infinite values, the first at sample {bad[0]}; leave such samples out."
        )
    return array


def _mean_square(e: NDArray[np.float64]) -> float:
    """Mean of e^2; inf, without a warning, for a run that left the range of floats."""
    with np.errstate(over="ignore"):
        return float(np.mean(e * e))


def _output_and_error(y: ArrayLike, y_hat: ArrayLike, skip: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Y and y - y_hat after the first ``skip`` samples."""
    y, y_hat = _vector(y, "y"), _vector(y_hat, "y_hat")
    if y.size != y_hat.size:
        raise ValueError(f"y has {y.size} samples and y_hat {y_hat.size}; give the same samples of both.")
    if isinstance(skip, bool) or not isinstance(skip, (int, np.integer)) or not 0 <= skip < y.size:
        raise ValueError(f"skip is {skip!r}; expected a whole number from 0 to {y.size - 1}.")
    return y[skip:], y[skip:] - y_hat[skip:]
