"""Are the intervals of `identify` as wide as its errors, where nothing is missing and where friction is rounded?

    python benchmarks/intervals.py [--count 12] [--seed 5000] [--only encoder,rounded]      # 8 s of CPU a log

The axis is simulated here, by equations of this file: exact Coulomb friction with the instant of every stop, or a
tanh of the given width, in 40 steps a sample (400 at 100 Hz), in closed loop behind an encoder.  Printed are the rms of
the error over its standard error, 1 where intervals are right, and of the error as a share of the truth.
"""

from __future__ import annotations

import argparse
import math
from typing import Any

import numpy as np

from whsklearn._numba import njit
from whsklearn.identification import identify

TRUTH = {"inertia": 0.05, "viscous": 0.02, "coulomb": 0.3, "input_offset": 0.03}
ROUNDED = 0.05  # rad/s
SLOW: dict[str, Any] = {"rate": 100.0, "substeps": 400, "gains": (10.0, 0.7, 5.0, 0.5)}
LOGS: dict[str, dict[str, Any]] = {
    "encoder": {},
    "coarse encoder": {"count": 2.0 * np.pi / 1000},
    "noise of position": {"count": 2.0 * np.pi / 65536, "noise": 2e-4},
    "noise of drive": {"of_drive": 0.02},
    "100 Hz": SLOW,
    "100 Hz with noise": SLOW | {"count": 2.0 * np.pi / 65536, "noise": 2e-4},
    "logged at 100 Hz": {"every": 10},
    "rounded": {"width": ROUNDED},
    "100 Hz rounded": SLOW | {"width": ROUNDED},
}


@njit(cache=True, error_model="numpy")
def _moved(q, v, drive, axis, width, h):
    """Position and velocity after ``h`` s under a constant drive."""
    inertia, viscous, coulomb, offset = axis
    net, left, start = drive - offset, h, v
    if width > 0.0:
        dry, half = math.tanh(v / width), 0.5 * h / inertia
        slope = viscous + coulomb / width * (1.0 - dry * dry)
        v += h / inertia * (net - viscous * v - coulomb * dry) / (1.0 + half * slope)
        return q + 0.5 * h * (start + v), v
    if v != 0.0:
        side = 1.0 if v > 0.0 else -1.0
        gain = (net - viscous * v - side * coulomb) / (inertia + 0.5 * h * viscous)
        if side * (v + h * gain) > 0.0:
            return q + h * (v + 0.5 * h * gain), v + h * gain
        q, left, v = q - 0.5 * v * v / gain, h + v / gain, 0.0
    if abs(net) > coulomb:
        v = left * (net - math.copysign(coulomb, net)) / inertia
    return q + 0.5 * left * v, v


@njit(cache=True, error_model="numpy")
def _closed_loop(reference, rates, noise, gains, axis, width, count, dt, substeps):
    """Drive and measured position (2, n) under a PID on the encoder, with feed-forward of the velocity."""
    out = np.zeros((2, reference.size))
    q, v, before, speed, total = 0.0, 0.0, 0.0, 0.0, 0.0
    for t in range(reference.size):
        place = count * math.floor((q + noise[t]) / count + 0.5)
        speed += gains[3] * ((place - before) / dt - speed)
        before, error = place, reference[t] - place
        total += gains[2] * error * dt
        out[0, t], out[1, t] = gains[0] * error + gains[1] * (rates[t] - speed) + total, place
        for _ in range(substeps):
            q, v = _moved(q, v, out[0, t], axis, width, dt / substeps)
    return out


def record(
    seed: int, *, rate: float = 1000.0, substeps: int = 40, gains: tuple[float, ...] = (40.0, 2.0, 20.0, 0.2),
    count: float = 2.0 * np.pi / 8000, noise: float = 0.0, of_drive: float = 0.0, width: float = 0.0, every: int = 1,
) -> tuple[np.ndarray, np.ndarray, float]:  # fmt: skip
    """Drive, position and sampling time of 20 s over five drawn waves of up to 3 Hz."""
    rng = np.random.default_rng(seed)
    t = np.arange(int(20.0 * rate)) / rate
    turns, phases = 2.0 * np.pi * rng.uniform(0.1, 3.0, (5, 1)), rng.uniform(0.0, 2.0 * np.pi, (5, 1))
    sizes = rng.uniform(0.3, 1.0, (5, 1)) / (1.0 + turns / (2.0 * np.pi)) * np.minimum(t / 0.5, 1.0)
    reference = np.sum(sizes * (np.sin(turns * t + phases) - np.sin(phases)), axis=0)
    rates = np.sum(sizes * turns * np.cos(turns * t + phases), axis=0)
    axis = tuple(TRUTH.values())
    noises = noise * rng.standard_normal(t.size)
    drive, place = _closed_loop(reference, rates, noises, gains, axis, width, count, 1.0 / rate, substeps)
    drive += of_drive * rng.standard_normal(t.size)
    return drive[::every], place[::every], every / rate


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--count", type=int, default=12)
    parser.add_argument("--seed", type=int, default=5000)
    parser.add_argument("--only", help="names of logs, with commas")
    options = parser.parse_args()
    for name in options.only.split(",") if options.only else LOGS:
        apart, off, white, rigid = [], [], 0, 0
        for seed in range(options.seed, options.seed + options.count):
            u, y, dt = record(seed, **LOGS[name])
            found = identify(u, y, dt=dt, units={"input": "Nm", "output": "rad"})
            white += found.white
            if found.recommended.name == "axis, viscous and Coulomb":
                rigid += 1
                numbers, errors = found.model.parameters, found.model.standard_errors
                apart.append([(numbers[k] - v) / errors[k] for k, v in TRUTH.items()])
                off.append([numbers[k] / v - 1.0 for k, v in TRUTH.items()])
        z, share = (np.sqrt(np.mean(np.square(x), axis=0)) for x in (apart, off))
        held = np.mean(np.abs(apart) < 1.96, axis=0)
        row = [f"{a:.1f} ({100 * h:.0f} %), {100 * s:.2g} %" for a, h, s in zip(z, held, share, strict=True)]
        print(f"| {name} | {rigid} | {white} | " + " | ".join(row) + " |", flush=True)


if __name__ == "__main__":
    main()
