"""Columns of an arm's log given to the wrong joints: is it told, and is a right order left alone?

    OMP_NUM_THREADS=1 python -m benchmarks.joint_order [--arms 3] [--seed 7000] [--joints 6] [--rig tx40] [--line 0.01]

Arms of `benchmarks.blind_arms`, one record of each, or a measured record of `benchmarks.arms`.  Columns are given in
other orders, as a wrong list of columns does: two joints exchanged (or with ``--drawn 20`` as many drawn orders), all
reversed, turned round by one and by two; ``--what positions`` or ``drives`` does it to these only. With ``--line`` all
joints move along one line but for this share, and drives have 2 % of noise. "told" warns
(`whsklearn.identification.arm_checks.in_another_order`), "doubt" says that the order is an example, "right" names the
true one. The other columns are what the rule's numbers are compared with: "left" is the largest share of a drive's
variance that the shared numbers leave (sought above MUCH), "clearly" what all moved joints leave in the true order as a
share of that in the given one (told below CLEARLY), "s" the CPU time.

With ``--scale 2`` no order is wrong, but the drives of one joint after the other are multiplied by it: who is told by
the others' drives or by the masses given (`whsklearn.identification.arm_checks.in_another_scale`), and with which
factor?  "none" is the record as it is.
"""

from __future__ import annotations

import itertools
import time
import warnings
from typing import Any

import click
import numpy as np

from benchmarks import arms as measured
from benchmarks.blind_arms import RATE, REDRAWN, drawn, follows, made, record, reference
from whsklearn import Arm, RigidBodyLags
from whsklearn.filtering import motion
from whsklearn.identification.arm_checks import CLEARLY, MUCH, _left, in_another_order, in_another_scale
from whsklearn.lags.arm_rows import records_of

Row = tuple[str, bool, bool, bool, float, float, float]
Log = tuple[Any, np.ndarray, np.ndarray, float]


def drawn_record(seed: int, n: int) -> Log:
    """A drawn arm, positions and drives, and the sampling time."""
    rng = np.random.default_rng(seed)
    root = drawn(rng, n)
    arm, gains, *_ = made(root)
    path = reference(rng, n)
    q, u = record(root, path, gains)
    return (arm, q, u, 1.0 / RATE) if follows(q, path) else drawn_record(seed + REDRAWN, n)


def in_line(log: Log, share: float, seed: int) -> Log:
    """The arm with its joints along one line but for a share of their own motion, and noise of its drives."""
    arm, q, _, dt = log
    rng, t = np.random.default_rng(seed), np.arange(len(q)) * dt
    size = rng.uniform(0.2, 0.6, arm.n_joints) * rng.choice([-1, 1], arm.n_joints)
    q = np.outer(np.sin(2 * np.pi * (0.1 * t + 0.02 * t**2)), size) + share * (q - q.mean(axis=0)) / q.std(axis=0)
    moved = [motion(x, 1.0 / dt, 50.0) for x in q.T]
    v, a = np.column_stack([m.velocity for m in moved]), np.column_stack([m.acceleration for m in moved])
    u = arm.inverse_dynamics(q, v, a)
    return arm, q, u + 0.02 * u.std(axis=0) * rng.standard_normal(u.shape), dt


def orders(n: int, count: int) -> dict[str, np.ndarray]:
    """Orders by name: as given, whole turns, and all exchanges of two joints or so many drawn ones."""
    given = np.arange(n)
    out = {"none": given, "reversed": given[::-1], "turned by 1": np.roll(given, 1), "turned by 2": np.roll(given, 2)}
    if count:
        rng = np.random.default_rng(0)
        return out | {f"drawn {k + 1}": rng.permutation(n) for k in range(count)}
    for i, j in itertools.combinations(range(n), 2):
        out[f"{i + 1}+{j + 1}"] = np.where(given == i, j, np.where(given == j, i, given))
    return out


def reordered(arm: Any, q: np.ndarray, u: np.ndarray, dt: float, count: int, what: str) -> list[Row]:
    """(order, told, doubt, right, left, clearly, seconds) for every order."""
    rows: list[Row] = []
    true = np.zeros(arm.n_joints)
    for name, order in orders(arm.n_joints, count).items():
        lags, moved = RigidBodyLags(arm, 1.0 / dt), np.flatnonzero(order != np.arange(arm.n_joints))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)
            seen = records_of(lags, q if what == "drives" else q[:, order], u if what == "positions" else u[:, order])
            began = time.process_time()
            said = in_another_order(seen)
        left = _left(seen.phi, seen.target, seen.keep)
        true = true if rows else left
        given, owner = (", ".join(arm.joints[k] for k in js) for js in (moved, order[moved]))
        right = bool(said) and f"if the {what} given for {given} are those of {owner}, in" in said[0]
        clearly = float(true[moved].sum() / left[moved].sum()) if moved.size else 1.0
        doubt = bool(said) and "for example" in said[0]
        rows.append((name, bool(said), doubt, right, float(left.max()), clearly, time.process_time() - began))
    return rows


def scaled(arm: Any, q: np.ndarray, u: np.ndarray, dt: float, scale: float) -> None:
    """Print what is told of drives of which one is multiplied by a factor."""
    for j in (-1, *range(arm.n_joints)):
        factors = np.where(np.arange(arm.n_joints) == j, scale, 1.0)
        seen = records_of(RigidBodyLags(arm, 1.0 / dt), q, u * factors)
        print(f"{arm.joints[j] if j >= 0 else 'none':10}", " ".join(in_another_scale(seen)) or "nothing")


@click.command()
@click.option("--arms", default=10)
@click.option("--seed", default=7000, help="Of the first arm.")
@click.option("--joints", default=6)
@click.option("--rig", help="A measured record in place of drawn ones: tx40, double_pendulum, airbot.")
@click.option("--drawn", "count", default=0, help="Drawn orders in place of exchanges.")
@click.option("--line", default=0.0, help="Share of the joints' own motion beside one line.")
@click.option("--what", default="columns", type=click.Choice(["columns", "positions", "drives"]))
@click.option("--scale", type=float, help="Factor of one drive after the other, in place of other orders.")
def main(
    arms: int, seed: int, joints: int, rig: str | None, count: int, line: float, what: str, scale: float | None
) -> None:
    if rig:
        logs = [(Arm.from_file(measured.folder() / f"{rig}.urdf"), *measured.record(rig))]
    else:
        logs = [drawn_record(seed + i, joints) for i in range(arms)]
        logs = [in_line(log, line, seed + i) for i, log in enumerate(logs)] if line else logs
    if scale is not None:
        for log in logs:
            scaled(*log, scale)
        return
    found = [reordered(*log, count, what) for log in logs]
    print(f"MUCH {MUCH}, CLEARLY {CLEARLY}\n{'order':12} told doubt right of          left       clearly         s")
    for rows in zip(*found, strict=True):
        told, doubt, right = (sum(r[k] for r in rows) for k in (1, 2, 3))
        spans = " ".join(f"{min(r[k] for r in rows):.4f}-{max(r[k] for r in rows):.4f}" for k in (4, 5))
        print(f"{rows[0][0]:12} {told:4} {doubt:5} {right:5} {len(rows):2} {spans} {max(r[6] for r in rows):.1f}")


if __name__ == "__main__":
    main()
