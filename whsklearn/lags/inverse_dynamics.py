"""From the log of an axis to a linear regression: torque = J a + sum of effects.

The columns are the acceleration, the terms of the friction law and the effects of the catalogue,
all computed from the position.  Their weights are the physical parameters of the axis, so every
estimator that takes rows can identify it.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.base import BaseEstimator, TransformerMixin
from sklearn.utils.validation import check_array, check_is_fitted, validate_data

from whsklearn.effects import Effect, FrictionLaw, PreslidingHysteresis
from whsklearn.effects.base import Array
from whsklearn.filtering.records import decimate, motion, motion_cutoff, velocity_noise, zero_phase
from whsklearn.filtering.streams import causal_delay, causal_kernels, causal_motion, causal_window
from whsklearn.lags.axis_rows import (
    AT_START,
    DRIVEN,
    RowState,
    checked_torque,
    column_names,
    effect_terms,
    experiments,
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
        without a record to choose from, the default is a tenth of the sampling rate.
    order : int, default=4
        Order of the zero-phase Butterworth filter.
    decimate : int, optional
        The result of `rows` is low-pass filtered and every ``decimate``-th row is kept (records only). By default,
        all rows are kept if ``cutoff`` is given. Otherwise two rows per period of the cut-off are kept, as many as
        are independent after the filter; with more, the standard errors of the fit would be too small.
    border : int, default=0
        Number of rows that `rows` drops at the start of each record, where the filter has no past. If ``cutoff`` is
        not given, one period of the cut-off is also dropped at both ends.
    standstill : float, optional
        Speed below which `rows` drops rows. At rest, friction equals whatever drive is applied, and the sign of a
        noisy velocity is random, which biases Coulomb friction towards viscous friction. The default is five times
        the noise of the velocity for a record, and 0 for a stream or if a hysteresis models the standstill.
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
        return self._fresh(X, y, groups)

    def rows(self, X: ArrayLike, y: ArrayLike, groups: ArrayLike | None = None) -> tuple[Array, Array]:
        """Regression rows of records: columns and torque, filtered alike, from a clean start.

        Parameters
        ----------
        X : array-like of shape (n, 1) or (n, 2)
            Position, and the drive if it is not y.
        y : array-like of shape (n,)
            Torque or force, with the same positive direction as the position.
        groups : array-like of shape (n,), optional
            Marks experiments; filters restart at each.

        Returns
        -------
        phi : ndarray of shape (m, n_terms)
        target : ndarray of shape (m,)
            Decimated, without border, warm-up and standstill: m < n.

        Raises
        ------
        ValueError
            If the torque is zero throughout, or a record is too short for the filters.
        """
        target = checked_torque(y, len(X))  # type: ignore[arg-type]
        phi = self._fresh(X, y, groups)
        pieces = []
        for s in experiments(groups, len(phi)):
            late = causal_delay(target[s], np.empty(0), self.delay_)[0]
            path = np.asarray(X, dtype=float)[s, 0]
            speed = self._speed(path)
            if self._is_automatic:
                edge = min(int(self.sample_rate / self.cutoff_), late.size // 4)
                late = zero_phase(late, self.sample_rate, self.cutoff_, self.order)
                both = np.column_stack([speed, phi[s], late])[max(self.border, edge) : late.size - edge]
                both = both[:: self.decimate or max(round(self.sample_rate / (2.0 * self.cutoff_)), 1)]
            else:
                both = np.column_stack([speed, phi[s], late])[max(self.border, self.warmup_) :]
                both = both if self.causal else decimate(both, self.decimate or 1)
            pieces.append(both[np.abs(both[:, 0]) >= self._limit(path), 1:])
        both = np.concatenate(pieces)
        return both[:, :-1], both[:, -1]

    # -- streams --------------------------------------------------------------------------

    def partial_fit_transform(self, X: ArrayLike, y: ArrayLike | None = None, groups: ArrayLike | None = None) -> Array:
        """Columns of the next piece of a stream, continuing where the last piece ended; shape (n, n_terms).

        ``X``, ``y``, ``groups``: as for `transform`; a new label begins a new stream. Raises ValueError if the
        transformer is not causal, or an effect needs the whole record.
        """
        X = self._next_piece(X)
        drive = self._drive(X, y)
        return self._go_on(X, drive, drive, groups)[0]

    def partial_rows(self, X: ArrayLike, y: ArrayLike, groups: ArrayLike | None = None) -> tuple[Array, Array]:
        """Regression rows of the next piece of a stream, the torque delayed like the columns.

        Rows of the warm-up are dropped, so the first pieces may give no rows.

        ``X``, ``y``, ``groups``: as for `rows`; a new label begins a new stream.
        """
        X = self._next_piece(X)
        target = np.asarray(y, dtype=float).ravel()
        if len(target) != len(X) or not np.isfinite(target).all():
            raise ValueError(f"y must be {len(X)} finite torques; give one for each row of X.")
        memory = self._stream.path
        phi, late, warm = self._go_on(X, self._drive(X, target), target, groups)
        keep = ~warm
        if self.standstill:
            speeds = [
                causal_motion(X[s, 0], np.empty(0) if i else memory, self._kernels)[0].velocity
                for i, s in enumerate(experiments(groups, len(X)))
            ]
            keep &= np.abs(np.concatenate(speeds)) >= self.standstill
        return phi[keep], late[keep]

    def begin(self) -> None:
        """Begin a new experiment: the next row of a stream has no past."""
        self._stream = AT_START

    def get_state(self) -> dict[str, Any]:
        """The arrays and numbers that a stream needs to continue."""
        check_is_fitted(self, "terms_")
        return {"n_features_in": int(self.n_features_in_), "cutoff": float(self.cutoff_), **self._stream._asdict()}

    def set_state(self, state: dict[str, Any]) -> Self:
        """Continue from what `get_state` of a transformer with the same parameters returned.

        Parameters
        ----------
        state : dict

        Raises
        ------
        ValueError
            If the state is of another kind.
        """
        if not isinstance(state, dict) or not {"n_features_in", "cutoff", *RowState._fields} <= state.keys():
            raise ValueError("This is not a state of InverseDynamicsLags; give what get_state() returned.")
        path, drive, torque = (np.array(state[name], dtype=float) for name in ("path", "drive", "torque"))
        self._settle()
        self.n_features_in_ = int(state["n_features_in"])
        self.cutoff_ = float(state["cutoff"])
        self._stream = RowState(path, drive, torque, int(state["seen"]))
        return self

    def _go_on(
        self, X: Array, drive: Array, target: Array, groups: ArrayLike | None
    ) -> tuple[Array, Array, NDArray[np.bool_]]:
        """Columns, delayed torque and warm-up rows of a piece of the stream; a new group starts a new stream."""
        stream, out = self._stream, []
        for i, s in enumerate(experiments(groups, len(X))):
            stream = AT_START if i else stream
            warm = stream.seen + np.arange(s.stop - s.start) < self.warmup_
            phi, late, stream = self._advance(stream, X[s, 0], drive[s], target[s])
            out.append((phi, late, warm))
        self._stream = stream
        phis, lates, warms = zip(*out, strict=True)
        return np.concatenate(phis), np.concatenate(lates), np.concatenate(warms)

    def _advance(self, stream: RowState, path: Array, drive: Array, target: Array) -> tuple[Array, Array, RowState]:
        """Columns and delayed torque of the next piece, zeros in the warm-up, and the stream after it."""
        moved, past = causal_motion(path, stream.path, self._kernels)
        force, past_drive = causal_delay(drive, stream.drive, self.delay_)
        late, past_torque = causal_delay(target, stream.torque, self.delay_)
        time = (stream.seen - self.delay_ + np.arange(len(path))) / self.sample_rate
        phi = stack_columns(self.terms_, moved, force, time)
        phi[: max(self.warmup_ - stream.seen, 0)] = 0.0
        return phi, late, RowState(past, past_drive, past_torque, stream.seen + len(path))

    def _next_piece(self, X: ArrayLike) -> Array:
        """Check a piece of a stream; the first piece fixes the columns."""
        if not self.causal:
            raise ValueError(
                "A zero-phase filter needs the whole record; use causal=True for a stream, whose delay is then known."
            )
        terms = getattr(self, "terms_", None) or effect_terms(self.law, self.effects)
        whole = [t.name for t in terms if isinstance(t, PreslidingHysteresis) or t.column_kind == "first_order"]
        if whole:
            raise ValueError(f"{', '.join(whole)} needs the whole record; remove it from a stream's effects.")
        if not hasattr(self, "terms_"):
            self.fit(X)
        return validated(self, X)

    # -- answers --------------------------------------------------------------------------

    @property
    def max_lag(self) -> int:
        """Samples of the past that a row needs: a window for streams, a period of the cutoff for records."""
        cutoff = 0.1 * self.sample_rate if self.cutoff is None else float(self.cutoff)
        if not self.causal:
            cutoff = getattr(self, "cutoff_", cutoff)
            return round(self.sample_rate / cutoff)
        return (causal_window(self.sample_rate, cutoff, self.degree) if self.window is None else self.window) - 1

    @property
    def independent_share(self) -> float:
        """Share of `rows` that are independent after the filter: two per period of its cut-off."""
        check_is_fitted(self, "terms_")
        apart = self.sample_rate / (2.0 * self.cutoff_)
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
    def _is_automatic(self) -> bool:
        """Whether the cut-off follows from the record."""
        return self.cutoff is None and not self.causal

    def _settle(self) -> None:
        """Set up terms, filter and delay from the parameters."""
        if not self.sample_rate > 0:
            raise ValueError(f"sample_rate is {self.sample_rate}, expected a frequency above zero, in Hz.")
        terms = effect_terms(self.law, self.effects)
        cutoff = 0.1 * self.sample_rate if self.cutoff is None else float(self.cutoff)
        delay = 0
        if self.causal:
            window = causal_window(self.sample_rate, cutoff, self.degree) if self.window is None else self.window
            self._kernels = causal_kernels(self.sample_rate, window, self.degree)
            delay = (window - 1) // 2
        self.terms_, self.cutoff_, self.delay_, self.warmup_ = terms, cutoff, delay, 2 * delay
        self._stream = AT_START

    def _fresh(self, X: ArrayLike, y: ArrayLike | None, groups: ArrayLike | None) -> Array:
        """Fit, then compute columns from a clean start."""
        X = validated(self.fit(X, y), X)
        drive = self._drive(X, y)
        target = drive if y is None else np.asarray(y, dtype=float).ravel()
        phi, self._stream = self._columns(X, drive, target, groups)
        return phi

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
                phi, _, stream = self._advance(AT_START, X[s, 0], drive[s], target[s])
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

    def _speed(self, path: Array) -> Array:
        """Velocity of a record, as used in its columns."""
        if self.causal:
            return causal_motion(path, np.empty(0), self._kernels)[0].velocity
        return motion(path, self.sample_rate, self.cutoff_, self.order).velocity

    def _limit(self, path: Array) -> float:
        """Speed below which a row counts as standstill."""
        if self.standstill is not None:
            return float(self.standstill)
        if self.causal or any(isinstance(t, PreslidingHysteresis) for t in self.terms_):
            return 0.0
        return 5.0 * velocity_noise(path, self.sample_rate, self.cutoff_, self.order)
