"""From the log of an axis to a linear regression: torque = J a + sum of effects.

The columns are the acceleration, the terms of the friction law and the effects of the catalogue,
all computed from the position.  Their weights are the physical parameters of the axis, so every
estimator that takes rows can identify it.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, Self

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import minimum_filter1d
from sklearn.base import BaseEstimator, TransformerMixin
from sklearn.utils.validation import check_array, check_is_fitted, validate_data

from whsklearn._inputs import check_above_zero, check_whole
from whsklearn.effects import Effect, FrictionLaw, PreslidingHysteresis
from whsklearn.effects.base import Array
from whsklearn.filtering.records import Motion, decimate, motion, motion_cutoff, velocity_noise, zero_phase
from whsklearn.filtering.streams import (
    causal_cutoff,
    causal_kernels,
    causal_motion,
    causal_window,
    window_averages,
)
from whsklearn.lags.axis_rows import (
    AT_START,
    DRIVEN,
    NOISY,
    RowState,
    averaging,
    checked_torque,
    column_names,
    effect_terms,
    experiments,
    least_speed,
    period_of,
    rest_sums,
    sized_effects,
    stack_columns,
)


def validated(owner: Any, X: ArrayLike, reset: bool = False) -> Array:
    """X as a finite (n, 1) or (n, 2) array of floats; an array that is valid already skips full validation."""
    known = () if reset or hasattr(owner, "feature_names_in_") else (getattr(owner, "n_features_in_", 0),)
    if type(X) is np.ndarray and X.dtype == np.float64 and X.shape[1:] == known and len(X) and np.isfinite(X).all():
        return X
    return np.asarray(validate_data(owner, X, dtype=np.float64, reset=reset))


SHORTEST = 64  # samples below which the noise cannot be estimated from the record
LEAST_ROWS = 10  # independent ones of a record, for each weight: with fewer, rows beside a reversal are kept
SLOW = 0.1  # of the speed so far: slower, friction is not yet the sign of the velocity; the arms' lags have 0.08
# Samples by which the drive acts later than it is logged, before a record says so: anything between 0, if it is
# measured with the position, and 1; half a sample if it is held over the sample that follows.  A motion that is fast
# enough to be bent by the age tells it a hundred times better than this.  A slow one tells it worse, and wrongly: noise
# in the acceleration looks like age (27 ms in 20 s of a sine of 0.3 Hz, tests/lags/test_inverse_dynamics.py).
AGE, AGE_SPREAD = 0.5, 12.0**-0.5


class InverseDynamicsLags(TransformerMixin, BaseEstimator):
    """Columns of the inverse dynamics of an axis, from its measured position.

    Parameters
    ----------
    sample_rate : float, default=1000.0
        Sampling rate of the log, in Hz.
    law : str, FrictionLaw or iterable of effects, default="viscous,coulomb"
        Friction terms, each with one weight.
    effects : str or iterable of (str or Effect), default="input_offset"
        Further effects of the catalogue, with fixed shapes; ``""`` for none.
    cutoff : float, optional
        Cut-off of the filter on the position, in Hz. For records, the default is the highest at which encoder noise
        makes up 1e-6 of the acceleration's variance, or what the motion needs (`motion_cutoff`). Torque and all
        columns then pass the same filter, so that only frequencies above it are lost. For streams, which start
        without a record to choose from, the default is a tenth of the sampling rate and at most 100 Hz; the rows of
        `rows` and `partial_rows` are averages over two periods of it.
    order : int, default=4
        Order of the zero-phase Butterworth filter.
    decimate : int, optional
        The result of `rows` is low-pass filtered and every ``decimate``-th row is kept. By default,
        all rows of a record are kept if ``cutoff`` is given. Otherwise two rows per period of the cut-off are kept,
        of a stream one, as many as are independent after the filter; with more, the standard errors of the fit would
        be too small.
    border : int, default=0
        Number of samples without rows at the start of each record, where the filter has no past. If ``cutoff`` is
        not given, one period of the cut-off is also dropped at both ends.
    standstill : float, optional
        Speed below which `rows` drops rows, with those that a period of the cut-off blurs into them.  At rest, friction
        equals whatever drive is applied, and the sign of a noisy velocity is random, which biases Coulomb friction
        towards viscous friction.  The default is five times the noise of the velocity or a tenth of its rms (for a
        stream, so far), whichever is more, and 0 if a hysteresis models the standstill.
    causal : bool, default=False
        False is for whole records and adds no delay. True is for streams and fits a polynomial
        over a moving window. Row t then holds the values from ``delay_`` samples earlier, and
        `rows` delays the torque by the same amount.
    window : int, optional
        Odd length of that window; by default it is chosen from ``cutoff``.
    degree : int, default=4
        Degree of its polynomial.

    Attributes
    ----------
    delay_ : int
        Samples by which a row lags its input: 0 for records, half a window for streams.
    cutoff_ : float
        Cut-off in use, in Hz.
    warmup_ : int
        Rows of zeros at the start of `transform`: 0 for records, the window length minus one for streams.
    terms_ : tuple of Effect
        The law's terms and the effects, in the order of their columns.

    Notes
    -----
    Sign convention: a positive weight is torque that the drive must supply.

    The torque is taken to act when its position is measured.  One that a controller holds over the sample acts half a
    sample later, which no standard error covers.  With ``effects="input_offset,input_delay"`` that age is a weight too,
    in s; the recursive estimators take it to lie between 0 and one sample until the motion tells it, and never more
    than 1.5 samples from the middle of these (`prior_`).

    The settings ``cutoff=sample_rate / 10``, ``decimate=10``, ``border=49`` and ``standstill=0`` give the reference
    method of Janot, Gautier, Brunot 2019, Data set and reference models of EMPS, Workshop on Nonlinear System
    Identification Benchmarks.

    X is the position (n, 1), or the position and the measured drive (n, 2) if an effect such as
    ``load_friction`` is a function of the drive. y is the torque (rad and Nm, or m and N).

    References
    ----------
    Janot, Gautier and Brunot 2019, Data Set and Reference Models of EMPS, Workshop on Nonlinear System
    Identification Benchmarks; Swevers, Verdonck and De Schutter 2007, Dynamic Model Identification for Industrial
    Robots, IEEE Control Systems Magazine 27(5), 58-71.

    Examples
    --------
    >>> import numpy as np
    >>> t = np.arange(4000) / 1000
    >>> q = 0.3 * np.sin(2 * t) + 0.1 * np.sin(5 * t)
    >>> v, a = 0.6 * np.cos(2 * t) + 0.5 * np.cos(5 * t), -1.2 * np.sin(2 * t) - 2.5 * np.sin(5 * t)
    >>> torque = 2.0 * a + 0.5 * v + 0.8 * np.sign(v) - 0.1
    >>> lags = InverseDynamicsLags(sample_rate=1000, border=50)
    >>> phi, target = lags.rows(q[:, None], torque)
    >>> [float(w) for w in np.linalg.lstsq(phi, target, rcond=None)[0].round(2)]
    [2.0, 0.5, 0.8, -0.1]
    >>> list(lags.get_feature_names_out())
    ['inertia', 'viscous', 'coulomb', 'input_offset']
    """

    _stream: RowState

    def __init__(
        self,
        sample_rate: float = 1000.0,
        law: str | FrictionLaw | Iterable[Effect] = "viscous,coulomb",
        effects: str | Iterable[str | Effect] = "input_offset",
        cutoff: float | None = None,
        order: int = 4,
        decimate: int | None = None,
        border: int = 0,
        standstill: float | None = None,
        causal: bool = False,
        window: int | None = None,
        degree: int = 4,
    ):
        self.sample_rate = sample_rate
        self.law = law
        self.effects = effects
        self.cutoff = cutoff
        self.order = order
        self.decimate = decimate
        self.border = border
        self.standstill = standstill
        self.causal = causal
        self.window = window
        self.degree = degree

    def fit(self, X: ArrayLike, y: ArrayLike | None = None) -> Self:
        """Check the log and set up columns, filter and delay; nothing is estimated here.

        ``X`` (n, 1) or (n, 2): position, and the drive if an effect needs it. ``y``: not used.
        """
        n_columns = check_array(X, dtype=np.float64).shape[1]
        if n_columns > 2:
            raise ValueError(f"X has {n_columns} columns, expected position, or position and drive; select those.")
        self._settle()
        paths = validated(self, X, reset=True)[:, 0]
        if self._is_automatic and len(paths) > SHORTEST and np.ptp(paths) > 0.0:  # else it has no cut-off of its own
            self.cutoff_ = motion_cutoff(paths, self.sample_rate, self.order)
        return self

    def transform(self, X: ArrayLike, y: ArrayLike | None = None, groups: ArrayLike | None = None) -> Array:
        """Compute the columns of records from a clean start; the state of a stream is neither used nor changed.

        ``X`` (n, 1) or (n, 2): position, and the drive if an effect needs it. ``y`` (n,): the drive, if X does not
        contain it. ``groups`` (n,): marks experiments; filters restart at each. Returns (n, n_terms): in a causal
        transformer, row t belongs to time t - ``delay_``.
        """
        check_is_fitted(self, "terms_")
        X = validated(self, X)
        drive = self._drive(X, y)
        return self._columns(X, drive, drive, groups)[0]

    def fit_transform(self, X: ArrayLike, y: ArrayLike | None = None, groups: ArrayLike | None = None) -> Array:
        """Call `fit`, then compute columns from a clean start; a stream can continue from the end of X.

        ``X``, ``y``, ``groups``: as for `transform`.
        """
        X = validated(self.fit(X, y), X)
        drive = self._drive(X, y)
        target = drive if y is None else np.asarray(y, dtype=float).ravel()
        phi, self._stream = self._columns(X, drive, target, groups)
        return phi

    def rows(self, X: ArrayLike, y: ArrayLike, groups: ArrayLike | None = None) -> tuple[Array, Array]:
        """Regression rows of records: columns and torque, filtered alike, from a clean start.

        ``X`` (n, 1) or (n, 2): position, and the drive if it is not y. ``y`` (n,): torque or force, with the same
        positive direction as the position. ``groups`` (n,): marks experiments; filters restart at each. Returns
        ``phi`` (m, n_terms) and ``target`` (m,), decimated, without border, warm-up and standstill: m < n. Raises
        ValueError if the torque is zero throughout, or a record is too short for the filters.
        """
        target = checked_torque(y, len(X))  # type: ignore[arg-type]
        X = validated(self.fit(X, y), X)
        if self.causal:
            return self._rows_of(X, target, groups)[:2]
        drive = self._drive(X, target)
        pieces = [
            self._record_rows(X[s, 0], self._record_columns(X[s, 0], drive[s]), target[s])
            for s in experiments(groups, len(X))
        ]
        both, slowest, limits = (np.concatenate(parts) for parts in zip(*pieces, strict=True))
        moving = slowest >= limits
        # where it turns too often for its filter, only rest itself is left out
        if moving.sum() * self.independent_share < LEAST_ROWS * (both.shape[1] - 2):
            moving = np.abs(both[:, 0]) >= limits
        return both[moving, 1:-1], both[moving, -1]

    def _record_rows(self, path: Array, phi: Array, target: Array) -> tuple[Array, Array, Array]:
        """Of one record: speed, columns and torque of every row, its slowest speed, and the least that counts."""
        speed = motion(path, self.sample_rate, self.cutoff_, self.order).velocity
        period = period_of(self.sample_rate, self.cutoff_)
        slowest = minimum_filter1d(np.abs(speed), 2 * period + 1)
        if self._is_automatic:
            edge = min(int(self.sample_rate / self.cutoff_), target.size // 4)
            smooth = zero_phase(target, self.sample_rate, self.cutoff_, self.order)
            inner = slice(max(self.border, edge), target.size - edge)
            every = self.decimate or max(round(self.sample_rate / (2.0 * self.cutoff_)), 1)
            both = np.column_stack([speed, phi, smooth])[inner][::every]
        else:
            inner, every = slice(self.border, None), self.decimate or 1
            both = decimate(np.column_stack([speed, phi, target])[inner], every)
        slowest = slowest[inner][::every]
        return both, slowest, np.full(len(both), self._limit(path, speed))

    # -- streams --------------------------------------------------------------------------

    def partial_fit_transform(self, X: ArrayLike, y: ArrayLike | None = None, groups: ArrayLike | None = None) -> Array:
        """Columns of the next piece of a stream, continuing where the last piece ended; shape (n, n_terms).

        ``X``, ``y``, ``groups``: as for `transform`; a new label begins a new stream. Raises ValueError if the
        transformer is not causal, or an effect needs the whole record.
        """
        X = self._next_piece(X)
        drive, stream, out = self._drive(X, y), self._stream, []
        for i, s in enumerate(experiments(groups, len(X))):
            phi, _, _, stream = self._advance(AT_START if i else stream, X[s, 0], drive[s], drive[s])
            out.append(phi)
        self._stream = stream
        return np.concatenate(out)

    def partial_rows(self, X: ArrayLike, y: ArrayLike, groups: ArrayLike | None = None) -> tuple[Array, Array]:
        """Regression rows of the next piece of a stream: averages of columns and torque, a period of the cut-off apart.

        The average is the same for both, so it takes no parameter from its value. There are no rows during the warm-up
        and none of windows with standstill, so a piece may give none.

        ``X``, ``y``, ``groups``: as for `rows`; a new label begins a new stream.
        """
        return self._rows_of(*self._checked_piece(X, y), groups)[:2]

    def partial_errors(self, X: ArrayLike, y: ArrayLike, theta: Array, groups: ArrayLike | None = None) -> Array:
        """Errors (n,) of the weights ``theta`` in the rows that `partial_rows` gives; NaN for samples without one.

        ``X``, ``y``, ``groups``: as for `partial_rows`.
        """
        X, target = self._checked_piece(X, y)
        phi, late, at = self._rows_of(X, target, groups)
        out = np.full(len(X), np.nan)
        out[at] = late - phi @ theta
        return out

    def begin(self) -> None:
        """Begin a new experiment: the next row of a stream has no past."""
        self._stream = AT_START

    def get_state(self) -> dict[str, Any]:
        """The arrays and numbers that a stream needs to continue."""
        check_is_fitted(self, "terms_")
        return {"n_features_in": int(self.n_features_in_), "cutoff": float(self.cutoff_), **self._stream._asdict()}

    def set_state(self, state: dict[str, Any]) -> Self:
        """Continue from a ``state`` that `get_state` of a transformer with the same parameters returned.

        Raises ValueError if it is of another kind.
        """
        if not isinstance(state, dict) or not {"n_features_in", "cutoff", *RowState._fields} <= state.keys():
            raise ValueError("This is not a state of InverseDynamicsLags; give what get_state() returned.")
        self._settle()
        self.n_features_in_ = int(state["n_features_in"])
        self.cutoff_ = float(state["cutoff"])
        kept = {name: np.array(state[name], dtype=float) for name in RowState._fields if name != "seen"}
        if not kept["path"].size == kept["drive"].size == kept["torque"].size:
            raise ValueError("This state is of an earlier version, whose filters were others; begin the stream anew.")
        self._stream = RowState(**kept, seen=int(state["seen"]))
        return self

    def _rows_of(self, X: Array, target: Array, groups: ArrayLike | None) -> tuple[Array, Array, NDArray[np.int64]]:
        """Rows of the next piece of the stream, their torque, and the samples at which they end."""
        drive, stream, out = self._drive(X, target), self._stream, []
        for i, s in enumerate(experiments(groups, len(X))):
            stream = AT_START if i else stream
            both, at, stream = self._chosen(stream, X[s, 0], *self._advance(stream, X[s, 0], drive[s], target[s]))
            out.append((both, at + s.start))
        self._stream = stream
        rows, at = (np.concatenate(parts) for parts in zip(*out, strict=True))
        return rows[:, :-1], rows[:, -1], at

    def _advance(
        self, stream: RowState, path: Array, drive: Array, target: Array
    ) -> tuple[Array, Array, Motion, RowState]:
        """Columns (zeros in the warm-up), smoothed torque and motion of the next piece, and the stream after it."""
        moved, past = causal_motion(path, stream.path, self._kernels)
        # the same polynomials, so that the noise of an encoder that a controller feeds back cancels in both
        force, past_drive = causal_motion(drive, stream.drive, self._kernels)
        late, past_torque = causal_motion(target, stream.torque, self._kernels)
        time = (stream.seen - self.delay_ + np.arange(len(path))) / self.sample_rate
        phi = stack_columns(self.terms_, moved, force.position, time, drive_rate=force.velocity)
        phi[: max(self.warmup_ - stream.seen, 0)] = 0.0
        seen = stream.seen + len(path)
        return phi, late.position, moved, stream._replace(path=past, drive=past_drive, torque=past_torque, seen=seen)

    def _chosen(
        self, before: RowState, path: Array, phi: Array, late: Array, moved: Motion, after: RowState
    ) -> tuple[Array, NDArray[np.int64], RowState]:
        """Averages of columns and torque where the axis moved, the samples at which they end, and the stream."""
        count, window = before.seen + np.arange(len(path)), self._taps.size
        speed = np.abs(moved.velocity)
        signals = np.column_stack([phi, late, speed])
        signals = np.concatenate([before.signals.reshape(-1, signals.shape[1]), signals])
        ends = np.arange(len(signals) - len(path), len(signals))
        middle = np.concatenate([before.path, path])[np.maximum(len(before.path) + count - count[0] - self.delay_, 0)]
        sums = rest_sums(moved, middle, before.sums, count < self.warmup_)
        full = (ends >= window - 1) & (count >= max(self.warmup_ + window - 1, self.border))
        at = np.flatnonzero(full & (count % self.spacing == 0))
        if at.size:
            slowest = sliding_window_view(signals[:, -1], window)[ends[at] - window + 1].min(axis=1)
            at = at[
                slowest > least_speed(sums[at], self._kernels, SLOW)
                if self.standstill is None
                else slowest >= self.standstill
            ]
        rows = window_averages(signals[:, :-1], self._taps, ends[at])
        return rows, at, after._replace(signals=signals[max(len(signals) - window + 1, 0) :].copy(), sums=sums[-1])

    def _checked_piece(self, X: ArrayLike, y: ArrayLike) -> tuple[Array, Array]:
        """A piece of a stream, and its torque."""
        X = self._next_piece(X)
        return X, checked_torque(y, len(X), moving=False)

    def _next_piece(self, X: ArrayLike) -> Array:
        """Check a piece of a stream; the first piece fixes the columns."""
        if not self.causal:
            raise ValueError(
                "A zero-phase filter needs the whole record; use causal=True for a stream, whose delay is then known."
            )
        terms = getattr(self, "terms_", None) or effect_terms(self.law, self.effects)
        whole = [t.name for t in terms if isinstance(t, PreslidingHysteresis)]
        if whole:
            raise ValueError(f"{', '.join(whole)} needs the whole record; remove it from a stream's effects.")
        if not hasattr(self, "terms_"):
            self.fit(X)
        return validated(self, X)

    # -- answers --------------------------------------------------------------------------

    @property
    def max_lag(self) -> int:
        """Samples of the past that a row needs: its windows for streams, a period of the cutoff for records."""
        cutoff = self._first_cutoff()
        if not self.causal:
            return round(self.sample_rate / getattr(self, "cutoff_", cutoff))
        window = causal_window(self.sample_rate, cutoff, self.degree) if self.window is None else self.window
        return window - 1 + 2 * period_of(self.sample_rate, cutoff)

    def _first_cutoff(self) -> float:
        """The cut-off before any record is seen, in Hz."""
        if self.cutoff is not None:
            return float(self.cutoff)
        return causal_cutoff(self.sample_rate) if self.causal else 0.1 * self.sample_rate

    @property
    def spacing(self) -> int:
        """Samples from one row of a stream to the next: half the window of their average."""
        return self.decimate or period_of(self.sample_rate, self._first_cutoff())

    @property
    def independent_share(self) -> float:
        """Share of `rows` that are independent after the filter: two per period of its cut-off, of a stream one."""
        check_is_fitted(self, "terms_")
        apart = self.sample_rate / (2.0 * self.cutoff_)
        if self.causal:
            return min(1.0, self.spacing / (2.0 * apart))
        kept = self.decimate or (max(round(apart), 1) if self._is_automatic else 1)
        return min(1.0, kept / apart)

    def interpret(self, theta: ArrayLike) -> tuple[float, tuple[Effect, ...]]:
        """Inertia and effects for these weights of the columns.

        ``theta`` (n_terms,): weights, in the order of the columns. Raises ValueError if the inertia is not positive,
        which is impossible for an axis.
        """
        check_is_fitted(self, "terms_")
        theta = np.asarray(theta, dtype=float).ravel()
        expected = len(self.get_feature_names_out())
        if len(theta) != expected:
            raise ValueError(f"theta has {len(theta)} weights, expected {expected}, one per column.")
        if theta[0] <= 0:
            raise ValueError(
                f"The fitted inertia is {theta[0]:.3g}, expected a number above zero; check the units and signs of "
                "drive and position, or give a record with more acceleration."
            )
        return float(theta[0]), sized_effects(self.terms_, theta[1:])

    def get_feature_names_out(self, input_features: Any = None) -> NDArray[np.object_]:
        """``inertia``, then the names of the effects, numbered if one recurs, with cos and sin for two columns.

        ``input_features``: not used; present for scikit-learn compatibility.
        """
        check_is_fitted(self, "terms_")
        return np.array(["inertia", *column_names(self.terms_)], dtype=object)

    @property
    def prior_(self) -> tuple[tuple[int, float, float], ...]:
        """What is known of a weight before any row: its column, mean and standard deviation.

        Only the age of the drive (``input_delay``) is, in s: in a motion of one frequency nothing tells it from
        friction and inertia.
        """
        check_is_fitted(self, "terms_")
        at = 1 + np.cumsum([0, *(len(t.coefficients) for t in self.terms_)])
        known = AGE / self.sample_rate, AGE_SPREAD / self.sample_rate
        return tuple((int(k), *known) for k, t in zip(at, self.terms_, strict=False) if t.column_kind == "first_order")

    @property
    def _is_automatic(self) -> bool:
        """Whether the cut-off follows from the record."""
        return self.cutoff is None and not self.causal

    def _settle(self) -> None:
        """Set up terms, filter and delay from the parameters."""
        check_above_zero("sample_rate", self.sample_rate, ", in Hz")
        if self.cutoff is not None:
            check_above_zero("cutoff", self.cutoff, ", in Hz, or None")
        for name, least in (("order", 1), ("border", 0), ("degree", 2), ("decimate", 1), ("window", 1)):
            if name not in ("decimate", "window") or getattr(self, name) is not None:
                check_whole(name, getattr(self, name), least)
        terms = effect_terms(self.law, self.effects)
        cutoff, delay = self._first_cutoff(), 0
        if self.causal:
            window = causal_window(self.sample_rate, cutoff, self.degree) if self.window is None else self.window
            self._kernels = causal_kernels(self.sample_rate, window, self.degree)
            self._taps = averaging(period_of(self.sample_rate, cutoff))
            delay = (window - 1) // 2
        self.terms_, self.cutoff_, self.delay_, self.warmup_ = terms, cutoff, delay, 2 * delay
        self._stream = AT_START

    def _drive(self, X: Array, y: ArrayLike | None) -> Array:
        """Drive for the columns that need it: the second column of X, or y, or zeros if no column needs it."""
        if X.shape[1] == 2:
            return X[:, 1]
        if y is not None:
            return np.asarray(y, dtype=float).ravel()
        needing = [t.name for t in self.terms_ if t.name in DRIVEN]
        if needing:
            raise ValueError(
                f"{', '.join(needing)} is a function of the drive; give X two columns, position and measured drive."
            )
        return np.zeros(len(X))

    def _columns(self, X: Array, drive: Array, target: Array, groups: ArrayLike | None) -> tuple[Array, RowState]:
        """Columns of every record, each from a clean start, and the stream at the end of the last."""
        stream = AT_START
        pieces = []
        for s in experiments(groups, len(X)):
            if self.causal:
                phi, _, _, stream = self._advance(AT_START, X[s, 0], drive[s], target[s])
            else:
                phi = self._record_columns(X[s, 0], drive[s])
            pieces.append(phi)
        return np.concatenate(pieces), stream

    def _record_columns(self, path: Array, drive: Array) -> Array:
        """Columns of one record."""
        rate, order, time = self.sample_rate, self.order, np.arange(len(path)) / self.sample_rate
        if not self._is_automatic:
            moved, smooth = motion(path, rate, self.cutoff_, order), zero_phase(drive, rate, self.cutoff_, order)
            return stack_columns(self.terms_, moved, smooth, time)
        # The value of the law is filtered, not only its argument; otherwise a reversal would be blurred in the torque
        # only. So position and speed come from a wider filter, and acceleration from the one that its noise allows.
        wider = min(2.0 * self.cutoff_, 0.1 * rate)
        moved, smooth = motion(path, rate, wider, order), zero_phase(drive, rate, wider, order)
        phi = zero_phase(stack_columns(self.terms_, moved, smooth, time), rate, self.cutoff_, order)
        phi[:, 0] = motion(path, rate, self.cutoff_, order).acceleration
        return phi

    def _limit(self, path: Array, speed: Array) -> float:
        """Speed below which a row counts as standstill."""
        if self.standstill is not None:
            return float(self.standstill)
        if any(isinstance(t, PreslidingHysteresis) for t in self.terms_):
            return 0.0
        noise = velocity_noise(path, self.sample_rate, self.cutoff_, self.order)
        return max(NOISY * noise, SLOW * float(np.sqrt(np.mean(speed**2))))
