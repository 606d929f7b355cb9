"""The batch prediction-error fit, the yardstick of the recursions."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Self

import numpy as np

from whsklearn.effects import FrictionLaw, Power, Viscous
from whsklearn.effects.terms import CONSTANT, HINGE, POWER
from whsklearn.estimators import _model as wh
from whsklearn.estimators.base import AxisRegressor
from whsklearn.lags import WienerHammersteinLags
from whsklearn.recursion.predictor import motion, record_errors
from whsklearn.recursion.starts import least_squares_start, random_start, term_scales
from whsklearn.systems.stability import is_stable

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    Array = NDArray[np.float64]

# kappa times the root mean square of dx; at the last about 1 sample in 400 lies within the smoothed sign
LADDER = (1.0, 2.0, 4.0, 8.0, 20.0, 50.0, 100.0, 200.0, 400.0)
INFERENCE = 20.0  # sharpness at which the covariance is taken, see `PEMRegressor`


class PEMRegressor(AxisRegressor):
    """Prediction-error fit of a Wiener-Hammerstein system by Levenberg-Marquardt from several starts.

    The first start is the best linear approximation: the same two blocks about a linear law, fitted
    first; the others are random.  Each climbs a ladder of ever sharper signs, and the start and
    rung with the least prediction error under the true sign is kept.

    Parameters
    ----------
    lags : WienerHammersteinLags, optional
        Orders and law; Example 5.1's by default.
    n_starts : int, default=16
        One from the best linear approximation, of the others every second with weights, c and
        d from least squares given a random L1.
    random_state : int, RandomState or None
        Of the starts.

    Attributes
    ----------
    theta_, covariance_, standard_errors_, parameters_, parameter_standard_errors_
        As for `RMILSRegressor`.
    cost_ : float
        Sum of squared one-step prediction errors.
    costs_ : ndarray of shape (n_starts,)
        The same for each start; those near the least found the same minimum.

    Notes
    -----
    The covariance is sigma^2 (J'J)^-1 with the sign smoothed to kappa rms(dx) = 20.  Under the true
    sign the likelihood is a staircase in a and b, and no Gaussian interval is exact there;
    benchmarks/accuracy.py measures what these cover.

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
    """

    def __init__(self, lags: WienerHammersteinLags | None = None, *, n_starts: int = 16, random_state: Any = None):
        self.lags = lags
        self.n_starts = n_starts
        self.random_state = random_state

    @property
    def _is_wiener_hammerstein(self) -> bool:
        return True

    @property
    def _given_lags(self) -> WienerHammersteinLags:
        return WienerHammersteinLags() if self.lags is None else self.lags

    def fit(self, X: ArrayLike, y: ArrayLike, groups: ArrayLike | None = None) -> Self:
        """Fit a record.

        Parameters
        ----------
        X : array-like of shape (n, 1)
            Input.
        y : array-like of shape (n,)
            Output.
        groups : array-like of shape (n,), optional
            Experiments; the state restarts where one begins.

        Raises
        ------
        ValueError
            If the record is too short or a number is not finite.
        """
        if isinstance(self.n_starts, bool) or not isinstance(self.n_starts, (int, np.integer)) or self.n_starts < 1:
            raise ValueError(f"n_starts is {self.n_starts!r}, expected a whole number of 1 or more.")
        X, y, restart = self._checked_record(X, y, groups)
        structure = self._structure()
        rng = np.random.default_rng(self._draw_seed())
        problem = _Problem(structure, np.ascontiguousarray(X), y, restart, rng)
        found = [problem.climb(problem.start(i, rng)) for i in range(self.n_starts)]
        self.costs_ = np.array([cost for cost, _ in found])
        cost, natural = min(found, key=lambda f: f[0])
        self.cost_ = float(cost)
        self.state_ = {
            "theta": natural,
            "covariance": cost / max(len(y) - natural.size, 1) * problem.inverse_information(natural),
            "seen": len(y),
        }
        return self

    def _natural(self) -> Array:
        return self.state_["theta"].copy()

    def _theta(self) -> Array:
        return wh.paper_vector(self._natural(), self._structure())

    def _natural_covariance(self) -> Array:
        return self.state_["covariance"].copy()

    def _covariance(self) -> Array:
        jacobian = wh.paper_jacobian(self._natural(), self._structure())
        return jacobian @ self._natural_covariance() @ jacobian.T

    def __sklearn_tags__(self) -> Any:
        tags = super().__sklearn_tags__()
        tags.regressor_tags.poor_score = True
        return tags


class _Problem:
    """Residuals and Jacobian of one record, as scipy.optimize.least_squares takes them."""

    def __init__(self, s: wh.Structure, u: Array, y: Array, restart: NDArray[np.bool_], rng: np.random.Generator):
        self.structure, self.u, self.y, self.restart = s, u, y, restart
        self.kernel = s.dims, s.law.codes, s.law.shapes
        self.scales = term_scales(self.kernel, u, y, restart, rng)
        self.b = s.slices()[1]
        self.no_rows = np.empty((0, int(s.slices()[-1].stop)))

    def start(self, i: int, rng: np.random.Generator) -> Array:
        """The i-th start: the best linear approximation, then two kinds in turn."""
        if i == 0:
            return least_squares_start(self.best_linear(rng), self.kernel, self.u, self.y, self.restart)
        theta = random_start(tuple(self.structure.dims), rng, self.scales)
        return least_squares_start(theta, self.kernel, self.u, self.y, self.restart) if i % 2 else theta

    def best_linear(self, rng: np.random.Generator) -> Array:
        """Blocks of the best linear approximation, in the place of the nonlinear model's."""
        s = self.structure
        moves = not np.isin(s.law.codes, (POWER, HINGE, CONSTANT)).all()
        law = FrictionLaw([Viscous() if moves else Power()])
        dims = np.append(s.dims[:4], 1)
        linear = _Problem(s._replace(dims=dims, law=law, key=0), self.u, self.y, self.restart, rng)
        _, found = min((linear.climb(linear.start(1 + i, rng), LADDER[:1]) for i in range(4)), key=lambda f: f[0])
        weight = self.b.stop
        return np.concatenate([found[:weight], np.zeros(len(s.law)), found[weight + 1 :]])

    def motion(self, theta: Array) -> float:
        """Root mean square of dx, never zero."""
        return max(float(motion(theta, self.kernel[0], self.u, self.restart)), 1e-12)

    def residuals(self, theta: Array, kappa: float) -> Array:
        """One-step prediction errors; large where L1 is unstable, so that the step is refused."""
        errors = np.empty(self.y.size)
        if not is_stable(np.ascontiguousarray(theta[self.b]), 0.999):
            return np.full(self.y.size, 1e3 * (np.abs(self.y).max() + 1.0))
        record_errors(theta, *self.kernel, kappa, self.u, self.y, self.restart, errors, self.no_rows)
        return np.nan_to_num(np.clip(errors, -1e100, 1e100), nan=1e100)

    def jacobian(self, theta: Array, kappa: float) -> Array:
        """Derivatives of `residuals`."""
        rows = np.zeros((self.y.size, theta.size))
        if is_stable(np.ascontiguousarray(theta[self.b]), 0.999):
            errors = np.empty(self.y.size)
            record_errors(theta, *self.kernel, kappa, self.u, self.y, self.restart, errors, rows)
        return -np.nan_to_num(np.clip(rows, -1e100, 1e100))

    def climb(self, theta: Array, ladder: tuple[float, ...] = LADDER) -> tuple[float, Array]:
        """(least sum of squares under the true sign, its parameters) over the rungs."""
        from scipy.optimize import least_squares

        best = np.inf, theta
        method = "lm" if self.y.size >= theta.size else "trf"  # MINPACK needs as many residuals as parameters
        for relative in ladder:
            kappa = relative / self.motion(theta)
            theta = least_squares(
                self.residuals, theta, self.jacobian, method=method, x_scale="jac", max_nfev=40, args=(kappa,)
            ).x
            cost = float(np.sum(self.residuals(theta, np.inf) ** 2))
            if cost < best[0]:
                best = cost, theta.copy()
        return best

    def inverse_information(self, theta: Array) -> Array:
        """(J'J)^-1 at the sharpness of `INFERENCE`."""
        rows = self.jacobian(theta, INFERENCE / self.motion(theta))
        scale = np.maximum(np.linalg.norm(rows, axis=0), 1e-300)
        inverse = np.linalg.pinv((rows / scale).T @ (rows / scale), rcond=1e-13, hermitian=True)
        return inverse / np.outer(scale, scale)
