"""Error against prediction horizon: one step ahead flatters, the free run does not.

A model that misses friction can predict one step with NMSE 4e-4 and still be a tenth of the
variance off when it runs freely; between the two, the curve shows how soon it loses the output.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from whsklearn.metrics.indices import nmse, rmse


@dataclass(frozen=True)
class HorizonCurve:
    """Errors at each horizon, and of the free run, where no horizon ends.

    Attributes
    ----------
    horizons : ndarray of shape (n,)
        In samples.
    nmse, rmse : ndarray of shape (n,)
        Of the prediction so far ahead; rmse in the unit of y.
    free_run_nmse, free_run_rmse : float

    References
    ----------
    Ljung 1999, System Identification, 2nd ed., sec. 16.4, on k-step prediction as a validation.

    Examples
    --------
    >>> import numpy as np
    >>> from whsklearn.validation import HorizonCurve
    >>> curve = HorizonCurve(np.array([1, 10]), np.array([1e-4, 0.02]), np.array([0.01, 0.14]), 0.1, 0.32)
    >>> curve.free_run_nmse
    0.1
    """

    horizons: NDArray[np.int64]
    nmse: NDArray[np.float64]
    rmse: NDArray[np.float64]
    free_run_nmse: float
    free_run_rmse: float


def error_against_horizon(
    estimator: Any, X: ArrayLike, y: ArrayLike, horizons: Iterable[int] = (1, 2, 5, 10, 20, 50), skip: int | None = None
) -> HorizonCurve:
    """NMSE and e_RMSE of ``predict_ahead`` at each horizon, and of ``predict``.

    Parameters
    ----------
    estimator : object
        Fitted, with ``predict_ahead(X, y, horizon=k)`` and ``predict(X)``.
    X : array-like of shape (n, n_features)
        Input.
    y : array-like of shape (n,)
        Measured output.
    horizons : iterable of int
        Steps ahead, each >= 1.
    skip : int, optional
        Samples at the start left out of every index; the largest horizon by default, so that
        all horizons are judged on the same samples.

    Raises
    ------
    ValueError
        If a horizon is below 1 or no sample is left.
    TypeError
        If the estimator has no ``predict_ahead``.

    Examples
    --------
    >>> from whsklearn import MultiInnovationGradientRegressor, WienerHammersteinLags
    >>> from whsklearn.datasets import make_wiener_hammerstein
    >>> from whsklearn.validation import error_against_horizon
    >>> X, y = make_wiener_hammerstein(200, snr_db=None, random_state=0)
    >>> model = MultiInnovationGradientRegressor(WienerHammersteinLags()).fit(X, y)
    >>> error_against_horizon(model, X, y, horizons=(1, 5)).horizons.tolist()
    [1, 5]
    """
    steps = sorted({int(k) for k in horizons})
    if not steps or steps[0] < 1:
        raise ValueError(f"error_against_horizon: horizons are {steps}, expected whole numbers >= 1.")
    if not hasattr(estimator, "predict_ahead"):
        raise TypeError(f"{type(estimator).__name__} has no predict_ahead(X, y, horizon=); give an estimator that has.")
    skip = steps[-1] if skip is None else skip
    ahead = [estimator.predict_ahead(X, y, horizon=k) for k in steps]
    free = estimator.predict(X)
    return HorizonCurve(
        horizons=np.array(steps),
        nmse=np.array([nmse(y, y_hat, skip) for y_hat in ahead]),
        rmse=np.array([rmse(y, y_hat, skip) for y_hat in ahead]),
        free_run_nmse=nmse(y, free, skip),
        free_run_rmse=rmse(y, free, skip),
    )
