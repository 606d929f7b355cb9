"""What looks wrong in an arm's log: too few rows, joints in another order or in degrees, drives in another scale."""

from __future__ import annotations

import itertools
import warnings
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve
from scipy.optimize import linear_sum_assignment, minimize_scalar
from sklearn.base import clone
from threadpoolctl import threadpool_limits

from whsklearn.effects import Coulomb, InputOffset, Viscous
from whsklearn.effects.base import Array
from whsklearn.filtering.records import Motion, motion, zero_phase
from whsklearn.identification.joint_least_squares import GROWS, PRIOR, fitted, with_blocks
from whsklearn.lags.arm_rows import ArmRows
from whsklearn.lags.axis_rows import experiments
from whsklearn.lags.rigid_body import RigidBodyLags
from whsklearn.systems.base_parameters import ROUNDING

# Smallest absolute correlation between the positions of all joints at which they are taken to move along one line:
# 0.997 on the AIRBOT; random sines and the other records here are below 0.7.
ONE_LINE = 0.97
FAR = 4.0 * np.pi  # rad: no limb turns further, while degrees exceed it at once
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
# A drive in another scale: a factor beyond what the masses of a robot's file are often wrong by, and one from which a
# wrong unit is likelier than a wrong gain (mA give 1,000); and where the search begins, with both signs.
LARGE, MILLI = 1.5, 30.0
FACTORS = np.outer([1.0, -1.0], np.geomspace(1e-3, 1e3, 19)).ravel()
FURTHEST = 2.0 * FACTORS.max()  # an optimum beyond is that of a joint whose drive had better be left out
BRAKES = Viscous.name, Coulomb.name
# Smallest friction, as a share of a joint's drive, whose sign tells that of the drive.  Of an arm without any, filters
# leave a ten-thousandth of either sign (the example of `whsklearn.identification.Payload`).
SOME_FRICTION = 0.004


def enough_rows(rows: ArmRows) -> None:
    """Raise ValueError if the log gives fewer rows than the arm has numbers."""
    there, needed = int(rows.keep.sum()), len(rows.lags.base_.names)
    if there < needed:
        seconds = len(rows.position) / rows.lags.sample_rate
        raise ValueError(f"The log of {seconds:.3g} s gives {there} rows for {needed} numbers; record longer.")


def suspicions(rows: ArmRows) -> list[str]:
    """Warnings about a log that looks wrong: degrees, all joints moving as one."""
    arm, q = rows.lags.arm_, rows.position
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
    return out


@threadpool_limits.wrap(limits=1, user_api="blas")
def in_another_order(rows: ArmRows) -> list[str]:
    """A sentence if the drives fit far better with the columns of the joints in another order, else none.

    A joint's own columns explain its own drive best, whatever the others are.  If the numbers that all joints share
    then leave much of a drive, the positions are in another order, too, and it is sought.  What is found has to be no
    worse for any joint that it moves, nor for any drive if each joint has numbers of its own, and far better for all of
    them together: a large effect that one joint lacks is no such order.  The spring of a vertical axis had looked like
    the weight of the next link, although that link's own columns explained its drive to rounding where it was.  What is
    told is an example only if another order fits about as well, as where all joints move along one line.
    """
    lags, q, torque = rows.lags, rows.position, rows.drive
    names, triple = lags.arm_.joints, (rows.phi, rows.target, rows.keep)
    given = places = np.arange(len(names))
    alone = _left_of_drives(*triple)
    by_themselves = alone
    before = _left(*triple)
    drives, left = _ordered(*triple, alone)
    if (left > MUCH).any() or (drives != given).any():
        trial, whole = clone(lags).set_params(cutoff=lags.cutoff_), max(experiments(rows.groups, len(q)), key=_length)
        middle = whole.start + max((_length(whole) - SOME) // 2, 0)
        part = slice(middle, min(middle + SOME, whole.stop))
        instants = _Instants(trial.fit(q[part]), q[part], torque[part], drives)
        other = instants.sought()
        with warnings.catch_warnings(), suppress(ValueError):  # nothing may move in this part
            warnings.simplefilter("ignore", UserWarning)
            phi, target, keep = trial.joint_rows(q[part][:, other], torque[part])
            elsewhere = _left_of_drives(phi, target, keep)
            for paid in (_ordered(phi, target, keep, elsewhere)[0], instants.drives_of(other)):
                rest = _left(phi, target[:, paid], keep)
                if np.log(MUCH + rest).sum() < np.log(MUCH + left).sum():
                    places, drives, left, by_themselves = other, paid, rest, elsewhere
    moved = (places != given) | (drives != given)
    better = left[moved] <= before[moved]
    better &= LESS * by_themselves[given, drives][moved] <= np.diag(alone)[drives][moved]
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

    def drives_of(self, places: NDArray[np.int64]) -> NDArray[np.int64]:
        """The order of the drives with which `left` is what it is."""
        ways = self.tried[tuple(places.tolist())]
        return np.array(min(ways, key=lambda way: ways[way]))

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
        drives, power = np.where(self.keep, target, 0.0), self._power(target)
        theta = self._solved(self.count / power, np.tensordot(drives * self.count / power, self.rows, 2))
        return np.asarray(np.sum((drives - self.rows @ theta) ** 2, axis=0) / power)

    def of_divided(self, target: Array) -> Callable[[Array], Array]:
        """`left` as a function of the factors by which the drives are divided, (n_joints,)."""
        drives = np.where(self.keep, target, 0.0)
        power, whole = self._power(target), np.sum(drives**2, axis=0)
        cross = np.einsum("tj,tjp->jp", drives, self.rows)

        def left(factors: Array) -> Array:
            weights = self.count / power * factors  # the rows are multiplied instead
            theta = self._solved(weights * factors, weights @ cross)
            rest = whole - 2.0 * factors * (cross @ theta) + factors**2 * ((self.squares @ theta) @ theta)
            return np.asarray(np.maximum(rest, 0.0) / power)

        return left

    def _power(self, target: Array) -> Array:
        """Of each drive, times the rows of the joint to which it is given: that of all rows, in any order the same.

        In rows of joints that move one after the other, the drive of another joint may be the larger one, and what is
        left of it a smaller share: seven such joints were told to be in another order.
        """
        power = self.count * np.var(target, axis=0)
        return np.where(power > 0.0, power, 1.0)

    def _solved(self, weights: Array, cross: Array) -> Array:
        # the weak prior is that of drives near one, and a log may be in counts
        gram = np.tensordot(weights, self.squares, 1) + np.eye(self.rows.shape[2]) * weights.min() / PRIOR
        unit = np.sqrt(np.diag(gram))
        scaled = gram / np.outer(unit, unit) + ROUNDING * np.eye(len(unit))
        return np.asarray(solve(scaled, cross / unit, assume_a="pos") / unit)


def _left(phi: Array, target: Array, keep: NDArray[np.bool_]) -> Array:
    """`_Shared.left` of one order of the drives."""
    return _Shared(phi, keep).left(target)


def _ordered(phi: Array, target: Array, keep: NDArray[np.bool_], alone: Array) -> tuple[NDArray[np.int64], Array]:
    """The drive that each joint's own columns explain best (``alone``: `_left_of_drives`), and what all together leave
    in that order.
    """
    order = np.asarray(linear_sum_assignment(alone)[1])
    return order, _left(phi, target[:, order], keep)


def _left_of_drives(phi: Array, target: Array, keep: NDArray[np.bool_]) -> Array:
    """What the columns of each joint (row) leave of each drive (column), as a share of its power, (n, n)."""
    left, power = np.ones((target.shape[1],) * 2), np.mean(target**2, axis=0)
    for j in range(len(left)):
        rows = phi[keep[:, j], j]
        rows = rows[:, np.any(rows != 0.0, axis=0)]
        if len(rows) > 2 * rows.shape[1]:
            scaled, drives = rows / np.linalg.norm(rows, axis=0), target[keep[:, j]]
            error = drives - scaled @ np.linalg.lstsq(scaled, drives, rcond=1e-9)[0]
            left[j] = np.mean(error**2, axis=0) / power
    return left


class Scale(NamedTuple):
    """A drive as a multiple of what it should be, and the standard error.

    By the masses given, ``left`` is the variance that the factor leaves of the drive, and ``power`` what a difference
    of one from it adds.
    """

    factor: float
    error: float
    left: float = 0.0
    power: float = 0.0

    def rather_one(self, factor: float) -> bool:
        """Whether the drive, by the masses given, is clearly what it should be and not this multiple of it."""
        one, other = (self.left + self.power * (f - self.factor) ** 2 for f in (1.0, factor))
        return one < CLEARLY * other

    @property
    def sure(self) -> bool:
        """Whether it is surely large or small, or negative."""
        low, high = self.factor - GROWS * self.error, self.factor + GROWS * self.error
        return high < 0.0 or low > LARGE or (low > 0.0 and high < 1.0 / LARGE)

    def __str__(self) -> str:
        return f"{self.factor:.4g} +- {self.error:.2g}"


@threadpool_limits.wrap(limits=1, user_api="blas")
def in_another_scale(rows: ArmRows, *, known: Array | None = None) -> list[str]:
    """Sentences on drives with a wrong gain, unit or sign.

    Joints share numbers, so a factor at one shows as an error at its neighbours, whatever the masses.  A factor that is
    common to all, or at a joint that hardly acts on others, shows only beside the masses given; and friction that
    drives its joint shows a wrong sign without either.

    ``known`` (n_columns,): numbers of another record, by which drives are judged in place of the masses.
    """
    joints = rows.lags.arm_.joints
    file = by_masses(rows) if known is None else by_numbers(rows, known)
    coupled = by_coupling(rows, file)
    out = []
    for alike in coupled.values():
        ways = " or ".join(f"that of {joints[k]} is divided by {scale}" for k, scale in alike.items())
        out.append(f"The drives fit far better if {ways}; check gain, unit and sign there.")
    told = {j: s for j, s in file.items() if j not in coupled and (s.sure or known is not None)}
    if told and known is not None:
        factors = ", that of ".join(f"{joints[j]} is {scale.factor:#.3g}" for j, scale in told.items())
        out.append(f"The drive of {factors} times what the model given requires; check gain, unit and sign there.")
    elif told:
        factors = ", that of ".join(f"{joints[j]} is {scale}" for j, scale in told.items())
        unit = "; for currents in mA, give --unit drive=mA and --gains" if max(told.values()).factor > MILLI else ""
        out.append(
            f"The drive of {factors} times what the masses given require; check gain, unit and sign there, or the "
            f"masses and what the arm carries{unit}."
        )
    if driven := [joints[j] for j in _driven_by_friction(rows) if j not in coupled and j not in told]:
        out.append(
            f"By the log, friction drives {', '.join(driven)} where it should brake; check the sign of the drive and "
            "that of the position."
        )
    return out


def by_masses(rows: ArmRows) -> dict[int, Scale]:
    """Each joint's drive as a multiple of the one that the masses given require, if it has the same form.

    That is, if these explain it about as well as free numbers do.  A payload gives it another form, and so do masses
    that are wrong in another way than by a factor.  Nothing is known of a factor that explains little more than one
    does: where little depends on it, an effect that the model lacks moves it by more than its standard error.
    """
    arm, names = rows.lags.arm_, rows.lags.base_.names
    out: dict[int, Scale] = {}
    if not arm.inertial[:, 0].any():
        return out
    links = replace(arm, armature=None, sum_armature={}, effects=(), sums={})
    asked, motors = rows.phi @ rows.lags.weights_of(links), rows.blur(rows.moved.acceleration)
    law, free = ~np.isin(names, arm.number_names), _left(rows.phi, rows.target, rows.keep)
    plain = rows.with_columns()
    for j in np.flatnonzero(rows.keep.any(axis=0)):
        own = rows.phi[:, j, law & np.any(rows.phi[:, j] != 0.0, axis=0)]
        phi = np.column_stack([own, motors[:, j], asked[:, j]])[:, None]
        one = replace(plain, phi=phi, target=rows.target[:, [j]], keep=rows.keep[:, [j]])
        left = _left(phi, one.target, one.keep)[0]
        if left <= free[j] / CLEARLY:
            theta, covariance = with_blocks(one, rows.weights[[j]])
            rest = one.target - phi[:, :, -1]  # with a factor of one
            given = _left(phi[:, :, :-1], rest, one.keep)[0] * np.var(rest)
            power = _left(phi[:, :, :-1], asked[:, [j]], one.keep)[0] * np.var(asked[:, j])
            least = left * np.var(one.target)
            error = float(np.sqrt(covariance[-1, -1])) if least <= CLEARLY * given else np.inf
            out[int(j)] = Scale(float(theta[-1]), error, float(least), float(power))
    return out


def by_numbers(rows: ArmRows, numbers: Array) -> dict[int, Scale]:
    """Joints whose drive is surely a multiple of the one that these numbers (n_columns,) require.

    The factor, beside an offset, has to explain the drive about as well as free numbers do, and far better than one.
    What else changes gives the drive another form: by three names, of which each had grown by half, a gain of 1.5 was
    explained as well.
    """
    offsets = np.array([name.endswith(f".{InputOffset.name}") for name in rows.lags.base_.names])
    asked, free = rows.phi @ np.where(offsets, 0.0, numbers), _left(rows.phi, rows.target, rows.keep)
    plain = rows.with_columns()
    out: dict[int, Scale] = {}
    for j in np.flatnonzero(rows.keep.any(axis=0)):
        own = rows.phi[:, j, offsets & np.any(rows.phi[:, j] != 0.0, axis=0)]
        phi = np.column_stack([own, asked[:, j]])[:, None]
        one = replace(plain, phi=phi, target=rows.target[:, [j]], keep=rows.keep[:, [j]])
        left, rest = _left(phi, one.target, one.keep)[0], one.target - phi[:, :, -1]
        given = _left(phi[:, :, :-1], rest, one.keep)[0] * np.var(rest) / max(np.var(one.target), 1e-300)
        if left <= min(free[j] / CLEARLY, CLEARLY * given):
            theta, covariance = with_blocks(one, rows.weights[[j]])
            scale = Scale(float(theta[-1]), float(np.sqrt(covariance[-1, -1])))
            if abs(scale.factor - 1.0) > GROWS * scale.error:
                out[int(j)] = scale
    return out


def by_coupling(rows: ArmRows, file: dict[int, Scale]) -> dict[int, dict[int, Scale]]:
    """Joints whose drive, divided by a factor, lets all drives be explained far better; with those that do as well.

    None that the masses given refute: a spring at an elbow, which the arm lacks, is half explained by a shoulder of
    half the drive.  That with the largest effect comes first, and the next is sought beside it.  Of several that are as
    good, it is the one whose factor is that of the masses given, if there are any; then the others are not told.
    """
    n = rows.lags.arm_.n_joints
    left, factors = _Shared(rows.phi, rows.keep).of_divided(rows.target), np.ones(n)
    found: dict[int, dict[int, Scale]] = {}
    while len(found) < n - 1:  # a factor at all of them changes nothing
        before = left(factors)
        tried = {j: _best(left, factors, j) for j in range(n) if j not in found and before[j] > MUCH}
        after = {j: left(f) for j, f in tried.items()}
        cost = {j: float(np.log(MUCH + x).sum()) for j, x in after.items()}
        good = [j for j, x in after.items() if x[j] <= CLEARLY * before[j] and np.all(x <= before + MUCH)]
        good = [
            j for j in good if cost[j] <= min(cost.values()) + DOUBT and 1 < FURTHEST * abs(tried[j][j]) < FURTHEST**2
        ]
        scales = {
            j: s
            for j in good
            if (s := _of(rows, tried[j], j)).sure and not (j in file and file[j].rather_one(s.factor))
        }
        if not scales:
            break
        first, known = min(scales, key=lambda j: cost[j]), [j for j in scales if j in file]
        if known:
            first = min(known, key=lambda j: abs(file[j].factor / scales[j].factor - 1.0))
            scales = {first: scales[first]}
        found[first], factors = {first: scales[first]} | scales, tried[first]
    return found


def _best(left: Callable[[Array], Array], factors: Array, joint: int) -> Array:
    """The factors with that of a joint at which least is left."""

    def at(factor: float) -> Array:
        return np.where(np.arange(len(factors)) == joint, factor, factors)

    def cost(factor: float) -> float:
        return float(np.log(MUCH + left(at(factor))).sum())

    first, step = min(FACTORS, key=cost), np.log(FACTORS[1] / FACTORS[0])
    return at(float(first * np.exp(minimize_scalar(lambda x: cost(first * np.exp(x)), bounds=(-step, step)).x)))


def _of(rows: ArmRows, factors: Array, joint: int) -> Scale:
    """The factor of a joint with its standard error."""
    rows = replace(rows.with_columns(), target=rows.target / factors)
    along = np.zeros((*rows.keep.shape, 1))
    along[:, joint, 0] = rows.phi[:, joint] @ fitted(rows.phi, rows.target, rows.keep, rows.weights)[0]
    _, covariance = with_blocks(rows.with_columns(along), rows.weights)
    return Scale(float(factors[joint]), float(abs(factors[joint]) * np.sqrt(covariance[-1, -1])))


def _driven_by_friction(rows: ArmRows) -> list[int]:
    """Joints to whose motion friction, `SOME_FRICTION` of the drive or more, surely adds power."""
    arm, names, speed = rows.lags.arm_, rows.lags.base_.names, rows.blur(rows.moved.velocity)
    brakes = np.array([[name in {f"{joint}.{e}" for e in BRAKES} for name in names] for joint in arm.joints])
    phi = np.where(rows.keep[:, :, None], rows.phi, 0.0)
    power = np.einsum("tjp,tj->jp", phi, speed) * brakes
    theta = fitted(rows.phi, rows.target, rows.keep, rows.weights)[0]
    friction = np.linalg.norm(np.einsum("tjp,jp,p->tj", phi, brakes, theta), axis=0)
    whole = np.linalg.norm(np.where(rows.keep, rows.target, 0.0), axis=0)
    asked = (power @ theta < 0.0) & (friction > SOME_FRICTION * whole)
    if not asked.any():
        return []
    theta, covariance = with_blocks(rows, rows.weights)
    return [
        int(j) for j in np.flatnonzero(asked) if power[j] @ theta < -GROWS * np.sqrt(power[j] @ covariance @ power[j])
    ]
