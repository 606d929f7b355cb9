"""One-step prediction errors, minimised over ever sharper signs: the default criterion of `PEMRegressor`."""

from __future__ import annotations

import numpy as np

from whsklearn.effects import FrictionLaw, Power, Viscous
from whsklearn.effects.base import Array, Bools
from whsklearn.effects.codes import CONSTANT, HINGE, NATURAL_SPLINE, POWER
from whsklearn.estimators import _model as wh
from whsklearn.recursion.memory.blocks import increment_rms
from whsklearn.recursion.memory.starts import least_squares_start, random_start, regressors, term_scales
from whsklearn.recursion.rows.predictor import record_errors
from whsklearn.systems.stability import is_stable

# kappa times the root mean square of dx; at the last value about 1 sample in 400 lies within the smoothed sign
LADDER = (1.0, 2.0, 4.0, 8.0, 20.0, 50.0, 100.0, 200.0, 400.0)
INFERENCE = 20.0  # sharpness at which the covariance is taken, see `PEMRegressor`


class PredictionError:
    """Residuals and Jacobian of one record, in the form that scipy.optimize.least_squares expects."""

    def __init__(
        self, s: wh.Structure, u: Array, y: Array, restart: Bools, rng: np.random.Generator,
        weights: Array | None = None,
    ):  # fmt: skip
        self.structure, self.u, self.y, self.restart = s, u, y, restart
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
        law = FrictionLaw([Viscous() if moves else Power()])
        dims = np.append(s.dims[:4], 1)
        inner = s._replace(dims=dims, law=law, key=0)
        linear = PredictionError(inner, self.u, self.y, self.restart, rng, self.weights)
        _, found = min((linear.climb(linear.start(1 + i, rng), LADDER[:1]) for i in range(4)), key=lambda f: f[0])
        weight = self.b.stop
        return np.concatenate([found[:weight], np.zeros(len(s.law)), found[weight + 1 :]])

    def increment_rms(self, theta: Array) -> float:
        """Root mean square of dx, never zero."""
        return max(float(increment_rms(theta, self.kernel[0], self.u, self.restart)), 1e-12)

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
