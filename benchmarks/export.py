"""Exported models against the library's own simulation: C99 (gcc), MuJoCo, FMI 2.0.

    python -m benchmarks.export --samples 1000000

(extra ``bench``, and a C compiler.) One axis for each effect replays the same drive: the largest difference of the C
code from `ServoAxis.simulate_drive`, its CPU time a step, and the rms difference of MuJoCo's replay over the rms of
the motion. ``--substeps`` sets the fine steps a sample, in both.
"""

from __future__ import annotations

import ctypes
import shutil
import subprocess
import tempfile
import time
from pathlib import Path
from typing import Any

import click
import numpy as np

from whsklearn import ServoAxis, WienerHammersteinSystem
from whsklearn.effects import (
    Backlash,
    CableSpring,
    ContactStop,
    Coulomb,
    Effect,
    FlexibleCoupling,
    Stribeck,
    Viscous,
    effect_names,
    get_effect,
)
from whsklearn.export import export_model

# sizes that can be seen where the default is too small or too large for an axis of 0.05 kg m2
SIZES = {
    "coulomb": 0.2,
    "asymmetric_viscous": 0.02,
    "stribeck": 0.1,
    "saturation": 0.8,
    "compliance": 1e-2,
    "input_delay": 3e-3,
    "actuator_lag": 3e-3,
    "end_stop": 10.0,
}
# Beside viscous and Coulomb friction, of an axis of 0.012 kg m2 on nothing, which sticks and slips or strikes a stop.
STICKING: dict[str, tuple[Effect, ...]] = {
    "Coulomb friction": (),
    "Stribeck, 0.12 rad/s": (Stribeck(0.09, 0.12),),
    "Stribeck, 0.02 rad/s": (Stribeck(0.05, 0.02),),
    "Stribeck, 0.05 rad/s, twofold": (Stribeck(0.2, 0.05),),
    "stop with a damper": (ContactStop(40.0, 0.5, relaxation=0.005),),
    "stiff stop with a damper": (ContactStop(400.0, 0.5, relaxation=0.002),),
    "load that rubs, spring": (FlexibleCoupling(1e-2, load_coulomb=0.05),),
    "load that rubs, play": (Backlash(0.02, load_coulomb=0.05),),
}
TIMED, REPEATS = 40_000, 40  # samples of a run that is timed, and how often
REPLAY = """
#include "model.h"
void replay(const double *u, double *y, long n)
{
    model_state s;
    long i;
    model_init(&s);
    for (i = 0; i < n; ++i) y[i] = model_step(&s, u[i]);
}
"""


def drive(n: int, rate: float = 1000.0) -> np.ndarray:
    """Two sines and noise (Nm), which move and stop the axis."""
    t = np.arange(n) / rate
    noise = np.random.default_rng(0).standard_normal(n)
    return 0.9 * np.sin(2 * np.pi * 0.3 * t) + 0.4 * np.sin(2 * np.pi * 3.1 * t + 1.0) + 0.1 * noise


def run_c(model: Any, u: np.ndarray) -> tuple[np.ndarray, float]:
    """(output, CPU seconds a step) of the C code."""
    with tempfile.TemporaryDirectory() as folder:
        export_model(model, to="c", out=folder)
        Path(folder, "replay.c").write_text(REPLAY)
        flags = ["-std=c99", "-O2", "-Wall", "-Wextra", "-Werror", "-pedantic", "-shared", "-fPIC"]
        subprocess.run(["gcc", *flags, "model.c", "replay.c", "-o", "model.so", "-lm"], cwd=folder, check=True)
        library = ctypes.CDLL(str(Path(folder, "model.so")))
    pointer = ctypes.POINTER(ctypes.c_double)
    library.replay.argtypes = [pointer, pointer, ctypes.c_long]
    y, again, times = np.empty_like(u), np.empty(min(TIMED, u.size)), []
    library.replay(u.ctypes.data_as(pointer), y.ctypes.data_as(pointer), u.size)
    for _ in range(REPEATS):  # the least of many short ones: a neighbour on the same core doubles the time
        began = time.process_time()
        library.replay(u.ctypes.data_as(pointer), again.ctypes.data_as(pointer), again.size)
        times.append(time.process_time() - began)
    return y, min(times) / again.size


def run_mujoco(axis: ServoAxis, u: np.ndarray) -> tuple[np.ndarray, bool]:
    """Position of MuJoCo's replay of the exported MJCF, and whether the file holds all of the axis."""
    import mujoco

    with tempfile.TemporaryDirectory() as folder:
        done = export_model(axis, to="mjcf", out=folder)
        model = mujoco.MjModel.from_xml_path(str(done.paths[0]))
    data = mujoco.MjData(model)
    every = round(1.0 / axis.sample_rate / model.opt.timestep)
    y = np.empty_like(u)
    for k, value in enumerate(u):
        y[k] = data.qpos[0]
        data.ctrl[0] = value
        mujoco.mj_step(model, data, every)
    return y, not done.losses


def axes(substeps: int) -> dict[str, ServoAxis]:
    """The bare axis on a spring, so that a replay stays where it is, and one with each effect."""
    base = ServoAxis(effects=[CableSpring(0.5)], substeps=substeps)
    every: dict[str, ServoAxis] = {"no effect": base}
    for name in effect_names():
        effect: Effect = get_effect(name)()
        every[name] = base.with_effect(effect.resized(SIZES[name]) if name in SIZES else effect)
    return every


def sticking() -> None:
    """Print MuJoCo's replay of axes that stick, under sines of 3 s and three waves of 5 s, as rms shares."""
    t = np.arange(5000) / 1000.0
    waves = ((0.45, 0.9, 0.0), (0.2, 2.7, 1.0), (0.1, 5.3, 0.0))
    drives = [a * np.sin(2 * np.pi * f * t[:3000]) + 0.02 for a, f in ((0.5, 0.5), (0.5, 1.0), (0.6, 2.0), (0.7, 4.0))]
    drives.append(np.sum([a * np.sin(2 * np.pi * f * t + p) for a, f, p in waves], axis=0))
    click.echo(f"\n{'MuJoCo, rms share':<32}{'0.5 Hz':>10}{'1 Hz':>10}{'2 Hz':>10}{'4 Hz':>10}{'three':>10}")
    for name, effects in STICKING.items():
        axis = ServoAxis(0.012, law=[Viscous(0.03), Coulomb(0.18)], effects=effects, substeps=20)
        shares = []
        for u in drives:
            own = axis.simulate_drive(u, noise=False).true_position
            shares.append(float(np.sqrt(np.mean((run_mujoco(axis, u)[0] - own) ** 2)) / np.std(own)))
        click.echo(f"{name:<32}" + "".join(f"{share:>10.4f}" for share in shares))


@click.command(help=__doc__)
@click.option("--samples", default=1_000_000, help="Of the C code's replay.")
@click.option("--mujoco-samples", default=10_000, help="Of MuJoCo's; 0 leaves it out.")
@click.option("--substeps", default=4, help="Fine steps a sample, of the axis and of its code.")
@click.option("--only", default="", help="Only these effects, joined by commas, or sticking.")
def main(samples: int, mujoco_samples: int, substeps: int, only: str) -> None:
    if shutil.which("gcc") is None:
        raise click.ClickException("gcc is not there; install a C compiler.")
    if mujoco_samples and only in ("", "sticking"):
        sticking()
    if only == "sticking":
        return
    u = drive(samples)
    click.echo(f"\n{'effect':<24}{'C - Python, largest':>20}{'ns a step':>12}{'MuJoCo, rms share':>20}")
    worst, slowest = 0.0, 0.0
    for name, axis in axes(substeps).items():
        if only and name not in only.split(","):
            continue
        y, seconds = run_c(axis, u)
        gap = float(np.max(np.abs(y - axis.simulate_drive(u, noise=False).position)))
        worst, slowest = max(worst, gap), max(slowest, seconds)
        share = ""
        if mujoco_samples:
            short = u[:mujoco_samples]
            own = axis.simulate_drive(short, noise=False).true_position
            replay, whole = run_mujoco(axis, short)
            share = (
                f"{float(np.sqrt(np.mean((replay - own) ** 2)) / np.std(own)):.4f}" if whole else "not held, said so"
            )
        click.echo(f"{name:<24}{gap:>20.1e}{1e9 * seconds:>12.0f}{share:>20}")
    system = WienerHammersteinSystem.example()
    y, seconds = run_c(system, u)
    gap = float(np.max(np.abs(y - system.simulate(u))))
    click.echo(f"{'Example 5.1':<24}{gap:>20.1e}{1e9 * seconds:>12.0f}")
    click.echo(
        f"\nLargest difference {max(worst, gap):.1e} over {samples} samples, slowest {1e9 * slowest:.0f} ns a step."
    )


if __name__ == "__main__":
    main()
