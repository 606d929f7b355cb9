"""A population search over the free-run error, as in the turntable literature."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from whsklearn.effects.base import Array
from whsklearn.estimators import _model as wh
from whsklearn.estimators._records import Given
from whsklearn.estimators.pem import PEMRegressor
from whsklearn.lags.wiener_hammerstein import WienerHammersteinLags
from whsklearn.recursion.memory.starts import denominator_of, term_scales


class DifferentialEvolutionRegressor(PEMRegressor):
    """Differential evolution on the free-run error: a baseline that needs no gradient and no starting point.

    Parameters
    ----------
    lags : WienerHammersteinLags, optional
        Orders and law; Example 5.1's by default.
    n_generations : int, default=200
        Largest number of generations.
    bound : float, default=3.0
        Entries of a and c are searched within +-bound, and weights of the law within +-bound times that at which their
        term alone has the size of the output. Denominators are parametrised by reflection coefficients, so that every
        candidate is stable.
    random_state : int, RandomState or None
        Draws the population.

    Attributes
    ----------
    theta_, parameters_
        As for `RMILSRegressor`; a population search has no covariance (NaN).
    cost_ : float
        Sum of squared free-run errors.

    References
    ----------
    Storn and Price 1997, J. Global Optimization 11, 341-359; the paper's references 31 and 32
    use particle swarms for the same purpose.

    Examples
    --------
    >>> from whsklearn import DifferentialEvolutionRegressor
    >>> from whsklearn.datasets import make_wiener_hammerstein
    >>> X, y = make_wiener_hammerstein(n_samples=100, snr_db=None, random_state=0)
    >>> DifferentialEvolutionRegressor(n_generations=3, random_state=0).fit(X, y).theta_.shape
    (9,)
    """

    _states_errors: ClassVar[bool] = False

    def __init__(
        self,
        lags: WienerHammersteinLags | None = None,
        *,
        n_generations: int = 200,
        bound: float = 3.0,
        random_state: Any = None,
    ):
        self.lags = lags
        self.n_generations = n_generations
        self.bound = bound
        self.random_state = random_state

    _fits_free_run: ClassVar[bool] = True  # type: ignore[misc]
    _finds_constant: ClassVar[bool] = False  # type: ignore[misc]

    def _check_parameters(self) -> None:
        for name, value in (("n_generations", self.n_generations), ("bound", self.bound)):
            if isinstance(value, bool) or not isinstance(value, (int, float, np.number)) or not value > 0:
                raise ValueError(f"{name} is {value!r}, expected a positive number.")

    def _fit(self, given: Given) -> None:
        from scipy.optimize import differential_evolution

        X, y, restart, weights = self._checked_record(given)
        root = np.float64(1.0) if weights is None else np.sqrt(weights)
        structure = self._structure()
        blocks = structure.slices()
        n = blocks[-1].stop
        u = np.ascontiguousarray(X)
        limits = np.full((n, 2), [-self.bound, self.bound])
        limits[blocks[1]] = limits[blocks[4]] = [-0.999, 0.999]
        seed = self._draw_seed()
        law = structure.dims, structure.law.codes, structure.law.shapes
        limits[blocks[2]] *= term_scales(law, u, y, restart, np.random.default_rng(seed))[:, None]

        def natural(genes: Array) -> Array:
            out = genes.copy()
            out[blocks[1]], out[blocks[4]] = denominator_of(genes[blocks[1]]), denominator_of(genes[blocks[4]])
            return out

        def cost(genes: Array) -> float:
            e: Any = root * (y - wh.free_run(natural(genes), structure, u, restart))
            return float(min(e @ e, 1e300))

        found = differential_evolution(
            cost, limits, maxiter=int(self.n_generations), popsize=10, rng=seed, polish=False, tol=1e-8
        )
        theta = natural(found.x)
        self.cost_ = float(found.fun)
        noise = self.cost_ / max(len(y) - n, 1)
        self.state_ = {"theta": theta, "covariance": np.full((n, n), np.nan), "seen": len(y), "noise": noise}
