"""Arms that MuJoCo simulates, with something hidden or nothing: is the right thing named, and nothing where it is not?

    OMP_NUM_THREADS=1 python -m benchmarks.blind_arms [--cases 40] [--empties 40] [--seed 7000] [--joints 3]

An arm of three and one of six joints in turn, drawn for each case: links, axes, friction, motors.  PID on encoder
steps at 500 Hz, 20 s along drawn sines.  A first record, in which nothing is hidden, gives the numbers
(`identify_arm`); a second one along other sines has one thing more, and `GapFinder` is asked what.  "right" is the
name and the joint that was hidden, the verdict's first name (its verdict beside it where that is not "named");
"ambiguous" has it among those that cannot be told; "wrong" is any other name without the right one beside it, and,
where the verdict is "named", any second name.  Sizes are drawn where they matter, and nothing of what is drawn is told
to the finder.  A limit is a rubber stop: its constraint in MuJoCo is made so soft that the force is a spring's and not
the drive's.  With ``--numbers`` both records have nothing hidden and are identified: by how many standard errors do
their numbers differ?  With ``--evidence`` the same delays and lags are told apart by whoever knows MuJoCo's model:
its inverse dynamics along the filtered positions, with its own friction, delayed or lagged by the best age.
"""

from __future__ import annotations

import time
from collections import Counter
from typing import Any
from xml.etree import ElementTree as ET

import click
import mujoco
import numpy as np
from scipy.optimize import minimize_scalar

from whsklearn import Arm
from whsklearn.effects import codes
from whsklearn.gap import GapFinder
from whsklearn.gap.calibration import gain, n_effective, vuong
from whsklearn.gap.plants.arm import arm_plant
from whsklearn.gap.plants.arm_view import advance
from whsklearn.identification import identify_arm

RATE, FINE, DURATION, BAND = 500, 4, 20.0, 5.0  # Hz, steps of MuJoCo a sample, s, Hz of the controllers
LARGEST_ERROR = 0.15  # rad; stable loops of the arms drawn reach 0.1
REDRAWN = 100_000  # added to the seed of a case whose loop is unstable
SOFT = 0.02  # impedance of a limit: the share of the drive that its force takes over
STEP = 2 * np.pi / 2**17  # of the encoders, on the joint's side
NAMES = {
    "payload": {"payload"}, "limit": {"end_stop"}, "coulomb": {"coulomb"}, "damping": {"viscous"},
    "delay": {"input_delay"}, "armature": {"joint_inertia"}, "spring": {"cable_spring"}, "play": {"backlash"},
    "lag": {"actuator_lag"},
}  # fmt: skip
TURNS = tuple(NAMES)[:-1]  # taken in turn; a lag only if asked for by --kinds
ASKED = ("payload", "limit", "coulomb", "damping", "delay", "armature")  # of which 85 % are wanted


def drawn(rng: np.random.Generator, n: int) -> ET.Element:
    """MJCF of a chain of n joints: a vertical one, then two that carry, then a wrist."""
    root = ET.Element("mujoco")
    ET.SubElement(root, "option", timestep=f"{1 / RATE / FINE}", gravity="0 0 -9.81", integrator="implicitfast")
    ET.SubElement(root, "compiler", angle="radian")
    parent = ET.SubElement(root, "worldbody")
    actuators = ET.SubElement(root, "actuator")
    axes = ["0 0 1", "0 1 0", "0 1 0", "1 0 0", "0 1 0", "1 0 0"]
    mass = rng.uniform(3.0, 6.0)
    for k in range(n):
        reach = 0.35 * 0.8**k
        parent = ET.SubElement(
            parent, "body", name=f"link{k + 1}", pos="0 0 0.2" if k == 0 else f"{1.2 * reach:.4f} 0 0"
        )
        size = np.diag([0.15, 1.0, 1.0]) * mass * reach**2 / 12 + np.eye(3) * mass * 0.03**2
        centre = [0.5 * reach, rng.uniform(-0.02, 0.02), rng.uniform(-0.02, 0.02)]
        ET.SubElement(parent, "inertial", mass=f"{mass:.5f}", pos=" ".join(f"{c:.5f}" for c in centre),
                      diaginertia=" ".join(f"{x:.6g}" for x in np.diag(size)))  # fmt: skip
        strength = 0.15 * mass * 9.81 * reach
        dry, viscous, motor = rng.uniform([0.2, 0.2, 0.5], [0.6, 0.6, 1.5]) * [strength, strength, mass * reach**2 / 6]
        ET.SubElement(parent, "joint", name=f"j{k + 1}", axis=axes[k], frictionloss=f"{dry:.5g}",
                      damping=f"{viscous:.5g}", armature=f"{motor:.5g}")  # fmt: skip
        ET.SubElement(actuators, "motor", joint=f"j{k + 1}")
        mass *= rng.uniform(0.55, 0.8)
    return root


def reference(rng: np.random.Generator, n: int) -> np.ndarray:
    """Five sines a joint, half a radian or so."""
    t = np.arange(int(DURATION * RATE))[:, None, None] / RATE
    w, phase = rng.uniform(0.8, 6.0, (n, 5)), rng.uniform(0, 2 * np.pi, (n, 5))
    path = (np.sin(w * t + phase) / np.sqrt(w)).sum(axis=2)
    return rng.uniform(0.5, 0.8, n) * path / np.abs(path).max(axis=0)


def hide(root: ET.Element, kind: str, joint: int, rng: np.random.Generator, scale: dict[str, Any]) -> dict[str, Any]:
    """Change the model; what MuJoCo has no word for is told to `record`."""
    j, body = root.find(f".//joint[@name='j{joint + 1}']"), root.find(f".//body[@name='link{joint + 1}']")
    assert j is not None
    assert body is not None
    torque, reach, speed, inertia = (scale[k][joint] for k in ("torque", "reach", "speed", "inertia"))
    if kind == "payload":
        load = ET.SubElement(body, "body", pos="0.05 0 0.03")
        ET.SubElement(load, "inertial", mass=f"{rng.uniform(0.15, 0.5) * scale['mass'][joint]:.5f}", pos="0 0 0",
                      diaginertia="1e-4 1e-4 1e-4")  # fmt: skip
    elif kind == "limit":
        high = np.quantile(scale["path"][:, joint], rng.uniform(0.8, 0.92))
        j.set("range", f"-3 {high:.5f}")
        j.set("limited", "true")
        # an acceleration of the joint alone; MuJoCo divides by the impedance, and applies that share of the result
        stiff = 20.0 * torque / reach * scale["gives"][joint]
        j.set("solreflimit", f"{-stiff:.5g} {-0.1 * np.sqrt(stiff):.5g}")
        j.set("solimplimit", f"{SOFT} {SOFT} 0.001 0.5 2")
    elif kind == "coulomb":
        j.set("frictionloss", f"{float(j.get('frictionloss', 0)) + rng.uniform(0.05, 0.2) * torque:.5g}")
    elif kind == "damping":
        j.set("damping", f"{float(j.get('damping', 0)) + rng.uniform(0.05, 0.2) * torque / speed:.5g}")
    elif kind == "armature":
        j.set("armature", f"{float(j.get('armature', 0)) + rng.uniform(0.3, 0.8) * inertia:.5g}")
    elif kind == "spring":
        j.set("stiffness", f"{rng.uniform(0.1, 0.4) * torque / reach:.5g}")
    elif kind == "delay":
        return {"delay": (joint, int(rng.integers(4, 8)))}
    elif kind == "lag":
        return {"lag": (joint, rng.uniform(4.0, 8.0) / RATE)}
    elif kind == "play":
        return {"play": (joint, rng.uniform(0.02, 0.06) * reach)}
    return {}


def record(
    root: ET.Element, path: np.ndarray, gains: np.ndarray, delay: Any = None, play: Any = None, lag: Any = None
) -> Any:
    """Positions as the encoders read them and drives, (n, n_joints) each.

    Play lies between the motor, where the encoder sits, and the link: the rotor is the joint's armature, the contact
    rings at 60 Hz.
    """
    model = mujoco.MjModel.from_xml_string(ET.tostring(root, encoding="unicode"))
    data = mujoco.MjData(model)
    n, dt = model.nv, 1.0 / RATE
    data.qpos[:] = path[0]
    q, u = np.zeros_like(path), np.zeros_like(path)
    total, last = np.zeros(n), path[0]
    kp, ki, kd = gains
    rotor, inertia, arrived = np.zeros(2), 1.0, 0.0
    if play:
        rotor[0], inertia = path[0][play[0]], float(model.dof_armature[play[0]])
        model.dof_armature[play[0]] *= 0.05
    for t in range(len(path)):
        read = data.qpos.copy()
        if play:
            read[play[0]] = rotor[0]
        q[t] = np.round(read / STEP) * STEP
        error = path[t] - q[t]
        total += error * dt
        rate = np.gradient(path[max(t - 1, 0) : t + 2], dt, axis=0)[min(t, 1)] - (q[t] - last) / dt
        u[t] = kp * error + ki * total + kd * rate
        last = q[t]
        for _ in range(FINE):
            data.ctrl[:] = u[t]
            if delay:
                data.ctrl[delay[0]] = u[max(t - delay[1], 0), delay[0]]
            if lag:
                arrived += (u[t, lag[0]] - arrived) * -np.expm1(-1.0 / (lag[1] * RATE * FINE))
                data.ctrl[lag[0]] = arrived
            if play:
                j, gap = play
                stiff, damp = inertia * (2 * np.pi * 60.0) ** 2, 0.3 * inertia * 2 * np.pi * 60.0
                twist = rotor[0] - data.qpos[j]
                beyond = np.sign(twist) * max(abs(twist) - gap / 2, 0.0)
                push = stiff * beyond + damp * (rotor[1] - data.qvel[j]) if beyond else 0.0
                rotor[1] += (u[t, j] - push) / inertia / RATE / FINE
                rotor[0] += rotor[1] / RATE / FINE
                data.ctrl[j] = push
            mujoco.mj_step(model, data)
        if data.warning[mujoco.mjtWarning.mjWARN_BADQACC].number:
            return np.full_like(q, np.nan), u
    return q, u


def follows(q: np.ndarray, path: np.ndarray, kind: str = "") -> bool:
    """Whether the loop is stable, seen by its error but where a stop or a play keeps the joint off its path."""
    off = np.abs(q - path).max() if np.isfinite(q).all() else np.inf
    return bool(off < (np.pi if kind in ("limit", "play") else LARGEST_ERROR))


def numbers(n: int, seed: int) -> np.ndarray:
    """Differences of the numbers of two records of one arm, in their standard errors."""
    rng = np.random.default_rng(seed)
    root = drawn(rng, n)
    arm, gains, *_ = made(root)
    paths = reference(rng, n), reference(rng, n)
    records = [record(root, path, gains) for path in paths]
    if not all(follows(q, path) for (q, _), path in zip(records, paths, strict=True)):
        return numbers(n, seed + REDRAWN)
    first, second = (identify_arm(q, u, dt=1 / RATE, robot=arm).model for q, u in records)
    spread = [np.hypot(first.standard_errors[k], second.standard_errors[k]) for k in first.numbers]
    return (np.array(list(first.numbers.values())) - np.array(list(second.numbers.values()))) / spread


def made(root: ET.Element) -> tuple[Arm, np.ndarray, np.ndarray, Any]:
    """The arm, gains of its controllers, its mass matrix and MuJoCo's model."""
    text = ET.tostring(root, encoding="unicode")
    model = mujoco.MjModel.from_xml_string(text)
    data, mass = mujoco.MjData(model), np.zeros((model.nv, model.nv))
    mujoco.mj_forward(model, data)
    mujoco.mj_fullM(model, data, mass)
    w = 2 * np.pi * BAND
    return Arm.from_file(text), np.diag(mass) * np.array([[w**2], [w**3 / 10], [2 * w]]), mass, model


def evidence(kind: str, n: int, seed: int) -> None:
    """What delay and lag leave of the drive beside the true model, and by how much and how surely one is better."""
    arm, _, (q, u), joint, root = two_records(kind, n, seed)
    plant = arm_plant(arm, (np.arange(len(q)) / RATE, q, u), law=None, tolerance=0.004)
    plant.check()
    view, model = plant.view, mujoco.MjModel.from_xml_string(ET.tostring(root, encoding="unicode"))
    data, needed = mujoco.MjData(model), np.empty(len(q))
    for t, (data.qpos[:], data.qvel[:], data.qacc[:]) in enumerate(zip(*view.moved, strict=True)):
        mujoco.mj_inverse(model, data)
        needed[t] = data.qfrc_inverse[joint]

    def left(age: float, code: int) -> np.ndarray:
        drive = needed + advance(code, needed, age, 1 / RATE)
        return np.where(view.keep[:, joint], view.target[:, joint] - view.blur(drive[:, None])[:, 0], 0.0)

    errors = []
    for code in (codes.INPUT_DELAY, codes.ACTUATOR_LAG):
        best = minimize_scalar(
            lambda age, c=code: float(np.sum(left(age, c) ** 2)), bounds=(0.0, 0.03), method="bounded"
        )
        errors.append(left(best.x, code))
    right, wrong = errors if kind == "delay" else errors[::-1]
    powers = float(wrong @ wrong), float(right @ right)
    shares = [100 * view.by_joint(np.outer(e, np.ones(n)))[joint] / view.drive_rms[joint] for e in errors]
    lead, z = gain(*powers, n_effective(right)), vuong(wrong, right)
    print(f"{seed} {n} {kind} at j{joint + 1}: a delay leaves {shares[0]:.3f} %, a lag {shares[1]:.3f} %; "
          f"the right one leads by {lead:.0f}, {z:.1f} standard errors over blocks", flush=True)  # fmt: skip


def two_records(kind: str, n: int, seed: int) -> tuple[Arm, Any, Any, int, ET.Element]:
    """(a drawn arm, positions and drives of it, the same with one thing hidden along other sines, the joint, MJCF)."""
    rng = np.random.default_rng(seed)
    root = drawn(rng, n)
    arm, gains, mass, model = made(root)
    first = reference(rng, n)
    q, u = record(root, first, gains)
    if not follows(q, first):
        return two_records(kind, n, seed + REDRAWN)
    before = q, u
    joint = int(rng.integers(1 if kind in ("payload", "limit", "spring") else 0, n))
    if kind == "payload":
        joint = n - 1
    path = reference(rng, n)
    scale = {"torque": np.std(u, axis=0), "reach": np.ptp(path, axis=0) / 2, "path": path,
             "speed": np.std(np.gradient(path, 1 / RATE, axis=0), axis=0), "inertia": np.diag(mass),
             "gives": np.diag(np.linalg.inv(mass)), "mass": model.body_mass[1:]}  # fmt: skip
    changed = hide(root, kind, joint, rng, scale)
    if kind == "play":  # the controller of a motor that its link leaves alone
        gains = gains * np.where(np.arange(n) == joint, 2.0 * model.dof_armature / np.diag(mass), 1.0)
    q, u = record(root, path, gains, **changed)
    if not follows(q, path, kind):
        return two_records(kind, n, seed + REDRAWN)
    return arm, before, (q, u), joint, root


def case(kind: str, n: int, seed: int) -> dict[str, Any]:
    """One arm with one thing hidden: what the finder says."""
    arm, before, (q, u), joint, _ = two_records(kind, n, seed)
    known = identify_arm(*before, dt=1 / RATE, robot=arm).model
    began = time.process_time()
    finder = GapFinder(known).fit((np.arange(len(q)) / RATE, q, u))
    label = f"{next(iter(NAMES[kind]))} at j{joint + 1}" if kind else ""
    names = [e.label for e in finder.effects_]
    beside = [a for e in finder.effects_ for a in e.aliases]
    sure = finder.verdict_ == "named"
    if not kind:
        outcome = "silent" if not names else "false"
    elif sure and set(names) != {label}:
        outcome = "wrong"
    elif names and names[0] == label:
        outcome = "right" if sure else f"right ({finder.verdict_})"
    elif label in names + beside:
        outcome = "ambiguous" if finder.verdict_ == "ambiguous" else "beside"
    else:
        outcome = "unnamed" if not names else f"wrong ({finder.verdict_})"
    return {"kind": kind, "n": n, "seed": seed, "label": label, "outcome": outcome, "verdict": finder.verdict_,
            "names": names, "beside": beside, "figures": finder.diagnosis_.figures,
            "seconds": time.process_time() - began}  # fmt: skip


@click.command()
@click.option("--cases", default=40)
@click.option("--empties", default=40)
@click.option("--seed", default=7000, help="Of the first case.")
@click.option("--joints", type=click.Choice(["3", "6"]), help="Only arms of so many.")
@click.option("--kinds", default="", help="Only these, joined by commas.")
@click.option("--evidence", "truth", is_flag=True, help="Of delays and lags: what the true model says.")
@click.option("--numbers", "pairs", is_flag=True, help="Of the empties: how far the numbers of two records differ.")
def main(cases: int, empties: int, seed: int, joints: str | None, kinds: str, truth: bool, pairs: bool) -> None:
    if pairs:
        z = np.concatenate([numbers(int(joints or 6), seed + i) for i in range(empties)])
        far = ", ".join(f"{100 * np.mean(np.abs(z) > k):.1f} % beyond {k}" for k in (2, 3, 5))
        print(f"{z.size} numbers of {empties} arms: rms {np.sqrt(np.mean(z**2)):.2f} standard errors, {far}")
        return
    every = kinds.split(",") if kinds else list(TURNS)
    asked = [every[i % len(every)] for i in range(cases)] + [""] * empties
    outcomes: dict[str, Counter[str]] = {}
    for i, kind in enumerate(asked):
        n = int(joints) if joints else (3, 6)[(i // len(every)) % 2]
        if truth:
            if kind in ("delay", "lag"):
                evidence(kind, n, seed + i)
            continue
        row = case(kind, n, seed + i)
        outcomes.setdefault(kind or "nothing", Counter())[row["outcome"]] += 1
        share = ", ".join(f"{100 * x:.2f}" for x in row["figures"])
        told = f"{'; '.join(row['names'])} | {'; '.join(row['beside'])} | {share} % | {row['seconds']:.1f} s"
        print(f"{row['seed']} {n} {row['label'] or 'nothing':22} {row['outcome']:18} {told}", flush=True)
    print()
    for kind, found in outcomes.items():
        print(f"{kind:10} {dict(found)}")
    wanted = [found for kind, found in outcomes.items() if kind in ASKED]
    total, right = sum(map(Counter.total, wanted)), sum(f["right"] for f in wanted)
    first = right + sum(v for f in wanted for k, v in f.items() if k.startswith("right ("))
    if total:
        print(f"\nof {', '.join(ASKED)}: right and sure {right} of {total}, right name first {first}")


if __name__ == "__main__":
    main()
