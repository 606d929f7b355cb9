"""An arm from its log: base numbers with intervals, and how well each joint's drive is predicted on held-out blocks."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import minimize
from sklearn.base import clone
from threadpoolctl import threadpool_limits

from whsklearn.effects import Coulomb, Effect, InputOffset, LoadFriction, PreslidingHysteresis, QuadraticDrag, Viscous
from whsklearn.effects.base import Array
from whsklearn.identification.arm_checks import enough_rows, in_another_order, in_another_scale, in_degrees, suspicions
from whsklearn.identification.joint_least_squares import GROWS, SAME, fitted, halves, held_out, with_blocks
from whsklearn.lags.arm_rows import ArmRows, records_of
from whsklearn.lags.axis_rows import DRY
from whsklearn.lags.rigid_body import RigidBodyLags
from whsklearn.models.arm import ArmModel
from whsklearn.systems.arm import Arm, direction_of
from whsklearn.systems.base_parameters import ROUNDING

# Range of the logarithm of the speed over which dry friction reverses, in a joint's rms speed, and largest lead (s):
# MuJoCo's leads by 10 ms, and the memory of lubricated contacts reaches as far.
REVERSES, LEADS = (np.log(0.003), np.log(0.5)), 0.03
WIDTHS, N_LEADS, EVALUATIONS = (0.01, 0.05, 0.2), 11, 40  # where the search begins, and its steps
DISTANCES = PreslidingHysteresis.quantities["distance"].starts  # over which dry friction may reverse instead


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
    for text in (*suspicions(rows), *in_another_scale(rows)):
        warnings.warn(text, UserWarning, stacklevel=3)
    if "reversals" not in settings and (reversals := reversals_of(rows)):
        rows = records_of(lags.set_params(reversals=reversals), q, torque, groups)
        if doubtful := unsure(rows, effects):
            effects |= {j: tuple(e for e in effects[j] if not isinstance(e, LoadFriction)) for j in doubtful}
            rows = records_of(lags.set_params(effects=effects), q, torque, groups)
    lags.weights_ = rows.weights
    names, joints = lags.base_.names, lags.arm_.joints
    aged, moving = with_ages(rows)
    theta, covariance = with_blocks(aged, rows.weights)
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
    Schwarz's criterion, n ln(error squared) + 2 ln n, and if no effect by itself does as well: presliding friction,
    which reverses over a distance, by as much again, and a curve of the speed, such as friction that grows ever more
    slowly, at all.  Over half of all speeds a reversal is such a curve, but an arm whose dry friction jumps then has
    too much of it.  So has one whose friction reverses with the velocity or after it: only the friction of a solver of
    contacts comes first, and what comes later is a distance or a curve again.  In MuJoCo, friction that reverses at
    once leaves two to ten times the error at a wrist, and a delay is then not told from a lag, which the records do
    tell (`python -m benchmarks.blind_arms --evidence`).

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
        curved = error(np.hstack([phi[:, k, at], rows.axis_columns(joint, [QuadraticDrag()])]))
        enough = 2.0 * np.log(n)
        better = n * np.log(abrupt / found.fun) > enough >= n * np.log(found.fun / memory) and found.fun < curved
        if better and found.x[1] > 0.0:
            out[joint] = float(np.exp(found.x[0]) * speed), float(found.x[1])
    return out


class Others:
    """The columns of an arm beside which those of one joint are tried: the error there on blocks that were not fitted.

    All columns are projected out by the square root of their normal equations, which are summed only once.
    """

    def __init__(self, phi: Array, target: Array, keep: NDArray[np.bool_], weights: Array):
        self.rows, self.y, self.keep, self.weights = phi * weights[:, None], target * weights, keep, weights
        self.tests = halves(keep)
        self.sums = []
        for test in self.tests:
            rows, y = (x[keep & ~test] for x in (self.rows, self.y))
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
            fit, held = use & ~test[:, joint], test[:, joint]
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
            known = with_blocks(aged, weights)
            growing = [a for a, i in at.items() if less[direction[a] != 0.0].all() and _sure(*known, i)]
            if len(growing) < asked:
                break
    return growing


def unsure(rows: ArmRows, effects: Mapping[str, tuple[Effect, ...]]) -> list[str]:
    """Joints whose friction was told to grow with the torque, and surely does not where it is known how it reverses."""
    names = rows.lags.base_.names
    asked = [j for j, row in effects.items() if any(isinstance(e, LoadFriction) for e in row)]
    known = with_blocks(with_ages(rows)[0], rows.weights) if asked else None
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
