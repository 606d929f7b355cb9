"""Real arms: held-out error of each joint, coupled and one axis at a time; speed beside Pinocchio's.

    OMP_NUM_THREADS=1 python -m benchmarks.arms [--only tx40]

reads the records beside the checkout (``../shared/data/arms`` or ``WHSKLEARN_DATA``; none is shipped).  An error is of
blocks that were not fitted, a share of that joint's rms drive, slow samples left out, all settings at their defaults;
`identify_arm` says how.  "wrist" is the TX40 with viscous and Coulomb friction along joint_5 + joint_6, which its
owners publish; "physical" is the arm whose links are bodies, on the samples fitted, and "free" the same for the base
numbers as measured.  Speed is CPU time over 25,000 samples of six joints; Pinocchio's (extra ``bench``) is called for
each sample, as it has no other way.
"""

from __future__ import annotations

import os
import time
from pathlib import Path
from typing import Any

import click
import numpy as np
import pandas as pd

from whsklearn import Arm
from whsklearn.identification import find_payload, identify_arm

WRIST = {**{f"joint_{k}": "input_offset" for k in range(1, 7)}, "joint_5+joint_6": "viscous,coulomb"}
RIGS: dict[str, tuple[str, dict[str, Any]]] = {
    "tx40": ("tx40", {}),
    "tx40, wrist": ("tx40", {"effects": WRIST}),
    "double_pendulum": ("double_pendulum", {}),
    "airbot": ("airbot", {}),
    "airbot_loaded": ("airbot", {}),
}
SPEED_SAMPLES, BATCH = 25_000, 1_000


def folder() -> Path:
    """Where the records are."""
    shared = os.environ.get("WHSKLEARN_DATA", Path(__file__).resolve().parents[2] / "shared" / "data")
    return Path(shared) / "arms"


def record(name: str) -> tuple[np.ndarray, np.ndarray, float]:
    """Positions and drives (n, n_joints) on an even grid, and its step (s)."""
    log = pd.read_csv(folder() / f"{name}.csv.gz")
    time_s = log["time_s"].to_numpy()
    dt = float(np.median(np.diff(time_s)))
    grid = np.arange(time_s[0], time_s[-1], dt)
    signals = []
    for kind in ("position", "torque"):
        columns = [c for c in log if c.startswith(kind)]
        signals.append(np.column_stack([np.interp(grid, time_s, log[c]) for c in columns]))
    return signals[0], signals[1], dt


def percent(shares: Any) -> str:
    return " ".join(f"{100 * s:6.1f}" for s in shares)


def in_sample(found: Any, q: np.ndarray, torque: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Errors of base numbers as measured, and of the physical arm, on the samples fitted; shares of the rms drive."""
    phi, target, keep = found.lags.joint_rows(q, torque)
    measured = np.array(list(found.model.numbers.values()))
    physical = found.lags.weights_of(found.model.arm)
    size = np.sqrt(np.sum(np.where(keep, target, 0.0) ** 2, axis=0))
    both = (np.where(keep, target - phi @ x, 0.0) for x in (measured, physical))
    return tuple(np.sqrt(np.sum(e**2, axis=0)) / size for e in both)  # type: ignore[return-value]


def payload() -> None:
    """AIRBOT with its load, whose mass is not published, against without; and one half without against the other."""
    q, torque, dt = record("airbot")
    robot, half = folder() / "airbot.urdf", len(q) // 2
    empty = identify_arm(q, torque, dt=dt, robot=robot)
    first = identify_arm(q[:half], torque[:half], dt=dt, robot=robot)
    for name, found in (
        ("loaded against empty", find_payload(empty, *record("airbot_loaded")[:2])[0]),
        ("empty against empty", find_payload(first, q[half:], torque[half:])[0]),
    ):
        told = f"{found.mass:6.3f} kg +- {found.mass_error:.3f} at {found.joint}"
        print(f"{name:22} {told}, leaves {100 * found.left:.1f} %")


def speed() -> None:
    """Joint rows of the regressor per second of CPU."""
    arm = Arm.from_file(folder() / "tx40.urdf")
    q, v, a = arm.drawn_motion(SPEED_SAMPLES)
    parts = [slice(i, i + BATCH) for i in range(0, SPEED_SAMPLES, BATCH)]
    arm.regressor(q[:BATCH], v[:BATCH], a[:BATCH])
    begun = time.process_time()
    for s in parts:
        arm.regressor(q[s], v[s], a[s])
    ours = SPEED_SAMPLES * arm.n_joints / (time.process_time() - begun)
    print(f"\nregressor: {ours / 1e6:.2f} M joint rows/s", end="")
    try:
        import pinocchio as pin
    except ImportError:
        print("; Pinocchio is not installed")
        return
    model = pin.buildModelFromUrdf(str(folder() / "tx40.urdf"))
    data = model.createData()
    begun = time.process_time()
    for k in range(SPEED_SAMPLES // 5):
        pin.computeJointTorqueRegressor(model, data, q[k], v[k], a[k])
    theirs = SPEED_SAMPLES // 5 * arm.n_joints / (time.process_time() - begun)
    print(f"; Pinocchio {pin.__version__}, sample by sample: {theirs / 1e6:.2f} M")


@click.command()
@click.option("--only", default="", help="Rigs whose names begin so.")
def main(only: str) -> None:
    print("Held-out error, % of each joint's rms drive\n")
    for name, (urdf, settings) in RIGS.items():
        if not name.startswith(only):
            continue
        q, torque, dt = record(name.split(",")[0])
        begun = time.process_time()
        found = identify_arm(q, torque, dt=dt, robot=folder() / f"{urdf}.urdf", **settings)
        seconds = time.process_time() - begun
        numbers, hertz = len(found.model.numbers), found.lags.cutoff_
        print(
            f"{name:16} coupled {percent(found.missing.values())}   {numbers} numbers, {hertz:.1f} Hz, {seconds:.1f} s"
        )
        print(f"{'':16} alone   {percent(found.alone.values())}")
        if not settings:
            free, physical = in_sample(found, q, torque)
            print(f"{'':16} fitted: free {percent(free)}, physical {percent(physical)}")
    if "airbot".startswith(only) or only.startswith("airbot"):
        payload()
    speed()


if __name__ == "__main__":
    main()
