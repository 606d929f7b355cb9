"""The batch fit of the one-step prediction error or of the simulation error: the baseline for the recursions."""

from __future__ import annotations

from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike
from sklearn.base import clone
from sklearn.utils.validation import check_is_fitted

from whsklearn._inputs import check_whole
from whsklearn.effects.base import Array, Bools
from whsklearn.estimators import _model as wh
from whsklearn.estimators._prediction_error import PredictionError
from whsklearn.estimators._records import joined
from whsklearn.estimators._simulation_fit import from_record, law_of, scale_free
from whsklearn.estimators.base import AxisRegressor
from whsklearn.lags.wiener_hammerstein import WienerHammersteinLags


class ChainRegressor(AxisRegressor):
    """A chain whose orders and law may be found by the fit; blocks may have direct paths.

    A subclass provides its natural vector and covariance, and reports in `_found_lags` what the fit found.
    """

    @property
    def _is_wiener_hammerstein(self) -> bool:
        return True

    @property
    def _takes_direct_paths(self) -> bool:
        return True

    @property
    def _given_lags(self) -> WienerHammersteinLags:
        return WienerHammersteinLags() if self.lags is None else self.lags

    def fit(
        self, X: ArrayLike, y: ArrayLike, groups: ArrayLike | None = None, sample_weight: ArrayLike | None = None
    ) -> Self:
        """Fit a record, or several, from the beginning.

        Parameters
        ----------
        X : array-like of shape (n, 1), or list of them
            Input; each record of a list is a separate experiment.
        y : array-like of shape (n,), or list of them
            Output.
        groups : array-like of shape (n,), optional
            Experiment of each sample; the state restarts at the beginning of each.
        sample_weight : array-like of shape (n,), optional
            Weights of the squared errors, as 1 / variance; a sample of weight zero drives the state but is not fitted.

        Raises
        ------
        ValueError
            If the record is too short, a number is not finite, or a setting is invalid; a stream then stays unchanged.
        """
        raise NotImplementedError

    def _found_lags(self) -> dict[str, Any] | None:
        """The lag settings that the fit found; None if it did not search for any."""
        raise NotImplementedError

    @property
    def _lags(self) -> WienerHammersteinLags:
        found = self._found_lags() if "state_" in self.__dict__ else None
        return super()._lags if found is None else WienerHammersteinLags(**found)

    @property
    def structure_(self) -> WienerHammersteinLags:
        """Orders, law and delays that the fit found."""
        check_is_fitted(self, "state_")
        return clone(self._lags)

    def _noise_filter(self, natural: Array, structure: wh.Structure) -> Array:
        return np.empty(0) if self._fits_free_run else super()._noise_filter(natural, structure)

    def _theta(self) -> Array:
        return wh.paper_vector(self._natural(), self._structure())

    def _covariance(self) -> Array:
        jacobian = wh.paper_jacobian(self._natural(), self._structure())
        return jacobian @ self._natural_covariance() @ jacobian.T

    def __sklearn_tags__(self) -> Any:
        tags = super().__sklearn_tags__()
        tags.regressor_tags.poor_score = True
        return tags


CRITERIA = ("prediction", "simulation")


class PEMRegressor(ChainRegressor):
    """Batch fit of a Wiener-Hammerstein system: the least error one step ahead, or in free run.

    ``criterion="prediction"`` minimises the one-step prediction error by Levenberg-Marquardt from
    several starts.  The first is the best linear approximation: the same two blocks with a linear law
    between them.  The other starts are random.  Each start is refined with ever sharper signs, and the
    result with the least prediction error under the true sign is kept.  Use it where noise enters as
    in (2), before L2's denominator, and the friction law (4) acts on dx, as in Example 5.1.

    ``criterion="simulation"`` minimises the error of the free run.  The poles and zeros of the best
    linear approximation are divided between L1 and L2 in all possible ways.  The best divisions are
    refined with exact sensitivities, and the law is solved again at each step.  Use it for measured
    records, where noise is added to the output and no model is exact, for laws in x, and for high
    orders.  Without ``lags`` it searches for the orders and adds poles where the error shows that one
    is missing.  The law is then a cubic spline, or a polynomial of third degree where held-out data show
    no difference between the two.  For laws in dx it starts from the result of the other criterion.

    Parameters
    ----------
    lags : WienerHammersteinLags, optional
        Orders, law and delays.  None means those of Example 5.1 for the prediction error, and a search for
        the simulation error.  In the latter, the knots of a law given by name (``law="cubic_spline"``) are
        chosen from the data.
    criterion : {"prediction", "simulation"}, default="prediction"
        The error to minimise.
    n_starts : int, default=16
        Number of starts for the prediction error.  The first is the best linear approximation.  Of the
        others, every second takes weights, c and d from least squares given a random L1.
    random_state : int, RandomState or None
        Draws the starts.

    Attributes
    ----------
    theta_, covariance_, standard_errors_, parameters_, parameter_standard_errors_
        As for `RMILSRegressor`.
    structure_ : WienerHammersteinLags
        Orders, law with its weights and knots, and delays, as the fit found them.
    cost_ : float
        Sum of squared errors.  For a free run, the first samples of each experiment (300, or a tenth)
        are excluded, because a model that starts at rest cannot know their transient.
    costs_ : ndarray of shape (n_starts,)
        The sum of squared one-step errors of each start; starts near the least value found the same minimum.

    Notes
    -----
    For the prediction error the covariance is sigma^2 (J'J)^-1, with the sign smoothed to kappa rms(dx) = 20.
    Under the true sign the likelihood is a staircase in a and b, so no Gaussian interval is exact;
    benchmarks/accuracy.py measures their coverage.  For the simulation error the covariance does not
    assume a white residual: sums of J e over 60 batches of the record replace sigma^2 J'J.

    References
    ----------
    Ljung 1999, System Identification, ch. 7; More 1978, The Levenberg-Marquardt algorithm, as in
    MINPACK, which scipy.optimize.least_squares calls; Sjoberg and Schoukens 2012, Initializing
    Wiener-Hammerstein models based on partitioning of the best linear approximation, Automatica 48.

    Examples
    --------
    >>> from whsklearn import PEMRegressor
    >>> from whsklearn.datasets import make_wiener_hammerstein
    >>> X, y = make_wiener_hammerstein(n_samples=300, snr_db=40, random_state=0)
    >>> model = PEMRegressor(n_starts=6, random_state=0).fit(X, y)
    >>> model.parameters_["b"].round(1)
    array([1. , 0.5])

    A saturation between two blocks with direct paths; the fit finds orders and law:

    >>> import numpy as np
    >>> from scipy.signal import lfilter
    >>> u = np.random.default_rng(0).standard_normal(2000)
    >>> y = lfilter([0.5], [1.0, -0.4], np.minimum(lfilter([0.3], [1.0, -0.7], u), 0.3))
    >>> model = PEMRegressor(criterion="simulation").fit(u[:, None], y)
    >>> bool(np.std(y - model.predict(u[:, None])) < 0.02 * np.std(y))
    True
    """

    def __init__(
        self,
        lags: WienerHammersteinLags | None = None,
        *,
        criterion: str = "prediction",
        n_starts: int = 16,
        random_state: Any = None,
    ):
        self.lags = lags
        self.criterion = criterion
        self.n_starts = n_starts
        self.random_state = random_state

    @property
    def _fits_free_run(self) -> bool:  # type: ignore[override]
        return self.criterion == "simulation"

    @property
    def _finds_constant(self) -> bool:  # type: ignore[override]
        return self.criterion == "simulation"

    def _found_lags(self) -> dict[str, Any] | None:
        found: dict[str, Any] | None = self.state_.get("lags")
        return found

    def fit(
        self, X: ArrayLike, y: ArrayLike, groups: ArrayLike | None = None, sample_weight: ArrayLike | None = None
    ) -> Self:
        check_whole("n_starts", self.n_starts, 1)
        if self.criterion not in CRITERIA:
            raise ValueError(f"criterion is {self.criterion!r}, expected one of: {', '.join(CRITERIA)}.")
        before = self.__dict__.pop("state_", None)
        try:
            X, y, restart, weights = self._checked_record(joined(X, y, groups, sample_weight))
        except BaseException:
            if before is not None:
                self.state_ = before
            raise
        if self.criterion == "simulation":
            return self._fit_simulation(X, y, restart, weights)
        self.state_ = self._fit_prediction(X, y, restart, weights)
        return self

    def _fit_prediction(self, X: Array, y: Array, restart: Bools, weights: Array | None) -> dict[str, Any]:
        structure = self._structure()
        if structure.advance:
            X, y, restart, to = wh.shifted(X, y, restart, structure.advance)
            structure = structure._replace(advance=0)
            if weights is not None:
                weights, given = np.zeros(len(y)), weights
                weights[to] = given
        rng = np.random.default_rng(self._draw_seed())
        problem = PredictionError(structure, np.ascontiguousarray(X), y, restart, rng, weights)
        found = [problem.climb(problem.start(i, rng)) for i in range(self.n_starts)]
        self.costs_ = np.array([cost for cost, _ in found])
        cost, natural = min(found, key=lambda f: f[0])
        self.cost_ = float(cost)
        counted = len(y) if weights is None else int(np.count_nonzero(weights))
        noise = float(cost) / max(counted - natural.size, 1)
        return {
            "theta": natural,
            "covariance": noise * problem.inverse_information(natural),
            "seen": len(y),
            "noise": noise,
        }

    def _fit_simulation(self, X: Array, y: Array, restart: Bools, weights: Array | None) -> Self:
        many = X.shape[1] > 1
        if many and self.lags is None:
            raise ValueError(
                f"X has {X.shape[1]} inputs, and orders are searched for one; give lags=WienerHammersteinLags(...)."
            )
        # The best linear approximation does not show a law in dx, or how several inputs share L1.
        free = not many and scale_free(law_of(self.lags))
        start = None if free else self._fit_prediction(X, y, restart, weights)["theta"]
        fit = from_record(self.lags, X, y, restart, start, weights)
        self.__dict__.pop("costs_", None)
        self.cost_ = fit.cost
        self.state_ = {
            "theta": fit.natural, "covariance": fit.covariance, "seen": len(y), "lags": fit.lags, "noise": fit.noise
        }  # fmt: skip
        return self

    def _natural(self) -> Array:
        return self.state_["theta"].copy()

    def _natural_covariance(self) -> Array:
        return self.state_["covariance"].copy()

    def _noise_variance(self) -> float:
        return float(self.state_.get("noise", np.nan))
