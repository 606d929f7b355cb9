"""Real arms: held-out error of each joint, coupled and one axis at a time; speed beside Pinocchio's.

    OMP_NUM_THREADS=1 python -m benchmarks.arms [--only tx40] [--gap] [--replay] [--cost]

reads the records beside the checkout (``../shared/data/arms`` or ``WHSKLEARN_DATA``; none is shipped).  An error is of
blocks that were not fitted, a share of that joint's rms drive, slow samples left out, all settings at their defaults;
`identify_arm` says how.  "wrist" is the TX40 with viscous and Coulomb friction along joint_5 + joint_6, which its
owners publish; "physical" is the arm whose links are bodies, on the samples fitted, and "free" the same for the base
numbers as measured.  With ``--gap`` the gap of each record is asked instead: what the arm lacks in truth is found
first (the TX40's wrist, blind), then Coulomb and viscous friction are taken from the law of one joint at a time, and
gravity from all; "first" has the hidden effect first within its joint, of those that a record shows at all.  The finder
goes on to the next candidate where the numbers of one are impossible; "first accepted" counts so, and an effect whose
own numbers are refused is none.  A load on the AIRBOT is asked for against the numbers without it, and half of the
record without against the other half.  With
``--replay`` MuJoCo replays the logged drives on the exported arm, from the measured motion every 0.5 s: rms error in
position beside that of our own free runs, and beside standing still, which is the motion in a window.  The friction is
the one that MJCF holds, because friction that grows with the torque is lost in the file; the last line is our own free
run with it.  With
``--cost`` the CPU time of a diagnosis of 50 s at 500 Hz of six joints, with a cogging hidden at one.  Speed is CPU
time over 25,000 samples of six joints; Pinocchio's (extra ``bench``) is called for each sample, as it has no other way.
"""

from __future__ import annotations

import dataclasses
import os
import time
from pathlib import Path
from typing import Any

import click
import mujoco
import numpy as np
import pandas as pd

from whsklearn import Arm
from whsklearn.datasets import make_arm_log
from whsklearn.effects import Cogging, Coulomb, Viscous
from whsklearn.export.robots import arm_mjcf
from whsklearn.filtering import motion
from whsklearn.gap import GapFinder
from whsklearn.gap.plants.arm import arm_plant
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
WINDOW = 0.5  # s of a free run
HELD = "viscous,coulomb"  # what the joints of MJCF hold


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


def without(arm: Arm, joint: str = "", name: str = "") -> Arm:
    """The arm with viscous and Coulomb friction as base law, but for one at one joint."""
    law = (Viscous(1.0), Coulomb(1.0))
    rows = [tuple(e for e in law if (j, e.name) != (joint, name)) for j in arm.joints]
    return dataclasses.replace(arm, effects=rows)


def hidden(rig: str, urdf: str) -> np.ndarray:
    """How many effects hidden at the joints of a record are first there, first accepted, and seen at all; (3,)."""
    q, torque, dt = record(rig)
    log, arm = (np.arange(len(q)) * dt, q, torque), Arm.from_file(folder() / f"{urdf}.urdf")
    begun = time.process_time()
    finder = GapFinder(without(arm), max_effects=10).fit(log)
    told = "; ".join(f"{e.label} {dict(e.parameters)}" for e in finder.effects_)
    print(f"{rig}: {finder.verdict_}, {time.process_time() - begun:.1f} s: {told}")
    for when in ("before", "after"):
        shares = percent(row["missing"][when] for row in finder.diagnosis_.joints)
        print(f"    missing on held-out blocks {when:6} {shares}", flush=True)
    counts = np.zeros(3, dtype=int)
    for joint, name in [("", "gravity"), *((j, n) for j in arm.joints for n in ("coulomb", "viscous"))]:
        base = without(arm, joint, name)
        plant = arm_plant(
            base if joint else dataclasses.replace(base, gravity=(0, 0, 0)), log, law=None, tolerance=0.004
        )
        plant.check()
        real = finder.found_.model.terms if joint else ()
        model = plant.settled(plant.base(np.random.default_rng(0)).with_terms(real))
        looks = [k for k in plant.looks(model, np.random.default_rng(0)) if k.name]
        label = f"{name} at {joint}" if joint else name
        own = [k for k in looks if not k.place or not joint or joint in k.place]
        it = next(k for k in own if k.name == label)
        if it.p_value > 0.01 or it.size < plant.tolerance:
            continue
        refused = {k.name: plant.objection(model, plant.refine(model, k)) for k in own[: own.index(it) + 1]}
        accepted = [name for name, why in refused.items() if not why]
        counts += own[0] is it, accepted[:1] == [label], 1
        if own[0] is not it or refused[label]:
            print(f"    {label}: " + ", ".join(f"{k} ({why or 'accepted'})" for k, why in refused.items()))
    print(f"    first within its joint: {counts[0]} of {counts[2]}, first accepted: {counts[1]}")
    return counts


def gap(only: str) -> None:
    """Names on real arms."""
    rigs = ("double_pendulum", "double_pendulum"), ("airbot", "airbot"), ("airbot_loaded", "airbot"), ("tx40", "tx40")
    first, accepted, seen = sum(hidden(*rig) for rig in rigs if rig[0].startswith(only))
    print(f"hidden: first {first} of {seen}, first accepted {accepted}")
    if not "airbot".startswith(only):
        return
    q, torque, dt = record("airbot")
    robot, half = folder() / "airbot.urdf", len(q) // 2
    for name, (a, b), (c, d) in (
        ("loaded against empty", (q, torque), record("airbot_loaded")[:2]),
        ("empty against empty", (q[:half], torque[:half]), (q[half:], torque[half:])),
    ):
        finder = GapFinder(identify_arm(a, b, dt=dt, robot=robot).model).fit((np.arange(len(c)) * dt, c, d))
        found = [f"{e.label} {e.parameters} +- {e.errors}" for e in finder.effects_ if e.name == "payload"]
        print(f"{name}: {finder.verdict_}, {'; '.join(found) or 'no payload'}")


def replay() -> None:
    """Free runs of exported arms in MuJoCo against the log."""
    for rig in ("double_pendulum", "airbot", "tx40"):
        q, torque, dt = record(rig)
        robot = folder() / f"{rig}.urdf"
        arm, full = (identify_arm(q, torque, dt=dt, robot=robot, **k).model.arm for k in ({"law": HELD}, {}))
        model = mujoco.MjModel.from_xml_string(arm_mjcf(arm)[0])
        fine = int(np.ceil(dt / model.opt.timestep))
        model.opt.timestep = dt / fine
        data = mujoco.MjData(model)
        smooth = [motion(x, 1.0 / dt, 0.1 / dt) for x in q.T]
        path, rate = (np.column_stack([getattr(m, k) for m in smooth]) for k in ("position", "velocity"))
        offsets = [sum(e.magnitude for e in row if e.name == "input_offset") for row in arm.effects]
        n = round(WINDOW / dt)
        theirs = path.copy()
        for start in range(n, len(q), n):
            data.qpos[:], data.qvel[:], data.qacc_warmstart[:] = path[start], rate[start], 0.0
            for t in range(start, min(start + n, len(q))):
                theirs[t] = data.qpos
                data.ctrl[:] = torque[t] - offsets
                mujoco.mj_step(model, data, fine)
        at = {"sample_rate": 1.0 / dt, "resync": WINDOW, "position": path, "velocity": rate}
        ours, best = (a.simulate_drive(torque, **at).position for a in (arm, full))
        still = path[np.arange(len(q)) // n * n]
        errors = (np.sqrt(np.mean((x - q)[n:] ** 2, axis=0)) for x in (theirs, ours, still, best))
        lines = "MuJoCo", "own free run", "standing still", "with all that identify finds"
        for what, e in zip(lines, errors, strict=True):
            print(f"{rig:16} {what:28}", " ".join(f"{x:7.4f}" for x in e), "rad")


def cost() -> None:
    """CPU time to the first ranking and of a whole diagnosis."""
    arm = without(Arm.from_file(folder() / "tx40.urdf"))
    q, torque = make_arm_log(arm, {arm.joints[3]: [Cogging(1.0, order=9.0)]}, duration=50.0, return_arrays=True)
    log = np.arange(len(q)) / 500.0, q, torque
    for _ in range(2):  # the first compiles
        begun, rng = time.process_time(), np.random.default_rng(0)
        plant = arm_plant(arm, log, law=None, tolerance=0.004)
        plant.check()
        first = plant.looks(plant.base(rng), rng)[0]
        ranked = time.process_time() - begun
    begun = time.process_time()
    finder = GapFinder(arm).fit(log)
    names = "; ".join(e.label for e in finder.effects_)
    print(f"first ranking {ranked:.1f} s ({first.name} first), whole {time.process_time() - begun:.1f} s: {names}")


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
@click.option("--gap", "names", is_flag=True, help="What is missing, by name.")
@click.option("--replay", "replays", is_flag=True, help="MuJoCo replays the logged drives.")
@click.option("--cost", "costs", is_flag=True, help="CPU time of a diagnosis.")
def main(only: str, names: bool, replays: bool, costs: bool) -> None:
    if replays:
        replay()
        return
    if names:
        gap(only)
        return
    if costs:
        cost()
        return
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
