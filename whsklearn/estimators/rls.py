"""Recursive least squares, one innovation at a time."""

from __future__ import annotations

from whsklearn.estimators._recursive import RecursiveRegressor


class RLSRegressor(RecursiveRegressor):
    """Recursive least squares on given rows, or on a Wiener-Hammerstein system.

    Parameters
    ----------
    lags : WienerHammersteinLags or InverseDynamicsLags, optional
        How rows are made from X and y; None takes the columns of X as they are.
    P0 : float, optional
        P(0) = P0 I. The default is 1e6, or 1 for the exact gradient without memory.
    forgetting : float, default=1.0
        Forgetting factor, in (0, 1].
    theta0 : float or array-like of shape (n_parameters,), optional
        theta(0), in the paper's order.
    gradient : {"full", "pseudolinear"}, default="full"
        The exact gradient of the predictor, or the published key-term form. It has no
        effect on given rows.
    n_starts : int, default=32
        Number of starts that run in parallel (exact gradient only).
    memory : int, default=4096
        Number of samples that are kept and re-run with the newest parameters; 0 gives the pure
        recursion (exact gradient only).
    random_state : int, RandomState or None
        Draws the starts.

    Attributes
    ----------
    theta_ : ndarray of shape (n_parameters,)
        The estimate.
    covariance_, standard_errors_ : ndarrays
        Covariance and standard errors of ``theta_``.
    parameters_ : dict
        The estimate by name.
    state_ : dict
        The complete state of the stream.

    References
    ----------
    Ljung 1999, System Identification, ch. 11.

    Examples
    --------
    >>> import numpy as np
    >>> from whsklearn import RLSRegressor
    >>> X = np.random.default_rng(0).standard_normal((100, 2))
    >>> model = RLSRegressor().fit(X, X @ [1.0, -2.0])
    >>> model.theta_.round(3)
    array([ 1., -2.])
    """
