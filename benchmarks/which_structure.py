"""Does `identify` recommend the right structure?  Drawn axes and chains, the library's servo, EMPS, KR300, XL330.

    python benchmarks/which_structure.py [--count 20] [--mujoco 20] [--seed 0] [--data FOLDER]

The generator of the first is ours, so its rate is a regression test, not a result; axes with and without gravity are
simulated by MuJoCo as well; the real records have no class but one that is known of the rig: all are axes, the XL330
with gravity.
"""

from __future__ import annotations

import argparse
import importlib.util
import os
import warnings
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.signal import lfilter

from whsklearn.datasets import make_servo_log
from whsklearn.filtering.records import fine_drive
from whsklearn.identification import Identification, identify
from whsklearn.logs import LogWarning, load_log
from whsklearn.recursion.batch.axis_free_run import AxisLog, axis_motion

LAWS = {
    "linear": lambda x: x,
    "absolute": np.abs,
    "relay": np.sign,
    "quadratic": lambda x: x + x**2 / 2,
    "saturation": lambda x: np.clip(x, -0.7, 0.7),
    "dead zone": lambda x: np.sign(x) * np.maximum(np.abs(x) - 0.4, 0.0),
    "cubic": lambda x: x + 0.5 * x**3,
}


def drawn_axis(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, float, str]:
    """A stable axis driven in open loop by a slow torque that breaks its friction most of the time."""
    dt, n = 0.002, 10_000
    inertia, coulomb = np.exp(rng.uniform(np.log(0.01), np.log(1.0))), 0.0
    viscous = inertia / rng.uniform(0.05, 0.5)
    amplitude = 1.0
    coulomb = rng.uniform(0.15, 0.4) * amplitude
    u = amplitude * lfilter([1.0], [1.0, -0.985], rng.standard_normal(n))
    u *= amplitude / np.std(u)
    theta = np.array([inertia, viscous, coulomb, 0.05 * rng.standard_normal()])
    log = AxisLog(fine_drive(u, 4), u, u == u, np.array([0, n]), np.zeros((1, 2)), dt)
    if rng.random() < 0.5:
        q = axis_motion(theta, log._replace(of_position=True))
        return u, q + 2e-5 * np.std(q) * rng.standard_normal(n), dt, "axis"
    v = axis_motion(theta, log)
    return u, v + 0.01 * np.std(v) * rng.standard_normal(n), dt, "axis"


def drawn_chain(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, float, str]:
    """Two second-order blocks about one of seven laws, white drive, 2 % noise; a linear law makes it linear."""
    n = 6_000
    name = list(LAWS)[rng.integers(len(LAWS))]

    def block(signal: np.ndarray) -> np.ndarray:
        radius, angle = rng.uniform(0.3, 0.9), rng.uniform(0.1, 2.5)
        out = lfilter([1.0, rng.uniform(-0.8, 0.8)], [1.0, -2 * radius * np.cos(angle), radius**2], signal)
        return out / np.std(out)

    u = rng.standard_normal(n)
    y = block(LAWS[name](block(u)))
    y = np.r_[0.0, y[:-1]]  # an output follows its input by a sample
    return u, y + 0.02 * rng.standard_normal(n), 0.001, "linear" if name == "linear" else "wiener-hammerstein"


def mujoco_axis(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, float, dict[str, float]]:
    """A hinge of MuJoCo under a slow random torque, with a pendulum's weight or without; drive, position, dt, truth."""
    import mujoco

    dt, n, substeps = 0.002, 6000, 4
    mass, arm = rng.uniform(0.2, 1.0), rng.uniform(0.08, 0.3)
    weight = 9.81 * mass * arm * (rng.random() < 0.6)
    scale = max(weight, 0.5)
    truth = {
        "inertia": mass * arm**2 + 0.005,
        "viscous": scale * rng.uniform(0.03, 0.3),
        "coulomb": scale * rng.uniform(0.03, 0.2),
        "gravity_imbalance": weight,
    }
    model = mujoco.MjModel.from_xml_string(
        f"""<mujoco><option timestep="{dt / substeps}" gravity="0 0 {-9.81 * bool(weight)}" integrator="implicitfast"/>
        <worldbody><body><joint name="hinge" axis="0 1 0" damping="{truth["viscous"]}" frictionloss="{truth["coulomb"]}"
        armature="0.005"/><inertial pos="0 0 {-arm}" mass="{mass}" diaginertia="1e-9 1e-9 1e-9"/></body></worldbody>
        <actuator><motor joint="hinge"/></actuator></mujoco>"""
    )
    data = mujoco.MjData(model)
    u = lfilter([1.0], [1.0, -0.95], lfilter([1.0], [1.0, -0.9], rng.standard_normal(n)))
    u *= scale * rng.uniform(0.5, 1.2) / np.std(u)
    q = np.empty(n)
    for t in range(n):
        q[t], data.ctrl[0] = data.qpos[0], u[t]
        mujoco.mj_step(model, data, substeps)
    count = 2 * np.pi / rng.choice([1024, 4096, 16384])
    return u, count * np.round(q / count), dt, truth


def of_mujoco(count: int, seed: int) -> None:
    """Is the axis found, with gravity where there is gravity, and how far off are its numbers?"""
    right, off = 0, []
    for i in range(count):
        u, q, dt, truth = mujoco_axis(np.random.default_rng([seed, i, 7]))
        found = identify(u, q, dt=dt)
        name = "axis with gravity" if truth["gravity_imbalance"] else "axis, viscous and Coulomb"
        same = found.recommended.name == name
        right += same
        if same:
            off.append([abs(found.model.parameters[k] / v - 1) for k, v in truth.items() if k != "gravity_imbalance"])
        print(f"MuJoCo {i:<17}{name:28}{found.recommended.name:28}{'' if same else 'WRONG'}", flush=True)
    worst = ", ".join(f"{100 * v:.1f}" for v in np.median(off, axis=0))
    print(f"MuJoCo: right structure {right} of {count}; inertia, viscous, Coulomb off by {worst} % (median)")


def told(name: str, found: Identification, expected: str) -> tuple[bool, bool]:
    """One line a record: (right class, never worse than ARX)."""
    arx = min(c.score for c in found.models if c.kind == "arx")
    kind = "linear" if found.recommended.kind in ("arx", "output_error") else found.recommended.kind
    right, no_worse = kind == expected, found.recommended.score <= 1.075 * arx
    ratio = found.recommended.score / arx
    print(
        f"{name:24}{expected:20}{found.recommended.name:28}{ratio:10.4f} of ARX  {'' if right else 'WRONG CLASS'}"
        f"{'' if no_worse else ' WORSE THAN ARX'}",
        flush=True,
    )
    return right, no_worse


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=20)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--mujoco", type=int, default=20, help="axes simulated by MuJoCo")
    parser.add_argument("--data")
    options = parser.parse_args()
    results = []
    for i in range(options.count):
        rng = np.random.default_rng([options.seed, i])
        u, y, dt, expected = (drawn_axis if i % 2 == 0 else drawn_chain)(rng)
        results.append(told(f"drawn {i}", identify(u, y, dt=dt), expected))
    right, no_worse = np.sum(results or [(0, 0)], axis=0)
    print(f"right class {right} of {len(results)}, no worse than ARX {no_worse} of {len(results)}\n")
    if options.mujoco and importlib.util.find_spec("mujoco"):
        of_mujoco(options.mujoco, options.seed)
    servo = make_servo_log([], random_state=0)
    u, q = servo["torque_nm"].to_numpy(), servo["position_rad"].to_numpy()
    found = identify(u, np.gradient(q, 1e-3), dt=1e-3)
    told("library servo, velocity", found, "axis")
    linear = min(c.test["nmse"] for c in found.models if c.kind in ("arx", "output_error"))
    noise = found.floor**2 / np.var(found.test.y)
    nmse = found.recommended.test["nmse"]
    print(
        f"    NMSE of the held-out velocity {nmse:.3g}, of the best linear model {linear:.3g}, of the noise {noise:.3g}"
    )
    beside = Path(__file__).resolve().parents[2] / "shared" / "data"
    folder = Path(options.data or os.environ.get("WHSKLEARN_DATA") or beside)
    if (folder / "emps").is_dir():
        a, b = (pd.read_csv(folder / "emps" / f"emps_{k}.csv") for k in ("train", "test"))
        found = identify(a.drive_V, a.position_m, dt=1e-3, test=(b.drive_V, b.position_m))
        told("EMPS", found, "axis")
    if (folder / "kr300").is_dir():
        for part in "ABC":
            frame = pd.read_csv(folder / "kr300" / f"kr300_axis1_{part}.csv")
            units = {"input": "Nm", "output": "deg"}
            found = identify(frame.motor_torque_Nm, frame.motor_position_deg, dt=4e-3, units=units)
            told(f"KR300 {part}", found, "axis")
    for path in sorted((folder / "xl330").glob("*.csv")):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", LogWarning)  # uneven stamps, signed numbers as unsigned ones
            log = load_log(path, time="timestamp", drive="load", output="position")
        told(f"XL330 {path.stem[-8:]}", identify(log.X[:, 0], log.y, dt=1.0 / log.sample_rate), "axis")


if __name__ == "__main__":
    main()
