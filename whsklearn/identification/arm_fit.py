"""An arm from its log: base numbers with intervals, and how well each joint's drive is predicted on held-out blocks."""

from __future__ import annotations

import itertools
import warnings
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import solve, solve_triangular
from scipy.optimize import linear_sum_assignment, minimize
from sklearn.base import clone
from threadpoolctl import threadpool_limits

from whsklearn.effects import Coulomb, Effect, InputOffset, LoadFriction, PreslidingHysteresis, Viscous
from whsklearn.effects.base import Array
from whsklearn.filtering.records import Motion, motion, zero_phase
from whsklearn.lags.arm_rows import ArmRows, records_of
from whsklearn.lags.axis_rows import DRY, experiments
from whsklearn.lags.rigid_body import RigidBodyLags
from whsklearn.models.arm import ArmModel
from whsklearn.systems.arm import Arm, direction_of

# Blocks of a record, each omitted once for the spread of the numbers. Between two records of 14 unchanged arms of six
# joints, numbers differ by 0.9 standard errors (rms), or by 1.9 if errors are taken to be white, with one in 37 beyond
# five (`benchmarks.blind_arms --numbers`).
N_LEFT_OUT = 20
# Standard errors above zero at which friction is said to grow with the torque, or to act along two joints: Student's t
# over 20 blocks is beyond it once in 25,000 joints that have none.
GROWS = 5.0
SAME = 1e-9  # of the largest singular value: below it, columns are combinations of each other
DIGITS = 4  # of the numbers of a model without standard errors
ROUNDING = 1e-12  # of the largest eigenvalue of a correlation matrix
# Range of the logarithm of the speed over which dry friction reverses, in a joint's rms speed, and largest lead (s):
# MuJoCo's leads by 10 ms, and the memory of lubricated contacts reaches as far.
REVERSES, LEADS = (np.log(0.003), np.log(0.5)), 0.03
WIDTHS, N_LEADS, EVALUATIONS = (0.01, 0.05, 0.2), 11, 40  # where the search begins, and its steps
DISTANCES = PreslidingHysteresis.quantities["distance"].starts  # over which dry friction may reverse instead
PRIOR = 1e6  # variance of a number that no row tells, in units of the residual's: as that of `RLSRegressor`
BLOCKS = 10  # blocks of a record; every second one is held out, and then the others


@dataclass(frozen=True)
class ArmFit:
    """The result of `identify_arm`.

    Attributes
    ----------
    model : ArmModel
    lags : RigidBodyLags
        As used in the fit: filter, base columns, weights of the joints.
    missing : dict of str to float
        For each joint, the rms error on held-out blocks as a share of its rms drive, without slow samples.
    alone : dict of str to float
        The same for each joint as a single axis: inertia, friction, offset.
    nominal : dict of str to float
        Base numbers of the robot's file; empty if it gives no mass.
    covariance : ndarray of shape (b, b)
        Of the base numbers.
    ages : dict of str to float
        For each moving joint, the delay between its logged drive and its action (s).
    untold : tuple of str
        Numbers that act on no drive in this record, such as the friction of a joint that does not move.

    References
    ----------
    Swevers, Verdonck and De Schutter 2007, IEEE Control Systems Magazine 27(5), 58-71, on validation.

    Examples
    --------
    >>> from whsklearn.datasets import default_arm, make_arm_log
    >>> from whsklearn.identification import identify_arm
    >>> q, torque = make_arm_log(duration=12.0, return_arrays=True)
    >>> found = identify_arm(q, torque, dt=0.002, robot=default_arm())
    >>> 10 * found.missing["pitch"] < found.alone["pitch"]
    True
    """

    model: ArmModel
    lags: RigidBodyLags
    missing: dict[str, float]
    alone: dict[str, float]
    nominal: dict[str, float]
    covariance: Array
    ages: dict[str, float]
    untold: tuple[str, ...] = ()


@threadpool_limits.wrap(limits=1, user_api="blas")  # two threads take twice the CPU and sum in another order
def identify_arm(
    position: ArrayLike, drive: ArrayLike, *, dt: float, robot: Any, groups: ArrayLike | None = None, **settings: Any
) -> ArmFit:
    """Fit an arm to a record of all its joints.

    Parameters
    ----------
    position, drive : array-like of shape (n, n_joints)
        In rad and Nm (m and N where a joint slides), in the order of the robot's joints.
    dt : float
        Sampling time (s).
    robot : Arm, or path of a URDF, MJCF or model file
    groups : array-like of shape (n,), optional
        Marks experiments, each filtered on its own.
    **settings
        Of `RigidBodyLags`: ``law``, ``effects``, ``cutoff``, ``slow``, ``reversals``.  If neither ``law`` nor
        ``effects`` is given, friction that grows with the torque is added at the joints that show it, and friction
        along the sum or difference of two neighbours that one gear turns: a payload found beside numbers without them
        would be charged with them.  Unless ``reversals`` are given, they are found where they predict the drive better
        (`reversals_of`).

    Raises
    ------
    ValueError
        If the record or the robot cannot be used, and if the drives fit far better with the positions taken as degrees
        or with the columns of the joints in another order.
    """
    q, torque = np.asarray(position, dtype=float), np.asarray(drive, dtype=float)
    lags = RigidBodyLags(robot, sample_rate=1.0 / dt, **settings)
    rows = records_of(lags, q, torque, groups)
    enough_rows(rows)
    effects: dict[str, tuple[Effect, ...]] = {}
    if not settings.keys() & {"law", "effects"}:
        effects = _frictions(rows)
        if any(row != (InputOffset(),) for row in effects.values()):
            rows = records_of(lags.set_params(effects=effects), q, torque, groups)
    if wrong := in_degrees(rows) or in_another_order(rows):
        raise ValueError(wrong[0])
    for text in suspicions(lags.arm_, q, torque):
        warnings.warn(text, UserWarning, stacklevel=3)
    if "reversals" not in settings and (reversals := reversals_of(rows)):
        rows = records_of(lags.set_params(reversals=reversals), q, torque, groups)
        if doubtful := unsure(rows, effects):
            effects |= {j: tuple(e for e in effects[j] if not isinstance(e, LoadFriction)) for j in doubtful}
            rows = records_of(lags.set_params(effects=effects), q, torque, groups)
    lags.weights_ = rows.weights
    names, joints = lags.base_.names, lags.arm_.joints
    aged, moving = with_ages(rows)
    theta, covariance = _with_blocks(aged, rows.weights)
    ages = dict(zip([joints[int(j)] for j in moving], theta[len(names) :].tolist(), strict=True))
    theta, covariance = theta[: len(names)], covariance[: len(names), : len(names)]
    errors = dict(zip(names, np.sqrt(np.maximum(np.diag(covariance), 0.0)).tolist(), strict=True))
    missing = held_out(aged.phi, rows.target, rows.keep, rows.weights)
    powers = np.linalg.norm(rows.phi[rows.keep], axis=0)
    size = np.sqrt(np.sum(np.where(rows.keep, rows.target, 0.0) ** 2, axis=0) / np.maximum(rows.keep.sum(axis=0), 1))
    model = ArmModel(
        lags.interpret(theta, covariance), dict(zip(names, theta.tolist(), strict=True)), dt=dt,
        logged="position", standard_errors=errors, units={"input": "Nm", "output": "rad"}, covariance=covariance,
        unexplained={j: float(x) for j, x in zip(joints, missing * size, strict=True) if np.isfinite(x)},
        varied=dict(zip(joints, rows.target.std(axis=0).tolist(), strict=True)), reversals=lags.reversals or {},
    )  # fmt: skip
    return ArmFit(
        model, lags, dict(zip(joints, missing.tolist(), strict=True)),
        {j: one_axis(rows, k) for k, j in enumerate(joints)}, nominal_numbers(lags), covariance, ages,
        tuple(name for name, power in zip(names, powers, strict=True) if power <= SAME * powers.max()),
    )  # fmt: skip


def reversals_of(rows: ArmRows, beside: Sequence[Effect] = ()) -> dict[str, tuple[float, float]]:
    """How dry friction reverses at each joint where that predicts held-out blocks better: see `RigidBodyLags`.

    The two numbers of a joint minimise its error on blocks that were not fitted.  They are kept if that lowers
    Schwarz's criterion, n ln(error squared) + 2 ln n, and if presliding friction, which reverses over a distance and is
    an effect by itself, does not lower it further by as much.  In MuJoCo, friction that reverses at once leaves two to
    ten times the error at a wrist, and a delay is then not told from a lag, which the records do tell
    (`python -m benchmarks.blind_arms --evidence`).

    ``beside``: effects that joints may lack, which are fitted with the others; without viscous friction, a reversal
    over a wide range of speeds looks like it. So is the second derivative of the drives: that of a delay of ten
    samples looked like a reversal 8 ms behind the velocity.
    """
    lags, keep, names = rows.lags, rows.keep, rows.lags.base_.names
    first = _first(rows)
    asked, aged = rows.predicted(first), with_ages(rows)[0]
    more = {
        (j, e): rows.axis_columns(j, [e], drive=asked)[:, None, :] * lags.axes_[j][0][:, None]
        for j in lags.arm_.joints
        for e in beside
        if type(e) not in map(type, lags.axes_[j][1])
    }
    late = _aged(rows, rows.per_age(first, 2)).phi[:, :, len(names) :]
    phi = aged.with_columns(*more.values(), late).phi
    out, others = {}, Others(phi, rows.target, keep, rows.weights)
    speeds = np.sqrt(np.mean(rows.moved.velocity**2, axis=0))
    for k, joint in enumerate(lags.arm_.joints):
        dry = [t for t in lags.axes_[joint][1] if isinstance(t, DRY) and f"{joint}.{t.name}" in names]
        lacked = [i for i, (j, e) in enumerate(more) if j == joint and isinstance(e, Coulomb)]
        n = int(keep[:, k].sum())
        if not (dry or lacked) or n < 2 * phi.shape[2]:
            continue
        at = [*(names.index(f"{joint}.{t.name}") for t in dry), *(aged.phi.shape[2] + i for i in lacked)]
        dry += [Coulomb()] * len(lacked)
        columns = partial(rows.axis_columns, joint, dry)
        error, speed = others.at(k, at), float(speeds[k])
        over = [rows.axis_columns(joint, [PreslidingHysteresis(1.0, d)]) for d in DISTANCES]

        def left(x: Array, error: Any = error, columns: Any = columns, speed: float = speed) -> float:
            inside = REVERSES[0] <= x[0] <= REVERSES[1] and abs(x[1]) <= LEADS
            return error(columns((float(np.exp(x[0])) * speed, float(x[1])))) if inside else np.inf

        leads = np.linspace(-0.5 * LEADS, 0.5 * LEADS, N_LEADS)
        best = min((np.array([np.log(w), lead]) for w in WIDTHS for lead in leads), key=left)
        simplex = best + np.array([[0.0, 0.0], [0.5, 0.0], [0.0, 0.1 * LEADS]])
        found = minimize(left, best, method="Nelder-Mead", options={"maxfev": EVALUATIONS, "initial_simplex": simplex})
        abrupt, memory = error(phi[:, k, at]), min(error(np.hstack([phi[:, k, at], x])) for x in over)
        if n * np.log(abrupt / found.fun) > 2.0 * np.log(n) >= n * np.log(found.fun / memory):
            out[joint] = float(np.exp(found.x[0]) * speed), float(found.x[1])
    return out


class Others:
    """The columns of an arm beside which those of one joint are tried: the error there on blocks that were not fitted.

    All columns are projected out by the square root of their normal equations, which are summed only once.
    """

    def __init__(self, phi: Array, target: Array, keep: NDArray[np.bool_], weights: Array):
        block = np.arange(len(phi)) * BLOCKS // len(phi)
        self.rows, self.y, self.keep, self.weights = phi * weights[:, None], target * weights, keep, weights
        self.tests = [block % 2 == fold for fold in range(2)]
        self.sums = []
        for test in self.tests:
            rows, y = (x[keep & ~test[:, None]] for x in (self.rows, self.y))
            self.sums.append((rows.T @ rows, rows.T @ y))

    def at(self, joint: int, columns: list[int]) -> Callable[[Array], float]:
        """The squared error of a joint as a function of its columns (m, k) in place of these."""
        others, use = np.delete(np.arange(self.rows.shape[2]), columns), self.keep[:, joint]
        weight, folds = self.weights[joint], []
        for test, (gram, cross) in zip(self.tests, self.sums, strict=True):
            inner = gram[np.ix_(others, others)]
            size = np.sqrt(np.maximum(np.diag(inner), 1e-300))
            power, turned = np.linalg.eigh(inner / np.outer(size, size))
            root = (turned / np.sqrt(np.where(power > ROUNDING * power[-1], power, np.inf))) / size[:, None]
            fit, held = use & ~test, use & test
            u, seen = (self.rows[x, joint][:, others] @ root for x in (fit, held))
            known = root.T @ cross[others]
            folds.append((fit, held, u, seen, self.y[fit, joint] - u @ known, self.y[held, joint] - seen @ known))

        def error(columns: Array) -> float:
            total, columns = 0.0, columns * weight
            for fit, held, u, seen, left, rest in folds:
                own = columns[fit]
                inside = u.T @ own
                sizes = np.linalg.lstsq(own.T @ own - inside.T @ inside, own.T @ left, rcond=SAME)[0]
                total += float(np.sum((rest - (columns[held] - seen @ inside) @ sizes) ** 2))
            return total

        return error


def enough_rows(rows: ArmRows) -> None:
    """Raise ValueError if the log gives fewer rows than the arm has numbers."""
    there, needed = int(rows.keep.sum()), len(rows.lags.base_.names)
    if there < needed:
        seconds = len(rows.position) / rows.lags.sample_rate
        raise ValueError(f"The log of {seconds:.3g} s gives {there} rows for {needed} numbers; record longer.")


def _frictions(rows: ArmRows) -> dict[str, tuple[Effect, ...]]:
    """Offsets, and friction that the record surely shows: along sums of neighbours, and growing with the torque."""
    arm = rows.lags.arm_
    law: tuple[Effect, ...] = (Viscous(), Coulomb())
    effects: dict[str, tuple[Effect, ...]] = {j: (InputOffset(),) for j in arm.joints}
    pairs = [(int(p), k) for k, p in enumerate(arm.parents) if p >= 0 and arm.slides[p] == arm.slides[k]]
    families: list[dict[str, tuple[Effect, ...]]] = [
        *({f"{arm.joints[p]}{sign}{arm.joints[k]}": law for p, k in pairs} for sign in "+-"),
        {j: (LoadFriction(),) for j in arm.joints},
    ]
    for more in families:
        if shown := _shown(rows, more):
            effects |= {axis: (*effects.get(axis, ()), *more[axis]) for axis in shown}
            lags = clone(rows.lags).set_params(effects=effects, cutoff=rows.lags.cutoff_)
            rows = records_of(lags, rows.position, rows.drive, rows.groups)
    return effects


def _shown(rows: ArmRows, more: dict[str, tuple[Effect, ...]]) -> list[str]:
    """Axes at which all of these effects are surely above zero, and whose held-out error is smaller with them.

    What is a function of the drive has to be sure with the torque of the fit without it, too: of a measured drive that
    is little but friction, c |u| sign(v) is the drive itself with its noise, and explains all of it.
    """
    first, target, keep, p = _first(rows), rows.target, rows.keep, rows.phi.shape[2]
    rate, before = rows.per_age(first), held_out(with_ages(rows)[0].phi, target, keep, rows.weights)
    driven = any(isinstance(e, LoadFriction) for row in more.values() for e in row)
    direction = {a: direction_of(rows.lags.arm_.joints, a) for a in more}
    added = [
        {a: rows.axis_columns(a, more[a], drive=drive)[:, None, :] * direction[a][:, None] for a in more}
        for drive in ((rows.predicted(first), None) if driven else (None,))
    ]
    growing, asked = list(more), 0
    while growing and len(growing) != asked:  # until all of those fitted together are significant
        asked = len(growing)
        for columns in added:
            wider = rows.with_columns(*(columns[a] for a in growing))
            weights, aged = wider.weights, _aged(wider, rate)
            ends = p + np.cumsum([0, *(len(more[a]) for a in growing)])
            at = {a: list(range(i, j)) for a, i, j in zip(growing, ends, ends[1:], strict=False)}
            growing = [a for a, i in at.items() if _sure(*fitted(aged.phi, target, keep, weights), i)]
            if len(growing) < asked:  # errors by blocks are no smaller, and take longer
                break
            less = held_out(aged.phi, target, keep, weights) < before
            known = _with_blocks(aged, weights)
            growing = [a for a, i in at.items() if less[direction[a] != 0.0].all() and _sure(*known, i)]
            if len(growing) < asked:
                break
    return growing


def unsure(rows: ArmRows, effects: Mapping[str, tuple[Effect, ...]]) -> list[str]:
    """Joints whose friction was told to grow with the torque, and surely does not where it is known how it reverses."""
    names = rows.lags.base_.names
    asked = [j for j, row in effects.items() if any(isinstance(e, LoadFriction) for e in row)]
    known = _with_blocks(with_ages(rows)[0], rows.weights) if asked else None
    return [j for j in asked if known and not _sure(*known, [names.index(f"{j}.{LoadFriction.name}")])]


def _sure(theta: Array, covariance: Array, columns: list[int]) -> bool:
    """Whether these numbers are all above zero by `GROWS` standard errors."""
    return bool(np.all(theta[columns] > GROWS * np.sqrt(np.diag(covariance)[columns])))


def _first(rows: ArmRows) -> Array:
    """Weights of the columns by themselves."""
    return fitted(rows.phi, rows.target, rows.keep, rows.weights)[0]


def _aged(rows: ArmRows, rate: Array) -> ArmRows:
    """The rows with the ages of the moving joints' drives as columns, from `ArmRows.per_age`."""
    moving = np.any(rows.keep & (rate != 0.0), axis=0)
    return rows.with_columns(rate[:, :, None] * np.eye(len(moving))[:, moving])


def with_ages(rows: ArmRows) -> tuple[ArmRows, NDArray[np.int64]]:
    """Rows whose columns are extended by the drive ages of the moving joints, and the list of these joints.

    A drive is held over a sample and logged late or early; with its age in the fit, friction and inertia are not
    biased.
    """
    rate = rows.per_age(_first(rows))
    return _aged(rows, rate), np.flatnonzero(np.any(rows.keep & (rate != 0.0), axis=0))


def _with_blocks(rows: ArmRows, weights: Array) -> tuple[Array, Array]:
    """Weights of the columns, and their covariance by leaving out blocks of the record."""
    keep = rows.keep
    theta, white = fitted(rows.phi, rows.target, keep, weights)
    error = (rows.target - rows.phi @ theta) * weights
    return theta, block_covariance((rows.phi * weights[:, None])[keep], error[keep], blocks_of(keep), white)


def blocks_of(keep: NDArray[np.bool_]) -> NDArray[np.int64]:
    """The block of the record, of `N_LEFT_OUT`, to which each used row belongs."""
    block = np.arange(len(keep)) * N_LEFT_OUT // len(keep)
    return np.broadcast_to(block[:, None], keep.shape)[keep]


def fitted(
    phi: Array, target: Array, keep: NDArray[np.bool_], weights: Array, known: Array | None = None
) -> tuple[Array, Array]:
    """Weights of the columns and their covariance, by weighted least squares over the used rows.

    ``known`` (r, p) are further rows with target zero (`Known`).
    """
    rows = (np.concatenate([phi, target[:, :, None]], axis=2) * weights[:, None])[keep]
    if known is not None:
        rows = np.vstack([rows, np.pad(known, ((0, 0), (0, 1)))])
    p, prior = phi.shape[2], np.eye(phi.shape[2], phi.shape[2] + 1) / np.sqrt(PRIOR)
    r: Array = np.asarray(np.linalg.qr(np.vstack([rows, prior]), mode="r"))
    inverse = solve_triangular(r[:p, :p], np.eye(p))
    variance = float(r[p, p] ** 2) / (len(rows) - p) if len(rows) > p else np.nan
    return inverse @ r[:p, p], variance * inverse @ inverse.T


def block_covariance(rows: Array, error: Array, block: NDArray[np.int64], white: Array) -> Array:
    """Covariance of least-squares weights for errors that are neither white nor normal, because those of a real arm
    repeat.

    Each block of rows is omitted in turn, and the covariance is the spread of the fits to the others. It is at least
    ``white`` in every direction, because there are fewer blocks than weights.

    ``rows`` (m, p): weighted. ``error`` (m,): residuals of the fit. ``block`` (m,): to which each row belongs.
    ``white`` (p, p): covariance if the errors were independent.

    References
    ----------
    Kunsch 1989, The jackknife and the bootstrap for general stationary observations, Annals of Statistics 17(3),
    1217-1241.

    Examples
    --------
    >>> import numpy as np
    >>> rng = np.random.default_rng(0)
    >>> x, slow = np.ones((4000, 1)), np.repeat(rng.standard_normal(80), 50)
    >>> white = np.array([[slow.var() / 4000]])
    >>> wide = block_covariance(x, slow - slow.mean(), np.arange(4000) // 200, white)
    >>> bool(20.0 < wide[0, 0] / white[0, 0] < 100.0)  # 80 independent errors, not 4000
    True
    """
    deviation = np.sqrt(error @ error / max(len(error) - rows.shape[1], 1))
    scale = 1.0 / deviation if deviation > 0.0 else 0.0
    unit = _root(white)  # with these weights the rows are orthonormal
    return _wider(unit, _spread(rows @ unit * scale, error * scale, block))


def _root(covariance: Array) -> Array:
    """A matrix whose product with its transpose is the covariance, (p, p)."""
    size = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    values, vectors = np.linalg.eigh(covariance / np.outer(size, size))
    return np.asarray(size[:, None] * vectors * np.sqrt(np.maximum(values, 0.0)))


def _spread(rows: Array, error: Array, block: NDArray[np.int64]) -> Array:
    """Covariance (p, p) of weights whose total information is the identity, by leaving out each block of rows in
    turn.
    """
    moved = []
    for b in np.unique(block):
        own = rows[block == b]
        others = np.eye(rows.shape[1]) - own.T @ own
        moved.append(np.linalg.lstsq(others, -own.T @ error[block == b], rcond=1e-9)[0])
    apart = np.array(moved) - np.mean(moved, axis=0)
    return np.asarray(apart.T @ apart * (len(moved) - 1.0) / len(moved))


def _wider(unit: Array, spread: Array) -> Array:
    """The covariance ``unit unit'``, widened in every direction in which ``spread`` exceeds one."""
    values, turned = np.linalg.eigh(spread)
    half = unit @ turned * np.sqrt(np.maximum(values, 1.0))
    return np.asarray(half @ half.T)


class Known(NamedTuple):
    """Prior knowledge of the weights from another record: ``root`` (r, p) times (weights - values) has unit variance.

    ``covariance`` (p, p) is that of the values, zero where nothing is known; ``unexplained`` the rms of what they left
    of each joint's drive in that record (Nm or N), by joint, and ``varied`` the standard deviation of that drive.

    Examples
    --------
    >>> import numpy as np
    >>> from whsklearn.datasets import default_arm
    >>> numbers = {"pitch.coulomb": 1.0, "pitch.input_offset": 5.0}
    >>> model = ArmModel(default_arm(), numbers, dt=0.01, logged="position", covariance=np.diag([0.04, 1.0]))
    >>> Known.of(model, list(numbers)).root.round(1).tolist()
    [[5.0, 0.0]]
    """

    values: Array
    covariance: Array
    root: Array
    unexplained: Mapping[str, float]
    varied: Mapping[str, float]

    @classmethod
    def of(cls, model: ArmModel, names: Sequence[str]) -> Known:
        """From a model, in the order of ``names``; nothing is known of drive offsets, which differ between records.

        A model without a covariance is taken to be correct in its first `DIGITS` digits.
        """
        own = list(model.numbers)
        if missing := [n for n in names if n not in model.numbers]:
            raise ValueError(
                f"The model has no number {missing[0]!r}; give one that identify wrote of this robot and law."
            )
        at, values = [own.index(n) for n in names], np.array([model.numbers[n] for n in names], dtype=float)
        c = np.diag((10.0**-DIGITS * np.maximum(np.abs(values), ROUNDING)) ** 2)
        if model.covariance is not None:
            c = np.asarray(model.covariance, dtype=float)[np.ix_(at, at)]
        kept = np.array([not n.endswith(f".{InputOffset.name}") for n in names])
        c = c * np.outer(kept, kept)
        size = np.sqrt(np.diag(c)[kept])
        power, vectors = np.linalg.eigh(c[np.ix_(kept, kept)] / np.outer(size, size))
        root = np.zeros((int(kept.sum()), len(c)))
        root[:, kept] = (vectors / np.sqrt(np.maximum(power, ROUNDING * power[-1]))).T / size
        return cls(values, c, root, model.unexplained, model.varied)


def updated(rows: Array, target: Array, block: NDArray[np.int64], known: Array) -> tuple[Array, Array, float]:
    """Weights of the columns of a record combined with the prior knowledge from another record; their covariance; its
    inflation.

    The inflation is the factor of the variances over those of independent errors that agree with the other record.

    A number that this record determines better is moved, and one that it hardly determines is kept. Errors that repeat
    within the record reduce the effective number of rows. If the two records disagree by more than their errors, all
    errors are widened.

    ``rows`` (m, p): weighted. ``target`` (m,): minus the prediction from the other record. ``block`` (m,): to which
    each row belongs. ``known`` (r, p): its product with the weights is zero with unit variance (`Known`).

    References
    ----------
    Theil and Goldberger 1961, On pure and mixed statistical estimation in economics, Int. Economic Review 2(1), 65-78;
    Birge 1932, The calculation of errors by the method of least squares, Physical Review 40, 207-227.

    Examples
    --------
    >>> import numpy as np
    >>> rng = np.random.default_rng(0)
    >>> rows = rng.standard_normal((400, 3)) * [1.0, 1.0, 0.0]  # the third moves nothing
    >>> target = rows @ [1.0, 2.0, 3.0] + 0.1 * rng.standard_normal(400)
    >>> x, c, _ = updated(rows, target, np.arange(400) // 20, np.array([[0.0, 0.0, 2.0]]))
    >>> x.round(1).tolist(), float(np.sqrt(c[2, 2]).round(2))  # it stays where it was, +- 1/2
    ([1.0, 2.0, 0.0], 0.5)
    """
    scale = np.linalg.norm(np.vstack([rows, known]), axis=0)
    scale = np.where(scale > 0.0, scale, 1.0)
    rows, known = rows / scale, known / scale
    x = np.linalg.lstsq(rows, target, rcond=SAME)[0]
    left = target - rows @ x
    variance, repeats = max(float(left @ left) / max(len(left) - rows.shape[1], 1), 1e-300), 1.0
    for _ in range(2):  # errors taken as independent, and then as they repeat
        variance *= repeats
        all_rows = np.vstack([rows / np.sqrt(variance), known])
        u, s, vt = np.linalg.svd(all_rows, full_matrices=False)
        s = np.where(s > SAME * s[0], s, np.inf)
        x = (vt.T / s) @ (u[: len(rows)].T @ (target / np.sqrt(variance)))
        unit = vt.T / s
        seen, left = u[: len(rows)], (target - rows @ x) / np.sqrt(variance)
        spread = _spread(seen, left, block)
        repeats = max(repeats, float(np.trace(spread)) / max(float(np.sum(seen**2)), 1e-300))
    beside = u[len(rows) :]
    tested = len(known) - float(np.sum(beside**2))  # directions in which both records carry information
    apart = max(float(np.sum((known @ x) ** 2)) / max(tested, 1.0), 1.0)
    return x / scale, apart * _wider(unit, spread) / np.outer(scale, scale), apart * repeats


def held_out(
    phi: Array, target: Array, keep: NDArray[np.bool_], weights: Array, drive: Array | None = None,
    known: Array | None = None,
) -> Array:  # fmt: skip
    """For each joint the rms error on blocks that were not fitted, as a share of its rms drive there; (n_joints,).

    NaN for a joint without used rows, because it does not move.

    ``phi``, ``target``, ``keep``, ``weights``: rows of all joints, as `RigidBodyLags.joint_rows` makes them. ``drive``
    (m, n_joints): the drives, if ``target`` is only a part of them. ``known`` (r, n_columns): see `fitted`.
    """
    block = np.arange(len(phi)) * BLOCKS // len(phi)
    whole = np.sum(np.where(keep, target if drive is None else drive, 0.0) ** 2, axis=0)
    left = np.zeros(target.shape[1])
    for fold in range(2):
        test = block % 2 == fold
        theta, _ = fitted(phi[~test], target[~test], keep[~test], weights, known)
        left += np.sum(np.where(keep, target - phi @ theta, 0.0)[test] ** 2, axis=0)
    return np.asarray(np.sqrt(left / np.where(whole > 0.0, whole, np.nan)))


def one_axis(rows: ArmRows, joint: int) -> float:
    """`held_out` of one joint as a single axis, behind the same filter; NaN if it does not move."""
    lags, arm = rows.lags, rows.lags.arm_
    alone = Arm([arm.joints[joint]], [-1], [False], [np.eye(3)], [[0, 0, 0]], [[0, 0, 1]], gravity=(0, 0, 0))
    own = RigidBodyLags(
        alone, lags.sample_rate, law=lags.law, cutoff=lags.cutoff_, slow=lags.slow, reversals=lags.reversals
    )
    try:
        seen = records_of(own, rows.position[:, [joint]], rows.drive[:, [joint]], rows.groups)
    except ValueError:
        return float("nan")
    return float(held_out(seen.phi, seen.target, seen.keep, seen.weights)[0])


def nominal_numbers(lags: RigidBodyLags) -> dict[str, float]:
    """Base numbers of the robot's file: links, motor inertia, damping and dry friction; empty without a mass."""
    arm = lags.arm_
    if not arm.inertial[:, 0].any():
        return {}
    return dict(zip(lags.base_.names, lags.weights_of(arm).tolist(), strict=True))


# Smallest absolute correlation between the positions of all joints at which they are taken to move along one line:
# 0.997 on the AIRBOT; random sines and the other records here are below 0.7.
ONE_LINE = 0.97
FAR = 4.0 * np.pi  # rad: no limb turns further, while degrees exceed it at once
UNLIKE = 30.0  # times the drive that the file's masses require: amperes logged in mA give 1,000, gear ratios up to 300
# Columns given to other joints (`python -m benchmarks.joint_order` prints what these are compared with).
CLEARLY = 0.25  # of the drives' residual: half the error at the joints affected by another order
# Of a drive's variance, left by a fit of all joints: then other orders of the positions are tried, on some samples.
# Simulated arms in order leave 0.0003, and with two joints exchanged 0.03 to 0.9; real ones in order leave 0.01, with a
# wrist turned by its neighbour 0.2.
MUCH, SOME = 0.005, 6000
FEW = 5  # rows per number at the instants at which all orders are compared before the best one is judged on all rows
LESS = 0.7  # of what is left at a joint: for an order to be better, each joint that it moves has to have this or less
# By which the order told has to lead every other one tried.  Where six joints move along one line to 0.5 %, 26 of 33
# orders that were told led by as much, and were right; of the other seven one was wrong (`python -m
# benchmarks.joint_order --arms 2 --seed 1420001 --line 0.005`).
DOUBT = 0.5
# Drawn orders from which one is sought, about half of which lead to the right one; and numbers fitted, over all orders
# tried, before it is over: all 720 orders of six joints may be tried, and of 20 joints as many as 10 s of CPU allow.
DRAWN, TRIED = 16, 100_000


def suspicions(arm: Arm, q: Array, torque: Array) -> list[str]:
    """Warnings about a log that looks wrong: degrees, mA, all joints moving as one.

    ``q``, ``torque`` are (n, n_joints).
    """
    out = []
    far = [j for j, x, slides in zip(arm.joints, q.T, arm.slides, strict=True) if not slides and np.ptp(x) > FAR]
    if far:
        out.append(f"The travel of {', '.join(far)} exceeds two turns; for degrees, give --unit position=deg.")
    moving = q[:, np.ptp(q, axis=0) > 0.0]
    if moving.shape[1] > 1 and np.abs(np.corrcoef(moving.T)).min() > ONE_LINE:
        out.append(
            "All joints move along one line, so the log says little of how they act on each other, and free runs off "
            "that line are the file's; let joints move at different times or frequencies."
        )
    if not arm.inertial[:, 0].any():
        return out
    rest = np.zeros_like(q)
    gravity = arm.inverse_dynamics(q, rest, rest, effects=False)
    needed, there = np.sqrt(np.mean(gravity**2, axis=0)), np.sqrt(np.mean(torque**2, axis=0))
    heavy = needed > 0.2 * needed.max() if needed.max() > 0 else np.zeros(len(needed), dtype=bool)
    if not far and heavy.any() and np.median(there[heavy] / needed[heavy]) > UNLIKE:
        times = float(np.median(there[heavy] / needed[heavy]))
        out.append(
            f"The drives are {times:.0f} times what gravity requires with the file's masses; "
            "if they are currents in mA, give --unit drive=mA and --gains; if they are counts, convert them to Nm."
        )
    return out


@threadpool_limits.wrap(limits=1, user_api="blas")
def in_another_order(rows: ArmRows) -> list[str]:
    """A sentence if the drives fit far better with the columns of the joints in another order, else none.

    A joint's own columns explain its own drive best, whatever the others are.  If the numbers that all joints share
    then leave much of a drive, the positions are in another order, too, and it is sought.  What is found has to be no
    worse for any joint that it moves, and far better for all of them together: a large effect that one joint lacks is
    no such order.  It is an example only if another order fits about as well, as where all joints move along one line.
    """
    lags, q, torque = rows.lags, rows.position, rows.drive
    names, triple = lags.arm_.joints, (rows.phi, rows.target, rows.keep)
    given = places = np.arange(len(names))
    before = _left(*triple)
    drives, left = _ordered(*triple)
    if (left > MUCH).any() or (drives != given).any():
        trial, whole = clone(lags).set_params(cutoff=lags.cutoff_), max(experiments(rows.groups, len(q)), key=_length)
        middle = whole.start + max((_length(whole) - SOME) // 2, 0)
        part = slice(middle, min(middle + SOME, whole.stop))
        instants = _Instants(trial.fit(q[part]), q[part], torque[part], drives)
        other = instants.sought()
        with warnings.catch_warnings(), suppress(ValueError):  # nothing may move in this part
            warnings.simplefilter("ignore", UserWarning)
            paid, rest = _ordered(*trial.joint_rows(q[part][:, other], torque[part]))
            if np.log(MUCH + rest).sum() < np.log(MUCH + left).sum():
                places, drives, left = other, paid, rest
    moved = (places != given) | (drives != given)
    better = left[moved] <= before[moved]
    if not moved.any() or not better.all() or left[moved].sum() > CLEARLY * before[moved].sum():
        return []
    orders = [("positions", places), ("drives", drives)] if (places != drives).any() else [("columns", places)]
    told = [
        f"the {what} given for {', '.join(names[k] for k in given[order != given])} are those of "
        f"{', '.join(names[k] for k in np.argsort(order)[order != given])}"
        for what, order in orders if (order != given).any()
    ]  # fmt: skip
    what = f"{' and '.join(told)}, in this order"
    if instants.lead(places, drives) < DOUBT:
        return [
            f"The drives fit far better in another order of the columns, for example if {what}; "
            "others fit about as well, so check all columns and name them with --joints."
        ]
    return [f"The drives fit far better if {what}; name the columns with --joints."]


class _Instants:
    """Some instants of a record, behind one filter, at which orders of the joints are compared.

    Columns are taken of the filtered motion and not filtered themselves, so that an order of six joints costs a
    millisecond.  ``drives`` are those that each joint's own columns explain best in the order given.
    """

    def __init__(self, lags: RigidBodyLags, q: Array, torque: Array, drives: NDArray[np.int64]):
        rate, n = lags.sample_rate, q.shape[1]
        rows = lags.samples_of(len(q))
        some = rows[:: max(len(rows) * n // (FEW * len(lags.base_.names)), 1)]
        each = [motion(x, rate, lags.cutoff_) for x in q.T]
        speeds = np.sqrt(np.mean(np.column_stack([m.velocity for m in each]) ** 2, axis=0))
        self.lags, self.time, self.paid = lags, some / rate, drives
        self.drive = zero_phase(torque, rate, lags.cutoff_)[some]
        self.moved = Motion(*(np.column_stack([x[some] for x in xs]) for xs in zip(*each, strict=True)))
        self.fast = np.abs(self.moved.velocity) > lags.slow * speeds
        self.tried: dict[tuple[int, ...], dict[tuple[int, ...], float]] = {}

    def left(self, places: NDArray[np.int64]) -> float:
        """What remains with the positions in this order, by the likelihood of joints with errors of their own.

        Each position keeps the drive that its columns explain, or that of its own name, or drives are right as given.
        A joint in another place has to gain what chance does not give.
        """
        key = tuple(places.tolist())
        if key not in self.tried:
            given = np.arange(len(places))
            phi = self.lags.columns(Motion(*(x[:, places] for x in self.moved)), self.drive[:, places], self.time)
            shared = _Shared(phi, self.fast[:, places])
            ways = {tuple(way.tolist()): way for way in (self.paid[places], places, given)}
            self.tried[key] = {
                way: float(np.log(MUCH + shared.left(self.drive[:, at])).sum())
                - float(np.log(LESS)) * int(((places != given) | (at != given)).sum())
                for way, at in ways.items()
            }
        return min(self.tried[key].values())

    def lead(self, places: NDArray[np.int64], drives: NDArray[np.int64]) -> float:
        """By how much this order of positions and drives leaves less than every other one tried."""
        each = {(p, way): x for p, ways in self.tried.items() for way, x in ways.items()}
        own = each.pop((tuple(places.tolist()), tuple(drives.tolist())), np.inf)
        return min(each.values()) - own

    def sought(self) -> NDArray[np.int64]:
        """The order of the positions that leaves least, from several starts."""
        given, rng = np.arange(len(self.paid)), np.random.default_rng(0)
        usual = given, np.argsort(self.paid), given[::-1], np.roll(given, 1), np.roll(given, -1)
        starts = sorted(usual, key=self.left)
        best, little = self._descended(starts[0]), len(given) * np.log(2.0 * MUCH)  # its neighbours are rivals of it
        for start in (*starts[1:], *(rng.permutation(given) for _ in range(DRAWN))):
            if self.left(best) > little and not self._over():
                best = min(best, self._descended(start), key=self.left)
        return best

    def _over(self) -> bool:
        return len(self.tried) * len(self.lags.base_.names) > TRIED

    def _descended(self, places: NDArray[np.int64]) -> NDArray[np.int64]:
        """The order reached by exchanges, as long as they leave less: the best one, or many at once by assignment."""
        while True:
            cost, now = np.full((len(places),) * 2, self.left(places)), places
            for i, j in itertools.combinations(range(len(places)), 2):
                if self._over():
                    return places
                other = now.copy()
                other[[i, j]] = now[[j, i]]
                cost[i, j] = cost[j, i] = self.left(other)
                places = min(places, other, key=self.left)
            places = min(places, now[linear_sum_assignment(cost)[1]], key=self.left)
            if (places == now).all():
                return now


def in_degrees(rows: ArmRows) -> list[str]:
    """A sentence if the drives of joints that turn fit far better with their positions taken as degrees, else none.

    Those of half of them have to, and all no worse in sum: the drive of a wrist is mostly friction, in any unit.
    """
    lags, q = rows.lags, rows.position
    turns = ~np.asarray(lags.arm_.slides, dtype=bool)
    if not (np.ptp(q[:, turns], axis=0) > FAR).any():
        return []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        trial = clone(lags).set_params(cutoff=lags.cutoff_)
        left = _left(*trial.joint_rows(np.where(turns, np.radians(q), q), rows.drive, rows.groups))
    before = _left(rows.phi, rows.target, rows.keep)
    if 2 * np.sum((left <= CLEARLY * before)[turns]) < turns.sum() or left.sum() > before.sum():
        return []
    return ["The drives fit far better with the positions taken as degrees; give --unit position=deg."]


def _length(s: slice) -> int:
    return int(s.stop - s.start)


class _Shared:
    """Rows of all joints, and what the numbers that they share leave of drives.

    Normal equations are summed by joint, so that further orders of the drives cost little.  ``phi`` and ``keep`` are as
    `RigidBodyLags.joint_rows` makes them.
    """

    def __init__(self, phi: Array, keep: NDArray[np.bool_]):
        self.rows, self.keep, self.count = np.where(keep[:, :, None], phi, 0.0), keep, np.maximum(keep.sum(axis=0), 1)
        self.squares = np.zeros((phi.shape[1], phi.shape[2], phi.shape[2]))
        for j, square in enumerate(self.squares):
            own = np.flatnonzero(np.any(self.rows[:, j] != 0.0, axis=0))
            rows = self.rows[:, j, own]
            square[np.ix_(own, own)] = rows.T @ rows

    def left(self, target: Array) -> Array:
        """The share of each drive's variance that is left, (n_joints,); ``target`` (m, n_joints) are the drives."""
        drives = np.where(self.keep, target, 0.0)
        power = np.sum(np.where(self.keep, drives - drives.sum(axis=0) / self.count, 0.0) ** 2, axis=0)
        power = np.where(power > 0.0, power, 1.0)
        weights = self.count / power
        # the weak prior is that of drives near one, and a log may be in counts
        gram = np.tensordot(weights, self.squares, 1) + np.eye(self.rows.shape[2]) * weights.min() / PRIOR
        unit = np.sqrt(np.diag(gram))
        scaled = gram / np.outer(unit, unit) + ROUNDING * np.eye(len(unit))
        cross = np.tensordot(drives * weights, self.rows, 2) / unit
        theta = solve(scaled, cross, assume_a="pos") / unit
        return np.asarray(np.sum((drives - self.rows @ theta) ** 2, axis=0) / power)


def _left(phi: Array, target: Array, keep: NDArray[np.bool_]) -> Array:
    """`_Shared.left` of one order of the drives."""
    return _Shared(phi, keep).left(target)


def _ordered(phi: Array, target: Array, keep: NDArray[np.bool_]) -> tuple[NDArray[np.int64], Array]:
    """The drive that each joint's own columns explain best, and what all together leave in that order."""
    order = np.asarray(linear_sum_assignment(_left_of_drives(phi, target, keep))[1])
    return order, _left(phi, target[:, order], keep)


def _left_of_drives(phi: Array, target: Array, keep: NDArray[np.bool_]) -> Array:
    """What the columns of each joint (row) leave of each drive (column), as a share of its power, (n, n)."""
    left = np.ones((target.shape[1],) * 2)
    for j in range(len(left)):
        rows = phi[keep[:, j], j]
        rows = rows[:, np.any(rows != 0.0, axis=0)]
        if len(rows) > 2 * rows.shape[1]:
            scaled, drives = rows / np.linalg.norm(rows, axis=0), target[keep[:, j]]
            error = drives - scaled @ np.linalg.lstsq(scaled, drives, rcond=1e-9)[0]
            left[j] = np.sum(error**2, axis=0) / np.sum(drives**2, axis=0)
    return left
