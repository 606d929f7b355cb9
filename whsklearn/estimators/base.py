"""What all identified models share: free run, score, prediction ahead."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from sklearn.base import RegressorMixin
from sklearn.utils.validation import check_is_fitted, validate_data

from whsklearn._inputs import check_lengths, check_whole, in_one_sentence, starts, writeable
from whsklearn.effects.base import Array, Bools
from whsklearn.estimators import _advice
from whsklearn.estimators import _model as wh
from whsklearn.estimators._checked import CheckedModel, warn
from whsklearn.estimators._model import draws, noise_spread, rows_spread
from whsklearn.estimators._records import fold_of_a_search, is_plain, joined
from whsklearn.lags.axis_rows import rows_and_samples

OUTPUTS = ("expected", "simulation")
# Expected number m of wrong signs in an experiment up to which it is more likely than not that none is wrong.  If they
# occur by chance, none is wrong with probability exp(-m), which is one half at m = ln 2.  So below this number the
# simulation has the smaller median error, and above it the expected output, whose mean square is smaller for any m.
FEW_SIGNS = math.log(2.0)


class AxisRegressor(RegressorMixin, CheckedModel):
    """Base of the estimators: ``predict`` is the free run, ``score`` is its R2.

    `FittedModel` holds its settings and learned attributes, `KeptModel` its state and files, `CheckedModel` its checks.

    >>> from whsklearn import RLSRegressor
    >>> X = np.arange(20.0).reshape(10, 2) % 7
    >>> model = RLSRegressor().fit(X, X @ [1.0, -2.0])
    >>> isinstance(model, AxisRegressor), model.predict(X[:2]).round(3), round(model.score(X, X @ [1.0, -2.0]), 3)
    (True, array([-2., -4.]), 1.0)
    """

    _default_output = "simulation"  # of `predict`

    def predict(
        self, X: ArrayLike, groups: ArrayLike | None = None, *, output: str | None = None, return_std: bool = False
    ) -> Any:
        """Free run: the output from X alone, starting at rest before the first sample.

        If the law jumps with sign(dx), the sign is uncertain at samples where dx is small: parameters that the record
        does not distinguish give different signs.  The *expected* output is the mean over these parameters, in which
        sign(dx) becomes erf(dx / (sqrt(2) sd)).  It has the least mean squared error (on Example 5.1, N = 1,000,
        7.5 dB, about two thirds of the simulation's, benchmarks/accuracy.py).  The *simulation* uses `parameters_`,
        with one sign at each sample.  When the parameters are known well, as after 20,000 clean samples, it is right
        to the last sample on most records, and it is what a simulator or an export will compute.  `wrong_signs` gives
        the number of signs of a record that the simulation is expected to get wrong.  If this is less than 0.7 (ln 2),
        it is more likely than not that all signs are right, and the simulation is the default.

        Parameters
        ----------
        X : array-like of shape (n, n_features), or list of them
            Input u; with ``lags=None`` the rows themselves.  A list of records gives a list.
        groups : array-like of shape (n,), optional
            Experiments; each starts at rest.
        output : {"expected", "simulation"}, optional
            Which output to give.  By default it is the expected output if the estimator has a posterior of its
            parameters, as the recursive ones with ``gradient="full"`` do, and 0.7 signs or more of the experiment are
            expected to be wrong.  Otherwise it is the simulation of `parameters_`.  The two differ only for a law with
            sign(dx).  Signs are counted over the whole experiment, so the default may differ between a record and its
            first half; choose the output explicitly if both must be alike.
        return_std : bool, default=False
            Whether to return the standard deviation of the measured output about the free run too.  It includes the
            uncertainty of the parameters (the spread of the free runs of 100 draws from their Gaussian) and the
            noise, which is constant if the free run was fitted, and otherwise the one-step error through L2's
            denominator.

        Returns
        -------
        y_hat : ndarray of shape (n,)
            Finite whatever the estimate: poles outside the unit circle are moved inside.
        std : ndarray of shape (n,)
            Only with ``return_std``; infinite while nothing is known of the noise.

        Raises
        ------
        ValueError
            If X or a setting is invalid, or if the estimator has no covariance and a standard deviation is asked for.
        """
        check_is_fitted(self, "state_")
        by_record = output is None and self._default_output == "expected"
        output = self._default_output if output is None else output
        if output not in OUTPUTS:
            raise ValueError(f"output is {output!r}, expected one of {', '.join(map(repr, OUTPUTS))}.")
        if return_std and not self._states_errors:
            raise ValueError(f"{type(self).__name__} has no covariance, so no return_std; use RMILSRegressor.")
        given = joined(X, groups=groups)
        with in_one_sentence(given.X):
            u: Array = validate_data(self, given.X, dtype=np.float64, reset=False)
        y_hat, std = self._predicted(u, given.groups, "by record" if by_record else output, return_std)
        return (given.apart(y_hat), given.apart(std)) if return_std else given.apart(y_hat)

    def _predicted(self, u: Array, groups: ArrayLike | None, output: str, with_std: bool) -> tuple[Array, Array]:
        """The free run, and its standard deviation or as many zeros."""
        std = np.zeros(len(u))
        if not self._is_wiener_hammerstein:
            rows: Array = u if self.lags is None else np.asarray(self.lags_.transform(u, groups=groups))
            if with_std and self._answers_several:
                raise ValueError("return_std is for one output; use parameter_standard_errors_ for an arm instead.")
            if with_std:
                std = rows_spread(rows, self._covariance(), self._noise_variance())
            return rows @ self._theta(), std
        restart = starts(groups, len(u), first=True)
        natural, structure, u = self._natural(), self._structure(), writeable(u)
        covariance = self._natural_covariance() if with_std or output != "simulation" else None
        if with_std:
            assert covariance is not None
            noise = noise_spread(self._noise_variance(), self._noise_filter(natural, structure), restart)
            std = np.hypot(draws(natural, covariance, structure, u, restart), noise)
        if output == "simulation":
            return _finite(wh.free_run(natural, structure, u, restart)), std
        y_hat = wh.free_run(natural, structure, u, restart, covariance)
        if output == "by record":
            assert covariance is not None
            wrong = wh.wrong_signs(natural, structure, u, restart, covariance)
            if (wrong < FEW_SIGNS).any():
                right = np.repeat(wrong < FEW_SIGNS, np.diff(np.append(np.flatnonzero(restart), len(u))))
                y_hat = np.where(right, wh.free_run(natural, structure, u, restart), y_hat)
        return _finite(y_hat), std

    def wrong_signs(self, X: ArrayLike, groups: ArrayLike | None = None) -> Array:
        """How many signs of dx a simulation of `parameters_` is expected to get wrong in each experiment of X.

        This is the sum over the samples of min(p, 1 - p), where p is the probability that dx is positive, given the
        posterior of L1.  It is zero for a law without sign(dx) and for an estimator that has no covariance.  `predict`
        gives the simulation below 0.7 (ln 2), and the expected output from there on.

        ``X``, ``groups``: as for `predict`. Returns (n_experiments,).
        """
        check_is_fitted(self, "state_")
        given = joined(X, groups=groups)
        with in_one_sentence(given.X):
            u: Array = writeable(validate_data(self, given.X, dtype=np.float64, reset=False))
        restart = starts(given.groups, len(u), first=True)
        if not self._is_wiener_hammerstein or self._default_output != "expected":
            return np.zeros(int(restart.sum()))
        return wh.wrong_signs(self._natural(), self._structure(), u, restart, self._natural_covariance())

    def _noise_filter(self, natural: Array, structure: wh.Structure) -> Array:
        """The denominator through which the minimised error enters the free run: that of L2 in (2)."""
        return wh.inside(natural[structure.slices()[4]])

    def score(
        self, X: ArrayLike, y: ArrayLike, sample_weight: ArrayLike | None = None, groups: ArrayLike | None = None
    ) -> float:
        """R2 of the free run; of lags whose rows are late, against the samples to which they belong.

        ``X`` (n, n_features), ``y`` and ``sample_weight`` (n,): as for `fit`, or lists of them. ``groups`` (n,):
        experiments; each starts at rest.
        """
        from sklearn.metrics import r2_score

        given = joined(X, y, groups, sample_weight)
        y_hat = self.predict(given.X, given.groups)
        rows, samples = rows_and_samples(getattr(self, "lags_", None), given.groups, len(y_hat))
        weights = None if given.sample_weight is None else np.asarray(given.sample_weight)[samples]
        r2 = float(r2_score(np.asarray(given.y)[samples], y_hat[rows], sample_weight=weights))
        if fold_of_a_search() is None:  # a search also tries bad settings, so it is not warned
            warn(_advice.of_a_free_run(r2))
        return r2

    def predict_ahead(
        self, X: ArrayLike, y: ArrayLike, horizon: int = 1, groups: ArrayLike | None = None, *, settle: bool = True
    ) -> Any:
        """Prediction ``horizon`` samples ahead: y is known up to t - horizon, u up to t - 1.

        Parameters
        ----------
        X : array-like of shape (n, n_features), or list of them
            Input; a list of records gives a list.
        y : array-like of shape (n,)
            Measured output.
        horizon : int, default=1
            Number of samples; 1 is the one-step prediction.
        groups : array-like of shape (n,), optional
            Experiments.
        settle : bool, default=True
            False uses the running estimate. This takes less than 200 us for a few hundred samples in float64 arrays
            and suits a control loop. With True, an estimator in mid-stream first computes the mean over the signs that
            are still in doubt, or a fit to the samples so far, which takes 20 ms and more.

        Returns
        -------
        ndarray of shape (n,)
            For given rows, which hold no past output of their own, the same as `predict`.  For an arm the shape is
            (n, n_joints), and with causal lags a row belongs to the sample ``lags_.delay_`` samples earlier.

        Raises
        ------
        ValueError
            If an argument is invalid, or if ``settle`` is False and there is no running estimate yet.
        """
        if not settle and groups is None and type(horizon) is int and horizon >= 1:
            # a column of pandas is read-only
            u, known = (writeable(v) if isinstance(v, np.ndarray) else np.empty(0) for v in (X, y))
            fitted = "state_" in self.__dict__ and len(getattr(u, "shape", ())) == 2
            if fitted and is_plain(u, known, self.n_features_in_):  # no further checks
                return self._ahead_now(u, known, horizon)
        check_is_fitted(self, "state_")
        check_whole("horizon", horizon, 1, " samples")
        given = joined(X, y, groups)
        X, y, groups = given.X, given.y, given.groups
        with in_one_sentence(X, y):
            u, known = validate_data(
                self, X, y, dtype=np.float64, reset=False, y_numeric=True, multi_output=self._answers_several
            )
        known = writeable(np.asarray(known, dtype=np.float64))
        check_lengths(u, known)
        if not self._is_wiener_hammerstein:  # columns may depend on the drive
            rows = u if self.lags is None else self.lags_.transform(u, known, groups)
            return given.apart(np.asarray(rows @ self._theta()))
        restart = starts(groups, len(u), first=True)
        natural, structure = (self._natural(), self._structure()) if settle else self._running()
        return given.apart(_finite(wh.predictions(natural, structure, writeable(u), known, restart, int(horizon))))

    def _ahead_now(self, X: Array, y: Array, horizon: int) -> Array:
        """`predict_ahead` of one experiment in checked arrays, from the running estimate."""
        if not self._is_wiener_hammerstein:
            return np.asarray((X if self.lags is None else self.lags_.transform(X, y)) @ self._theta())
        restart = np.zeros(len(y), dtype=np.bool_)
        restart[0] = True
        return _finite(wh.predictions(*self._running(), X, y, restart, horizon))

    def _warn_of_the_law(self, X: Array, y: Array, restart: Bools) -> None:
        """Warn of a chain that misses something that follows the input, or whose free run leaves most of the record.

        Nothing is added to what is told of a signal at rest and of a missing constant, and in a search, which tries bad
        settings.
        """
        s = self._structure()
        if fold_of_a_search() is not None or _advice.of_a_signal_at_rest(X, y) or _advice.of_a_constant(s.law, X, y):
            return
        natural = self._running()[0]
        told = _advice.one_step(natural, (s.dims, s.law.codes, s.law.shapes), X, y, restart)
        settled = slice(min(_advice.UNSETTLED, len(y) // 10), None)
        error = (y - _finite(wh.free_run(natural, s, X, restart)))[settled]
        share = float(np.mean(error**2)) / max(float(np.var(y[settled])), 1e-300)
        warn(
            _advice.of_the_law(told, natural, s.law, s.dims, X, restart)
            or _advice.of_a_linear_filter(share, X, y, restart)
            or (_advice.of_a_weak_run(share) if len(y) > natural.size else None)
            or _advice.of_noise_at_the_output(told, share)
        )

    def _running(self) -> tuple[Array, wh.Structure]:
        """The running estimate of the natural parameters, with signs in doubt left unresolved, and the structure."""
        return self._natural(), self._structure()

    def __sklearn_tags__(self) -> Any:
        tags = super().__sklearn_tags__()
        # A strictly delayed dynamic model cannot fit the static data of the generic checks.
        tags.regressor_tags.poor_score = self.lags is not None
        return tags


def _finite(y_hat: Array) -> Array:
    """Make predictions finite: interim estimates may be far off, but the estimator returns numbers only."""
    if (np.abs(y_hat) <= 1e30).all():
        return y_hat
    return np.clip(np.nan_to_num(y_hat, nan=0.0, posinf=1e30, neginf=-1e30), -1e30, 1e30)
