"""What moved between two records: named, sized, and silent where nothing did.

    python -m benchmarks.compare --changes 40 --equals 100
    python -m benchmarks.compare --real
    python -m benchmarks.compare --arms 40

MuJoCo (extra ``bench``) drives one axis twice, along two references; one number differs in the second record, or none.
Half of the pairs have an offset that walks at random (its deviation over a record a tenth of the rms drive) or
friction that warms (a fifth lower in the end). ``right``: the first name is the truth. ``inside``: the true change lies
in the 95 % interval. ``--real`` takes the measured records (``../shared/data`` or ``WHSKLEARN_DATA``): halves, quarters
and repeats of one rig, of which nothing moved; XL330 at two gains of its loop; an arm with and without a load.
``--arms``: arms of three and six joints as `benchmarks.blind_arms` draws them, with one thing more in the second record
or nothing.
Printed: rates with Wilson intervals, seconds a pair.
"""

from __future__ import annotations

import itertools
import json
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import click
import mujoco
import numpy as np
import pandas as pd

from benchmarks.blind import wilson
from benchmarks.blind_arms import RATE, two_records
from benchmarks.blind_mujoco import FINE, Rig, _rms, build, draw_rig, hide, reference
from benchmarks.real_axes import folder
from whsklearn import Arm
from whsklearn.compare import ArmLog, Comparison, compare_arms, compare_records
from whsklearn.gap import ServoRecord

DRIFTS = ("none", "walk", "none", "warm")  # half of the pairs
# name -> (factor of what moves; the effect that both axes have beside the base, if it needs one)
CHANGES = (
    "inertia", "viscous", "coulomb", "input_offset", "gravity_imbalance", "cable_spring", "cogging", "gain", "delay",
    "gravity came", "cogging came", "spring came",
)  # fmt: skip
ALSO = {"gravity_imbalance": "pendulum", "cable_spring": "stiffness", "cogging": "cogging"}
CAME = {"gravity came": "pendulum", "cogging came": "cogging", "spring came": "stiffness"}
TRUE = {"gravity came": "gravity_imbalance", "cogging came": "cogging", "spring came": "cable_spring"}
SECONDS = 30.0


def logged(rig: Rig, drift: str, rng: np.random.Generator, offset: float = 0.0, gain: float = 1.0) -> ServoRecord:
    """The rig under its controller: an offset beside the drive, a drive whose log reads ``gain`` times too high."""
    model = mujoco.MjModel.from_xml_string(build(rig))
    data = mujoco.MjData(model)
    n, every, dt = rig.reference.shape[1], round(FINE / rig.rate), 1.0 / rig.rate
    plain = rig.inertia * rig.reference[2] + rig.damping * rig.reference[1] + rig.friction * np.sign(rig.reference[1])
    walk = np.cumsum(rng.standard_normal(n))
    walk *= 0.1 * _rms(plain) / max(float(np.std(walk)), 1e-300) if drift == "walk" else 0.0
    warm = 0.8 + 0.2 * np.exp(-3.0 * np.arange(n) / n) if drift == "warm" else np.ones(n)
    step, (kp, kd) = 2 * np.pi / rig.counts, rig.gains
    u, y, speed, last = np.zeros(n), np.zeros(n), 0.0, 0.0
    friction = model.dof_frictionloss.copy()
    for k in range(n):
        y[k] = step * np.round(data.qpos[0] / step)
        speed += 0.4 * ((y[k] - last) / dt - speed)
        last = y[k]
        u[k] = kp * (rig.reference[0, k] - y[k]) + kd * (rig.reference[1, k] - speed)
        model.dof_frictionloss[:] = warm[k] * friction
        data.ctrl[0], data.qfrc_applied[0] = u[k], -walk[k] - offset
        mujoco.mj_step(model, data, every)
    u = u + 0.005 * _rms(u) * rng.standard_normal(n)
    units = ("N", "m") if rig.joint == "slide" else ("Nm", "rad")
    return ServoRecord(np.arange(n) * dt, gain * u, y, units=units)


def again(rig: Rig, rng: np.random.Generator) -> Rig:
    """The same axis along another reference of about its reach and speed."""
    t = np.arange(rig.reference.shape[1]) / rig.rate
    reach, speed = float(np.abs(rig.reference[0]).max()), _rms(rig.reference[1])
    return replace(rig, reference=reference(rng, t, reach * rng.uniform(0.8, 1.1), speed * rng.uniform(0.8, 1.2)))


def pair(kind: str, seed: int) -> tuple[list[ServoRecord], str, float | None]:
    """(two records, the true name or none, the true change in its unit where it has one)."""
    rng = np.random.default_rng([seed, list(CHANGES).index(kind) if kind in CHANGES else 99, 25])
    rig = draw_rig(rng, SECONDS)
    drift = DRIFTS[seed % len(DRIFTS)]
    if kind in ALSO:
        hide(ALSO[kind], rig, 0.3, rng)
    elif kind == "none" and seed % 3:
        hide(("pendulum", "cogging")[seed % 3 - 1], rig, 0.2, rng)
    other, offset, gain, change = again(rig, rng), 0.0, 1.0, None
    factor = float(rng.choice([1.0 / rng.uniform(1.25, 1.6), rng.uniform(1.25, 1.6)]))
    plain = rig.inertia * rig.reference[2] + rig.damping * rig.reference[1] + rig.friction * np.sign(rig.reference[1])
    if kind == "inertia":
        other.inertia, change = rig.inertia * factor, rig.inertia * (factor - 1.0)
    elif kind == "viscous":
        other.damping, change = rig.damping * factor, rig.damping * (factor - 1.0)
    elif kind == "coulomb":
        other.friction, change = rig.friction * factor, rig.friction * (factor - 1.0)
    elif kind == "input_offset":
        offset = change = float(rng.choice([-1.0, 1.0])) * 0.3 * _rms(plain)
    elif kind == "gain":
        gain, change = factor, 1.0 / factor - 1.0
    elif kind == "delay":
        late = round(rng.uniform(3.0, 5.0) * FINE / rig.rate)
        other.actuator, change = f'nsample="{late}" delay="{late / FINE:.9g}"', late / FINE
    elif kind in CAME:
        hide(CAME[kind], other, 0.2, rng)
    elif kind == "gravity_imbalance":
        other.gravity, change = rig.gravity * factor, rig.gravity * (factor - 1.0)
    elif kind == "cable_spring":
        words = rig.joint_extra.split('"')
        k = float(words[1])
        other.joint_extra = rig.joint_extra.replace(words[1], f"{k * factor:.9g}")
        change = k * (factor - 1.0)
    elif kind == "cogging":
        words = rig.motor.split('"')[1].split()
        size = float(words[0])
        other.motor, change = rig.motor.replace(words[0], f"{size * factor:.9g}"), size * (factor - 1.0)
    truth = TRUE.get(kind, kind)
    if truth == "gravity_imbalance" and rig.joint == "slide":
        truth, change = "input_offset", None if change is None else change
    records = [logged(rig, drift, rng), logged(other, drift, rng, offset, gain)]
    return records, "" if kind == "none" else truth, change


def judged(records: list[ServoRecord]) -> tuple[Comparison, float]:
    """The comparison, and its seconds of CPU."""
    began = time.process_time()
    found = compare_records(records)
    return found, time.process_time() - began


def simulated(changes: int, equals: int, seeds: int) -> Iterator[dict[str, Any]]:
    """A row a pair."""
    plan = [(CHANGES[i % len(CHANGES)], seeds + i // len(CHANGES) + 2 * i) for i in range(changes)]
    for kind, seed in [*plan, *(("none", seeds + i) for i in range(equals))]:
        records, truth, change = pair(kind, seed)
        found, seconds = judged(records)
        first = found.changes[0] if found.changes else None
        row = {"kind": kind, "seed": seed, "drift": DRIFTS[seed % 4], "verdict": found.verdict,
               "named": "|".join([first.name, *first.rivals]) if first else "", "all": [c.name for c in found.changes],
               "right": bool(first) and first.name == truth, "wrong": bool(first) and not truth, "seconds": seconds,
               "text": found.sentence}  # fmt: skip
        if first is not None and row["right"] and change is not None:
            low, high = first.interval
            row["inside"] = low <= change <= high
            row["off"] = (first.change - change) / abs(change)
        yield row


def record(path: Path, **columns: str) -> ServoRecord:
    """One file with the columns of its own."""
    return ServoRecord.from_frame(pd.read_csv(path), **columns)


def parts(r: ServoRecord, n: int) -> list[ServoRecord]:
    """The record in ``n`` equal parts."""
    edges = np.linspace(0, len(r), n + 1).astype(int)
    return [replace(r, time=r.time[a:b], drive=r.drive[a:b], position=r.position[a:b], reference=None)
            for a, b in itertools.pairwise(edges)]  # fmt: skip


def xl330(data: Path, error: bool) -> dict[tuple[int, str], ServoRecord]:
    """The eight logs, by gain of the loop and path; drive: volts, or goal minus position."""
    out = {}
    for file in sorted((data / "xl330").glob("*.csv")):
        facts, f = json.loads(file.with_suffix(".json").read_text()), pd.read_csv(file)
        load = f["load"].to_numpy(float)
        load = np.where(load > 32767, load - 65536, load)
        drive = (f["goal_position"] - f["position"]).to_numpy() if error else load * f["input_volts"].to_numpy() / 885.0
        grid = np.linspace(f["timestamp"].iloc[0], f["timestamp"].iloc[-1], len(f))
        u, y = (np.interp(grid, f["timestamp"], x) for x in (drive, f["position"].to_numpy()))
        out[facts["kp"], facts["trajectory"]] = ServoRecord(grid, u, y, units=("rad" if error else "V", "rad"))
    return out


def equal_pairs(data: Path) -> Iterator[tuple[str, list[ServoRecord]]]:
    """Pairs of real records of which nothing moved."""
    whole: dict[str, ServoRecord] = {}
    for part in ("train", "test"):
        file = data / "emps" / f"emps_{part}.csv"
        whole[f"emps {part}"] = record(file, time="time_s", drive="force_N", position="position_m")
    for part in "ABC":
        file = data / "kr300" / f"kr300_axis1_{part}.csv"
        whole[f"kr300 {part}"] = record(file, time="time_s", drive="motor_torque_Nm", position="motor_position_deg")
    yield "emps repeat", [whole["emps train"], whole["emps test"]]
    for a, b in itertools.combinations("ABC", 2):
        yield f"kr300 {a} {b}", [whole[f"kr300 {a}"], whole[f"kr300 {b}"]]
    for error in (False, True):
        logs = xl330(data, error)
        for kp in (100, 200, 400, 800):
            yield f"xl330 kp {kp} {error}", [logs[kp, "sin_sin"], logs[kp, "up_and_down"]]
        for (kp, path), log in logs.items():
            yield f"xl330 half {kp} {path} {error}", parts(log, 2)
    for motion in ("pd_sysid", "energy", "ddp"):
        file = data / "pendulum" / f"{motion}.csv.gz"
        whole[f"pendulum {motion}"] = record(file, time="time_s", drive="torque_nm", position="position_rad")
    laas = data / "laas" / "compensation_off.csv"
    whole["laas"] = record(laas, time="time_s", drive="current_a", position="position_rad")
    for arm, joints in (("double_pendulum", 2), ("airbot", 6), ("airbot_loaded", 6), ("tx40", 6)):
        frame = pd.read_csv(data / "arms" / f"{arm}.csv.gz")
        for j in range(1, joints + 1):
            names = {"time": "time_s", "drive": f"torque_{j}_nm", "position": f"position_{j}_rad"}
            whole[f"{arm} {j}"] = ServoRecord.from_frame(frame, **names)
    for name, log in whole.items():
        yield f"{name} halves", parts(log, 2)
        if not name.startswith("kr300"):
            first, second, third, fourth = parts(log, 4)
            yield f"{name} quarters 1 3", [first, third]
            yield f"{name} quarters 2 4", [second, fourth]


def deviate(row: dict[str, Any]) -> float:
    """Difference of a number between two records over its standard error."""
    (a, b), errors = row["values"], row["standard_errors"]
    return float((b - a) / np.hypot(*errors))


def gain_pairs(data: Path) -> Iterator[tuple[str, list[ServoRecord]]]:
    """XL330 at two gains of its loop: all pairs of gains, either path each, and across."""
    logs = xl330(data, True)
    for a, b in itertools.combinations((100, 200, 400, 800), 2):
        for p, q in itertools.product(("sin_sin", "up_and_down"), repeat=2):
            yield f"xl330 kp {a} to {b} {p} {q}", [logs[a, p], logs[b, q]]


ARM_CHANGES = {
    "payload": ("mass", "moment"), "coulomb": ("coulomb",), "damping": ("viscous",), "armature": ("joint_inertia",),
    "delay": ("delay",), "": (),
}  # fmt: skip


def of_arms(count: int, seeds: int, every: bool) -> None:
    """Drawn arms: one thing more in the second record at one joint, or nothing."""
    rows = []
    for i in range(count):
        kind = list(ARM_CHANGES)[i % len(ARM_CHANGES)]
        n = (3, 6)[(i // len(ARM_CHANGES)) % 2]
        arm, before, after, joint, _ = two_records(kind, n, seeds + i)
        began = time.process_time()
        found = compare_arms([ArmLog(RATE, *before), ArmLog(RATE, *after)], arm)
        first = found.changes[0].name if found.changes else ""
        beside = found.changes[0].rivals if found.changes else []
        true = [f"{name} at j{joint + 1}" for name in ARM_CHANGES[kind]]
        rows.append({"kind": kind, "right": first in true, "beside": bool({first, *beside} & set(true)),
                     "wrong": bool(first) and not kind, "seconds": time.process_time() - began})  # fmt: skip
        if every or not (rows[-1]["right"] or (not kind and not first)):
            click.echo(f"{kind or 'nothing':<10} {n} {seeds + i:>5} {' or '.join(true):<24} {found.sentence[:150]}")
    moved, equal = [r for r in rows if r["kind"]], [r for r in rows if not r["kind"]]
    click.echo(told("arms: right name and joint first", [r["right"] for r in moved], ""))
    click.echo(told("  or beside it", [r["beside"] for r in moved], ""))
    click.echo(told("arms: named though nothing moved", [r["wrong"] for r in equal], "<= 1 %"))
    seconds = sorted(r["seconds"] for r in rows)
    click.echo(f"CPU seconds a pair: median {seconds[len(seconds) // 2]:.2f}, worst {seconds[-1]:.2f}")


def real_arm(data: Path, name: str, joints: int) -> tuple[Arm, ArmLog]:
    """The robot and its log."""
    frame = pd.read_csv(data / "arms" / f"{name}.csv.gz")
    q, u = (frame[[c.format(j) for j in range(1, joints + 1)]].to_numpy() for c in ("position_{}_rad", "torque_{}_nm"))
    rate = 1.0 / float(np.median(np.diff(frame["time_s"])))
    return Arm.from_file(data / "arms" / f"{name.removesuffix('_loaded')}.urdf"), ArmLog(rate, q, u)


def arm_parts(r: ArmLog, n: int) -> list[ArmLog]:
    """The record in ``n`` equal parts."""
    edges = np.linspace(0, len(r.position), n + 1).astype(int)
    return [ArmLog(r.sample_rate, r.position[a:b], r.drive[a:b]) for a, b in itertools.pairwise(edges)]


def equal_arms(data: Path) -> Iterator[tuple[str, Arm, list[ArmLog]]]:
    """Parts of real records of arms, of which nothing moved."""
    for name, joints in (("double_pendulum", 2), ("airbot", 6), ("airbot_loaded", 6), ("tx40", 6)):
        arm, log = real_arm(data, name, joints)
        yield f"{name} halves", arm, arm_parts(log, 2)
        first, second, third, fourth = arm_parts(log, 4)
        yield f"{name} quarters 1 3", arm, [first, third]
        yield f"{name} quarters 2 4", arm, [second, fourth]


def told(label: str, hits: list[bool], goal: str) -> str:
    """A rate with its Wilson interval."""
    _, low, high = wilson(sum(hits), max(len(hits), 1))
    return f"{label:<44} {sum(hits):>3}/{len(hits):<3} [{100 * low:5.1f}, {100 * high:5.1f}] %  {goal}"


@click.command(help=__doc__)
@click.option("--changes", default=40, help="Simulated pairs of which one number differs.")
@click.option("--equals", default=100, help="Simulated pairs of which none does.")
@click.option("--seeds", default=0, help="First seed.")
@click.option("--arms", default=0, help="Drawn arms in place of axes.")
@click.option("--real", is_flag=True, help="The measured records in place of MuJoCo.")
@click.option("--all", "every", is_flag=True, help="Print every pair, not only those that were missed.")
def main(changes: int, equals: int, seeds: int, arms: int, real: bool, every: bool) -> None:
    if real or arms:
        of_real(every) if real else of_arms(arms, seeds, every)
        return
    rows = []
    for row in simulated(changes, equals, seeds):
        rows.append(row)
        if every or row["wrong"] or (row["kind"] != "none" and not row["right"]) or not row.get("inside", True):
            click.echo(f"{row['kind']:<18} {row['seed']:>4} {row['drift']:<5} {row['text'][:150]}")
    moved, equal = [r for r in rows if r["kind"] != "none"], [r for r in rows if r["kind"] == "none"]
    click.echo(told("right", [r["right"] for r in moved], ">= 90 %"))
    click.echo(told("true change inside its 95 % interval", [r["inside"] for r in moved if "inside" in r], ">= 90 %"))
    click.echo(told("named though nothing moved", [r["wrong"] for r in equal], "<= 1 %"))
    click.echo(told("equal, and said so", [r["verdict"] == "nothing" for r in equal], ""))
    off = sorted(abs(r["off"]) for r in moved if "off" in r)
    click.echo(f"error of the change: median {100 * off[len(off) // 2]:.1f} %" if off else "")
    seconds = sorted(r["seconds"] for r in rows)
    click.echo(f"CPU seconds a pair: median {seconds[len(seconds) // 2]:.2f}, worst {seconds[-1]:.2f}; goal 2")


def of_real(every: bool) -> None:
    """The measured records."""
    data, false, verdicts, away = folder(), [], [], []
    for name, records in equal_pairs(data):
        found, _ = judged(records)
        false.append(bool(found.changes))
        verdicts.append(found.verdict if found.numbers else "refused")
        away += [deviate(row) for row in found.numbers]
        if every or found.changes:
            click.echo(f"{name:<30} {found.sentence[:160]}")
    click.echo(told("real equal axes, something named", false, "<= 2.5 %"))
    click.echo(told("  refused: no rigid axis, or no use", [v == "refused" for v in verdicts], ""))
    click.echo(told("  cannot tell: half of any number is missed", [v == "cannot_tell" for v in verdicts], ""))
    click.echo(told("numbers of equal records within two errors", [abs(z) < 2.0 for z in away], "95 % if honest"))
    click.echo(f"  rms of their difference over its error: {np.sqrt(np.mean(np.square(away))):.2f}, 1 if honest")
    whole = []
    for name, arm, pieces in equal_arms(data):
        found = compare_arms(pieces, arm)
        whole.append(bool(found.changes))
        if every or found.changes:
            click.echo(f"{name:<30} {found.sentence[:160]}")
    click.echo(told("real equal arms, something named", whole, ""))
    arm, empty = real_arm(data, "airbot", 6)
    click.echo(
        f"airbot, empty and loaded: {compare_arms([empty, real_arm(data, 'airbot_loaded', 6)[1]], arm).sentence}"
    )
    first, beside = [], []
    for name, records in gain_pairs(data):
        found, _ = judged(records)
        names = [found.changes[0].name, *found.changes[0].rivals] if found.changes else []
        first.append(names[:1] == ["gain"])
        beside.append("gain" in names[:2])
        if every or not beside[-1]:
            click.echo(f"{name:<44} {found.sentence[:160]}")
    click.echo(told("XL330 at two gains: gain first", first, ""))
    click.echo(told("  or as the first rival", beside, ">= 20 of 24"))


if __name__ == "__main__":
    main()
