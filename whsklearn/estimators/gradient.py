"""The multi-innovation stochastic gradient, a cheap relative of MILS."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike
from sklearn.base import TransformerMixin

from whsklearn.effects.base import Array
from whsklearn.estimators._recursive import RecursiveRegressor
from whsklearn.recursion.rows.pseudolinear import GRADIENT


class MultiInnovationGradientRegressor(RecursiveRegressor):
    """theta(t) = theta(t-1) + Phi(p, t) E(p, t) / r(t), r(t) = lambda r(t-1) + norm(phi(t))^2.

    A baseline: it takes n operations per sample, has no covariance and converges slowly.  For a
    Wiener-Hammerstein system the rows are the published ones, (6).

    Parameters
    ----------
    lags : WienerHammersteinLags or InverseDynamicsLags, optional
        How rows are made from X and y; None takes the columns of X as they are.
    p : int, default=4
        Innovation length.
    forgetting : float, default=1.0
        Forgetting factor of r(t), in (0, 1]; below 1 the step does not shrink to zero.
    theta0 : float or array-like of shape (n_parameters,), optional
        theta(0), in the paper's order.

    Attributes
    ----------
    theta_, parameters_, state_
        As for `RLSRegressor`; there are no standard errors (NaN).

    References
    ----------
    Ding and Chen 2007, Performance analysis of multi-innovation gradient type identification
    methods, Automatica 43(1), 1-14.

    Examples
    --------
    >>> import numpy as np
    >>> from whsklearn import MultiInnovationGradientRegressor
    >>> X = np.random.default_rng(0).standard_normal((2000, 2))
    >>> model = MultiInnovationGradientRegressor(forgetting=0.9).fit(X, X @ [1.0, -2.0])
    >>> model.theta_.round(2)
    array([ 1., -2.])
    """

    _published_mode: ClassVar[int] = GRADIENT
    _stochastic_gradient: ClassVar[bool] = True
    _states_errors: ClassVar[bool] = False
    gradient = "pseudolinear"

    def __init__(
        self,
        lags: TransformerMixin | None = None,
        *,
        p: int = 4,
        forgetting: float = 1.0,
        theta0: ArrayLike | None = None,
    ):
        self.lags = lags
        self.p = p
        self.forgetting = forgetting
        self.theta0 = theta0

    def _covariance(self) -> Array:
        """A gradient step has no covariance."""
        n = self.state_["theta"].size
        return np.full((n, n), np.nan)
