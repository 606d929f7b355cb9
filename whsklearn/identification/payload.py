"""A payload from a loaded record against an unloaded one, and drive gains from a known load.

The loaded record is fitted together with the knowledge of the arm's parameters from the unloaded one, so that a
parameter which neither record determines well is not fixed at a random value; offsets and ages of the drives belong to
the loaded record. A body at a link adds its ten parameters to those of the link, and the columns of any parameter are
those of the base parameters times its column of the base mapping, so nothing is filtered again. Currents alone do not
determine a gain: with a load of known mass, the currents of each joint in both records are regressed on its columns and
on the load's torque.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.base import clone

from whsklearn.effects.base import Array
from whsklearn.identification.arm_fit import ArmFit, with_ages
from whsklearn.identification.joint_least_squares import N_LEFT_OUT, SAME, Known, block_covariance, blocks_of, updated
from whsklearn.lags.arm_rows import records_of
from whsklearn.lags.rigid_body import RigidBodyLags
from whsklearn.systems._arm_kernels import N_BODY

SEEN = 1e-9  # share of a column's power that remains after what both records know: below it, rounding
MASS = 4  # fitted parameters of a body, m and m c: on the AIRBOT all ten left the mass uncertain by 2 kg
INERTIAS = ((0, 0), (0, 1), (1, 1), (0, 2), (1, 2), (2, 2))  # in the order of a link's numbers
FURTHEST = 1.0  # m, largest distance of a load's centre from its joint during the search
DISTANCES, EVALUATIONS = (0.05, 0.2, 0.6), 300  # m at which a search begins, and the number of its steps
# Share of the power of what a known load leaves of the drives: if one near by leaves less, that is told. From its true
# place it leaves 0.997 or more, from 2 cm beside it 0.71 to 0.82 (`python -m benchmarks.arm_loads --places`), and on
# the AIRBOT, whose columns are no better than 5 %, 0.88 from where its drives tell it.
PLACED = 0.85
ALIKE = 4.0  # chi-squared: two links may explain a load equally well, such as a load on the axis of the last one


class Payload(NamedTuple):
    """A body at a link.

    Attributes
    ----------
    joint : str
        That carries it.
    mass, mass_error : float
        In kg, and its standard error, which includes that of the unloaded fit and of the gains, and the disagreement of
        the two records elsewhere.
    centre, centre_error : tuple of three float
        Of its mass, in the joint's frame, and its standard errors (m).
    left : float
        Share of the squared weighted error that remains.

    References
    ----------
    Swevers, Verdonck, Naumer, Pieters and Biber 2002, An experimental robot load identification method for industrial
    application, Int. J. Robotics Research 21(8), 701-712.

    Examples
    --------
    >>> import numpy as np
    >>> from whsklearn import Arm
    >>> from whsklearn.datasets import make_arm_log
    >>> from whsklearn.identification import find_payload, identify_arm
    >>> arm = Arm.from_dh([(0.4, 0, 0, 0), (0.3, 0, 0, 0)], gravity=(0, -9.81, 0), joints=("one", "two"))
    >>> arm = arm.with_body("one", 3.0, (0.2, 0, 0), 0.04 * np.eye(3))
    >>> arm = arm.with_body("two", 1.0, (0.1, 0, 0), 0.01 * np.eye(3))
    >>> empty = identify_arm(*make_arm_log(arm, return_arrays=True), dt=0.002, robot=arm)
    >>> best = find_payload(empty, *make_arm_log(arm.with_body("two", 0.8, (0.2, 0, 0)), return_arrays=True))[0]
    >>> best.joint, abs(best.mass - 0.8) < 3 * best.mass_error
    ('two', True)
    """

    joint: str
    mass: float
    mass_error: float
    centre: tuple[float, float, float]
    centre_error: tuple[float, float, float]
    left: float


def find_payload(empty: ArmFit, position: ArrayLike, drive: ArrayLike, *, gain_error: float = 0.0) -> list[Payload]:
    """A body at each link whose mass affects a drive, the one with the smallest residual first.

    Parameters
    ----------
    empty : ArmFit
        Of `identify_arm`, without the load.
    position, drive : array-like of shape (n, n_joints)
        Of the loaded record, in the same units.
    gain_error : float, default=0.0
        Relative standard deviation of the drive gains, taken as common to all joints: the mass is proportional to them.
    """
    lags = clone(empty.lags)
    rows = records_of(lags, position, drive)
    phi, keep, weights = rows.phi, rows.keep, rows.weights
    known = Known.of(empty.model, lags.base_.names)
    beside, moving = with_ages(rows)
    record = Beside(
        (beside.phi * weights[:, None])[keep], ((rows.target - phi @ known.values) * weights)[keep],
        np.pad(known.root, ((0, 0), (0, len(moving)))), blocks_of(keep), np.nonzero(keep)[1],
    )  # fmt: skip
    found = []
    for k, joint in enumerate(lags.arm_.joints):
        body = (phi @ lags.base_.mapping[:, N_BODY * k : N_BODY * (k + 1)] * weights[:, None])[keep]
        if (told := record.weigh(joint, body)) is not None:
            found.append(told)
    found.sort(key=lambda one: one[0].left)
    alike = [p.joint for p, chance in found if p.left <= found[0][0].left + found[0][1]]
    last = max(alike, key=lags.arm_.index, default="")
    order = sorted((p for p, _ in found), key=lambda p: p.joint != last)
    return [p._replace(mass_error=float(np.hypot(p.mass_error, p.mass * gain_error))) for p in order]


@dataclass(frozen=True)
class Beside:
    """A record in which a load is sought, with the knowledge from another record."""

    rows: Array  # (m, p): weighted columns of the arm's parameters and of other free parameters
    error: Array  # (m,): weighted residual with the other record's numbers
    known: Array  # (r, p): see `whsklearn.identification.joint_least_squares.updated`
    block: NDArray[np.int64]  # block, joint (m,): to which each row belongs
    joint: NDArray[np.int64]

    @cached_property
    def deviation(self) -> float:
        """Residual of an error if all columns were free."""
        left = self.error - self.rows @ np.linalg.lstsq(self.rows, self.error, rcond=None)[0]
        return max(float(np.sqrt(left @ left / max(len(left) - self.rows.shape[1], 1))), 1e-300)

    def away(self, at: Any) -> Array:
        """Orthonormal columns whose span, reduced by prior knowledge, is projected out of these rows."""
        both = np.vstack([self.rows[at] / self.deviation, self.known])
        return np.linalg.qr(both)[0][: len(self.rows[at])]

    @cached_property
    def _whole(self) -> tuple[Array, Array]:
        q, error = self.away(slice(None)), self.error / self.deviation
        return q, error - q @ (q.T @ error)

    def weigh(self, joint: str, body: Array) -> tuple[Payload, float] | None:
        """The load at the link of a ``joint``, and the chance excess of its residual; None if no drive shows its mass.

        ``body`` (m, 10): weighted columns of the ten numbers of a body at that link.
        """
        q, left = self._whole
        body = body / self.deviation
        inside = q.T @ body
        gram, cross = body.T @ body - inside.T @ inside, body.T @ left
        numbers = point_load(gram, cross)
        slopes = slopes_at(place_of(numbers))
        inner = slopes.T @ gram @ slopes
        size = np.sqrt(np.maximum(np.diag(inner), 0.0))  # rounding, where the other numbers explain a direction
        shown = size > SEEN * size.max()
        size = np.where(shown, size, np.inf)
        power, along = np.linalg.eigh(inner / np.outer(size, size))
        if not shown[0] or np.any((power < SEEN) & (np.abs(along[0]) > SEEN)):
            return None
        columns = np.column_stack([body @ slopes * self.deviation, self.rows])
        x, covariance, wide = updated(columns, self.error, self.block, np.pad(self.known, ((0, 0), (MASS, 0))))
        mass, h = float(x[0]), x[1:MASS]
        centre = h / (mass or np.inf)
        turn = np.column_stack([-centre, np.eye(3)]) / (mass or np.inf)
        errors = np.sqrt(np.maximum(np.diag(turn @ covariance[:MASS, :MASS] @ turn.T), 0.0))
        errors = np.where(shown[1:], errors, np.inf)
        apart = between_joints(*self._by_joint(body @ slopes @ np.append(1.0, place_of(numbers))), wide)
        whole = float(left @ self.error) / self.deviation
        share = float(np.clip(1.0 - numbers @ slopes.T @ cross / max(whole, 1e-300), 0.0, 1.0))
        three = tuple(map(float, centre)), tuple(map(float, errors))
        told = Payload(joint, mass, float(np.sqrt(covariance[0, 0] + apart)), *three, share)  # type: ignore[arg-type]
        return told, ALIKE * wide / max(whole, 1e-300)

    def _by_joint(self, one: Array) -> tuple[Array, Array]:
        """The mass that each joint's drive indicates, and its variance; ``one`` (m,) are the rows of one kilogram."""
        masses, variances = [], []
        for j in np.unique(self.joint):
            at = self.joint == j
            q = self.away(at)
            seen = one[at] - q @ (q.T @ one[at])
            power = float(seen @ one[at])
            if power > SEEN * float(one[at] @ one[at]):
                masses.append(float(seen @ self.error[at]) / self.deviation / power)
                variances.append(1.0 / power)
        return np.array(masses), np.array(variances)


def gains_from_load(
    lags: RigidBodyLags, empty: tuple[ArrayLike, ...], loaded: tuple[ArrayLike, ...], *, joint: str,
    numbers: ArrayLike,
) -> dict[str, tuple[float, float]]:  # fmt: skip
    """Nm per unit of the drive and its standard error, by joint, from a pair of records with a known load.

    Each joint is fitted alone, in its own unit, to both records at once: its columns, an offset of the loaded record
    and the torque of the load, whose weight is one over the gain.  What the load would leave at another place tells
    whether the given one is right.

    Parameters
    ----------
    lags : RigidBodyLags
        With robot and sampling rate.
    empty, loaded : tuple of array-like of shape (n, n_joints)
        Positions and drives without and with the load, the drives in the same unit, such as A; a third array, of shape
        (n,), marks experiments.
    joint : str
        That carries the load.
    numbers : array-like of shape (10,)
        Of the load, in that joint's frame (`whsklearn.systems.arm_files.body_numbers`).

    Returns
    -------
    dict of str to (float, float)
        NaN and an infinite error for a joint whose drive the load does not change.

    Warns
    -----
    UserWarning
        If the drives fit a load at another place much better.

    Examples
    --------
    >>> from whsklearn import RigidBodyLags
    >>> from whsklearn.datasets import default_arm, make_arm_log
    >>> from whsklearn.identification import gains_from_load
    >>> from whsklearn.systems.arm_files import body_numbers
    >>> arm, load = default_arm(), (0.8, (0.1, 0.0, 0.05))
    >>> pair = [make_arm_log(a, return_arrays=True) for a in (arm, arm.with_body("pitch", *load))]
    >>> in_amperes = [(q, torque / 5.0) for q, torque in pair]  # as if each gave 5 Nm/A
    >>> numbers = body_numbers(*load, [[0.0] * 3] * 3)
    >>> gain, _ = gains_from_load(RigidBodyLags(arm, 500.0), *in_amperes, joint="pitch", numbers=numbers)["pitch"]
    >>> abs(gain - 5.0) < 0.1
    True
    """
    own, numbers = clone(lags), np.asarray(numbers, dtype=float)
    rows = [own.joint_rows(*empty)]
    rows.append(clone(lags).set_params(cutoff=own.cutoff_).joint_rows(*loaded))
    phi, target, keep = map(np.concatenate, zip(*rows, strict=True))
    there = np.repeat([0.0, 1.0], [len(one) for one, *_ in rows])
    place, at = numbers[1:MASS] / (numbers[0] or np.inf), N_BODY * own.arm_.index(joint)
    one = np.column_stack([numbers, numbers[0] * slopes_at(place)[:, 1:]])  # the load, and as its centre moves
    load = (phi * there[:, None, None]) @ (own.base_.mapping[:, at : at + N_BODY] @ one)
    block = there * N_LEFT_OUT + np.concatenate([np.arange(len(x)) * N_LEFT_OUT // len(x) for x, *_ in rows])
    gains, beside = {}, [np.zeros((0, 4))]
    for j, name in enumerate(own.arm_.joints):
        use, gains[name] = keep[:, j], (float("nan"), float("inf"))
        columns = np.column_stack([load[:, j, 0], there, phi[:, j]])[use]
        columns = columns[:, np.any(columns != 0.0, axis=0)]
        if not load[use, j, 0].any() or len(columns) < 2 * columns.shape[1]:
            continue
        columns = columns / np.linalg.norm(columns, axis=0)
        inverse = np.linalg.pinv(columns, rcond=SAME)
        share = inverse @ target[use, j]
        error = target[use, j] - columns @ share
        white = inverse @ inverse.T * (error @ error) / (len(error) - len(share))
        spread = float(np.sqrt(block_covariance(columns, error, block[use], white)[0, 0]))
        if share[0] <= spread:  # not told from none
            continue
        gain = float(np.linalg.norm(load[use, j, 0]) / share[0])
        gains[name] = gain, gain * spread / float(share[0])
        moved = load[use, j, 1:] - columns @ (inverse @ load[use, j, 1:])
        beside.append(np.column_stack([moved / gain, error]) / max(float(np.std(error)), 1e-300))
    x, y = np.split(np.vstack(beside), [3], axis=1)
    shift = np.linalg.lstsq(x, y[:, 0], rcond=SEEN)[0]
    rest = float(np.sum((y[:, 0] - x @ shift) ** 2) / max(float(np.sum(y**2)), 1e-300))
    if rest < PLACED:
        here, found = (", ".join(f"{c:.2f}" for c in centre) for centre in (place, place + shift))
        warnings.warn(
            f"The drives fit a load at ({found}) m of {joint} far better than the given one at ({here}): "
            f"{100 * (1 - rest):.0f} % of what it leaves goes. Check its place; the gains depend on it.",
            UserWarning, stacklevel=2,
        )  # fmt: skip
    return gains


def between_joints(masses: Array, variances: Array, wide: float) -> float:
    """Variance of a weighted mean over joints due to their disagreement beyond their own errors.

    An error of the model at a joint is the same in every block of a record, so a jackknife over blocks does not show
    it. All joints carry the same mass, and tau^2 is the variance between them beyond their errors.

    ``masses``, ``variances`` (k,): for each joint that the body affects: the mass that its drive alone indicates, with
    independent errors. ``wide``: inflation of these variances.

    References
    ----------
    DerSimonian and Laird 1986, Meta-analysis in clinical trials, Controlled Clinical Trials 7(3), 177-188.

    Examples
    --------
    >>> import numpy as np
    >>> between_joints(np.array([2.7, 2.9]), np.array([1.0, 1.0]), 1.0)  # they agree within their errors
    0.0
    >>> round(between_joints(np.array([2.7, 2.9]), np.array([1e-6, 1e-6]), 1.0), 3)
    0.01
    """
    weight = 1.0 / (variances * wide)
    if len(weight) < 2:
        return 0.0
    share = weight / weight.sum()
    beyond = float(weight @ (masses - share @ masses) ** 2) - (len(weight) - 1)
    alone = float(share @ share)
    return max(beyond, 0.0) / float(weight.sum()) / (1.0 - alone) * alone


def place_of(numbers: Array) -> Array:
    """Centre (3,) of a load of numbers m and m c, (4,), no further than `FURTHEST`."""
    return np.asarray(np.clip(numbers[1:MASS] / (numbers[0] if numbers[0] else np.inf), -FURTHEST, FURTHEST))


def slopes_at(place: Array) -> Array:
    """Derivatives (10, 4) of the ten parameters of a point load with respect to m and m c.

    Its inertia I(m, h) = (h.h - h h') / m is homogeneous of first degree, so the derivatives times (m, h) give it
    exactly (Euler's theorem).

    >>> import numpy as np
    >>> from whsklearn.systems.arm_files import body_numbers
    >>> load = body_numbers(2.0, (0.1, 0.0, 0.3), np.zeros((3, 3)))
    >>> bool(np.allclose(slopes_at(np.array([0.1, 0.0, 0.3])) @ load[:4], load))
    True
    """
    slopes = np.zeros((N_BODY, MASS))
    slopes[:MASS] = np.eye(MASS)
    for k, (i, j) in enumerate(INERTIAS):
        slopes[MASS + k, 0] = place[i] * place[j] - float(i == j) * (place @ place)
        for axis, unit in enumerate(np.eye(3)):
            both = unit[i] * place[j] + place[i] * unit[j]
            slopes[MASS + k, 1 + axis] = 2.0 * float(i == j) * place[axis] - both
    return slopes


def point_load(gram: Array, cross: Array) -> Array:
    """m and m c, (4,), of the point load that explains most, from the normal equations of the ten numbers of a body.

    If a joint's axis intersects the previous one, a mass affects the drives only through the inertia of its position;
    the search therefore begins along the moment, at several distances.

    ``gram`` is (10, 10). ``cross`` is (10,).
    """
    from scipy.optimize import minimize

    def kilogram(place: Array) -> Array:
        return np.asarray(slopes_at(place) @ np.concatenate([[1.0], place]))

    def taken(place: Array) -> float:
        one = kilogram(place)
        return -float((one @ cross) ** 2 / max(float(one @ gram @ one), 1e-300))

    size = np.sqrt(np.maximum(np.diag(gram)[:MASS], 1e-300))
    four = gram[:MASS, :MASS] / np.outer(size, size)
    linear = np.linalg.pinv(four, rcond=SEEN, hermitian=True) @ (cross[:MASS] / size) / size
    moment = linear[1:] / max(float(np.linalg.norm(linear[1:])), 1e-300)
    starts = [place_of(linear), np.zeros(3), *(d * moment for d in DISTANCES)]
    first = np.vstack([np.zeros(3), 0.05 * np.eye(3)])
    found = min(
        (minimize(taken, start, method="Nelder-Mead", bounds=[(-FURTHEST, FURTHEST)] * 3,
                  options={"initial_simplex": start + first, "maxfev": EVALUATIONS, "xatol": 1e-5, "fatol": 1e-9})
         for start in starts), key=lambda r: float(r.fun),
    )  # fmt: skip
    one = kilogram(found.x)
    return np.asarray(float(one @ cross) / max(float(one @ gram @ one), 1e-300) * np.concatenate([[1.0], found.x]))
