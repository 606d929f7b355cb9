"""The scikit-learn interface to the recursions: `fit`, `partial_fit` and the choice of a stream."""

from __future__ import annotations

import copy
from collections.abc import Iterator
from contextlib import contextmanager
from functools import update_wrapper
from types import FunctionType
from typing import Any, ClassVar, Self

import numpy as np
from numpy import ndarray
from numpy.typing import ArrayLike
from sklearn.base import TransformerMixin, clone
from sklearn.utils.validation import check_is_fitted

from whsklearn._inputs import check_whole, starts
from whsklearn.effects.base import Array, Bools
from whsklearn.effects.law import FrictionLaw, as_law, has_knots, placed, without_knots
from whsklearn.estimators import _advice
from whsklearn.estimators import _model as wh
from whsklearn.estimators._checked import warn
from whsklearn.estimators._records import Given, is_plain, joined
from whsklearn.estimators._streams import AnyStream, FullStream, PublishedStream, RowsStream, noise_variance
from whsklearn.estimators._undo import copied
from whsklearn.estimators.base import AxisRegressor
from whsklearn.recursion.memory.blocks import KNOWN, first_block
from whsklearn.recursion.memory.settings import FIRST_RERUN, Settings
from whsklearn.recursion.rows.covariance import conditioned
from whsklearn.recursion.rows.pseudolinear import BLOCK

GRADIENTS = ("full", "pseudolinear")
PER_MODEL = (
    "theta", "ud", "before", "loss", "motion", "sharpness", "origin", "page_theta", "prior_theta", "prior_information",
)  # fmt: skip
DEFAULT_P0 = 1e6
PURE_P0 = 1.0  # the pure recursion updates from the first sample on, from arbitrary starts


class RecursiveRegressor(AxisRegressor):
    """Base of the estimators that learn sample by sample."""

    _frozen: ClassVar[bool] = True  # all rows of a window at theta(t-1)
    _published_mode: ClassVar[int] = BLOCK
    _stochastic_gradient: ClassVar[bool] = False

    def __init_subclass__(cls, **named: Any) -> None:
        """Let an inherited ``__init__`` name the class in its errors."""
        super().__init_subclass__(**named)
        if "__init__" not in cls.__dict__:
            init: Any = cls.__init__
            own = FunctionType(init.__code__, init.__globals__, "__init__", init.__defaults__, init.__closure__)
            cls.__init__ = update_wrapper(own, init)  # type: ignore[method-assign]
            own.__kwdefaults__, own.__qualname__ = init.__kwdefaults__, f"{cls.__qualname__}.__init__"

    p: int = 1
    _stream: AnyStream | None = None  # where rows go without further checks
    _asked: FullStream | None = None  # reads a state that came without a stream; it caches its last result

    def __init__(
        self,
        lags: TransformerMixin | None = None,
        *,
        P0: float | None = None,
        forgetting: float = 1.0,
        theta0: ArrayLike | None = None,
        gradient: str = "full",
        n_starts: int = 32,
        memory: int = 4096,
        random_state: Any = None,
    ):
        self.lags = lags
        self.P0 = P0
        self.forgetting = forgetting
        self.theta0 = theta0
        self.gradient = gradient
        self.n_starts = n_starts
        self.memory = memory
        self.random_state = random_state

    def fit(
        self, X: ArrayLike, y: ArrayLike, groups: ArrayLike | None = None, sample_weight: ArrayLike | None = None
    ) -> Self:
        """Learn a record from a clean start.

        The record passes through the recursion once. With ``gradient="full"`` the samples that
        are still in memory are run once more at the end.

        Parameters
        ----------
        X : array-like of shape (n, n_features), or list of them
            Input u of shape (n, 1); with ``lags=None``, rows.  Each record of a list is a separate experiment.
        y : array-like of shape (n,), or list of them
            Output.
        groups : array-like of shape (n,), optional
            Experiment of each sample; the state restarts at the beginning of each.
        sample_weight : array-like of shape (n,), optional
            Weights of the squared errors, as 1 / variance.  A row with weight zero is ignored.  A sample of a chain
            with weight zero is not fitted but still drives the state.  Rows that a filter makes
            (`InverseDynamicsLags`) take no weights.

        Raises
        ------
        ValueError
            If a parameter, a shape or a number is invalid; the estimator is then unchanged.
        """
        with self._alone(), self._unchanged_if_refused():
            self._drop_stream()
            given = joined(X, y, groups, sample_weight)
            X, y, restart, weights = self._checked_record(given)
            rows, targets = (X, y) if self._is_wiener_hammerstein else self._rows(X, y, given.groups)
            if len(targets) != len(restart):
                restart = starts(None, len(targets), first=True)
            seed = self._draw_seed()
            anew = self._with_knots_placed(X, y, restart, weights, seed)
            stream = self._make_stream(rows.shape[1], seed, anew)
            state = _learnt(stream, rows, targets, restart, weights) | ({"law": anew.law} if anew else {})
            self._keep(stream, state, seed, given.groups)
            chosen = self.P0 is not None or self.theta0 is not None
            on_rows = isinstance(stream, RowsStream) and not stream.gradient
            if on_rows and not chosen and (tight := _advice.of_a_tight_start(rows, DEFAULT_P0)):
                warn(tight)
            else:
                self._warn_of_an_axis(X[:, 0], len(targets))
            converged = isinstance(stream, FullStream) and self.memory > 0  # the pure recursion need not have
            if weights is None and self.forgetting == 1.0 and converged:
                self._warn_of_the_law(X, y, restart)
        return self

    @property
    def _leaves_knots_open(self) -> bool:
        """Whether the law is a name that has knots, which suit an x of unit deviation until `fit` places them."""
        if not self._is_wiener_hammerstein or self.gradient != "full" or self.theta0 is not None:
            return False
        return isinstance(self._given_lags.law, str) and has_knots(self._structure().law.terms)

    def _with_knots_placed(
        self, X: Array, y: Array, restart: Bools, weights: Array | None, seed: int
    ) -> wh.Structure | None:
        """The structure with knots where x is under a cubic; None if the law names no knots that are to be placed."""
        if not self._leaves_knots_open:
            return None
        s = self._structure()
        smooth = s.under(without_knots(s.law))
        stream = self._make_stream(0, seed, smooth)
        (x, _), _ = first_block(stream.theta(_learnt(stream, X, y, restart, weights)), s.dims, X, restart, KNOWN)
        return s.under(FrictionLaw(placed(s.law.terms, x)))

    def partial_fit(
        self, X: ArrayLike, y: ArrayLike, groups: ArrayLike | None = None, sample_weight: ArrayLike | None = None
    ) -> Self:
        """Learn further samples; how they are divided into chunks makes no difference.

        A call learns all of its samples or none: if an exception or Ctrl-C ends it, the state is bit for bit what it
        was before.

        ``X``, ``y``, ``groups``, ``sample_weight``: as for `fit`. Without ``groups`` the samples continue the last
        experiment. Raises ValueError: as for `fit`; the state is then exactly as it was.
        """
        stream = self._stream
        if (
            type(stream) is RowsStream
            and type(X) is ndarray
            and type(y) is ndarray
            and groups is None
            and sample_weight is None
            and stream.step(self.state_, X, y)
        ):
            return self
        with self._alone():
            stream = self._stream  # another thread may have made it another one
            told = groups is not None or sample_weight is not None
            if stream is None or told or not is_plain(X, y, self.n_features_in_):
                return self._partial_fit_checked(X, y, groups, sample_weight)
            n = len(y)  # type: ignore[arg-type]  # an array, as is_plain has seen
            undo = stream.undo
            undo.before(self.state_, X, y)  # type: ignore[arg-type]
            try:
                stream.run(self.state_, X, y, _NO_RESTART if n == 1 else np.zeros(n, dtype=np.bool_))  # type: ignore[arg-type]
                undo.done(n)
            except BaseException:
                self.state_ = undo.restored(stream.run)
                raise
            if n == 1 and type(stream) is RowsStream:
                stream.pack(self.state_)
        return self

    def _partial_fit_checked(
        self, X: ArrayLike, y: ArrayLike, groups: ArrayLike | None, sample_weight: ArrayLike | None
    ) -> Self:
        """`partial_fit` with every check; also the first call and the one after parameters changed."""
        before = self.__dict__.copy()
        first = "state_" not in before
        for name, made in (("state_", copied), ("lags_", copy.deepcopy)):  # these change in place
            if name in before:
                before[name] = made(before[name])
        try:
            self._learn_checked(joined(X, y, groups, sample_weight, 0 if first else self.state_["seen"]), first)
        except BaseException:
            self.__dict__ = before
            raise
        return self

    def _learn_checked(self, given: Given, first: bool) -> None:
        """Check and learn, in place; the caller restores the state if this fails."""
        if first:
            self._keep_lags()
        self._check_parameters()
        groups = given.groups
        X, y = self._validate(given.X, given.y, reset=first)
        weights = self._weights(given.sample_weight, len(X), some=False)
        last = None if first else self.state_["group"]
        restart = starts(groups, len(X), first=first, last=last)
        seed = self._draw_seed() if first else self.state_["seed"]
        stream = self._stream
        if self._is_wiener_hammerstein and not first and stream is None:
            self._keep_lags()
            self._check_state(self.state_)
        if first and len(X) >= FIRST_RERUN:  # the axis may be at rest in the first rows of a stream
            self._warn_of_record(X, y)
        if first and self._leaves_knots_open:
            warn(
                f"The knots of law={self._given_lags.law!r} suit an x of unit deviation, as a stream places none; "
                "give a first record to fit, whose knots partial_fit keeps, or cubic_spline_law(knots, values)."
            )
        rows, targets = X, y
        if not self._is_wiener_hammerstein and self.lags is not None:
            if restart[0] and not first:
                self.lags_.begin()
            rows, targets = self.lags_.partial_rows(X, y, np.cumsum(restart))
            restart = starts(None, len(targets), first=first)
        stream = stream or self._make_stream(rows.shape[1], seed)
        state = stream.initial() if first else self.state_
        if not first and stream is not self._stream:
            self._check_state(state)
        if len(targets):
            stream.run(state, np.ascontiguousarray(rows), np.ascontiguousarray(targets), restart, weights)
        stream.undo.clear()
        self._keep(stream, state, seed, groups)

    def consolidate(self) -> Self:
        """Re-run the samples in memory now, as `fit` does at its end; useful when a stream has time to spare."""
        check_is_fitted(self, "state_")
        with self._alone():
            state = copied(self.state_)  # so that an interrupt leaves the old state
            self._make_stream(self.theta_.size, state["seed"]).settle(state)
            self.state_ = state
        return self

    def forget_past(self, samples: float = 100.0) -> Self:
        """Give everything learned so far the weight of at most ``samples`` samples from now on.

        This is for a system that has just changed. However long the stream was, the estimate then
        follows as fast as one that has seen only so few samples.  `whsklearn.change.forgetting_after`
        gives the forgetting factor to continue with.

        ``samples``: a number above 0.  If the estimate already rests on fewer samples, nothing changes. Raises
        ValueError if ``samples`` is not a positive number.
        """
        if not 0 < samples < np.inf:
            raise ValueError(f"samples is {samples!r}, expected a positive number, the weight of the past in samples.")
        check_is_fitted(self, "state_")
        with self._alone():
            state = copied(self.state_)
            self._reader().forget_past(state, float(samples))
            self.state_ = state
        return self

    @property
    def innovation_variance_(self) -> float:
        """Variance of the one-step prediction error over the latest samples."""
        _ = self.theta_
        loss = self.state_["loss"]
        rows = loss.reshape(-1, 2)
        seen = rows[:, 1] > 0
        return float((rows[seen, 0] / rows[seen, 1]).min()) if seen.any() else float("nan")

    def _noise_variance(self) -> float:
        if self._is_wiener_hammerstein:
            return self.innovation_variance_
        return noise_variance(self.state_["loss"], self.state_["theta"].size)

    # -- advice --------------------------------------------------------------------------

    def _warn_of_record(self, X: Array, y: Array) -> None:
        super()._warn_of_record(X, y)
        if self._is_wiener_hammerstein and self.gradient == "full" and not self.memory:
            warn(_advice.of_scale(X, y))

    def _warn_of_an_axis(self, path: Array, n_rows: int) -> None:
        """Warn of rigid-axis parameters that no real axis can have."""
        if self.lags is None or self._is_wiener_hammerstein or self._answers_several:
            return
        independent = int(n_rows * getattr(self.lags_, "independent_share", 1.0))
        warn(_advice.of_an_axis(self._column_names(), self._theta(), self._covariance(), independent, path))

    # -- settings ------------------------------------------------------------------------

    def _check_parameters(self) -> None:
        check_whole("p", self.p, 1, ", the innovation length")
        p0 = 1.0 if self.P0 is None else self.P0
        for name, value, most, expected in (
            ("P0", p0, np.finfo(np.float64).max, "a positive number that is finite"),
            ("forgetting", self.forgetting, 1.0, "a number above 0 and at most 1"),
        ):
            if isinstance(value, bool) or not isinstance(value, (int, float, np.number)) or not 0.0 < value <= most:
                raise ValueError(f"{name} is {value!r}, expected {expected}.")
        if self.gradient not in GRADIENTS:
            raise ValueError(f"gradient is {self.gradient!r}, expected one of {', '.join(map(repr, GRADIENTS))}.")
        for name, least in (("n_starts", 1), ("memory", 0)):
            check_whole(name, getattr(self, name), least)
        if self._is_wiener_hammerstein:
            self._lags.dims()
            if self.gradient == "pseudolinear":
                self._lags.key_term()

    def _theta0(self, n: int, default: float) -> Array:
        """theta(0) of the right length."""
        if self.theta0 is None:
            return np.full(n, default)
        theta0 = np.asarray(self.theta0, dtype=np.float64)
        if theta0.ndim == 0:
            theta0 = np.full(n, float(theta0))
        if theta0.shape != (n,) or not np.isfinite(theta0).all():
            raise ValueError(f"theta0 has shape {theta0.shape}, expected ({n},) finite numbers, one per parameter.")
        return theta0

    def _make_stream(self, n_columns: int, seed: int, structure: wh.Structure | None = None) -> AnyStream:
        """The stream for the current parameters; ``structure``: in place of that of the lags."""
        forgetting, p = float(self.forgetting), int(self.p)
        p0 = float(self.P0 or DEFAULT_P0)
        if not self._is_wiener_hammerstein:
            return RowsStream(
                n_columns, p, p0, forgetting, self._theta0(n_columns, 0.0),
                self.gradient == "full", self._stochastic_gradient,
            )  # fmt: skip
        structure = structure or self._structure()
        n = int(structure.dims[:4].sum() - 2 + structure.dims[4])
        if self.gradient == "pseudolinear":
            initial = self._theta0(n, 0.01)  # the paper's theta(0)
            return PublishedStream(structure, p, p0, forgetting, initial, self._published_mode)
        theta0 = None
        if self.theta0 is not None:
            theta0 = wh.natural_vector(self._theta0(n, 0.0), structure)
            theta0[structure.slices()[1]] = wh.inside(theta0[structure.slices()[1]])
        settings = Settings(
            dims=structure.dims, codes=structure.law.codes, shapes=structure.law.shapes, p=p,
            p0=p0 if self.memory or self.P0 else PURE_P0, forgetting=forgetting,
            n_starts=int(self.n_starts), memory=int(self.memory), frozen=self._frozen, seed=seed,
            n_inputs=self.n_features_in_, theta0=theta0,
        )  # fmt: skip
        return FullStream(structure, settings)

    def _keep(self, stream: AnyStream, state: dict[str, Any], seed: int, groups: ArrayLike | None) -> None:
        """Make a state the estimator's current one."""
        state["seed"] = seed
        if groups is not None:
            state["group"] = str(np.asarray(groups)[-1])
        state.setdefault("group", None)
        self.state_ = state
        fast = self.lags is None or self._is_wiener_hammerstein
        self._drop_stream()
        if fast:
            self._stream = stream

    @property
    def _lags(self) -> Any:
        """With the knots that `fit` placed, which are a part of the state."""
        given, law = super()._lags, self.__dict__.get("state_", {}).get("law")
        known = law is not None and as_law(given.law).labels == law.labels
        return clone(given).set_params(law=law) if known else given

    # -- answers -------------------------------------------------------------------------

    @property
    def _default_output(self) -> str:  # type: ignore[override]
        """Default output of `predict`; the published reading has no covariance, so it has no expected output."""
        return "expected" if self.gradient == "full" else "simulation"

    def _reader(self) -> AnyStream:
        """The stream that can read the state."""
        stream = self._stream or self._asked
        if stream is None:
            stream = self._make_stream(self.state_["theta"].shape[-1], self.state_["seed"])
            if isinstance(stream, FullStream):
                self._asked = stream
        return stream

    def _drop_stream(self) -> None:
        """Discard everything that was built for the old parameters or the old state."""
        for name in _NO_STATE:
            self.__dict__.pop(name, None)

    @contextmanager
    def _alone(self) -> Iterator[None]:
        with self._lock:
            stream = self._stream
            held = stream if type(stream) is RowsStream else None
            if held is not None:  # closed to callers without the lock
                held.hold(self.state_)
            try:
                yield
            finally:
                if held is not None:
                    held.let_go(self.state_)

    def _structure(self) -> wh.Structure:
        return getattr(self._stream or self._asked, "structure", None) or super()._structure()

    def _theta(self) -> Array:
        with self._lock:
            reader = self._reader()
            return super()._theta() if reader.is_natural else self._linear(reader)[0]

    def _running(self) -> tuple[Array, wh.Structure]:
        with self._lock:
            reader = self._reader()
            if isinstance(reader, FullStream):
                return reader.running(self.state_), reader.structure
            return super()._running()

    def _natural(self) -> Array:
        with self._lock:
            reader = self._reader()
            return reader.theta(self.state_) if reader.is_natural else super()._natural()

    def _covariance(self) -> Array:
        with self._lock:
            reader = self._reader()
            return super()._covariance() if reader.is_natural else self._linear(reader)[1]

    def _linear(self, reader: AnyStream) -> tuple[Array, Array]:
        """Estimate and covariance of a stream of rows, with what its lags know of a weight without any row."""
        theta, p = reader.theta(self.state_), reader.covariance(self.state_)
        for known in getattr(getattr(self, "lags_", None), "prior_", ()):
            theta, p = conditioned(theta, p, *known)
        return theta, p

    def _natural_covariance(self) -> Array:
        with self._lock:
            reader = self._reader()
            return reader.covariance(self.state_) if reader.is_natural else super()._natural_covariance()

    def _check_state(self, state: dict[str, Any]) -> None:
        """A state fits if it has the arrays of a fresh one; only the number of models may differ."""
        super()._check_state(state)
        self._drop_stream()
        self._check_parameters()
        self._check_size(state)
        shape = np.shape(state["theta"])
        fresh = self._make_stream(shape[-1] if shape else 0, int(state.get("seed", 0))).initial()
        for name, value in fresh.items():
            expected = np.shape(value)
            if name in PER_MODEL and len(np.shape(fresh["theta"])) == 2:
                expected = (*shape[:1], *expected[1:])
            if name not in state or np.shape(state[name]) != expected:
                got, by = np.shape(state.get(name, 0)), {"recent": "p or order", "memory": "memory"}
                raise ValueError(
                    f"This {type(self).__name__} was begun with another {by.get(name.partition('_')[0], 'structure')}: "
                    f"its state has {name} of shape {got}, and its parameters need {expected}; use the parameters it "
                    "was begun with, or call fit."
                )
            if isinstance(value, int) and (type(state[name]) is not int or state[name] < 0):
                raise ValueError(f"The state has {name} {state[name]!r}, expected a count; go back to an earlier one.")
            if isinstance(value, np.ndarray) and getattr(state[name], "dtype", None) != value.dtype:
                raise ValueError(f"The state's {name} has another type than {value.dtype}; go back to an earlier one.")
        if state.get("fill", 0) > len(state.get("memory_restart", ())):
            raise ValueError(f"The state's memory cannot hold {state['fill']} samples; go back to an earlier one.")

    def _check_size(self, state: dict[str, Any]) -> None:
        """Reject settings that need far more numbers than the state holds, before memory is allocated for them."""
        held = sum(np.size(value) for value in state.values())
        n, memory, n_starts = self.n_features_in_, 0, 1
        if self._is_wiener_hammerstein:
            lags = self._lags
            n = n * lags.n_a + lags.n_b + lags.n_c + lags.n_d
            if self.gradient == "full":
                memory, n_starts = self.memory, 1 if self.memory else self.n_starts
        elif self.lags is not None:
            n = 0  # other lags make their own number of columns
        asked = n * n * n_starts + memory + self.p
        if asked > 100 * held + 1000:
            raise ValueError(
                f"This state holds {held} numbers, and its parameters need {asked} or more; use the parameters "
                "it was begun with."
            )

    def set_params(self, **params: Any) -> Self:
        """Set parameters; a stream uses them from the next sample on."""
        self._drop_stream()
        return super().set_params(**params)

    def __getstate__(self) -> dict[str, Any]:
        state = dict(super().__getstate__())
        for name in _NO_STATE:
            state.pop(name, None)
        return state


def _learnt(stream: AnyStream, X: Array, y: Array, restart: Bools, weights: Array | None) -> dict[str, Any]:
    """The state of a stream that has read a record."""
    state = stream.initial()
    stream.run(state, X, y, restart, weights)
    stream.settle(state)
    return state


_NO_STATE = "_stream", "_asked"  # attributes of an estimator that can be rebuilt
_NO_RESTART = np.zeros(1, dtype=np.bool_)
