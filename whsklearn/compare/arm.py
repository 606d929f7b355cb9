"""Records of one arm as rows of the same regression: the drives of all joints, and what may change at each of them.

The links' numbers are known as base numbers only, and no single one of them is a change of anything.  What may have
changed is a direction among them: a load at a link adds its mass and its moments, a joint's gain scales all numbers
that are seen by that joint's drive.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from whsklearn.compare.rows import FEWEST_BLOCKS, MOST_BLOCKS, Array, Regression, drifting, slowest_of
from whsklearn.identification.payload import MASS
from whsklearn.lags.arm_rows import ArmRows, records_of
from whsklearn.lags.rigid_body import RigidBodyLags
from whsklearn.systems._arm_kernels import N_BODY
from whsklearn.systems.arm import NUMBERS, Arm

LAW = ("viscous", "coulomb")  # of every joint, beside an offset and the motor's inertia
TOLD = {"armature": "joint_inertia"}  # a column's name -> what it is called
MOST_LEFT = 0.3  # of the rms drive: beyond it the numbers are not those of the axis or joint
OWN = 1e-6  # of a column's norm that those before it leave: below, it is made of them (rounding is 1e-13)


class ArmLog(NamedTuple):
    """One record of an arm.

    Attributes
    ----------
    sample_rate : float
        In Hz.
    position, drive : ndarray of shape (n, n_joints)
        In rad and Nm (m and N where a joint slides), in the order of the robot's joints.

    References
    ----------
    Khalil and Dombre 2002, Modeling, Identification and Control of Robots, ch. 12.

    Examples
    --------
    >>> import numpy as np
    >>> from whsklearn.compare import ArmLog
    >>> ArmLog(500.0, np.zeros((1000, 6)), np.zeros((1000, 6))).position.shape
    (1000, 6)
    """

    sample_rate: float
    position: Array
    drive: Array


def arm_rows(records: Sequence[ArmLog], arm: Arm, labels: Sequence[str]) -> list[Regression]:
    """Every record behind the lowest of their cut-offs, with the same weights of the joints.

    Raises ValueError if a record cannot be used.
    """
    lags = [RigidBodyLags(arm, r.sample_rate, law=",".join(LAW)) for r in records]
    for k, r in zip(lags, records, strict=True):
        k.fit(r.position)
    cutoff = min(k.cutoff_ for k in lags)
    for k in lags:
        k.set_params(cutoff=cutoff)
    views = [records_of(k, r.position, r.drive) for k, r in zip(lags, records, strict=True)]
    weights = 1.0 / np.sqrt(np.mean([1.0 / v.weights**2 for v in views], axis=0))
    return [_rows(v, weights, label) for v, label in zip(views, labels, strict=True)]


def poor_joints(rows: Sequence[Regression], joints: Sequence[str]) -> dict[str, float]:
    """Joint -> share of its drive that the arm's numbers leave in one of the records, if above `MOST_LEFT`."""
    most: dict[str, float] = {}
    for r in rows:
        left = r.target - (r.columns / r.sizes) @ np.linalg.lstsq(r.columns / r.sizes, r.target, rcond=1e-9)[0]
        for at in r.channels():
            assert r.channel is not None
            joint = joints[int(r.channel[at[0]])]
            share = float(np.linalg.norm(left[at]) / max(float(np.linalg.norm(r.target[at])), 1e-300))
            most[joint] = max(most.get(joint, 0.0), share)
    return {joint: share for joint, share in most.items() if share > MOST_LEFT}


def _rows(view: ArmRows, weights: Array, label: str) -> Regression:
    """Joint after joint, the rows that count of each, weighed."""
    lags, arm, n = view.lags, view.lags.arm_, view.lags.arm_.n_joints
    flat = (view.phi * weights[:, None])[view.keep], (view.target * weights)[view.keep]
    first = np.linalg.lstsq(flat[0], flat[1], rcond=1e-9)[0]
    rate = view.per_age(np.asarray(first))
    step = float(view.kept[1] - view.kept[0]) / lags.sample_rate
    names, units = [], []
    for name in lags.base_.names:
        joint, _, number = name.partition(".")
        names.append(name if number in NUMBERS else f"{TOLD.get(number, number)} at {joint}")
        units.append(arm.unit_of(name))
    moving = [j for j in range(n) if view.keep[:, j].any()]
    names += [f"delay at {arm.joints[j]}" for j in moving]
    units += ["s"] * len(moving)
    parts = []
    for j in moving:
        at = np.flatnonzero(view.keep[:, j])
        ages = np.zeros((at.size, len(moving)))
        ages[:, moving.index(j)] = rate[at, j]
        columns = np.hstack([view.phi[at, j], ages]) * weights[j]
        parts.append(
            (columns, view.target[at, j] * weights[j], at, np.full(at.size, j), view.moved.position[view.kept[at], j])
        )
    columns, target, at, channel, path = (np.concatenate(x) for x in zip(*parts, strict=True))
    time = at * step
    clock = np.arange(len(view.position)) / lags.sample_rate
    slowest = min(slowest_of(view.moved.position[:, j], clock) for j in moving)
    nuisances, drift_of = drifting(columns, tuple(names), time, slowest)
    swings = int(2.0 * slowest * float(np.ptp(time)))  # a block shorter than a swing is no record of its own
    block = at * int(np.clip(swings, FEWEST_BLOCKS, MOST_BLOCKS)) // len(view.kept)
    drives = np.array([np.linalg.norm(target[channel == j]) for j in moving]) / np.sqrt(target.size)
    changes = directions(lags, tuple(names), columns, target, channel)
    return Regression(
        label, tuple(names), tuple(units), columns, target, at + 2 * len(view.kept) * channel, step, time, path,
        block.astype(np.intp), nuisances, drift_of, drives, slowest, {},
        channel=channel, changes=changes,
    )  # fmt: skip


def directions(
    lags: RigidBodyLags, names: tuple[str, ...], columns: Array, target: Array, channel: Array
) -> dict[str, Array]:
    """Name -> directions (p, k) in which it changes the numbers."""
    arm, p = lags.arm_, len(names)
    unit = np.eye(p)
    out = {name: unit[:, [i]] for i, name in enumerate(names) if " at " in name}
    for k, joint in enumerate(arm.joints):  # of a first joint it is one with the links'
        basis = np.zeros((p, 1))
        basis[: len(lags.base_.names), 0] = lags.base_.mapping[:, N_BODY * arm.n_joints + k]
        out[f"joint_inertia at {joint}"] = basis
    rms = np.sqrt(np.mean(columns**2, axis=0))
    for k, joint in enumerate(arm.joints):
        basis = np.zeros((p, N_BODY))
        basis[: len(lags.base_.names)] = lags.base_.mapping[:, N_BODY * k : N_BODY * (k + 1)]
        alone = independent(basis, rms, [*range(1, N_BODY), 0])
        if basis[:, :MASS].any():  # the mass is asked last: what moments and inertias do not say is its own
            out[f"{'mass' if 0 in alone else 'moment'} at {joint}"] = basis
    scale = np.maximum(rms, 1e-300)
    for j in np.unique(channel):
        own = np.where(channel == j, target, 0.0)
        out[f"gain at {arm.joints[j]}"] = (np.linalg.lstsq(columns / scale, own, rcond=1e-9)[0] / scale)[:, None]
    return out


def independent(basis: Array, rms: Array, order: Sequence[int]) -> list[int]:
    """The columns that are no combination of those before them, of a basis weighed by ``rms`` (p,)."""
    weighed = basis * rms[:, None]
    kept: list[int] = []
    for k in order:
        left = weighed[:, k]
        if kept:
            q = np.linalg.qr(weighed[:, kept])[0]
            left = left - q @ (q.T @ left)
        if np.linalg.norm(left) > OWN * max(float(np.linalg.norm(weighed[:, k])), 1e-300):
            kept.append(k)
    return kept
