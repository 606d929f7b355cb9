"""Reframed multi-innovation least squares, (10) to (14): the estimator of the paper."""

from __future__ import annotations

from typing import ClassVar

from whsklearn.estimators.mils import MILSRegressor
from whsklearn.recursion.rows.pseudolinear import REEVALUATED


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
    output expected over them.  They are computed when they are read, which takes 20 to 110 ms, and
    kept until the next sample; `partial_fit` does not wait for them.

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
