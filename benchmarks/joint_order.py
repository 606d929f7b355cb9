"""Columns of an arm's log given to the wrong joints: is it told, and is a right order left alone?

    OMP_NUM_THREADS=1 python -m benchmarks.joint_order [--arms 3] [--seed 7000] [--joints 6] [--rig tx40]

Arms of `benchmarks.blind_arms`, one record of each, or a measured record of `benchmarks.arms`.  Positions and drives of
every pair of joints are exchanged, as a wrong list of columns does.  "told" warns
(`whsklearn.identification.arm_fit.swapped`), "right" names the pair.  The other columns are what the rule's numbers are
compared with: "left" is the largest share of a drive's variance that the shared numbers leave (tried above MUCH),
"less" the sum of these over the exchanged joints in the true order as a share of that in the given one (taken below
LESS), "clearly" the largest
such share of one exchanged joint (told below CLEARLY).
"""

from __future__ import annotations

import itertools
import warnings
from typing import Any

import click
import numpy as np

from benchmarks import arms as measured
from benchmarks.blind_arms import RATE, REDRAWN, drawn, follows, made, record, reference
from whsklearn import Arm, RigidBodyLags
from whsklearn.identification.arm_fit import CLEARLY, LESS, MUCH, _left, swapped
from whsklearn.lags.arm_rows import records_of

Row = tuple[str, bool, bool, float, float, float]


def drawn_record(seed: int, n: int) -> tuple[Any, np.ndarray, np.ndarray, float]:
    """A drawn arm, positions and drives, and the sampling time."""
    rng = np.random.default_rng(seed)
    root = drawn(rng, n)
    arm, gains, *_ = made(root)
    path = reference(rng, n)
    q, u = record(root, path, gains)
    return (arm, q, u, 1.0 / RATE) if follows(q, path) else drawn_record(seed + REDRAWN, n)


def exchanged(arm: Any, q: np.ndarray, u: np.ndarray, dt: float) -> list[Row]:
    """(pair, told, right, left, less, clearly): in order first, then with every pair exchanged."""
    rows: list[Row] = []
    n, true = arm.n_joints, np.zeros(arm.n_joints)
    for pair in ((), *itertools.combinations(range(n), 2)):
        order = np.arange(n)
        order[list(pair)] = order[list(pair)][::-1]
        lags = RigidBodyLags(arm, 1.0 / dt)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)
            seen = records_of(lags, q[:, order], u[:, order])
            said = swapped(seen)
        left = _left(seen.phi, seen.target, seen.keep)
        true = true if pair else left
        ways = (pair, pair[::-1]) if pair else ()
        named = [f"the columns of {arm.joints[i]} by those given for {arm.joints[j]}" for i, j in ways]
        right = bool(said) and all(text in said[0] for text in named) and said[0].count("the columns of") == 2
        share = (true / left)[list(pair)].max() if pair else 1.0
        less = float(true[list(pair)].sum() / left[list(pair)].sum()) if pair else 1.0
        name = "+".join(str(i + 1) for i in pair)
        rows.append((name, bool(said), right, float(left.max()), less, float(share)))
    return rows


@click.command()
@click.option("--arms", default=10)
@click.option("--seed", default=7000, help="Of the first arm.")
@click.option("--joints", default=6)
@click.option("--rig", help="A measured record in place of drawn ones: tx40, double_pendulum, airbot.")
def main(arms: int, seed: int, joints: int, rig: str | None) -> None:
    if rig:
        logs = [(Arm.from_file(measured.folder() / f"{rig}.urdf"), *measured.record(rig))]
    else:
        logs = [drawn_record(seed + i, joints) for i in range(arms)]
    found = [exchanged(*log) for log in logs]
    print(f"MUCH {MUCH}, LESS {LESS}, CLEARLY {CLEARLY}\n{'exchanged':10} told right of      left      less   clearly")
    for rows in zip(*found, strict=True):
        told, right = (sum(r[k] for r in rows) for k in (1, 2))
        spans = " ".join(f"{min(r[k] for r in rows):.4f}-{max(r[k] for r in rows):.4f}" for k in (3, 4, 5))
        print(f"{rows[0][0] or 'none':10} {told:4} {right:5} {len(rows):2} {spans}")


if __name__ == "__main__":
    main()
