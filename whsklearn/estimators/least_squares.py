"""Recursive least squares on one innovation or on several, and its stochastic gradient: RLS, MILS, RMILS, MISG."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike
from sklearn.base import TransformerMixin

from whsklearn.effects.base import Array
from whsklearn.estimators._recursive import RecursiveRegressor
from whsklearn.recursion.rows.pseudolinear import GRADIENT, REEVALUATED


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


# --- multi-innovation least squares, (7) to (9) ----------------------------------------------------------------------
class MILSRegressor(RecursiveRegressor):
    """Multi-innovation least squares: each sample updates together with the p - 1 before it, as one block.

    Parameters
    ----------
    lags : WienerHammersteinLags or InverseDynamicsLags, optional
        How rows are made from X and y; None takes the columns of X as they are.
    p : int, default=4
        Innovation length.
    P0, forgetting, theta0, gradient, n_starts, memory, random_state
        As for `RLSRegressor`.

    Attributes
    ----------
    theta_, covariance_, standard_errors_, parameters_, state_
        As for `RLSRegressor`.

    Notes
    -----
    The block update is computed as p scalar updates, which are equivalent to it (block inversion
    lemma), so no matrix is inverted.  In the published form (``gradient="pseudolinear"``) each
    sample counts in p windows with weight one, and P is about p times too small.  Otherwise its
    weight is 1/p, and P is calibrated.

    References
    ----------
    Paper, (7)-(9); Ding, Liu and Liu 2010, Multi-innovation least squares identification for system
    modeling, IEEE Trans. Syst. Man Cybern. B 40(3), 767-778.

    Examples
    --------
    >>> from whsklearn import MILSRegressor, WienerHammersteinLags
    >>> from whsklearn.datasets import make_wiener_hammerstein
    >>> X, y = make_wiener_hammerstein(n_samples=400, snr_db=40, random_state=0)
    >>> model = MILSRegressor(WienerHammersteinLags(), p=2, random_state=0).fit(X, y)
    >>> model.parameters_["b"].round(1)
    array([1. , 0.5])
    """

    def __init__(
        self,
        lags: TransformerMixin | None = None,
        *,
        p: int = 4,
        P0: float | None = None,
        forgetting: float = 1.0,
        theta0: ArrayLike | None = None,
        gradient: str = "full",
        n_starts: int = 32,
        memory: int = 4096,
        random_state: Any = None,
    ):
        super().__init__(
            lags, P0=P0, forgetting=forgetting, theta0=theta0, gradient=gradient, n_starts=n_starts, memory=memory,
            random_state=random_state,
        )  # fmt: skip
        self.p = p


# --- reframed multi-innovation least squares, (10) to (14): the estimator of the paper -------------------------------
class RMILSRegressor(MILSRegressor):
    """Reframed multi-innovation least squares: p sub-innovations, each with the newest parameters.

    Parameters
    ----------
    lags : WienerHammersteinLags or InverseDynamicsLags, optional
        How rows are made from X and y. None takes the columns of X as they are; the
        sub-innovations then equal the block update of `MILSRegressor`.
    p : int, default=4
        Innovation length: the last p samples are re-run at each new sample.
    P0 : float, optional
        P(0) = P0 I, in units of the noise variance, or of the output's power with the exact
        gradient. The default is 1e6, or 1 without memory.
    forgetting : float, default=1.0
        Forgetting factor, in (0, 1].
    theta0 : float or array-like of shape (n_parameters,), optional
        theta(0), in the paper's order. In the published form its default is 0.01; with the exact
        gradient it is one additional start.
    gradient : {"full", "pseudolinear"}, default="full"
        "pseudolinear" is the published method to the letter: key-term separation (5), an
        auxiliary model and weights of one.  It does not converge on the paper's own example
        (``python -m pipelines.reproduce`` shows this).  "full" uses the exact gradient of the
        same predictor: the recursive prediction error method.
    n_starts : int, default=32
        Number of starts that run in parallel, because the prediction error has wrong minima.
    memory : int, default=4096
        Number of samples that are kept and re-run with the newest parameters, in parts of about
        50 us between the samples. 0 gives the pure recursion, which loses about half of the accuracy.
    random_state : int, RandomState or None
        Draws the starts.

    Attributes
    ----------
    theta_ : ndarray of shape (n_parameters,)
        The estimate, in the paper's order (6).
    covariance_, standard_errors_ : ndarrays of shape (n_parameters, n_parameters), (n_parameters,)
        Covariance and standard errors of ``theta_``.
    parameters_ : dict
        ``a``, ``b``, ``c``, ``d`` and a weight for each term of the law.
    parameter_standard_errors_ : dict
        Their standard errors, in the same layout.
    innovation_variance_ : float
        Variance of the one-step prediction error.
    state_ : dict
        The complete state of the stream; its size does not grow.

    Notes
    -----
    If the law jumps with sign(dx), ``theta_`` and ``standard_errors_`` are the mean and standard
    deviation of the posterior over the samples whose sign is in doubt, and `predict` gives the
    output expected over them; for other laws they are those of the memory re-run as far as it has
    come.  They are computed when they are read, which takes 20 to 110 ms, or up to half a second for a
    re-run, and kept until the next sample; `partial_fit` does not wait for them.

    References
    ----------
    Paper, (10)-(14); Ljung 1999, System Identification, ch. 11; Soderstrom and Stoica 1989,
    System Identification, ch. 9.

    Examples
    --------
    >>> from whsklearn import RMILSRegressor, WienerHammersteinLags
    >>> from whsklearn.datasets import make_wiener_hammerstein
    >>> X, y = make_wiener_hammerstein(n_samples=400, snr_db=40, random_state=0)
    >>> model = RMILSRegressor(WienerHammersteinLags(), p=4, random_state=0).fit(X, y)
    >>> model.parameters_["a"].round(1)
    array([1. , 2.2])
    >>> bool(model.score(X, y) > 0.99)
    True
    """

    _frozen: ClassVar[bool] = False
    _published_mode: ClassVar[int] = REEVALUATED


# --- the multi-innovation stochastic gradient, a cheap relative of MILS ----------------------------------------------
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
    gradient, P0, n_starts, memory = "pseudolinear", None, 1, 0

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
