"""From the log of an arm to a linear regression: drives = columns times (link parameters, motor inertia, effects).

A row is one joint at one instant.  Its columns are the rigid-body regressor and, for every axis, the acceleration (for
the motor's inertia) and the effects of the catalogue.  Columns that no motion can separate from others are merged
(`whsklearn.systems.base_parameters`).  An axis is a joint or a signed sum of joints: a gear that turns by
q5 + q6 has friction along that sum, and both joints supply the torque for it.
"""

from __future__ import annotations

import copy
import dataclasses
import warnings
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import minimum_filter1d
from sklearn.base import BaseEstimator, TransformerMixin
from sklearn.utils.validation import check_array, check_is_fitted, validate_data

from whsklearn._inputs import check_above_zero
from whsklearn.effects import InputOffset, PreslidingHysteresis
from whsklearn.effects.base import Array
from whsklearn.filtering.records import Motion, motion, motion_cutoff, velocity_noise, zero_phase
from whsklearn.filtering.streams import causal_cutoff, causal_delay, causal_kernels, causal_motion, causal_window
from whsklearn.lags.arm_rows import records_of, turning
from whsklearn.lags.axis_rows import (
    DRIVEN,
    NOISY,
    averaging,
    column_names,
    effect_terms,
    experiments,
    least_speed,
    period_of,
    rest_sums,
    sized_effects,
    stack_columns,
)
from whsklearn.models.files import as_arm
from whsklearn.systems._arm_kernels import N_BODY
from whsklearn.systems.arm import Arm, closed, direction_of
from whsklearn.systems.base_parameters import ROUNDING, BaseParameters, base_parameters

FINE = 5.0  # the motion passes a filter this many times wider than the columns, so that signs and products stay sharp
WIDEST = 0.2  # of the sampling rate, for that filter: beyond it the central difference is not a derivative
ROWS = 10.0  # least number of rows per weight in a record: a lower cut-off would leave fewer
FAST = 4.0  # the same without slow rows: half of a record, which tells the held-out error, has two for each weight
HIGHER = 1.25  # from one cut-off to the next, while it leaves fewer
# Periods of the cut-off omitted at each end.  Without noise, the filter's end causes an error of 12, 3, 0.7 and 0.1 %
# in successive half periods.
EDGE = 3
# Instants of random motion that show which columns to merge: the same for every law below 39 terms per joint,
# so that two laws of one robot keep the same parameters of its links.
DRAWN = 200
AT_ONCE = 128  # samples of links, or columns behind the filter: of all, each step would hold a copy (GB for 20 joints)


class ArmRowState(NamedTuple):
    """State of a causal transformer: last samples, and how many came before.

    ``path`` (some, n_joints), ``drive`` (some, 2 n_joints): as logged, drives as columns take them and as the target.
    ``signals`` (some, 5 n_joints): motion and drives that the next average needs. ``sums`` (n_joints, 3): `rest_sums`.
    """

    path: Any
    drive: Any
    signals: Any
    sums: Any
    seen: int


class RigidBodyLags(TransformerMixin, BaseEstimator):
    """Columns of the inverse dynamics of an arm, from the measured positions of its joints.

    Parameters
    ----------
    robot : Arm, or path of a URDF, MJCF or model file
        The kinematics; its masses are not used.
    sample_rate : float, default=1000.0
        Sampling rate of the log, in Hz.
    law : str, FrictionLaw or iterable of effects, default="viscous,coulomb"
        Friction terms of every joint.
    effects : str, iterable or mapping of these, default="input_offset"
        Further effects of every joint. A mapping gives them by axis: the name of a joint, or a sum such as
        ``"wrist+hand"``; they are then added to the law of that axis only.
    cutoff : float, optional
        Cut-off of the filter on both drives and columns, in Hz; positions pass a filter five times wider.  The default
        is the median of what the joints' noise allows (`motion_cutoff`), but high enough to leave ten rows per weight,
        four without the slow ones.
        For streams it is a tenth of the sampling rate and at most 100 Hz, on positions only.
    slow : float, default=0.08
        Share of a joint's rms speed below which its rows are dropped, because near rest friction
        equals whatever drive is applied.  In MuJoCo, with nothing hidden, this reduced the error from between 0.6 and
        6 % to between 0.1 and 0.7 %.
    weights : array-like of shape (n_joints,), optional
        Weights of the joints' errors, 1 / standard deviation.  For records, the default follows from the residual of
        each joint's rows when they are fitted alone; for streams it is 1.
    causal : bool, default=False
        False is for whole records.  True is for streams; a row then holds the values from ``delay_`` samples earlier.
    degree : int, default=4
        Degree of the polynomial over the moving window of a stream.
    reversals : mapping of str to (float, float), optional
        For each axis, the speed s (rad/s) over which dry friction reverses, and the time T (s) by which it does so
        ahead of the velocity v: its sign is tanh((v + T a) / s) with the acceleration a, or that of v for an axis that
        is not listed.  Real friction lags (T < 0, the frictional memory of Armstrong-Helouvry et al. 1994); that of
        MuJoCo leads by half of the time constant of its ``solreffriction``, 10 ms by default.

    Attributes
    ----------
    arm_ : Arm
    axes_ : dict of str to (ndarray of shape (n_joints,), tuple of effects)
        For each axis, its direction over the joints and its effects, those of the law first.
    base_ : BaseParameters
        The columns that are kept, and those that are merged into each.
    cutoff_ : float
        In Hz.
    weights_ : ndarray of shape (n_joints,)
        The weights in use.
    delay_, warmup_ : int
        Samples by which a row of a stream lags, and rows of zeros at its beginning; 0 for records.
    every_ : int
        Samples from one row of a record to the next: two rows per period of the cut-off, because more would not be
        independent.
    spacing : int
        Samples from one row of a stream to the next, a period of the cut-off.

    Notes
    -----
    X holds the positions (n, n_joints), or positions and measured drives (n, 2 n_joints) if an effect such as
    ``load_friction`` is a function of the drive. y holds the drives (n, n_joints); units are rad and Nm, or m and N
    for a prismatic joint.

    References
    ----------
    Atkeson, An and Hollerbach 1986, Int. J. Robotics Research 5(3), 101-119; Gautier and Khalil 1990, Direct
    calculation of minimum set of inertial parameters, IEEE Trans. Robotics and Automation 6(3), 368-373; Khalil and
    Dombre 2002, Modeling, Identification and Control of Robots, ch. 12, on filtering.

    Examples
    --------
    >>> import numpy as np
    >>> from whsklearn import Arm, RigidBodyLags, RLSRegressor
    >>> arm = Arm.from_dh([(0.3, 0, 0, 0), (0, 0, 0, 0)], gravity=(0, -9.81, 0), joints=("shoulder", "elbow"))
    >>> arm = arm.with_body("shoulder", 2.0, [0.15, 0, 0], 0.02 * np.eye(3)).with_body("elbow", 1.0, [0.1, 0, 0])
    >>> t = np.arange(8000)[:, None] / 1000
    >>> q, v, a = (np.sin(t * [3, 5]), np.cos(t * [3, 5]) * [3, 5], -np.sin(t * [3, 5]) * [9, 25])
    >>> model = RLSRegressor(RigidBodyLags(arm)).fit(q, arm.inverse_dynamics(q, v, a))
    >>> round(model.parameters_["elbow.mx"], 3), round(model.parameters_["shoulder.mx"], 3)  # 2 x 0.15 + 1 x 0.3
    (0.1, 0.6)
    >>> model.lags_.base_.merged["shoulder.mx"]
    {'elbow.m': 0.3}
    """

    multi_output = True
    _stream: ArmRowState

    def __init__(
        self,
        robot: Any = None,
        sample_rate: float = 1000.0,
        law: Any = "viscous,coulomb",
        effects: Any = "input_offset",
        cutoff: float | None = None,
        slow: float = 0.08,
        weights: ArrayLike | None = None,
        causal: bool = False,
        degree: int = 4,
        reversals: Mapping[str, tuple[float, float]] | None = None,
    ):
        self.robot = robot
        self.sample_rate = sample_rate
        self.law = law
        self.effects = effects
        self.cutoff = cutoff
        self.slow = slow
        self.weights = weights
        self.causal = causal
        self.degree = degree
        self.reversals = reversals

    @classmethod
    def of_arm(cls, arm: Arm, sample_rate: float, law: Any = None, **settings: Any) -> Self:
        """Columns with an arm's own effects as the law: those at its joints and an offset, or ``law`` if given.

        A link moves with its motor, as in `Arm.inverse_dynamics`.
        ``sample_rate``: in Hz. ``law``: friction of every joint of the ``arm``; viscous and Coulomb friction if it has
        no effects. ``**settings``: further parameters.
        """
        if law is not None or not (any(arm.effects) or arm.sums):
            return cls(arm, sample_rate, **({} if law is None else {"law": law}), **settings)
        offset = InputOffset()
        own = {
            joint: (*closed(row), *(() if any(e.name == offset.name for e in row) else (offset,)))
            for joint, row in zip(arm.joints, arm.effects, strict=True)
        }
        return cls(arm, sample_rate, law=(), effects=own | arm.sums, **settings)

    def fit(self, X: ArrayLike, y: ArrayLike | None = None) -> Self:
        """Set up columns, filter and delay; nothing is estimated here.

        ``X`` (n, n_joints) or (n, 2 n_joints): positions, and drives. ``y``: not used. Raises ValueError if a setting
        is invalid, or if the columns of X do not match the robot's joints.
        """
        width = check_array(X, dtype=np.float64).shape[1]
        self._settle()
        n = self.arm_.n_joints
        if width not in (n, 2 * n):
            raise ValueError(
                f"X has {width} columns, expected a position for each of {', '.join(self.arm_.joints)}, in that order"
                f"{', and their drives after them' if n > 1 else ''}; select those, or name fewer joints of the robot."
            )
        X = np.asarray(validate_data(self, X, dtype=np.float64, reset=True))
        if self.cutoff is None and not self.causal:
            self._set_cutoff(self._cutoff_of(X[:, :n], len(X)))
        return self

    def transform(self, X: ArrayLike, y: ArrayLike | None = None, groups: ArrayLike | None = None) -> Array:
        """Columns of records, from a clean start; shape (n, n_joints, n_columns).

        ``X`` (n, n_joints) or (n, 2 n_joints): positions, and drives. ``y`` (n, n_joints): drives, if X does not
        contain them. ``groups`` (n,): marks experiments; filters restart at each.
        """
        check_is_fitted(self, "base_")
        X = np.asarray(validate_data(self, X, dtype=np.float64, reset=False))
        drive = self._drive(X, y)
        pieces = []
        for s in experiments(groups, len(X)):
            if self.causal:
                moved, force, _, _ = self._advance(self._at_start(), X[s], drive[s], drive[s])
                time = (np.arange(len(X[s])) - self.delay_) / self.sample_rate
                phi = self.columns(moved, force, time)
                phi[: self.warmup_] = 0.0
                pieces.append(phi)
            else:
                pieces.append(self._filtered(self._columns_along(X[s], drive[s])[0]))
        return np.concatenate(pieces)

    def rows(self, X: ArrayLike, y: ArrayLike, groups: ArrayLike | None = None) -> tuple[Array, Array]:
        """Regression rows of records, weighted by joint, from a clean start.

        ``X`` (n, n_joints) or (n, 2 n_joints): positions, and drives. ``y`` (n, n_joints): drives, with the same
        positive direction as the positions. ``groups`` (n,): marks experiments. Returns ``phi`` (m, n_columns) and
        ``target`` (m,), joint by joint at each instant, without the filter's ends and without slow joints. Raises
        ValueError if a drive is zero throughout, or a record is too short.
        """
        phi, target, keep = self.joint_rows(X, y, groups)
        self.weights_ = self.joint_weights(phi, target, keep)
        return (phi * self.weights_[:, None])[keep], (target * self.weights_)[keep]

    def joint_rows(
        self, X: ArrayLike, y: ArrayLike, groups: ArrayLike | None = None
    ) -> tuple[Array, Array, NDArray[np.bool_]]:
        """Unweighted rows (m, n_joints, n_columns), drives (m, n_joints), and which of them count.

        ``X``, ``y``, ``groups``: as for `rows`.
        """
        if not self.causal:
            found = records_of(self, X, y, groups)
            return found.phi, found.target, found.keep
        X = np.asarray(check_array(X, dtype=np.float64))
        self.fit(X)
        target = self._checked_drives(y, len(X))
        drive, start = self._drive(X, target), self._at_start()
        pieces = [self._averages(start, X[s], drive[s], target[s])[:3] for s in experiments(groups, len(X))]
        phi, late, keep = (np.concatenate(parts) for parts in zip(*pieces, strict=True))
        return phi, late, keep

    def columns(self, moved: Motion, drive: Array, time: Array) -> Array:
        """Columns of a motion as it is, without any filter, (n, n_joints, n_columns).

        ``moved``: position, velocity and acceleration, (n, n_joints) each. ``drive`` (n, n_joints): for effects that
        depend on it. ``time`` (n,): in s.
        """
        kept, n = self.base_.kept, self.arm_.n_joints
        out = np.zeros((len(time), n, kept.size))
        if not len(time):
            return out
        at = N_BODY * n  # the links, without a memory, by parts
        for i in range(0, len(time), AT_ONCE):
            s = slice(i, i + AT_ONCE)
            out[s][:, :, kept < at] = self.arm_.regressor(*(x[s] for x in moved))[:, :, kept[kept < at]]
        for block in self._axis_columns(moved, drive, time):
            here = (at <= kept) & (kept < at + block.shape[2])
            out[:, :, here] = block[:, :, kept[here] - at]
            at += block.shape[2]
        return out

    def joint_weights(self, phi: Array, target: Array, keep: NDArray[np.bool_]) -> Array:
        """1 / standard deviation of the residual of each joint's rows, fitted alone; or the given weights.

        ``phi``, ``target``, ``keep``: as `joint_rows` makes them. Returns (n_joints,).
        """
        if self.weights is not None or self.causal:
            return self.weights_
        out = np.ones(self.arm_.n_joints)
        for j in range(out.size):
            own, drive = phi[keep[:, j], j], target[keep[:, j], j]
            own = own[:, np.any(own != 0.0, axis=0)]
            if len(own) > 2 * own.shape[1]:
                scaled = own / np.linalg.norm(own, axis=0)
                left = drive - scaled @ np.linalg.lstsq(scaled, drive, rcond=1e-9)[0]
                out[j] = float(np.sqrt(left @ left / (len(own) - own.shape[1])))
            elif len(own):
                out[j] = float(np.std(drive))
        smallest = 1e-9 * max(float(np.abs(target).max()), 1e-300)
        return 1.0 / np.maximum(out, smallest)

    def _filtered(self, signals: Array) -> Array:
        """Signals (n, ...) of a record, filtered like the columns."""
        flat = zero_phase(signals.reshape(len(signals), -1), self.sample_rate, self.cutoff_)
        return flat.reshape(signals.shape)

    def _moved(self, X: Array) -> Motion:
        """Motion of a record behind the finer filter, (n, n_joints) each; the gap of an arm asks for it, too."""
        each = [motion(x, self.sample_rate, self._fine) for x in X[:, : self.arm_.n_joints].T]
        return Motion(*(np.column_stack(signals) for signals in zip(*each, strict=True)))

    # -- streams --------------------------------------------------------------------------

    def partial_rows(self, X: ArrayLike, y: ArrayLike, groups: ArrayLike | None = None) -> tuple[Array, Array]:
        """Rows of the next piece of a stream: averages of columns and drives, a period of the cut-off apart.

        The average is the same for both, so it takes no parameter from its value, and it is what keeps the noise of the
        encoders out of the inertias. A joint that rests or turns within it has a row of zeros, which teaches nothing.
        There are none during the warm-up.

        ``X``, ``y`` (n, n_joints): positions and drives. ``groups`` (n,): a new label begins a new stream. Raises
        ValueError if the transformer is not causal.
        """
        if not self.causal:
            raise ValueError(
                "A zero-phase filter needs the whole record; use causal=True for a stream, whose delay is then known."
            )
        if not hasattr(self, "base_"):
            self.fit(X)
            if any(isinstance(t, PreslidingHysteresis) or t.column_kind == "first_order" for t in self._all_terms()):
                raise ValueError("An effect needs the whole record; remove hysteresis and delays for a stream.")
        X = np.asarray(X, dtype=float)  # full validation would double the time of a sample
        if X.ndim != 2 or X.shape[1] != self.n_features_in_ or not np.isfinite(X).all():
            raise ValueError(f"X has shape {X.shape}, expected (n, {self.n_features_in_}) finite numbers.")
        target = self._checked_drives(y, len(X), moving=False)
        drive, out = self._drive(X, target), []
        for i, s in enumerate(experiments(groups, len(X))):
            stream = self._at_start() if i else self._stream
            phi, late, keep, self._stream = self._averages(stream, X[s], drive[s], target[s])
            weights = np.where(keep, self.weights_, 0.0)
            out.append((phi * weights[..., None], late * weights))
        phis, lates = zip(*out, strict=True)
        phi = np.concatenate(phis)
        return phi.reshape(-1, phi.shape[-1]), np.concatenate(lates).ravel()

    def begin(self) -> None:
        """Begin a new experiment: the next row of a stream has no past."""
        self._stream = self._at_start()

    def get_state(self) -> dict[str, Any]:
        """The arrays and numbers that a stream needs to continue."""
        check_is_fitted(self, "base_")
        held = {"n_features_in": int(self.n_features_in_), "cutoff": float(self.cutoff_), "weights": self.weights_}
        return {**held, **self._stream._asdict()}

    def set_state(self, state: dict[str, Any]) -> Self:
        """Continue from a ``state`` that `get_state` of a transformer with the same parameters returned.

        Raises ValueError if it is of another kind.
        """
        if (
            not isinstance(state, dict)
            or not {"n_features_in", "cutoff", "weights", *ArmRowState._fields} <= state.keys()
        ):
            raise ValueError("This is not a state of RigidBodyLags; give what get_state() returned.")
        self._settle()
        self.n_features_in_ = int(state["n_features_in"])
        self._set_cutoff(float(state["cutoff"]))
        self.weights_ = np.array(state["weights"], dtype=float)
        kept = {name: np.array(state[name], dtype=float) for name in ArmRowState._fields if name != "seen"}
        self._stream = ArmRowState(**kept, seen=int(state["seen"]))
        return self

    # -- answers ----------------------------------------------------------------------------

    def get_feature_names_out(self, input_features: Any = None) -> NDArray[np.object_]:
        """Names of the columns kept, such as ``elbow.mx``, ``elbow.armature``, ``elbow.coulomb``.

        ``input_features``: not used; present for scikit-learn compatibility.
        """
        check_is_fitted(self, "base_")
        return np.array(self.base_.names, dtype=object)

    def interpret(
        self,
        theta: ArrayLike,
        covariance: ArrayLike | None = None,
        *,
        physical: bool = True,
        motors: Mapping[str, float] | None = None,
    ) -> Arm:
        """The arm with these weights: physically consistent links close to the file's, motor inertias and effects.

        ``theta`` (n_columns,): the weights. ``covariance`` (n_columns, n_columns): weights the deviations when links
        are made physically consistent. ``physical``: False keeps exactly these weights, whether or not a real body can
        have such parameters; the motion is the same. ``motors``: inertias of motors that are known, if physical.
        """
        check_is_fitted(self, "base_")
        theta = np.asarray(theta, dtype=float)
        full = np.zeros(self.base_.mapping.shape[1])
        full[self.base_.kept] = theta
        n = self.arm_.n_joints
        sums = [a for a in self.axes_ if a not in self.arm_.joints]
        bare = dataclasses.replace(self.arm_, effects=[()] * n, sums={}, sum_armature={})
        effects, at = {}, (N_BODY + 1) * n
        if physical:
            arm = bare.consistent(self.base_, theta, covariance, motors)
            full[self.base_.kept] = self._beside(arm, theta, covariance)
        else:
            links, armature = full[: N_BODY * n].reshape(n, N_BODY), full[N_BODY * n : at]
            arm = dataclasses.replace(bare, inertial=links, armature=armature)
        turned = np.maximum(full[at : at + len(sums)], 0.0) if physical else full[at : at + len(sums)]
        arm = dataclasses.replace(arm, sum_armature=dict(zip(sums, turned.tolist(), strict=True)))
        at += len(sums)
        for axis in (a for group in self._groups for a in group):
            terms = self.axes_[axis][1]
            width = sum(len(t.coefficients) for t in terms)
            effects[axis] = sized_effects(terms, full[at : at + width])
            at += width
        return arm.with_effects(effects)

    def weights_of(self, arm: Arm) -> Array:
        """Weights (n_columns,) of the columns for an arm's links, motors and effects: the inverse of `interpret`.

        ``arm``: with the same joints; only effects with the shapes set here count.
        """
        check_is_fitted(self, "base_")
        sums = [arm.sum_armature.get(a, 0.0) for a in self.axes_ if a not in arm.joints]
        parts, acting = [arm.inertial.ravel(), arm.armature, sums], dict(zip(arm.joints, arm.effects, strict=True))
        for axis in (a for group in self._groups for a in group):
            there = list((acting | arm.sums).get(axis, ()))
            for term in self.axes_[axis][1]:
                given = next((e for e in there if e.name == term.name), None)
                there = [e for e in there if e is not given]
                parts.append(np.zeros(len(term.coefficients)) if given is None else np.asarray(given.coefficients))
        numbers = np.concatenate(parts)
        out, size = self.base_.mapping @ numbers, np.abs(self.base_.mapping) @ np.abs(numbers)
        return np.where(np.abs(out) > ROUNDING * size, out, 0.0)

    def _beside(self, arm: Arm, theta: Array, covariance: ArrayLike | None) -> Array:
        """Expected values of the other weights given the links of ``arm``, such as an offset if a link is lighter.

        Negative friction would drive the arm, so it is set to zero, and the remaining weights follow from that.
        """
        full = np.zeros(self.base_.mapping.shape[1])
        full[: (N_BODY + 1) * arm.n_joints] = np.concatenate([arm.inertial.ravel(), arm.armature])
        held = self.base_.kept < (N_BODY + 1) * arm.n_joints
        fixed = np.where(held, self.base_.mapping @ full, theta)
        physical = {t.name for t in self._all_terms() if len(t.coefficients) == 1 and t.quantities[t.size].positive}
        losses = np.array([name.rpartition(".")[2] in physical for name in self.base_.names]) & ~held
        c = np.eye(len(theta)) if covariance is None else np.asarray(covariance, dtype=float)
        while True:
            out = fixed.copy()
            out[~held] += c[np.ix_(~held, held)] @ np.linalg.solve(c[np.ix_(held, held)], (fixed - theta)[held])
            below = losses & ~held & (out < 0.0)
            if not below.any():
                return out
            held |= below
            fixed[below] = 0.0

    # -- inside -----------------------------------------------------------------------------

    def __deepcopy__(self, memo: Any) -> Self:
        """A shallow copy, made at each row of a stream: everything held is replaced, never changed in place."""
        return copy.copy(self)

    def _settle(self) -> None:
        """Set up arm, axes, columns, filter and delay from the parameters."""
        check_above_zero("sample_rate", self.sample_rate, ", in Hz")
        if self.robot is None:
            raise ValueError("robot is None, expected an Arm or the path of a URDF or MJCF file.")
        made_of = (id(self.robot), str(self.law), str(self.effects))
        if getattr(self, "_made_of", None) != made_of:
            self.arm_ = as_arm(self.robot)
            self.axes_ = axes_of(self.arm_, self.law, self.effects)
            self._groups = groups_of(self.axes_)
            self.base_ = self._structural_base()
            self._made_of = made_of
        n, self.delay_ = self.arm_.n_joints, 0
        widest = causal_cutoff(self.sample_rate) if self.causal else 0.1 * self.sample_rate
        self._set_cutoff(widest if self.cutoff is None else float(self.cutoff))
        if self.causal:
            window = causal_window(self.sample_rate, self.cutoff_, self.degree)
            self._kernels = causal_kernels(self.sample_rate, window, self.degree)
            self.spacing = period_of(self.sample_rate, self.cutoff_)
            self._taps = averaging(self.spacing)
            self.delay_ = (window - 1) // 2
        self.warmup_ = 2 * self.delay_
        given = np.ones(n) if self.weights is None else np.asarray(self.weights, dtype=float)
        if given.shape != (n,) or not (given > 0).all():
            raise ValueError(f"weights has shape {given.shape}, expected ({n},) numbers above zero, one per joint.")
        self.weights_, self._stream = given, self._at_start()

    def _set_cutoff(self, hertz: float) -> None:
        self.cutoff_, self.every_ = hertz, max(round(0.5 * self.sample_rate / hertz), 1)

    def _all_terms(self) -> list[Any]:
        return [t for _, terms in self.axes_.values() for t in terms]

    def _at_start(self) -> ArmRowState:
        n = self.arm_.n_joints
        return ArmRowState(np.empty((0, n)), np.empty((0, 2 * n)), np.empty((0, 5 * n)), np.zeros((n, 3)), 0)

    def _structural_base(self) -> BaseParameters:
        """The base parameters: which columns no motion can separate from those before them."""
        names = [*self.arm_.number_names, *(f"{j}.armature" for j in self.axes_)]
        names += [f"{a}.{n}" for group in self._groups for a in group for n in column_names(self.axes_[a][1])]
        q, v, a = self.arm_.drawn_motion(max(4 * len(names) // self.arm_.n_joints, DRAWN))
        drive = np.random.default_rng(1).normal(size=q.shape)
        others = self._axis_columns(Motion(q, v, a), drive, np.arange(len(q)) / self.sample_rate)
        columns = np.concatenate([self.arm_.regressor(q, v, a), *others], axis=2)
        links = self.arm_.n_joints
        groups = [N_BODY] * links + [1] * (len(names) - N_BODY * links)
        return base_parameters(columns.reshape(-1, len(names)), names, groups)

    def _axis_columns(self, moved: Motion, drive: Array, time: Array) -> Iterator[Array]:
        """All columns but those of the links, block by block, (n, n_joints, some) each."""
        n, length = self.arm_.n_joints, len(time)
        directions = np.array([d for d, _ in self.axes_.values()])
        yield directions.T * (moved.acceleration @ directions.T)[:, None, :]
        for group in self._groups:
            d = np.array([self.axes_[a][0] for a in group])
            along = Motion(*((x @ d.T).T.ravel() for x in moved))
            given = (drive @ d.T).T.ravel(), np.tile(time, len(group)), turning(self.reversals, group, along)
            each = stack_columns(self.axes_[group[0]][1], along, *given)[:, 1:].reshape(len(group), length, -1)
            yield np.einsum("kj,ktw->tjkw", d, each).reshape(length, n, -1)

    def drives(self, moved: Motion, smooth: Array, theta: Array) -> Array:
        """Drives of one record for these weights, (n, n_joints); those of the links without their columns.

        ``moved``: behind the finer filter, (n, n_joints) each. ``smooth`` (n, n_joints): the measured drives behind it,
        for effects that depend on them. ``theta`` (n_columns,): the weights.
        """
        n, at = self.arm_.n_joints, N_BODY * self.arm_.n_joints
        full = np.zeros(self.base_.mapping.shape[1])
        full[self.base_.kept] = theta
        links = full[:at].reshape(n, N_BODY)
        bare = dataclasses.replace(self.arm_, inertial=links, armature=None, effects=(), sums={}, sum_armature={})
        out = bare.inverse_dynamics(*moved)
        for block in self._axis_columns(moved, smooth, np.arange(len(out)) / self.sample_rate):
            out += block @ full[at : (at := at + block.shape[2])]
        return out

    def samples_of(self, length: int) -> NDArray[np.int64]:
        """Indices of the samples that give rows: two per period of the cut-off, without the ends of the filter.

        ``length``: samples of the record.
        """
        period = max(int(self.sample_rate / self.cutoff_), 1)
        edge = min(EDGE * period, length // 4)
        return np.arange(edge, length - edge, self.every_)

    @property
    def _fine(self) -> float:
        """Cut-off of the motion (Hz)."""
        return min(FINE * self.cutoff_, WIDEST * self.sample_rate)

    def _columns_along(self, X: Array, drive: Array) -> tuple[Array, Motion]:
        """Columns of one record before the filter, and its motion behind the finer one, (n, n_joints) each."""
        moved, rate = self._moved(X), self.sample_rate
        return self.columns(moved, zero_phase(drive, rate, self._fine), np.arange(len(X)) / rate), moved

    def _seen(self, columns: Array, moved: Motion, target: Array, limits: Array) -> tuple[Any, ...]:
        """Rows of one record, two per period of the cut-off, without the filter's ends; and where joints are fast."""
        keep = self._fast(moved.velocity, limits, self.cutoff_)
        kept = self.samples_of(len(target))
        flat = columns.reshape(len(columns), -1)
        parts = [self._filtered(flat[:, i : i + AT_ONCE])[kept] for i in range(0, flat.shape[1], AT_ONCE)]
        phi = np.concatenate(parts, axis=1).reshape(len(kept), *columns.shape[1:])
        return phi, self._filtered(target)[kept], keep[kept]

    def _limits(self, X: Array, velocity: Array) -> Array:
        """Speed of each joint below which its rows are excluded, (n_joints,); infinite if it does not move.

        ``velocity`` is that of all experiments, and ``X`` the positions of one, for the noise of their encoders.
        """
        speeds = np.sqrt(np.mean(velocity**2, axis=0))
        noise = np.array([velocity_noise(x, self.sample_rate, self._fine) for x in X.T])
        still = speeds <= NOISY * noise
        if still.all():
            raise ValueError("No joint moves more than its encoder's noise; record a motion, or check the columns.")
        if still.any():
            names = ", ".join(j for j, at_rest in zip(self.arm_.joints, still, strict=True) if at_rest)
            warnings.warn(
                f"{names} does not move, so its friction cannot be identified and its rows are not used.", UserWarning,
                stacklevel=6,
            )  # fmt: skip
        return np.where(still, np.inf, self.slow * speeds)

    def _advance(
        self, stream: ArmRowState, X: Array, drive: Array, target: Array
    ) -> tuple[Motion, Array, Array, ArmRowState]:
        """Motion, and drives as late as it is, of the next piece of a stream, and the stream after it.

        The drives come twice, as the columns take them and as the target; either is (n, n_joints).
        """
        parts = [causal_motion(x, m, self._kernels) for x, m in zip(X.T, stream.path.T, strict=True)]
        late, past = causal_delay(np.hstack([drive, target]), stream.drive, self.delay_)
        paths = np.array([p[1] for p in parts]).T
        moved = Motion(*np.array([p[0] for p in parts]).transpose(1, 2, 0))
        force, target = np.hsplit(late, 2)
        return moved, force, target, stream._replace(path=paths, drive=past, seen=stream.seen + len(X))

    def _averages(
        self, stream: ArmRowState, X: Array, drive: Array, target: Array
    ) -> tuple[Array, Array, NDArray[np.bool_], ArmRowState]:
        """Averaged columns (m, n_joints, n_columns) and drives (m, n_joints), joints that move, and the stream."""
        n, window = self.arm_.n_joints, self._taps.size
        moved, force, late, after = self._advance(stream, X, drive, target)
        count = stream.seen + np.arange(len(X))
        raw = np.concatenate([stream.path, X])
        middle = raw[np.maximum(len(stream.path) + np.arange(len(X)) - self.delay_, 0)]
        warm = count < self.warmup_
        sums = rest_sums(moved, middle, stream.sums, warm)
        signals = np.concatenate([stream.signals, np.hstack([*moved, force, late])])
        after = after._replace(signals=signals[max(len(signals) - window + 1, 0) :].copy(), sums=sums[-1])
        at = np.flatnonzero((count >= self.warmup_ + window - 1) & (count % self.spacing == 0))
        phi, drives = np.empty((at.size, n, self.base_.kept.size)), np.empty((at.size, n))
        keep = np.empty((at.size, n), dtype=bool)
        # window by window, so that no cutting of a stream changes a bit
        for row, k in enumerate(at):
            end = k + len(signals) - len(X)
            q, v, a, u, y = np.hsplit(signals[end - window + 1 : end + 1], 5)
            time = (count[k] - self.delay_ - np.arange(window)[::-1]) / self.sample_rate
            phi[row] = np.tensordot(self._taps, self.columns(Motion(q, v, a), u, time), 1)
            drives[row] = self._taps @ y
            keep[row] = np.abs(v).min(axis=0) > least_speed(sums[k], self._kernels, self.slow)
        return phi, drives, keep, after

    def _cutoff_of(self, paths: Array, length: int) -> float:
        """The median of the cut-offs that the joints' noise allows, but high enough to leave enough rows."""
        moving = [motion_cutoff(x, self.sample_rate) for x in paths.T if len(x) > 64 and np.ptp(x) > 0.0]
        if not moving:
            return self.cutoff_
        seconds, highest = length / self.sample_rate, 0.1 * self.sample_rate
        weights = len(self.base_.kept) / self.arm_.n_joints
        cutoff = min(max(float(np.median(moving)), 0.5 * ROWS * weights / seconds), highest)
        while cutoff < highest and 2.0 * cutoff * seconds * self._share_of_rows(paths, cutoff) < FAST * weights:
            cutoff = min(HIGHER * cutoff, highest)
        return cutoff

    def _share_of_rows(self, paths: Array, cutoff: float) -> float:
        """The share of a record's rows that count with this cut-off, in the median of the joints that move.

        A lower one leaves fewer for two reasons: it has fewer rows, and widens each reversal by more.
        """
        fine, speeds = min(FINE * cutoff, WIDEST * self.sample_rate), []
        for x in (x for x in paths.T if np.ptp(x) > 0.0):
            v = motion(x, self.sample_rate, fine).velocity
            speeds.append(np.abs(v) / max(float(np.sqrt(np.mean(v**2))), 1e-300))
        keep = self._fast(np.column_stack(speeds), np.full(len(speeds), self.slow), cutoff)
        return float(np.median(keep.mean(axis=0)))

    def _fast(self, velocity: Array, limits: Array, cutoff: float) -> NDArray[np.bool_]:
        """Where joints are fast within the filter's length, (n, n_joints)."""
        keep = np.abs(velocity) >= limits
        if self.slow:
            period = max(int(self.sample_rate / cutoff), 1)
            keep = minimum_filter1d(keep.astype(np.uint8), period + 1, axis=0).astype(bool)
        return keep

    def _drive(self, X: Array, y: ArrayLike | None) -> Array:
        """Drives for the columns that need them: the last columns of X, or y, or zeros if no column needs them."""
        n = self.arm_.n_joints
        if X.shape[1] == 2 * n:
            return X[:, n:]
        if y is not None:
            return np.asarray(y, dtype=float).reshape(len(X), n)
        needing = {t.name for t in self._all_terms() if t.name in DRIVEN}
        if needing:
            raise ValueError(f"{', '.join(sorted(needing))} is a function of the drive; add the drives to X.")
        return np.zeros((len(X), n))

    def _checked_drives(self, y: ArrayLike, length: int, *, moving: bool = True) -> Array:
        """The target as an array; raises an error that says what is wrong with it."""
        target = np.asarray(y, dtype=float)
        n = self.arm_.n_joints
        if target.ndim == 1 and n == 1:
            target = target[:, None]
        if target.shape != (length, n):
            raise ValueError(f"y has shape {target.shape}, expected ({length}, {n}): the drives of all joints.")
        if not np.isfinite(target).all():
            raise ValueError("y holds values that are not finite; fill or cut those rows first.")
        if moving and not target.any(axis=0).all():
            name = self.arm_.joints[int(np.argmin(target.any(axis=0)))]
            raise ValueError(f"The drive of {name} is zero throughout; check its column, or omit the joint.")
        return target


def axes_of(arm: Arm, law: Any, effects: Any) -> dict[str, tuple[Array, tuple[Any, ...]]]:
    """For each axis by name: its direction over the joints (n_joints,), and its effects, those of the law first."""
    by_axis: Mapping[str, Any] = effects if isinstance(effects, dict) else dict.fromkeys(arm.joints, effects)
    laws = dict.fromkeys(arm.joints, law)
    return {
        name: (direction_of(arm.joints, name), effect_terms(laws.get(name, ()), by_axis.get(name, "")))
        for name in {**laws, **by_axis}
    }


def groups_of(axes: Mapping[str, tuple[Array, tuple[Any, ...]]]) -> list[list[str]]:
    """Groups of axes with the same memoryless effects, so that one call computes each group."""
    out: list[list[str]] = []
    for name, (_, terms) in axes.items():
        alike = [g for g in out if axes[g[0]][1] == terms]
        if alike and all(t.column_kind == "exact" and not isinstance(t, PreslidingHysteresis) for t in terms):
            alike[0].append(name)
        else:
            out.append([name])
    return out
