"""A payload from a loaded record against an unloaded one, and drive gains from a known load.

What is found without the load is frozen; the offsets of the drives are the loaded record's own.  A body at a link adds
its ten numbers to the link's, and the columns of any number are those of the base numbers times its column of the
base's mapping, so nothing is filtered again. Currents alone do not determine a gain: with a load of known mass, the
extra current of each joint is regressed on the load's torque.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from sklearn.base import clone

from whsklearn.identification.arm_fit import N_LEFT_OUT, block_covariance, fitted
from whsklearn.systems._arm_kernels import N_BODY
from whsklearn.systems.arm_files import body_numbers

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from whsklearn.identification.arm_fit import ArmFit
    from whsklearn.lags.rigid_body import RigidBodyLags

    Array = NDArray[np.float64]

MASS = 4  # numbers of a body that are fitted, m and m c: on the AIRBOT all ten left the mass open by 2 kg
ROUNDS = 5  # of gains: an arm whose joints are in units of their own fits worse, by 1 to 3 % of the gains in the first


class Payload(NamedTuple):
    """A body at a link.

    Attributes
    ----------
    joint : str
        That carries it.
    mass, mass_error : float
        In kg, and its standard error, which holds that of the unloaded fit, that of the gains, and by how much the
        joints disagree.
    centre : tuple of three float
        Of its mass, in the joint's frame (m).
    left : float
        What it leaves of the squared weighted error, as a share.

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
        Relative standard deviation of the drive gains, as of one that all joints share: the mass follows them.
    """
    phi, error, offsets = _beside(empty, position, drive)
    whole = float(np.sum((error - offsets @ np.linalg.lstsq(offsets, error, rcond=None)[0]) ** 2))
    mapping, found = empty.lags.base_.mapping, []
    for k, joint in enumerate(empty.lags.arm_.joints):
        body = phi @ mapping[:, N_BODY * k : N_BODY * (k + 1)]
        columns = np.column_stack([body[:, :MASS], offsets])
        scale = np.linalg.norm(columns, axis=0)
        if not scale[0] > 1e-9 * scale.max():
            continue  # its mass moves no drive
        scale = np.where(scale > 0.0, scale, 1.0)
        inverse = np.linalg.pinv(columns / scale, rcond=1e-6) / scale[:, None]
        turning = np.zeros(len(error))  # what the inertia of a mass at that centre takes; it follows from the four
        for _ in range(ROUNDS):
            x = inverse @ (error - turning)
            turning = body[:, MASS:] @ point_mass(x[:MASS])[MASS:]
        left = error - turning - columns @ x
        variance = left @ left / max(len(left) - len(x), 1)
        of_empty = inverse[0] @ phi
        own = block_covariance(
            columns, left, np.arange(len(left)) * N_LEFT_OUT // len(left), variance * inverse @ inverse.T
        )
        within = float(own[0, 0] + of_empty @ empty.covariance @ of_empty)
        mass = float(x[0])
        spread = within + between_joints(*_mass_by_joint(body, error, offsets, x), within) if mass > 0.0 else within
        centre = tuple(float(c) for c in (x[1:4] / mass if mass else np.zeros(3)))
        deviation = float(np.sqrt(spread + (mass * gain_error) ** 2))
        found.append(Payload(joint, mass, deviation, centre, float(left @ left) / whole))  # type: ignore[arg-type]
    return sorted(found, key=lambda p: p.left)


def gains_from_load(
    lags: RigidBodyLags, empty: tuple[ArrayLike, ArrayLike], loaded: tuple[ArrayLike, ArrayLike], *,
    joint: str, numbers: ArrayLike,
) -> dict[str, tuple[float, float]]:  # fmt: skip
    """Nm for each unit of the drive and its standard error, by joint, from a pair of records with a known load.

    Parameters
    ----------
    lags : RigidBodyLags
        With robot and sampling rate.
    empty, loaded : pair of array-like of shape (n, n_joints)
        Positions and drives without and with the load, the drives in the same unit, such as A.
    joint : str
        That carries the load.
    numbers : array-like of shape (10,)
        Of the load, in that joint's frame (`whsklearn.systems.arm_files.body_numbers`).

    Returns
    -------
    dict of str to (float, float)
        NaN and an infinite error for a joint whose drive the load does not move.

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
    own = clone(lags)
    phi, target, keep = own.joint_rows(*empty)
    weights = own._weights(phi, target, keep)
    other = clone(lags).set_params(cutoff=own.cutoff_)
    loaded_phi, loaded_target, loaded_keep = other.joint_rows(*loaded)
    at = N_BODY * own.arm_.index(joint)
    load = loaded_phi @ (own.base_.mapping[:, at : at + N_BODY] @ np.asarray(numbers, dtype=float))
    gains, errors = np.ones(len(weights)), np.zeros(len(weights))
    for _ in range(ROUNDS):
        theta, _covariance = fitted(phi, target * gains, keep, weights / gains)
        for j in range(len(gains)):
            use = loaded_keep[:, j]
            torque, extra = load[use, j], (loaded_target[:, j] * gains[j] - loaded_phi[:, j] @ theta)[use]
            torque, extra = torque - torque.mean(), extra - extra.mean()
            size = float(torque @ torque)
            share = float(torque @ extra) / size if size > 0.0 else np.nan
            left = extra - share * torque
            errors[j] = gains[j] * np.sqrt(left @ left / max(len(left) - 2, 1) / size) if size > 0.0 else np.inf
            gains[j] = gains[j] / share if share > 0.0 else np.nan
        gains = np.where(np.isfinite(gains), gains, 1.0)
    moved = np.isfinite(errors) & (errors < gains)
    return {
        name: (float(g), float(e)) if told else (float("nan"), float("inf"))
        for name, g, e, told in zip(own.arm_.joints, gains, errors, moved, strict=True)
    }


def point_mass(numbers: Array) -> Array:
    """Ten numbers (10,) of a point of mass m at c, of m and m c (4,); no inertia where the mass is not above zero.

    Examples
    --------
    >>> import numpy as np
    >>> point_mass(np.array([2.0, 1.0, 0.0, 0.0])).tolist()
    [2.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.5, 0.0, 0.0, 0.5]
    """
    mass = float(numbers[0])
    if mass <= 0.0:
        return np.concatenate([numbers, np.zeros(N_BODY - MASS)])
    return body_numbers(mass, numbers[1:MASS] / mass, np.zeros((3, 3)))


def between_joints(mass: Array, share: Array, within: float) -> float:
    """Variance of a weighted mean over joints by what they disagree beyond their own errors.

    An error of the model at a joint is the same in every block of a record, so that no jackknife over blocks sees it.
    The joints see the same mass, and tau^2 is by how much more they differ than their errors say.

    Parameters
    ----------
    mass, share : ndarray of shape (k,)
        Of each joint that the body moves: the mass that its drive alone asks for, and its weight in the mean.
    within : float
        Variance of the mean by the errors of the rows.

    References
    ----------
    DerSimonian and Laird 1986, Meta-analysis in clinical trials, Controlled Clinical Trials 7(3), 177-188.

    Examples
    --------
    >>> import numpy as np
    >>> between_joints(np.array([2.7, 2.9]), np.array([0.5, 0.5]), 1.0)  # they agree within their errors
    0.0
    >>> round(between_joints(np.array([2.7, 2.9]), np.array([0.5, 0.5]), 0.0), 3)
    0.01
    """
    alone = float(np.sum(share**2))
    if len(mass) < 2 or not alone < 1.0:
        return 0.0
    apart = float(share @ (mass - share @ mass) ** 2) - (len(mass) - 1) * within
    return max(apart, 0.0) / (1.0 - alone) * alone


def _mass_by_joint(body: Array, error: Array, offsets: Array, found: Array) -> tuple[Array, Array]:
    """The mass that each joint's drive asks for at the centre that was found, and its weight in their mean."""
    column = body @ point_mass(found[:MASS]) / found[0]
    masses, powers = [], []
    for joint in offsets.T:
        own = joint != 0.0
        torque, asked = column[own], error[own]
        if own.sum() > 1 and np.ptp(torque) > 0.0:
            torque = torque - torque.mean()
            powers.append(float(torque @ torque))
            masses.append(float(torque @ asked) / powers[-1])
    return np.array(masses), np.array(powers) / max(float(np.sum(powers)), 1e-300)


def _beside(empty: ArmFit, position: ArrayLike, drive: ArrayLike) -> tuple[Array, Array, Array]:
    """Weighted rows of another record (m, b), what the unloaded numbers leave of it (m,), and columns of offsets."""
    lags = empty.lags
    own = clone(lags).set_params(cutoff=lags.cutoff_)
    phi, target, keep = own.joint_rows(position, drive)
    weights = own._weights(phi, target, keep)
    offsets = np.tile(np.diag(weights), (len(phi), 1, 1))[keep]
    rows = (phi * weights[:, None])[keep]
    error = (target * weights)[keep] - rows @ np.array(list(empty.model.numbers.values()))
    return rows, error, offsets
