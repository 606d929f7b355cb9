"""Does `identify` find cogging with its orders, and none where there is none?

    python benchmarks/cogging_axes.py [--count 12] [--seed 9100]      # one to two minutes of CPU a log

Axes are drawn and simulated here, by equations of this file: dry friction that holds exactly, 20 steps of second order
a sample, a controller that follows four waves, an encoder of 4,096 to 2^20 counts, and 0.2 % of noise in the logged
drive.  Of
three axes two cog, with one order or with two, at 0.1 to 0.5 of the torque of the motion; two of five have a weight and
then move over 0.3 to 2.5 rad, the others over 0.5 to 10 rad.  An error is in % of the truth, "z" in standard errors.
"""

from __future__ import annotations

import argparse
import time

import numpy as np

from whsklearn._numba import njit
from whsklearn.identification import identify

FINE = 20
ORDERS = (4.0, 5.5, 6.0, 7.0, 8.0, 12.0, 14.0, 24.0)
NAMES = {
    (False, False): "axis, viscous and Coulomb", (True, False): "axis with gravity",
    (False, True): "axis with cogging", (True, True): "axis with gravity and cogging",
}  # fmt: skip


@njit(cache=True, error_model="numpy")
def _closed_loop(reference, rates, pushes, axis, waves, gains, count, dt):
    """Drive and measured position (2, n)."""
    inertia, viscous, dry, weight = axis
    out, h = np.zeros((2, reference.size)), dt / FINE
    q, v = reference[0], rates[0]
    for t in range(reference.size):
        drive = gains[0] * (reference[t] - q) + gains[1] * (rates[t] - v) + pushes[t]
        out[0, t], out[1, t] = drive, count * np.floor(q / count + 0.5)
        for _ in range(FINE):
            q += 0.5 * h * v
            torque, left = drive - weight * np.cos(q + 0.4), h
            for k in range(waves.shape[0]):
                torque -= waves[k, 0] * np.cos(waves[k, 1] * q + waves[k, 2])
            if v != 0.0:
                pull = (torque - viscous * v - np.sign(v) * dry) / (inertia + 0.5 * h * viscous)
                left = max(h + v / pull, 0.0) if (v + h * pull) * v < 0.0 else 0.0  # after it has stopped
                v = v + h * pull if left == 0.0 else 0.0
            if left > 0.0 and abs(torque) > dry:
                v = left * (torque - np.sign(torque) * dry) / (inertia + 0.5 * left * viscous)
            q += 0.5 * h * v
    return out


def record(seed: int) -> tuple[np.ndarray, np.ndarray, float, dict[str, float], np.ndarray]:
    """Drive, position, sampling time, numbers and waves (k, 3) of a drawn axis."""
    rng = np.random.default_rng(seed)
    inertia, dt = 10.0 ** rng.uniform(-3.0, 0.0), 1.0 / rng.choice([250.0, 500.0, 1000.0])
    hangs, cogs = rng.random() < 0.4, seed % 3 > 0
    t = np.arange(int(rng.choice([10.0, 20.0, 30.0]) / dt)) * dt
    turns, phases = 2.0 * np.pi * rng.uniform(0.05, 1.0, (4, 1)), rng.uniform(0.0, 2.0 * np.pi, (4, 1))
    sizes = rng.uniform(0.3, 1.0, (4, 1)) / np.arange(1, 5)[:, None]
    reference = np.sum(sizes * np.sin(turns * t + phases), axis=0)
    far = (rng.uniform(0.3, 2.5) if hangs else rng.uniform(0.5, 10.0)) / np.abs(reference).max()
    reference, rates = far * reference, far * np.sum(sizes * turns * np.cos(turns * t + phases), axis=0)
    pushes = -inertia * far * np.sum(sizes * turns**2 * np.sin(turns * t + phases), axis=0)
    scale = float(np.std(pushes))
    axis = inertia, inertia * rng.uniform(0.5, 3.0), scale * rng.uniform(0.1, 0.6), hangs * scale * rng.uniform(0.5, 2)
    base, k = rng.choice(ORDERS), np.arange(1, 1 + cogs * rng.integers(1, 3))
    waves = np.column_stack([scale * rng.uniform(0.1, 0.5, k.size) / k, base * k, rng.uniform(-3.0, 3.0, k.size)])
    wide = 2.0 * np.pi * rng.uniform(3.0, 8.0)
    gains, count = inertia * np.array([wide**2, 1.6 * wide]), 2.0 * np.pi / 2.0 ** rng.choice([12, 16, 20])
    drive, place = _closed_loop(reference, rates, pushes, axis, waves.reshape(-1, 3), gains, count, dt)
    drive = drive + 0.002 * np.std(drive) * rng.standard_normal(drive.size)
    names = ("inertia", "viscous", "coulomb", "gravity_imbalance")
    return drive, place, dt, {n: float(x) for n, x in zip(names, axis, strict=True) if x}, waves


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--count", type=int, default=12)
    parser.add_argument("--seed", type=int, default=9100)
    options = parser.parse_args()
    right, errors, off, held = [], [], [], []
    for seed in range(options.seed, options.seed + options.count):
        u, q, dt, truth, waves = record(seed)
        begin = time.process_time()
        found = identify(u, q, dt=dt, units={"input": "Nm", "output": "rad"})
        seconds = time.process_time() - begin
        numbers, spread = found.model.parameters, found.model.standard_errors
        right.append(found.recommended.name == NAMES["gravity_imbalance" in truth, bool(waves.size)])
        print(f"{seed}: {found.recommended.name}{'' if right[-1] else ', WRONG'}, {seconds:.0f} s of CPU")
        if not right[-1]:
            continue
        for name, value in truth.items():
            errors.append([name, 100.0 * (numbers[name] / value - 1.0), (numbers[name] - value) / spread[name]])
            print(f"    {name:20s} {errors[-1][1]:+.3f} %, z {errors[-1][2]:+.1f}")
        for label in [k for k in numbers if k.endswith("__order")]:
            wave = waves[np.argmin(np.abs(waves[:, 1] - numbers[label]))]
            off.append(abs(numbers[label] - wave[1]))
            held.append(off[-1] < 1.96 * spread[label])
            size = 100.0 * (numbers[label.removesuffix("__order")] / wave[0] - 1.0)
            print(f"    order {wave[1]:g}: {off[-1]:.2g} off, amplitude {size:+.2f} %")
    print(f"\nright: {sum(right)} of {len(right)}")
    for name in ("inertia", "viscous", "coulomb", "gravity_imbalance"):
        rows = np.array([e[1:] for e in errors if e[0] == name])
        if len(rows):
            inside = np.mean(np.abs(rows[:, 1]) < 1.96)
            size = np.abs(rows[:, 0])
            print(
                f"{name:20s} {np.median(size):.3f} % off in the median, {size.max():.3f} at most; {inside:.0%} inside"
            )
    if off:
        print(
            f"orders               {np.median(off):.2g} off in the median, {max(off):.2g} at most; {np.mean(held):.0%}"
        )


if __name__ == "__main__":
    main()
