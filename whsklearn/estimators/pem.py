"""The batch fit of the one-step prediction error or of the simulation error: the baseline for the recursions."""

from __future__ import annotations

from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike
from sklearn.base import clone
from sklearn.utils.validation import check_is_fitted

from whsklearn._inputs import check_whole
from whsklearn.effects import FrictionLaw, Power, Viscous
from whsklearn.effects.base import Array, Bools
from whsklearn.effects.codes import CONSTANT, HINGE, NATURAL_SPLINE, POWER
from whsklearn.effects.law import has_knots, placed, without_knots
from whsklearn.estimators import _advice
from whsklearn.estimators import _model as wh
from whsklearn.estimators._checked import warn
from whsklearn.estimators._records import Given, fold_of_a_search, joined
from whsklearn.estimators._simulation_fit import from_record, law_of, scale_free
from whsklearn.estimators.base import AxisRegressor
from whsklearn.lags.wiener_hammerstein import WienerHammersteinLags
from whsklearn.recursion.memory.blocks import KNOWN, first_block, increment_rms
from whsklearn.recursion.memory.refit import INFERENCE, LADDER
from whsklearn.recursion.memory.starts import least_squares_start, random_start, regressors, term_scales
from whsklearn.recursion.rows.predictor import LEAST_MOTION, record_errors
from whsklearn.systems.stability import is_stable

# --- one-step prediction errors, minimised over ever sharper signs ---------------------------------------------------


class PredictionError:
    """Residuals and Jacobian of one record, in the form that scipy.optimize.least_squares expects.

    >>> from whsklearn import PEMRegressor
    >>> from whsklearn.datasets import make_wiener_hammerstein
    >>> X, y = make_wiener_hammerstein(n_samples=200, snr_db=40, random_state=0)
    >>> model = PEMRegressor(WienerHammersteinLags(), n_starts=2, random_state=0).fit(X, y)
    >>> restart = np.arange(200) == 0
    >>> error = PredictionError(model._structure(), X, y, restart, np.random.default_rng(0))
    >>> error.residuals(model._natural(), np.inf).shape, error.jacobian(model._natural(), np.inf).shape
    ((200,), (200, 9))
    """

    def __init__(
        self, s: wh.Structure, u: Array, y: Array, restart: Bools, rng: np.random.Generator,
        weights: Array | None = None,
    ):  # fmt: skip
        self.structure, self.u, self.y, self.restart, self.rng = s, u, y, restart, rng
        self.weights, self.root = weights, np.float64(1.0) if weights is None else np.sqrt(weights)
        self.kernel = s.dims, s.law.codes, s.law.shapes
        self.scales = term_scales(self.kernel, u, y, restart, rng)
        self.b = s.slices()[1]
        self.no_rows = np.empty((0, int(s.slices()[-1].stop)))

    def start(self, i: int, rng: np.random.Generator) -> Array:
        """The i-th start: the best linear approximation, then two kinds in turn."""
        if i == 0:
            return self.with_least_squares(self.best_linear(rng))
        theta = random_start(tuple(self.structure.dims), rng, self.scales)
        return self.with_least_squares(theta) if i % 2 else theta

    def with_least_squares(self, theta: Array) -> Array:
        """The start with the L1 of ``theta``; all else is linear then."""
        return least_squares_start(
            theta, self.kernel, regressors(theta, self.kernel, self.u, self.y, self.restart), self.y
        )

    def best_linear(self, rng: np.random.Generator) -> Array:
        """A start whose blocks are those of the best linear approximation."""
        s = self.structure
        moves = not np.isin(s.law.codes, (POWER, HINGE, CONSTANT, NATURAL_SPLINE)).all()
        linear = self.under(FrictionLaw([Viscous() if moves else Power()]))
        _, found = min((linear.climb(linear.start(1 + i, rng), LADDER[:1]) for i in range(4)), key=lambda f: f[0])
        weight = self.b.stop
        return np.concatenate([found[:weight], np.zeros(len(s.law)), found[weight + 1 :]])

    def under(self, law: FrictionLaw) -> PredictionError:
        """The same record under another law."""
        return PredictionError(self.structure.under(law), self.u, self.y, self.restart, self.rng, self.weights)

    def placed(self, theta: Array, law: FrictionLaw) -> tuple[PredictionError, float, Array]:
        """The problem under a law with its knots placed for the x of ``theta``, and what its blocks then lead to."""
        (x, _), _ = first_block(theta, self.kernel[0], self.u, self.restart, KNOWN)
        at, w = self.under(FrictionLaw(placed(law.terms, x))), self.structure.slices()[2]
        start = np.concatenate([theta[: w.start], np.zeros(len(law)), theta[w.stop :]])
        return at, *at.climb(at.with_least_squares(start))

    def increment_rms(self, theta: Array) -> float:
        """Root mean square of dx, never zero."""
        return max(float(increment_rms(theta, self.kernel[0], self.u, self.restart)), LEAST_MOTION)

    def residuals(self, theta: Array, kappa: float) -> Array:
        """One-step prediction errors; large where L1 is unstable, so that the step is refused."""
        errors = np.empty(self.y.size)
        if not is_stable(np.ascontiguousarray(theta[self.b]), 0.999):
            return np.full(self.y.size, 1e3 * (np.abs(self.y).max() + 1.0))
        record_errors(theta, *self.kernel, kappa, self.u, self.y, self.restart, errors, self.no_rows)
        return np.nan_to_num(np.clip(errors, -1e100, 1e100), nan=1e100) * self.root

    def jacobian(self, theta: Array, kappa: float) -> Array:
        """Derivatives of `residuals`."""
        rows = np.zeros((self.y.size, theta.size))
        if is_stable(np.ascontiguousarray(theta[self.b]), 0.999):
            errors = np.empty(self.y.size)
            record_errors(theta, *self.kernel, kappa, self.u, self.y, self.restart, errors, rows)
        return -np.nan_to_num(np.clip(rows, -1e100, 1e100)) * np.reshape(self.root, (-1, 1))

    def climb(self, theta: Array, ladder: tuple[float, ...] = LADDER) -> tuple[float, Array]:
        """The least sum of squares under the true sign over all rungs, and its parameters."""
        from scipy.optimize import least_squares

        best = np.inf, theta
        method = "lm" if self.y.size >= theta.size else "trf"  # MINPACK needs as many residuals as parameters
        for relative in ladder:
            kappa = relative / self.increment_rms(theta)
            theta = least_squares(
                self.residuals, theta, self.jacobian, method=method, x_scale="jac", max_nfev=40, args=(kappa,)
            ).x
            cost = float(np.sum(self.residuals(theta, np.inf) ** 2))
            if cost < best[0]:
                best = cost, theta.copy()
        return best

    def inverse_information(self, theta: Array) -> Array:
        """(J'J)^-1 at the sharpness of `INFERENCE`; NaN for parameters that move no residual."""
        rows = self.jacobian(theta, INFERENCE / self.increment_rms(theta))
        norms = np.linalg.norm(rows, axis=0)
        unseen = norms < 1e-100  # whose squares would be zero
        scale = np.where(unseen, 1.0, norms)
        scaled = np.linalg.pinv((rows / scale).T @ (rows / scale), rcond=1e-13, hermitian=True)
        inverse: Array = scaled / np.outer(scale, scale)
        inverse[unseen], inverse[:, unseen] = np.nan, np.nan
        return inverse


# --- the estimators --------------------------------------------------------------------------------------------------
class ChainRegressor(AxisRegressor):
    """A chain whose orders and law may be found by the fit; blocks may have direct paths.

    A subclass provides its natural vector and covariance, and reports in `_found_lags` what the fit found.

    >>> from whsklearn import PEMRegressor
    >>> from whsklearn.datasets import make_wiener_hammerstein
    >>> X, y = make_wiener_hammerstein(n_samples=300, snr_db=40, random_state=0)
    >>> model = PEMRegressor(criterion="simulation").fit(X, y)
    >>> isinstance(model, ChainRegressor), model.structure_.n_b >= 1
    (True, True)
    """

    _takes_direct_paths: ClassVar[bool] = True

    @property
    def _is_wiener_hammerstein(self) -> bool:
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
        with self._alone(), self._unchanged_if_refused():
            for name in ("state_", "_early"):  # with the orders that an earlier fit found
                self.__dict__.pop(name, None)
            self._fit(joined(X, y, groups, sample_weight))
        return self

    def _fit(self, given: Given) -> None:
        raise NotImplementedError

    def _found_lags(self) -> dict[str, Any] | None:
        """The lag settings that the fit found; None if it did not search for any."""
        found: dict[str, Any] | None = self.state_.get("lags")
        return found

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
    no difference between the two.  For laws in dx it starts from all minima of the other criterion.

    Parameters
    ----------
    lags : WienerHammersteinLags, optional
        Orders, law and delays.  None means those of Example 5.1 for the prediction error, and a search for
        the simulation error.  The knots of a law given by name (``law="cubic_spline"``) are chosen from the
        data.
    criterion : {"prediction", "simulation"}, default="prediction"
        The error to minimise.
    n_starts : int, default=16
        Number of starts for the prediction error.  The first is the best linear approximation.  The simulation
        error of a law in dx is fitted from what they lead to.
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
    >>> u = np.random.default_rng(0).standard_normal(400)
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
        return self.criterion == "simulation" and not _advice.is_odd(law_of(self.lags))

    def _check_parameters(self) -> None:
        check_whole("n_starts", self.n_starts, 1)
        if self.criterion not in CRITERIA:
            raise ValueError(f"criterion is {self.criterion!r}, expected one of: {', '.join(CRITERIA)}.")

    def _fit(self, given: Given) -> None:
        X, y, restart, weights = self._checked_record(given)
        if self.criterion == "simulation":
            self._fit_simulation(X, y, restart, weights)
            return
        problem, ((cost, natural), *_) = self._prediction_minima(X, y, restart, weights)
        self.cost_ = cost
        noise = cost / max((len(y) if weights is None else np.count_nonzero(weights)) - natural.size, 1)
        covariance = noise * problem.inverse_information(natural)
        law = problem.structure.law.reweighted(natural[problem.structure.slices()[2]])
        lags = {**self._given_lags.get_params(deep=False), "law": law}
        self.state_ = {"theta": natural, "covariance": covariance, "lags": lags, "seen": len(y), "noise": noise}
        if weights is None and not self._structure().advance:
            self._warn_of_the_law(X, y, restart)

    def _prediction_minima(
        self, X: Array, y: Array, restart: Bools, weights: Array | None
    ) -> tuple[PredictionError, list[tuple[float, Array]]]:
        """The one-step problem, and (sum of squares, natural vector) of what its starts lead to, best first."""
        structure = self._structure()
        if structure.advance:
            X, y, restart, weights, _ = wh.shifted(X, y, restart, structure.advance, weights)
            structure = structure._replace(advance=0)
        rng, law = np.random.default_rng(self._draw_seed()), structure.law
        problem = PredictionError(structure, np.ascontiguousarray(X), y, restart, rng, weights)
        named = isinstance(self._given_lags.law, str) and has_knots(law.terms)
        if named:
            problem = problem.under(without_knots(law))
        found = [problem.climb(problem.start(i, rng)) for i in range(self.n_starts)]
        self.costs_ = np.array([cost for cost, _ in found])
        found.sort(key=lambda f: f[0])
        if named:  # each minimum has an x of its own, and the best one another after its fit
            best = min((problem.placed(theta, law) for _, theta in found), key=lambda at: at[1])
            problem, cost, natural = min(best, best[0].placed(best[2], law), key=lambda at: at[1])
            found = [(cost, natural)]
        return problem, found

    def _fit_simulation(self, X: Array, y: Array, restart: Bools, weights: Array | None) -> None:
        many = X.shape[1] > 1
        if many and self.lags is None:
            raise ValueError(
                f"X has {X.shape[1]} inputs, and orders are searched for one; give lags=WienerHammersteinLags(...)."
            )
        # The best linear approximation does not show a law in dx, or how several inputs share L1.
        starts: list[Array] = []
        if many or not scale_free(law_of(self.lags)):
            starts = [theta for _, theta in self._prediction_minima(X, y, restart, weights)[1]]
        found, self.cost_ = from_record(self.lags, X, y, restart, starts, weights)
        self.__dict__.pop("costs_", None)
        self.state_ = found | {"seen": len(y)}
        told = not self._finds_constant and _advice.of_a_constant(law_of(self.lags), X, y) is not None
        if weights is None and fold_of_a_search() is None and not told:
            warn(_advice.of_a_weak_run(found["noise"] / max(float(np.var(y)), 1e-300)))

    def _natural(self) -> Array:
        return self.state_["theta"].copy()

    def _natural_covariance(self) -> Array:
        return self.state_["covariance"].copy()

    def _noise_variance(self) -> float:
        return float(self.state_.get("noise", np.nan))
