"""A load by ``whsklearn gap EMPTY --loaded LOADED --robot FILE``: how far off, and how often in its interval?

    OMP_NUM_THREADS=1 python -m benchmarks.arm_loads [--pairs 12] [--seed 52100] [--robot ur10e]

Two made-up arms with published kinematics and masses (rounded) of a UR10e (six joints) and a Panda (seven), viscous and
Coulomb friction, motors that the file does not name, and friction that grows with the torque (0.07) at joints 2 and 3.
A pair of records has drawn sines of its own each, 20 s at 250 Hz, encoder noise of 1e-5 rad and drive noise of 3 % of
each drive.  The load of 2.8 kg (0.9 kg for the Panda) sits at the last joint at a drawn place.  With ``--places`` it is
known and gives the gains, but its place is given 0, 2 and 5 cm from the true one: is that told, and what gains follow?
"""

from __future__ import annotations

import dataclasses
import json
import tempfile
import time
import warnings
from pathlib import Path

import click
import numpy as np
import pandas as pd
from click.testing import CliRunner

from whsklearn import Arm, RigidBodyLags
from whsklearn.cli.gap import main as gap
from whsklearn.datasets import make_arm_log
from whsklearn.effects import Coulomb, LoadFriction, Viscous
from whsklearn.export.robots import arm_mjcf
from whsklearn.identification import gains_from_load
from whsklearn.identification.joint_least_squares import N_LEFT_OUT
from whsklearn.systems.arm_files import body_numbers

RATE, GROWS, NOISE = 250.0, 0.07, 0.03
H = np.pi / 2
# a, alpha, d, theta; mass; centre; largest inertia; motor; viscous; Coulomb
UR10E = [
    ((0, H, 0.1807, 0), 7.369, (0, 0.02, 0.13), 0.03, 6.0, 12.0, 7.0),
    ((-0.6127, 0, 0, 0), 13.051, (-0.23, 0, 0.16), 0.4, 6.0, 12.0, 8.0),
    ((-0.57155, 0, 0, 0), 3.989, (-0.25, 0, 0.05), 0.12, 3.0, 8.0, 5.0),
    ((0, H, 0.17415, 0), 2.1, (0, 0, 0.01), 0.004, 0.8, 2.5, 1.8),
    ((0, -H, 0.11985, 0), 1.98, (0, 0, 0.01), 0.004, 0.8, 2.5, 1.8),
    ((0, 0, 0.11655, 0), 0.615, (0, 0, -0.02), 0.0004, 0.8, 2.5, 1.8),
]
PANDA = [
    ((0, -H, 0.333, 0), 4.97, (0, -0.1, 0.05), 0.06, 0.6, 1.0, 0.6),
    ((0, H, 0, 0), 3.5, (0, -0.03, 0.05), 0.04, 0.6, 1.0, 0.6),
    ((0.0825, H, 0.316, 0), 3.2, (0.03, 0.04, -0.07), 0.03, 0.6, 0.8, 0.5),
    ((-0.0825, -H, 0, -H), 3.6, (-0.05, 0.1, 0.03), 0.03, 0.6, 0.8, 0.5),
    ((0, H, 0.384, 0), 1.2, (-0.01, 0.04, -0.04), 0.03, 0.3, 0.4, 0.4),
    ((0.088, H, 0, H), 1.7, (0.06, -0.01, -0.01), 0.004, 0.3, 0.4, 0.3),
    ((0, 0, 0.107, 0), 0.74, (0.01, 0, 0.06), 0.005, 0.3, 0.4, 0.3),
]
ROBOTS = {"ur10e": (UR10E, 2.8), "panda": (PANDA, 0.9)}


def made(rows: list) -> tuple[Arm, Arm]:
    """The arm, and what its file says of it: no motors, no friction."""
    names = [f"j{k + 1}" for k in range(len(rows))]
    arm = Arm.from_dh([r[0] for r in rows], joints=names)
    for name, (_, mass, centre, size, *_) in zip(names, rows, strict=True):
        arm = arm.with_body(name, mass, centre, size * np.diag([0.3, 1.0, 1.0]))
    law = {name: (Viscous(r[5]), Coulomb(r[6])) for name, r in zip(names, rows, strict=True)}
    law |= {name: (*law[name], LoadFriction(GROWS)) for name in ("j2", "j3")}
    return dataclasses.replace(arm, armature=[r[4] for r in rows]).with_effects(law), arm


def record(arm: Arm, seed: int) -> pd.DataFrame:
    """One record."""
    log = make_arm_log(arm, duration=20.0, sample_rate=RATE, amplitude=0.9, noise=1e-5, random_state=seed)
    rng = np.random.default_rng(seed + 9)
    drives = [c for c in log if c.endswith("torque_nm")]
    log[drives] += NOISE * log[drives].std().to_numpy() * rng.standard_normal(log[drives].shape)
    return log


def write(arm: Arm, path: Path, seed: int) -> Path:
    """One record as a file."""
    record(arm, seed).to_csv(path, index=False)
    return path


def drawn_place(seed: int) -> np.ndarray:
    """Where the load of a pair is."""
    return np.random.default_rng(seed).uniform([-0.05, -0.05, 0.02], [0.05, 0.05, 0.12])


def places(arm: Arm, told: Arm, mass: float, seed: int) -> None:
    """What is told of a known load that is given beside its place, and the gains, which are one in truth."""
    place, way = drawn_place(seed), np.random.default_rng(seed).standard_normal(3)
    pair = []
    for k, one in enumerate((arm, arm.with_body(arm.joints[-1], mass, place))):
        log = record(one, 2 * seed + k)
        pair.append([log[[c for c in log if c.endswith(end)]].to_numpy() for end in ("position_rad", "torque_nm")])
    for off in (0.0, 0.02, 0.05):
        numbers = body_numbers(mass, place + off * way / np.linalg.norm(way), np.zeros((3, 3)))
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always", UserWarning)
            found = gains_from_load(RigidBodyLags(told, RATE), *pair, joint=arm.joints[-1], numbers=numbers)
        gains = " ".join(f"{gain:.2f}+-{error:.2f}" for gain, error in found.values())
        text = "; ".join(str(w.message) for w in said)
        print(f"{seed} {100 * off:.0f} cm off: {gains}; {text or 'nothing told'}", flush=True)


@click.command()
@click.option("--pairs", default=12)
@click.option("--seed", default=52100, help="Of the first pair.")
@click.option("--robot", type=click.Choice(list(ROBOTS)), default="ur10e")
@click.option("--places", "beside", is_flag=True, help="A known load, given beside its place.")
def main(pairs: int, seed: int, robot: str, beside: bool) -> None:
    from scipy.stats import t as student

    rows, mass = ROBOTS[robot]
    arm, told = made(rows)
    if beside:
        for k in range(seed, seed + pairs):
            places(arm, told, mass, k)
        return
    half = float(student.isf(0.025, N_LEFT_OUT - 1))
    off, inside, first = [], 0, 0
    for k in range(seed, seed + pairs):
        with tempfile.TemporaryDirectory() as folder:
            out = Path(folder)
            (out / "arm.xml").write_text(arm_mjcf(told)[0])
            empty = write(arm, out / "empty.csv", 2 * k)
            loaded = write(arm.with_body(arm.joints[-1], mass, drawn_place(k)), out / "loaded.csv", 2 * k + 1)
            begun = time.process_time()
            asked = [empty, "--loaded", loaded, "--robot", out / "arm.xml", "--report", out / "gap", "--no-track"]
            done = CliRunner().invoke(gap, [str(a) for a in asked])
            assert done.exit_code == 0, done.output
            found = json.loads((out / "gap" / "gap.json").read_text())
        loads = [e for e in found["effects"] if e["name"] == "payload"]
        labels = [f"{e['name']} at {e['joint']}" if e["joint"] else e["name"] for e in found["effects"]]
        first += labels[:1] == [f"payload at {arm.joints[-1]}"]
        if loads:
            value, error = (loads[0][kind]["mass_kg"] for kind in ("parameters", "standard_errors"))
            off.append(abs(value - mass))
            inside += off[-1] < half * error
            told_as = f"{value:.3f} +- {error:.3f} kg"
        else:
            told_as = "no load"
        print(
            f"{k} {told_as}, {found['verdict']}: {'; '.join(labels)}, {time.process_time() - begun:.1f} s", flush=True
        )
    print(f"\n{robot}: {mass} kg in the 95 % interval {inside} of {pairs}, first name {first} of {pairs}, "
          f"median error {1e3 * float(np.median(off)):.1f} g")  # fmt: skip


if __name__ == "__main__":
    main()
