"""What all identified models share: validation, free run, prediction ahead, state and files."""

from __future__ import annotations

import copy
import math
import os
import threading
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.base import BaseEstimator, RegressorMixin, clone
from sklearn.utils import check_random_state
from sklearn.utils.validation import check_is_fitted, validate_data

from whsklearn._inputs import check_lengths, in_one_sentence, starts, writeable
from whsklearn.effects import as_law
from whsklearn.estimators import _advice
from whsklearn.estimators import _model as wh
from whsklearn.estimators._model import draws, noise_spread, rows_spread
from whsklearn.estimators._records import Given, checked_weights, fold_of_a_search, is_plain, joined, sample_numbers
from whsklearn.estimators._summary import Summary, described
from whsklearn.lags.wiener_hammerstein import WienerHammersteinLags
from whsklearn.state.files import read_state, write_state

Array = NDArray[np.float64]


OUTPUTS = ("expected", "simulation")
# Expected number m of wrong signs in an experiment up to which it is more likely than not that none is wrong.  If they
# occur by chance, none is wrong with probability exp(-m), which is one half at m = ln 2.  So below this number the
# simulation has the smaller median error, and above it the expected output, whose mean square is smaller for any m.
FEW_SIGNS = math.log(2.0)
LARGEST_COUNT = 2**62  # of samples: a stream at 1 MHz reaches it after 100,000 years; twice as many exceed an int64
TOLD: set[str] = set()  # warnings that are given once per process
LEARNT = ("theta", "ud", "loss", "memory_u", "memory_y", "recent_u", "recent_y", "rows", "targets", "before")


class AxisRegressor(RegressorMixin, BaseEstimator):
    """Base of the estimators: ``predict`` is the free run, ``score`` is its R2.

    A subclass learns in ``fit`` and leaves ``state_``, a dict of arrays, from which
    `_natural`, `_theta` and `_covariance` read the answer.
    """

    lags: Any
    _states_errors: ClassVar[bool] = True  # False if the method has no covariance, as its docstring says
    _default_output = "simulation"  # of `predict`
    _fits_free_run = False  # whether the error minimised is that of the free run, not the one-step error
    _finds_constant = False  # whether the model can have a constant besides those of its law

    # -- what the model is ---------------------------------------------------------------

    @property
    def _is_wiener_hammerstein(self) -> bool:
        """Whether the rows are built from u and past y inside the estimator."""
        return hasattr(self.lags, "key_term")

    @property
    def _answers_several(self) -> bool:
        """Whether y has one column per joint, as for the lags of an arm."""
        return bool(getattr(self.lags, "multi_output", False))

    @property
    def _takes_direct_paths(self) -> bool:
        """Whether the blocks may respond without the paper's delay of one sample each."""
        return False

    @property
    def _given_lags(self) -> WienerHammersteinLags:
        """The transformer that holds orders and law, as the user gave it."""
        return self.lags

    @property
    def _lags(self) -> WienerHammersteinLags:
        """The transformer as it was when learning began: changing ``lags`` later does not change a fitted model."""
        return self.__dict__.get("lags_", self._given_lags)

    def _structure(self) -> wh.Structure:
        """Orders and law in the form that the kernels take."""
        lags = self._lags
        dims = lags.dims()
        dims[0] *= self.n_features_in_
        try:
            key = lags.key_term()
        except ValueError:
            key = -1
        return wh.Structure(dims, self.n_features_in_, as_law(lags.law), key, lags.advance())

    def _theta(self) -> Array:
        raise NotImplementedError

    def _natural(self) -> Array:
        return wh.natural_vector(self._theta(), self._structure())

    def _covariance(self) -> Array:
        raise NotImplementedError

    def _natural_covariance(self) -> Array:
        """Covariance of the natural parameters, by the delta method."""
        jacobian = np.linalg.pinv(wh.paper_jacobian(self._natural(), self._structure()))
        return jacobian @ self._covariance() @ jacobian.T

    # -- threads -------------------------------------------------------------------------

    @property
    def _lock(self) -> threading.RLock:
        """The lock of threads that learn or read; it is no part of the state, so no copy and no file holds it."""
        found: threading.RLock = self.__dict__.get("_own_lock") or self.__dict__.setdefault(
            "_own_lock", threading.RLock()
        )
        return found

    @contextmanager
    def _alone(self) -> Iterator[None]:
        """Make other threads that learn, or that read what was learnt, wait."""
        with self._lock:
            yield

    def __getstate__(self) -> dict[str, Any]:
        state = dict(super().__getstate__())
        state.pop("_own_lock", None)
        return state

    # -- what was learnt -----------------------------------------------------------------

    @property
    def theta_(self) -> Array:
        """Estimate of shape (n_parameters,), in the paper's order, (6)."""
        check_is_fitted(self, "state_")
        return self._theta()

    @property
    def covariance_(self) -> Array:
        """Covariance of `theta_`, shape (n_parameters, n_parameters)."""
        check_is_fitted(self, "state_")
        return self._covariance()

    @property
    def standard_errors_(self) -> Array:
        """Standard errors of `theta_`, shape (n_parameters,); NaN, with a warning, if the record cannot give them."""
        return self._told(np.sqrt(np.maximum(np.diag(self.covariance_), 0.0)))

    @property
    def parameters_(self) -> dict[str, Any]:
        """``a``, ``b``, ``c``, ``d`` and one weight per term of the law; for given rows, one weight per column."""
        check_is_fitted(self, "state_")
        if self._is_wiener_hammerstein:
            return wh.named(self._natural(), self._structure())
        return dict(zip(self._column_names(), self._theta().tolist(), strict=True))

    @property
    def parameter_standard_errors_(self) -> dict[str, Any]:
        """Standard errors in the layout of `parameters_`; NaN, with a warning, if the record cannot give them."""
        check_is_fitted(self, "state_")
        if self._is_wiener_hammerstein:
            return wh.named_errors(self._told(np.diag(self._natural_covariance())), self._structure())
        return dict(zip(self._column_names(), self.standard_errors_.tolist(), strict=True))

    def _told(self, values: Array) -> Array:
        """The same values, with a warning if some are NaN."""
        if self._states_errors and not np.isfinite(values).all():
            warnings.warn(
                "Some standard errors are NaN, because the samples so far do not determine them: there was too little "
                "motion for the parameters; give a longer record of an axis that moves.",
                UserWarning,
                stacklevel=3,
            )
        return values

    def _column_names(self) -> list[str]:
        """Names of the weights for given rows."""
        if self.lags is not None:
            return [str(n) for n in self.lags_.get_feature_names_out()]
        names = getattr(self, "feature_names_in_", [f"x{i}" for i in range(self.n_features_in_)])
        return [str(n) for n in names]

    # -- prediction ----------------------------------------------------------------------

    def predict(
        self, X: ArrayLike, groups: ArrayLike | None = None, *, output: str | None = None, return_std: bool = False
    ) -> Any:
        """Free run: the output from X alone, starting at rest before the first sample.

        If the law jumps with sign(dx), the sign is uncertain at samples where dx is small: parameters that the record
        cannot tell apart give different signs.  The *expected* output is the mean over these parameters, in which
        sign(dx) becomes erf(dx / (sqrt(2) sd)).  It has the least mean squared error (on Example 5.1, N = 1,000,
        7.5 dB, about two thirds of the simulation's, benchmarks/accuracy.py).  The *simulation* uses `parameters_`,
        with one sign at each sample.  When the parameters are known well, as after 20,000 clean samples, it is right
        to the last sample on most records, and it is what a simulator or an export will compute.  `wrong_signs` tells
        how many signs of a record the simulation is expected to get wrong.  If these are fewer than 0.7 (ln 2), it is
        more likely than not that all signs are right, and the simulation is the default.

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
            first half; name the output where both must be alike.
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
                raise ValueError("return_std is for one output; take parameter_standard_errors_ of an arm instead.")
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

        This is the sum over the samples of min(p, 1 - p), where p is the probability that dx is positive given what is
        known of L1.  It is zero for a law without sign(dx) and for an estimator that has no covariance.  `predict`
        gives the simulation below 0.7 (ln 2), and the expected output from there on.

        Parameters
        ----------
        X, groups
            As for `predict`.

        Returns
        -------
        ndarray of shape (n_experiments,)
        """
        check_is_fitted(self, "state_")
        given = joined(X, groups=groups)
        with in_one_sentence(given.X):
            u: Array = writeable(validate_data(self, given.X, dtype=np.float64, reset=False))
        restart = starts(given.groups, len(u), first=True)
        if not self._is_wiener_hammerstein or self._default_output != "expected":
            return np.zeros(int(restart.sum()))
        return wh.wrong_signs(self._natural(), self._structure(), u, restart, self._natural_covariance())

    def _noise_variance(self) -> float:
        """Variance of the error that was minimised; NaN where it is not known."""
        return float("nan")

    def _noise_filter(self, natural: Array, structure: wh.Structure) -> Array:
        """The denominator through which the minimised error enters the free run: that of L2 in (2)."""
        return wh.inside(natural[structure.slices()[4]])

    def score(
        self, X: ArrayLike, y: ArrayLike, sample_weight: ArrayLike | None = None, groups: ArrayLike | None = None
    ) -> float:
        """R2 of the free run.

        Parameters
        ----------
        X, y : array-like of shape (n, n_features), (n,), or lists of them
        sample_weight : array-like of shape (n,), optional
        groups : array-like of shape (n,), optional
            Experiments; each starts at rest.
        """
        from sklearn.metrics import r2_score

        given = joined(X, y, groups, sample_weight)
        y_hat = self.predict(given.X, given.groups)
        r2 = float(r2_score(given.y, y_hat, sample_weight=given.sample_weight))
        if fold_of_a_search() is None:  # which tries what may be bad
            warn(_advice.of_a_free_run(r2), stacklevel=3)
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
            For given rows, which hold no past output of their own, the same as `predict`.

        Raises
        ------
        ValueError
            If an argument is invalid, or if ``settle`` is False and there is no running estimate yet.
        """
        if not settle and groups is None and type(horizon) is int and horizon >= 1:
            # a column of pandas is read-only
            u, known = (writeable(v) if isinstance(v, np.ndarray) else np.empty(0) for v in (X, y))
            if self._is_plain(u, known):
                return self._ahead_now(u, known, horizon)
        check_is_fitted(self, "state_")
        if isinstance(horizon, bool) or not isinstance(horizon, (int, np.integer)) or horizon < 1:
            raise ValueError(f"horizon is {horizon!r}, expected a whole number of samples, 1 or more.")
        given = joined(X, y, groups)
        X, y, groups = given.X, given.y, given.groups
        with in_one_sentence(X, y):
            u, known = validate_data(
                self, X, y, dtype=np.float64, reset=False, y_numeric=True, multi_output=self._answers_several
            )
        known = writeable(np.asarray(known, dtype=np.float64))
        check_lengths(u, known)
        if not self._is_wiener_hammerstein:
            return given.apart(np.asarray(self.predict(X, groups)))
        restart = starts(groups, len(u), first=True)
        natural, structure = (self._natural(), self._structure()) if settle else self._running()
        return given.apart(_finite(wh.predictions(natural, structure, writeable(u), known, restart, int(horizon))))

    def _is_plain(self, X: Any, y: Any) -> bool:
        """Whether a fitted estimator can use X and y without further checks."""
        return "state_" in self.__dict__ and len(getattr(X, "shape", ())) == 2 and is_plain(X, y, self.n_features_in_)

    def _ahead_now(self, X: Array, y: Array, horizon: int) -> Array:
        """`predict_ahead` of one experiment in checked arrays, from the running estimate."""
        if not self._is_wiener_hammerstein:
            return np.asarray((X if self.lags is None else self.lags_.transform(X)) @ self._theta())
        restart = np.zeros(len(y), dtype=np.bool_)
        restart[0] = True
        return _finite(wh.predictions(*self._running(), X, y, restart, horizon))

    def _running(self) -> tuple[Array, wh.Structure]:
        """The running estimate of the natural parameters, with signs in doubt left unresolved, and the structure."""
        return self._natural(), self._structure()

    # -- in words, and for other tools -----------------------------------------------------

    def summary(self) -> Summary:
        """Structure, parameters with 95 % intervals, poles and noise, to print or to show in a notebook.

        Examples
        --------
        >>> import numpy as np
        >>> from whsklearn import RLSRegressor
        >>> X = np.random.default_rng(0).standard_normal((100, 2))
        >>> RLSRegressor().fit(X, X @ [1.0, -2.0] + 0.1 * X[:, 0] ** 2).summary().table.index.tolist()
        ['x0', 'x1']
        """
        check_is_fitted(self, "state_")
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # the table shows which errors are NaN
            return described(self, self._noise_variance())

    def to_dlti(self, dt: float = 1.0) -> tuple[Any, Any]:
        """L1 and L2 as linear systems in discrete time; the law between them is in `parameters_`.

        Parameters
        ----------
        dt : float, default=1.0
            Sampling interval in seconds.

        Returns
        -------
        first, second : scipy.signal.dlti
            u to x and v to y, with their delays. With several inputs the first is a tuple of systems, one per input.

        Raises
        ------
        ValueError
            If the estimator works on rows and has no blocks, or if ``dt`` is not a positive number.

        Examples
        --------
        >>> from whsklearn import RMILSRegressor, WienerHammersteinLags
        >>> from whsklearn.datasets import make_wiener_hammerstein
        >>> X, y = make_wiener_hammerstein(400, snr_db=40, random_state=0)
        >>> first, second = RMILSRegressor(WienerHammersteinLags(), random_state=0).fit(X, y).to_dlti(dt=0.01)
        >>> first.num.round(1), first.den.round(1)
        (array([1. , 2.2]), array([1. , 1. , 0.5]))
        """
        check_is_fitted(self, "state_")
        if not self._is_wiener_hammerstein:
            raise ValueError(
                f"This {type(self).__name__} was fitted on rows and has no linear blocks; give "
                "lags=WienerHammersteinLags()."
            )
        return wh.linear_blocks(self._natural(), self._structure(), self._lags.delays, dt)

    # -- state ---------------------------------------------------------------------------

    def get_state(self) -> dict[str, Any]:
        """Return a copy of all that was learnt, as a dict of arrays and numbers."""
        check_is_fitted(self, "state_")
        with self._alone():
            state = {"n_features_in": int(self.n_features_in_), "state": copy.deepcopy(self.state_)}
            if hasattr(self, "feature_names_in_"):
                state["feature_names_in"] = [str(n) for n in self.feature_names_in_]
            if hasattr(getattr(self, "lags_", None), "get_state"):
                state["lags"] = self.lags_.get_state()
        return state

    def set_state(self, state: dict[str, Any]) -> Self:
        """Continue from what `get_state` of an estimator with the same parameters returned.

        Raises
        ------
        ValueError
            If the state is of another kind of estimator, or its orders differ.
        """
        if not isinstance(state, dict) or not {"n_features_in", "state"} <= state.keys():
            raise ValueError("This is no state of an estimator; give what get_state() returned.")
        with self._alone(), self._unchanged_if_refused():
            self._keep_lags()
            if type(state["n_features_in"]) is not int or state["n_features_in"] < 1:
                raise ValueError(f"This state has {state['n_features_in']!r} inputs, expected a whole number.")
            self.n_features_in_ = state["n_features_in"]
            self.__dict__.pop("feature_names_in_", None)
            if "feature_names_in" in state:
                self.feature_names_in_ = np.array(state["feature_names_in"], dtype=object)
            if "lags" in state and hasattr(getattr(self, "lags_", None), "set_state"):
                self.lags_.set_state(state["lags"])
            try:
                self._check_state(state["state"])
            except (TypeError, KeyError, IndexError, AttributeError, ArithmeticError, MemoryError):
                raise ValueError("This state holds values that no estimator has; give what get_state() gave.") from None
            self.state_ = copy.deepcopy(state["state"])
        return self

    def _check_state(self, state: dict[str, Any]) -> None:
        """Raise if a state cannot belong to this estimator."""
        if not isinstance(state, dict) or "theta" not in state:
            raise ValueError("This state holds no theta; give what get_state() of the same estimator returned.")
        for name, value in state.items():
            if isinstance(value, np.ndarray) and value.dtype.kind == "f" and np.isnan(value).any() and name in LEARNT:
                raise ValueError(f"This state has NaN in {name}, expected numbers; go back to an earlier one.")
            whole = isinstance(value, int) or (isinstance(value, np.ndarray) and value.dtype.kind in "iu")
            if whole and np.any(np.abs(value) >= LARGEST_COUNT):
                raise ValueError(f"This state has {np.max(np.abs(value))} in {name}, a count that no stream reaches.")

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write parameters and state to a file, atomically and without pickle."""
        write_state(path, type(self).__name__, self.get_params(deep=False), self.get_state())

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Self:
        """Read what `save` wrote; a stream continues from there.

        Raises
        ------
        ValueError
            If the file is damaged, not one that `save` wrote, or of another estimator.
        """
        params, state = read_state(path, cls.__name__)
        try:
            return cls(**params).set_state(state)
        except TypeError:
            more = sorted(set(params) - set(cls().get_params(deep=False)))
            raise ValueError(
                f"{os.fspath(path)}: this state has {', '.join(more) or 'values'} that {cls.__name__} does not know; "
                "upgrade whsklearn, or go back to an earlier file."
            ) from None
        except ValueError as error:
            raise ValueError(f"{os.fspath(path)}: {error}") from None

    # -- validation ----------------------------------------------------------------------

    @contextmanager
    def _unchanged_if_refused(self) -> Iterator[None]:
        """Restore every attribute if the call within fails, including fitted ones such as n_features_in_."""
        before = self.__dict__.copy()
        try:
            yield
        except BaseException:
            self.__dict__ = before  # one step, which a second interrupt cannot split
            raise

    def _keep_lags(self) -> None:
        """Check the kind of ``lags`` and keep a copy as ``lags_``."""
        lags = self._given_lags
        self.__dict__.pop("lags_", None)
        if lags is None:
            return
        makes_rows = hasattr(lags, "partial_rows") and not self._is_wiener_hammerstein
        if isinstance(lags, type) or not (hasattr(lags, "key_term") or makes_rows):
            raise ValueError(
                f"lags is {lags!r}, expected None, WienerHammersteinLags() or, for recursive least squares, "
                "InverseDynamicsLags(); give one of them."
            )
        if hasattr(lags, "advance") and lags.advance() != 0 and not self._takes_direct_paths:
            raise ValueError(
                f"delays is {lags.delays!r}, and {type(self).__name__} knows one sample in each block; leave it at "
                '(1, 1), or fit PEMRegressor(lags, criterion="simulation").'
            )
        self.lags_ = clone(lags)

    def _validate(self, X: ArrayLike, y: ArrayLike, reset: bool) -> tuple[Array, Array]:
        """X and y as contiguous float64, checked."""
        with in_one_sentence(X, y):
            u, target = validate_data(
                self, X, y, reset=reset, dtype=np.float64, order="C", y_numeric=True, multi_output=self._answers_several
            )
        target = np.asarray(target, dtype=np.float64)
        check_lengths(u, target)
        return writeable(u), writeable(target)

    def _checked_record(self, given: Given) -> tuple[Array, Array, NDArray[np.bool_], Array | None]:
        """X, y, starts of experiments and weights for a batch fit; attributes stay unchanged if they are refused."""
        with self._unchanged_if_refused():
            self._keep_lags()
            X, y = self._validate(given.X, given.y, reset=True)
            self._need_rows(len(X))
            restart = starts(given.groups, len(X), first=True)
            weights = checked_weights(given.sample_weight, len(X), some=True)
            self._structure()
            self._warn_of_order(given.X, stacklevel=4)
            self._warn_of_record(X, y, stacklevel=4)
            self._warn_of_structure(X, y, restart, stacklevel=5)
        return X, y, restart, weights

    def _rows(self, X: Array, y: Array, groups: ArrayLike | None) -> tuple[Array, Array]:
        """Rows and targets of a record, made by lags other than the Wiener-Hammerstein ones."""
        return (X, y) if self.lags is None else self.lags_.rows(X, y, groups)

    def _need_rows(self, n: int) -> None:
        """Raise if a record is too short to fill the lags once; warn if it has no more samples than parameters."""
        needed = self._lags.max_lag + 1 if self._is_wiener_hammerstein else 1
        if n < needed:
            raise ValueError(
                f"Found {n} sample{'s' if n != 1 else ''} (n_samples={n}), expected at least {needed}, as many as the "
                "lags reach back and one more; give a longer record."
            )
        n_parameters = int(self._structure().slices()[-1].stop) if self._is_wiener_hammerstein else 0
        warn(_advice.of_few_samples(n, n_parameters), stacklevel=5)

    def _warn_of_record(self, X: Array, y: Array, stacklevel: int = 3) -> None:
        """Warn of records that do not show the dynamics, or that need a constant the model lacks."""
        if not self._is_wiener_hammerstein or len(X) <= self._lags.max_lag:
            return
        said = _advice.of_a_signal_at_rest(X, y)
        if said is None and not self._finds_constant:
            said = _advice.of_a_constant(self._structure().law, X, y)
        warn(said, stacklevel + 1)

    def _warn_of_order(self, X: Any, stacklevel: int = 3) -> None:
        """Warn of a dynamic model that is fitted to shuffled samples; once, not for every fold."""
        said = None if self.lags is None else _advice.of_the_order(sample_numbers(X))
        if said is not None and said not in TOLD:
            TOLD.add(said)
            warn(said, stacklevel + 1)

    def _warn_of_structure(self, X: Array, y: Array, restart: NDArray[np.bool_], stacklevel: int = 3) -> None:
        """Say which structure is used where ``lags`` was not given, because its default differs between estimators."""
        if self.lags is not None:
            return
        name = type(self).__name__
        if self._is_wiener_hammerstein:
            said = _advice.of_several_inputs(name, X.shape[1])
        else:
            said = _advice.of_a_dynamic_record(name, X, y, restart)
        warn(said, stacklevel + 1)

    def _draw_seed(self) -> int:
        """One whole number from ``random_state``; 0 where nothing is drawn."""
        if not self._is_wiener_hammerstein or getattr(self, "gradient", "full") != "full":
            return 0
        return int(check_random_state(getattr(self, "random_state", None)).randint(2**31 - 1))

    def __sklearn_tags__(self) -> Any:
        tags = super().__sklearn_tags__()
        # A strictly delayed dynamic model cannot fit the static data of the generic checks.
        tags.regressor_tags.poor_score = self.lags is not None
        return tags


def warn(said: str | None, stacklevel: int) -> None:
    """Pass on what there is to say."""
    if said is not None:
        warnings.warn(said, UserWarning, stacklevel=stacklevel)


def _finite(y_hat: Array) -> Array:
    """Make predictions finite: interim estimates may be far off, but the estimator returns numbers only."""
    return np.clip(np.nan_to_num(y_hat, nan=0.0, posinf=1e30, neginf=-1e30), -1e30, 1e30)
