"""One record of an arm filtered by `RigidBodyLags`: rows ordered by joint, and the residual of a model there.

The fit is linear in all sizes and weights every joint by its residual.  The effect of chance is taken from records
simulated with the fitted arm: the drives that it needs along the measured motion, read through the same encoders and
filters, plus noise with the colour of the unexplained part, joint by joint.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from whsklearn.effects import Coulomb, Effect, Scales, Viscous, codes
from whsklearn.effects.base import rms
from whsklearn.effects.transmission import contact_damping, contact_stiffness
from whsklearn.filtering import Motion
from whsklearn.filtering.records import encoder_noise
from whsklearn.gap.calibration import N_NULL, N_OWN, coloured, n_effective, null_rows, smoothed_power
from whsklearn.gap.plant import WithTerms
from whsklearn.gap.plants.arm_terms import NOTHING, AtJoint, JointInertia, JointTerm, Load, Weight, completed
from whsklearn.gap.plants.servo_candidates import ColumnSignals
from whsklearn.gap.plants.servo_two_mass import fine_steps, pushed
from whsklearn.gap.record import MAD, OUTLYING, Array, Segmented, white_noise
from whsklearn.identification.drive_lead import OLDEST
from whsklearn.identification.joint_least_squares import SAME, Known, held_out
from whsklearn.identification.payload import MASS
from whsklearn.lags.arm_rows import ArmRows, records_of, turning
from whsklearn.lags.axis_rows import DRY
from whsklearn.lags.rigid_body import RigidBodyLags
from whsklearn.logs.check import lattice
from whsklearn.systems._arm_kernels import N_BODY
from whsklearn.systems.arm import Arm
from whsklearn.systems.arm_files import STANDARD_GRAVITY, body_numbers

LATEST = 2.0  # samples: up to this age of a drive it is bookkeeping, beyond it a delay
# At rest, dry friction may have any value between both signs, and the model uses one of them: it is off by up to twice
# its size.
HELD = 2.0
WIDER = 1.5  # ratio of the speeds whose difference stands for a change of one
FINER = 4  # times the steps of a load on a spring: one step too late, an impact left 18 % of a drive for 10
LIGHTEST = 0.05  # of a joint's inertia at zero: what is behind a play, wherever its arm is


@dataclass(frozen=True)
class ArmState(WithTerms):
    """Base numbers, ages of the drives, and terms; the first ``n_base`` are the plays that the base model has.

    >>> from whsklearn.effects import Coulomb
    >>> bare = ArmState(np.array([0.05, 0.1]), np.zeros(1))
    >>> grown = bare.with_term(JointTerm(AtJoint(Coulomb, "hip", (1.0,)), (0.3,)))
    >>> [t.joint for t in grown.added], len(grown.without(0).terms)
    (['hip'], 0)
    """

    numbers: Any  # (n_columns,)
    timing: Any  # (n_joints,), s
    terms: tuple[JointTerm, ...] = ()
    n_base: int = 0


@dataclass(frozen=True)
class ArmRecord(Segmented):
    """Time (n,) in s, positions and drives (n, n_joints) in rad and Nm (m and N), in the order of the joints.

    ``starts`` are the samples before which the log has a hole.

    >>> record = ArmRecord(np.arange(5) / 100, np.zeros((5, 2)), np.zeros((5, 2)), starts=(3,))
    >>> record.groups
    array([0, 0, 0, 1, 1])
    """

    time: Array
    position: Array
    drive: Array
    starts: tuple[int, ...] = ()

    @property
    def groups(self) -> NDArray[np.intp]:
        """Number of the segment of every sample, shape (n,)."""
        return np.searchsorted(self.starts, np.arange(self.time.size), side="right")


class OwnJoints(NamedTuple):
    """The residuals of a model on its own records."""

    mean: Array  # (m, n_joints): the artefacts
    null: Array  # (k, m, n_joints): residuals by chance of records in which nothing is missing
    floor: Array  # (n_joints,): rms residual due to the noise of the encoders, as a share of each joint's drive
    counts: Array  # (n_joints,): independent samples of each joint's residual
    apart: Array  # (k, m, n_joints): residuals of single records by the noise of the encoders


def at_zero(arm: Arm) -> Array:
    """Inertia of each joint at the zero of all, with the others held, (n_joints,); above zero."""
    return np.maximum(np.diagonal(arm.mass_matrix(np.zeros((1, arm.n_joints)))[0]), NOTHING)


class ArmView(ArmRows):
    """One record after the filters.

    Filters, and effects with a memory, begin anew at each segment of the ``record``. ``known``: what another record
    knows of the numbers, which move only as far as it allows.
    """

    def __init__(self, lags: RigidBodyLags, record: ArmRecord, known: Known | None = None):
        super().__init__(**vars(records_of(lags, record.position, record.drive, record.groups)))
        self.record, self.known = record, known
        self.arm, self.dt = lags.arm_, 1.0 / lags.sample_rate
        self.n_rows, self.n_joints = self.target.shape
        self.time = record.clock
        self.step = float(self.kept[1] - self.kept[0]) * self.dt
        n = len(lags.base_.names)
        self.expected = np.zeros(n) if known is None else known.values
        self.root = np.zeros((0, n)) if known is None else known.root
        longest = self.position[max((s for s, _ in record.pieces), key=lambda s: s.stop - s.start)]
        self.noise = np.array([encoder_noise(x, lags.sample_rate) for x in longest.T])
        self.grid = np.array([lattice(x) for x in self.position.T])
        self.weight = self.unbiased = self.weights
        self.repeats = self._repeats()
        self.artefact = np.zeros_like(self.target)
        self.torque = self.smooth  # replaced by a model's torque
        self.rate = np.zeros_like(self.target)
        self._columns: dict[Any, Array] = {}
        self._signals: dict[Any, ColumnSignals] = {}
        self._scenes: dict[Any, Scales] = {}
        self._fits: dict[Any, ArmState] = {}
        self._last: Any = None  # motion and what `_rigid` gives along it
        self.model_arm = self.arm  # of the last model by which the joints were weighted
        self.drive_rms, self.varies = self.by_joint(self.target), self.target.std(axis=0)

    # -- rows ---------------------------------------------------------------------------------
    def by_joint(self, x: Array) -> Array:
        """Rms by joint, over the rows that count."""
        count = np.maximum(self.keep.sum(axis=0), 1)
        return np.asarray(np.sqrt(np.sum(np.where(self.keep, x, 0.0) ** 2, axis=0) / count))

    def motion_of(self, path: Array) -> Motion:
        """The motion along a path, (n, n_joints) each, behind the finer filter."""
        return Motion(*self.record.by_piece(self.lags._moved, path))

    def along_pieces(self, function: Callable[[ColumnSignals], Any], signals: ColumnSignals) -> Array:
        """A function of signals, such as an effect's columns; a memory in it begins anew at each segment."""
        kappa = signals.kappa
        parts = self.record.by_piece(lambda *x: function(ColumnSignals(*x)._replace(kappa=kappa)), *signals[:5])
        return np.asarray(parts)

    def flat_weight(self) -> Array:
        """Weight of every row, ordered by joint, then by instant; zero where the row does not count."""
        return np.asarray((self.keep * self.weight).ravel())

    def scene(self, kind: AtJoint) -> Scales:
        """Scales of the record along a joint or a sum of joints."""
        if kind.direction not in self._scenes:
            d = np.array(kind.direction)
            q, v, a = (x @ d for x in self.moved)
            u = self.drive @ d
            self._scenes[kind.direction] = Scales(
                torque=rms(u), peak=float(np.abs(u).max()), speed=max(rms(v), 1e-9),
                reach=max(float(np.ptp(q)) / 2, 1e-9), centre=float(q.max() + q.min()) / 2,
                duration=float(self.time[-1]), dt=self.dt, inertia=max(rms(u) / max(rms(a), 1e-9), 1e-9),
            )  # fmt: skip
        return self._scenes[kind.direction]

    def signals(self, direction: tuple[float, ...], moved: Motion | None = None) -> ColumnSignals:
        """The motion along a joint or a sum of joints; its drive is the torque that the model predicts."""
        if moved is None and direction in self._signals:
            return self._signals[direction]
        d = np.array(direction)
        q, v, a = (x @ d for x in moved or self.moved)
        found = ColumnSignals(self.time, q, v, a, self.torque @ d)
        if moved is None:
            self._signals[direction] = found
        return found

    def turned(self, effect: type[Effect], axis: str, signals: ColumnSignals) -> ColumnSignals:
        """The signals with, for dry friction, the speed at which it reverses there: see `RigidBodyLags`."""
        if not issubclass(effect, DRY):
            return signals
        along = Motion(signals.position, signals.velocity, signals.acceleration)
        turned = turning(self.lags.reversals, [axis], along)
        return signals if turned is None else signals._replace(velocity=turned, kappa=1.0)

    # -- columns ------------------------------------------------------------------------------
    def columns(self, kind: AtJoint, shape: tuple[float, ...]) -> Array:
        """Columns of an effect at its shape, on its rows: (rows, linear), or (rows, 1) if it has no size."""
        key = kind, shape
        if key not in self._columns:
            self._columns[key] = self.columns_at(kind, shape)
        return self._columns[key]

    def columns_at(self, kind: AtJoint, shape: tuple[float, ...]) -> Array:
        """The same columns, not cached."""
        if kind.cls is Load:
            return self.body(kind) @ point(shape)[:, None]
        if kind.cls is Weight:
            return self.weights_of_links.reshape(-1, kind.width)
        if kind.splits:
            return self.blur(self.freed(kind, shape)).reshape(-1, 1)
        if kind.cls is JointInertia:
            along = (self.moved.acceleration @ np.array(kind.direction))[:, None]
        elif kind.transforms:
            along = self.lost(kind, shape)[:, None]
        else:
            signals = self.turned(kind.cls, kind.joint, self.signals(kind.direction))
            along = self.along_pieces(partial(kind.catalogued.unit_columns, shape), signals)
        seen = self.blur(along)
        if kind.index is not None:
            return seen
        return (np.array(kind.direction)[None, :, None] * seen[:, None, :]).reshape(-1, seen.shape[1])

    @cached_property
    def widths(self) -> Array:
        """Change of the drives with the speeds over which dry friction reverses, (rows, k), where a record found them.

        In another motion they differ: MuJoCo's friction is soft in a way that is no function of the speed, and what a
        speed of the first record leaves of it in the second was named as a Stribeck curve.
        """
        found = (self.lags.reversals or {}) if self.known is not None else {}
        out = np.zeros((self.keep.size, len(found)))
        for i, (axis, (speed, lead)) in enumerate(found.items()):
            wide, narrow = (self.axis_columns(axis, [Coulomb(1.0)], (f * speed, lead)) for f in (WIDER, 1.0 / WIDER))
            out[self.arm.index(axis) :: self.n_joints, i] = (wide - narrow)[:, 0]
        return out

    def body(self, kind: AtJoint) -> Array:
        """Columns of the ten numbers of a body at a link, (rows, 10)."""
        at = N_BODY * self.arm.index(kind.joint)
        return (self.phi @ self.lags.base_.mapping[:, at : at + N_BODY]).reshape(-1, N_BODY)

    def weighs(self, kind: AtJoint) -> bool:
        """Whether a drive tells mass or moments of a body at a link: at a vertical axis only its inertia acts."""
        power = np.linalg.norm(self.body(kind), axis=0)
        return bool(power[:MASS].max() > SAME * power.max())

    def lost(self, kind: AtJoint, shape: tuple[float, ...]) -> Array:
        """The part of a joint's drive that an effect removes, shape (n,).

        A limit or a dead zone removes it from the logged drive.  A delay is applied to the torque that the model
        predicts, because a logged drive would explain its own noise.
        """
        if kind.delays:
            earlier = partial(advance, kind.catalogued.code, age=shape[0], dt=self.dt)
            return np.asarray(self.record.by_piece(earlier, self.torque @ np.array(kind.direction)))
        u, effect = self.drive @ np.array(kind.direction), kind.catalogued.effect(shape)
        return self.along_pieces(effect.contribution, self.signals(kind.direction)._replace(drive=u))

    def freed(self, kind: AtJoint, shape: tuple[float, ...], moved: Motion | None = None) -> Array:
        """Change of all drives, (n, n_joints), where a play at a joint frees its link from the measured motor.

        The other joints feel the link by the mass matrix.
        """
        return self._behind(kind, shape, moved or self.moved)[:, : self.n_joints]

    def behind(self, model: ArmState, moved: Motion) -> tuple[Array, Array]:
        """Positions and velocities of the links, (n, n_joints) each: a play frees them from the measured motors."""
        q, v = moved.position.copy(), moved.velocity.copy()
        for t in (t for t in model.terms if t.kind.splits):
            j = t.kind.index
            q[:, j], v[:, j] = self._behind(t.kind, t.shape, moved)[:, self.n_joints :].T
        return q, v

    def _behind(self, kind: AtJoint, shape: tuple[float, ...], moved: Motion) -> Array:
        """What `freed` returns, and the position and velocity of the link, (n, n_joints + 2).

        The share of the load is of the joint's inertia at zero, in any record the same.  Viscous friction is behind
        the play in the proportion of the dry one.
        """
        j, (gap, share, hertz, ratio, dry) = kind.index, shape
        mass, needed, coulomb, viscous = self._rigid(moved)
        whole = at_zero(self.model_arm)[j]
        if whole <= NOTHING:  # numbers with which nothing can move
            still = np.zeros((len(mass), self.n_joints))
            return np.column_stack([still, moved.position[:, j], moved.velocity[:, j]])
        motor = (1.0 - share) * whole
        inertia, reduced = np.maximum(mass[:, j, j] - motor, LIGHTEST * whole), motor * share
        damped = viscous[j] * min(dry / max(float(coulomb[j]), 1e-12), 1.0)
        stiffness = contact_stiffness(hertz, reduced)
        damping, steps = contact_damping(ratio, stiffness, reduced), FINER * fine_steps(hertz, ratio, self.dt)
        pull = needed[:, j] - mass[:, j, j] * moved.acceleration[:, j]

        def drives(q: Array, v: Array, a: Array, pull: Array, mass: Array, inertia: Array) -> Array:
            push, place, speed = pushed(q, v, pull, inertia, gap, stiffness, damping, damped, dry, self.dt, steps)
            out = mass * (np.gradient(speed, self.dt) - a)[:, None]
            out[:, j] = push - pull - inertia * a - damped * v - dry * np.sign(v)
            return np.column_stack([out, place, speed])

        return np.asarray(self.record.by_piece(drives, *(x[:, j] for x in moved), pull, mass[:, :, j], inertia))

    def motors(self, model: ArmState) -> dict[str, float]:
        """Inertia of the motor before each play, by joint."""
        plays = [t for t in model.terms if t.kind.splits]
        whole = at_zero(self.arm_of(model)) if plays else np.zeros(0)
        return {t.joint: (1.0 - t.q[1]) * float(whole[t.kind.index]) for t in plays}

    def _rigid(self, moved: Motion) -> tuple[Array, Array, Array, Array]:
        """Mass matrices and drives of the links along a motion, and each joint's dry and viscous friction."""
        if self._last is None or self._last[0] is not moved:
            dry, viscous = (
                np.array([sum(e.magnitude for e in row if type(e) is kind) for row in self.model_arm.effects])
                for kind in (Coulomb, Viscous)
            )
            mass, needed = (
                self.model_arm.mass_matrix(moved.position),
                self.model_arm.inverse_dynamics(*moved, effects=False),
            )
            self._last = moved, mass, needed, np.maximum(dry, 0.0), np.maximum(viscous, 0.0)
        return self._last[1:]

    @cached_property
    def weights_of_links(self) -> Array:
        """The smallest complete set of columns of gravity, shape (m, n_joints, k), for an arm without gravity."""
        if np.any(self.arm.gravity):
            return np.zeros((self.n_rows, self.n_joints, 0))
        still = np.zeros_like(self.moved.position)
        heavy = dataclasses.replace(self.arm, gravity=STANDARD_GRAVITY, effects=(), sums={}, sum_armature={})
        every = heavy.regressor(self.moved.position, still, still)
        u, s, _ = np.linalg.svd(self.blur(every).reshape(self.n_rows * self.n_joints, -1), full_matrices=False)
        return (u * s)[:, s > 1e-6 * s[0]].reshape(self.n_rows, self.n_joints, -1)

    def contribution(self, term: JointTerm) -> Array:
        """Torque of a term, shape (m, n_joints)."""
        out = np.zeros(self.n_rows * self.n_joints)
        sizes = np.ones(1) if term.kind.sizeless else np.array(term.q[: term.kind.linear])
        out[term.kind.rows] = self.columns(term.kind, term.shape) @ sizes
        return out.reshape(self.n_rows, self.n_joints)

    def design(self, model: ArmState, timed: NDArray[np.bool_]) -> tuple[Array, Array]:
        """Columns of all free numbers, the ages of the joints ``timed`` last, and the target that they explain."""
        n = self.n_rows * self.n_joints
        target = (self.target - self.artefact).ravel()
        target = target - (self.phi @ self.expected).ravel()
        parts = [self.phi.reshape(n, -1)]
        for t in model.terms:
            if t.kind.sizeless:
                target = target - self.contribution(t).ravel()
            else:
                columns = np.zeros((n, t.kind.linear))
                columns[t.kind.rows] = self.columns(t.kind, t.shape)
                parts.append(columns)
        ages = np.zeros((n, int(timed.sum())))
        for i, j in enumerate(np.flatnonzero(timed)):
            ages[j :: self.n_joints, i] = self.rate[:, j]
        late = ~timed * model.timing * self.rate
        return np.hstack([*parts, ages]), target - late.ravel()

    # -- fits ---------------------------------------------------------------------------------
    def fit(self, model: ArmState) -> ArmState:
        """Solve for all sizes at the model's shapes; the age of every drive is fitted within bookkeeping."""
        key = tuple((t.kind, t.shape) for t in model.terms)
        if key not in self._fits:
            model = dataclasses.replace(model, timing=np.zeros(self.n_joints))
            fitted = self._solved(model, timed := self.timed(model))
            bound = np.clip(fitted.timing, -OLDEST, LATEST * self.dt)
            if np.any(bound != fitted.timing):
                timed &= bound == fitted.timing
                fitted = self._solved(dataclasses.replace(model, timing=np.where(timed, 0.0, bound)), timed)
            self._fits[key] = fitted
        return self._fits[key]

    def timed(self, model: ArmState) -> NDArray[np.bool_]:
        """Joints, (n_joints,), whose drive has an age within bookkeeping: they move, and no delay is named there."""
        delayed = {t.joint for t in model.terms if t.kind.delays}
        inside = (model.timing > -OLDEST) & (model.timing < LATEST * self.dt)
        return inside & np.any(self.rate != 0.0, axis=0) & np.array([j not in delayed for j in self.arm.joints])

    def held_out(self, model: ArmState) -> Array:
        """Rms error of each joint on blocks that were not fitted, as a share of its rms drive, (n_joints,)."""
        x, y = self.design(model, self.timed(model))
        shape = self.target.shape
        known = self.known_rows(x.shape[1])
        return held_out(x.reshape(*shape, -1), y.reshape(shape), self.keep, self._weight(model), self.target, known)

    def _weight(self, model: ArmState) -> Array:
        """Weights of the joints, (n_joints,); beside another record's numbers alone, those before anything was found.

        With the weights of what the found effects leave, the numbers would bend to the gap of one joint at the cost of
        all others.
        """
        return self.weight if self.known is None or model.added else self.unbiased

    def known_rows(self, width: int) -> Array:
        """What another record says about the first of ``width`` columns, as rows scaled like weighted ones of this."""
        return np.pad(self.root * np.sqrt(self.repeats), ((0, 0), (0, width - self.root.shape[1])))

    def _repeats(self) -> float:
        """Rows for one independent error, from the colour of the residual after a fit of all base numbers."""
        x, y = self.phi.reshape(self.keep.size, -1), self.target.ravel()
        left = (y - x @ solved(x, y, self.flat_weight())).reshape(self.keep.shape)
        moving = np.flatnonzero(self.keep.any(axis=0))
        shares = self.keep[:, moving].mean(axis=0)
        counts = [n_effective(np.where(self.keep[:, j], left[:, j], 0.0)) for j in moving]
        return max(1.0, float(self.keep.sum() / max(float(shares @ counts), 1.0)))

    def _solved(self, model: ArmState, timed: NDArray[np.bool_]) -> ArmState:
        x, y = self.design(model, timed)
        sizes = solved(x, y, (self.keep * self._weight(model)).ravel(), self.known_rows(x.shape[1]))
        at, terms = len(self.expected), []
        numbers = self.expected + sizes[:at]
        for t in model.terms:
            n = 0 if t.kind.sizeless else t.kind.linear
            terms.append(dataclasses.replace(t, q=(*map(float, sizes[at : at + n]), *t.shape)))
            at += n
        timing = np.array(model.timing)
        timing[timed] = sizes[at:]
        return dataclasses.replace(model, numbers=numbers, timing=timing, terms=tuple(terms))

    def left(self, model: ArmState) -> Array:
        """Residual of the drives under a fitted model, shape (m, n_joints); zero at rows that do not count."""
        out = self.target - self.artefact - self.phi @ model.numbers - model.timing * self.rate
        return np.where(self.keep, out - sum(self.contribution(t) for t in model.terms), 0.0)

    def taken_off(self, model: ArmState) -> Array:
        """How many times as much each logged drive varies as what limits and dead zones let through, (n_joints,).

        A limit removes the peaks of a drive and with them what any model leaves there: one that took nine tenths of a
        drive had stood for the stop at which a controller wound up.
        """
        out = np.ones(self.n_joints)
        limits = [t for t in model.terms if t.kind.transforms and not t.kind.delays]
        for j in {t.kind.index for t in limits}:
            lost = sum(self.columns(t.kind, t.shape)[:, 0] for t in limits if t.kind.index == j)
            y, reaches = (x[self.keep[:, j]] for x in (self.target[:, j], self.target[:, j] - lost))
            out[j] = np.sqrt(fewer(y, reaches)) if y.size else 1.0
        return out

    def weigh(self, model: ArmState) -> None:
        """Weight the joints by their residuals, and use the model's torque where an effect needs the drive.

        Beside the numbers of another record the residual is largest where most has changed.  There, a joint is first
        weighted by the residual that it would have if its own numbers were fitted.
        """
        if self.known is None or model.added:
            left = self.by_joint(self.left(model))
            self.weight = 1.0 / np.maximum(left, 1e-6 * np.maximum(self.drive_rms, 1e-12))
        self.model_arm, self._last = self.arm_of(model), None
        self.torque = self.along(model, self.moved)
        self.rate = self.blur(self.record.by_piece(lambda u: np.gradient(u, self.dt, axis=0), self.torque))
        self._forget()

    def hear_stops(self, model: ArmState) -> None:
        """Count slow rows at which more is missing than friction can explain: a joint at its stop is at rest."""
        names = self.lags.base_.names
        left = (self.target - self.artefact) - self.phi @ model.numbers - model.timing * self.rate
        for j, joint in enumerate(self.arm.joints):
            if self.keep[:, j].any():
                friction = abs(model.numbers[names.index(f"{joint}.coulomb")]) if f"{joint}.coulomb" in names else 0.0
                most = HELD * friction + OUTLYING * MAD * float(np.median(np.abs(left[self.keep[:, j], j])))
                self.keep[:, j] |= np.abs(left[:, j]) > most
        self._fits = {}

    def _forget(self) -> None:
        self._fits, self._signals = {}, {}
        for key in list(self._columns):
            c = key[0].catalogued
            if key[0].splits or (c is not None and c.driven and (c.delays or not c.transforms)):
                del self._columns[key]

    # -- own records --------------------------------------------------------------------------
    def along(self, model: ArmState, moved: Motion) -> Array:
        """Drives that the model needs along a motion, shape (n, n_joints), without effects that transform the drive."""
        arm = self.arm_of(model)
        out = arm.inverse_dynamics(*moved, effects=False)
        acting = dict(zip(arm.joints, arm.effects, strict=True)) | arm.sums
        for d, (name, effects) in zip(arm._every_direction(), acting.items(), strict=True):
            s = self.signals(tuple(map(float, d)), moved)
            each = (self.along_pieces(e.contribution, self.turned(type(e), name, s)) for e in effects)
            out += np.outer(sum(each, np.zeros(len(out))), d)
        return out + sum(self.freed(t.kind, t.shape, moved) for t in model.terms if t.kind.splits)

    def arm_of(self, model: ArmState) -> Arm:
        """The arm of a model's numbers, physical or not, with all terms that are torques, and without plays."""
        arm = self.lags.interpret(model.numbers, physical=False)
        return completed(arm, (t for t in model.terms if not t.kind.sizeless))

    def read(self, path: Array, rng: np.random.Generator) -> Array:
        """A path, shape (n, n_joints), as the encoders would have read it."""
        out = path + white_noise(self.noise, self.grid) * rng.standard_normal(path.shape)
        grid = np.where(self.grid > 0.0, self.grid, 1.0)
        return np.where(self.grid > 0.0, np.round(out / grid) * grid, out)

    def own(self, model: ArmState, rng: np.random.Generator) -> OwnJoints:
        """The residuals on the model's own records (see `OwnJoints`).

        The model must be fitted.  The look itself projects out what a refit would explain.  The path is the measured
        one after the finer filter.  It passes that filter again with and without noise, because the noise that the
        second pass removes is not an artefact.
        """
        asked = self.blur(self.along(model, self.motion_of(self.moved.position)))
        made = [self.along(model, self.motion_of(self.read(self.moved.position, rng))) for _ in range(N_OWN)]
        rows = np.where(self.keep, asked - np.array([self.blur(x) for x in made]), 0.0)
        mean = rows.mean(axis=0)
        apart = (rows - mean) * np.sqrt(N_OWN / (N_OWN - 1.0))
        null, n = self.null(self.left(model) + np.where(self.keep, self.artefact, 0.0) - mean, apart, rng)
        floor = np.sqrt(np.mean([self.by_joint(a) ** 2 for a in apart], axis=0))
        return OwnJoints(mean, null, floor / np.maximum(self.drive_rms, 1e-300), n, apart)

    def unexplained(self, model: ArmState, rng: np.random.Generator) -> Array:
        """Drives by chance with the colour of what a fitted model leaves of each, shape (n, n_joints)."""
        shares, rows = np.maximum(self.keep.mean(axis=0), 1e-9), self.time[self.kept]
        power = [smoothed_power(x) / share for x, share in zip(self.left(model).T, shares, strict=True)]
        noise = [coloured(p, (1, self.n_rows), rng)[0] for p in power]
        return np.column_stack([np.interp(self.time, rows, x) for x in noise])

    def null(self, rest: Array, apart: Array, rng: np.random.Generator) -> tuple[Array, Array]:
        """Residuals by chance with the colour of ``rest``, (N_NULL, m, n_joints), and each joint's independent samples.

        They contain the noise of the encoders (``apart``), the remainder of ``rest`` as coloured noise, joint by joint,
        and the errors of numbers from another record.
        """
        null = np.empty((N_NULL, self.n_rows, self.n_joints))
        n = np.zeros(self.n_joints)
        for j in range(self.n_joints):
            share = max(float(self.keep[:, j].mean()), 1e-9)
            null[:, :, j] = null_rows(rest[:, j], apart[:, :, j], N_NULL, rng, share)
            spread = coloured(smoothed_power(rest[:, j]), (1, self.n_rows), np.random.default_rng(0))[0]
            if self.keep[:, j].any():
                n[j] = max(share * n_effective(spread, self.n_rows), 2.0)
        if self.known is not None:
            draws = rng.multivariate_normal(0.0 * self.expected, self.known.covariance, N_NULL, method="eigh")
            null += np.einsum("tjb,kb->ktj", self.phi, draws)
        return np.where(self.keep, null, 0.0), n


def fewer(drive: Array, reaches: Array, *, polish: bool = False) -> Array:
    """Variance of drives over that of what reaches the joint of each, along the last axis.

    A constant is no part of it, because an offset explains any.  Of the drive of a joint with a weight, a limit below
    all that is ever asked for let a constant through, which counted as half of it: that limit was named for a cogging.

    ``polish``: power in place of variance, to correct a limit that is found: by it noise moves the best one less, by
    0.3 instead of 0.6 % of a limit at a twentieth of what is asked for.
    """
    whole, rest = (np.mean(np.square(x), axis=-1) if polish else np.var(x, axis=-1) for x in (drive, reaches))
    return np.asarray(whole / np.maximum(rest, 1e-300))


def advance(code: int, torque: Array, age: float, dt: float) -> Array:
    """What a drive must have had beside the torque that arrives, (n,): the inverse of a delay or of a lag.

    A lag in reversed time is no inverse: it differs at second order, where a lag and a delay begin to differ too.
    """
    if code == codes.INPUT_DELAY:
        t = np.arange(torque.size) * dt
        return np.asarray(np.interp(t + age, t, torque) - torque)
    return np.asarray(age * np.gradient(torque, dt))


def point(centre: tuple[float, ...]) -> Array:
    """Ten numbers of 1 kg at a place, (10,)."""
    return body_numbers(1.0, centre, np.zeros((3, 3)))


def solved(x: Array, y: Array, weight: Array, known: Array | None = None) -> Array:
    """Weighted least squares; for dependent columns, the solution with the smallest norm.

    ``known`` (r, p) are further rows, of which the target is zero.
    """
    at = weight > 0.0
    rows: Array = np.column_stack([x, y])[at] * weight[at, None]
    if known is not None:
        rows = np.vstack([rows, np.pad(known, ((0, 0), (0, 1)))])
    scale = np.linalg.norm(rows[:, :-1], axis=0)
    scale = np.where(scale > 0.0, scale, 1.0)
    r: Array = np.asarray(np.linalg.qr(np.column_stack([rows[:, :-1] / scale, rows[:, -1]]), mode="r"))
    return np.asarray(np.linalg.lstsq(r[:, :-1], r[:, -1], rcond=SAME)[0] / scale)


def law_of(names: Mapping[str, Any]) -> dict[str, tuple[str, ...]]:
    """Names of the base model's effects by joint, from the axes of a `RigidBodyLags`."""
    return {joint: tuple(t.name for t in terms) for joint, (_, terms) in names.items()}
