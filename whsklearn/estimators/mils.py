"""Multi-innovation least squares, (7) to (9)."""

from __future__ import annotations

from typing import Any

from numpy.typing import ArrayLike
from sklearn.base import TransformerMixin

from whsklearn.estimators._recursive import RecursiveRegressor


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
