"""Does `identify` find a load behind a spring, with intervals that hold its numbers, and on no rigid axis?

    python benchmarks/two_masses.py [--count 10] [--seed 7100] [--only motor,load,rigid]      # 15 s of CPU a log

Axes are drawn and simulated here, by equations of this file: motor, spring, damper and load with dry and viscous
friction on either side, in 400 steps a sample, under a PID that follows five waves, its speed from the motor, with a
binary torque added to its drive.  The load at a held motor rings (the antiresonance of the motor) at 5 to 60 Hz.
"""

from __future__ import annotations

import argparse
import time

import numpy as np

from whsklearn._numba import njit
from whsklearn.identification import identify

RATE, SECONDS, FINE = 1000.0, 12.0, 400
COUNT = 2.0 * np.pi / 2**18  # of the encoder
SIDES = ("motor", "load", "rigid")


@njit(cache=True, error_model="numpy")
def _kicked(v, torque, inertia, viscous, dry, h):
    """Velocity after ``h`` s of a torque against friction."""
    free = v + h * (torque - viscous * v) / (inertia + 0.5 * h * viscous)
    return free - min(max(free, -h * dry / inertia), h * dry / inertia)


@njit(cache=True, error_model="numpy")
def _closed_loop(reference, rates, added, gains, axis, at_load, count, dt, substeps):
    """Drive and measured position (2, n); a load without inertia is none."""
    j_m, j_l, b_m, b_l, c_m, c_l, offset, k, d = axis
    out = np.zeros((2, reference.size))
    x, q, v, w, before, speed, total, h = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, dt / substeps
    for t in range(reference.size):
        near, place = count * np.floor(x / count + 0.5), count * np.floor((q if at_load else x) / count + 0.5)
        speed += gains[3] * ((near - before) / dt - speed)
        before, error = near, reference[t] - place
        total += gains[2] * error * dt
        drive = gains[0] * error + gains[1] * (rates[t] - speed) + total + added[t]
        out[0, t], out[1, t] = drive, place
        for _ in range(substeps):
            x, q = x + 0.5 * h * v, q + 0.5 * h * w
            torque = k * (x - q) + d * (v - w)
            v = _kicked(v, drive - offset - torque, j_m, b_m, c_m, h)
            w = _kicked(w, torque, j_l, b_l, c_l, h) if j_l > 0.0 else v
            x, q = x + 0.5 * h * v, q + 0.5 * h * w
    return out


def record(seed: int, side: str) -> tuple[np.ndarray, np.ndarray, float, dict[str, float]]:
    """Drive, position, sampling time and truth of a drawn axis; its ``side`` is where the encoder is."""
    rng = np.random.default_rng([seed, SIDES.index(side)])
    inertia, rings = np.exp(rng.uniform(np.log(0.003), np.log(3.0))), np.exp(rng.uniform(np.log(5.0), np.log(60.0)))
    share, ratio, far = rng.uniform(0.2, 0.8), np.exp(rng.uniform(np.log(0.01), np.log(0.1))), rng.uniform(0.0, 0.5)
    t = np.arange(int(SECONDS * RATE)) / RATE
    turns, phases = 2.0 * np.pi * rng.uniform(0.1, 2.0, (5, 1)), rng.uniform(0.0, 2.0 * np.pi, (5, 1))
    sizes = rng.uniform(0.3, 1.0, (5, 1)) / (1.0 + turns / (2.0 * np.pi)) * np.minimum(t / 0.5, 1.0)
    reference = np.sum(sizes * (np.sin(turns * t + phases) - np.sin(phases)), axis=0)
    rates = np.sum(sizes * turns * np.cos(turns * t + phases), axis=0)
    scale = inertia * float(np.std(np.gradient(rates[500:], 1.0 / RATE)))  # torque of the motion
    dry, viscous = scale * rng.uniform(0.1, 0.6), scale * rng.uniform(0.1, 0.6) / float(np.std(rates))
    offset = 0.1 * scale * rng.standard_normal()
    if side == "rigid":
        share = far = 0.0
    stiffness = share * inertia * (2.0 * np.pi * rings) ** 2
    damping = 2.0 * ratio * np.sqrt(stiffness * inertia * share * (1.0 - share))
    axis = ((1 - share) * inertia, share * inertia, (1 - far) * viscous, far * viscous, (1 - far) * dry, far * dry,
            offset, stiffness, damping)  # fmt: skip
    wide = 2.0 * np.pi * min(rings / 6.0, 4.0)  # of the loop, below the resonance so that a load encoder is stable
    gains = inertia * np.array([wide**2, 1.4 * wide, 0.1 * wide**3, 0.0]) + np.array([0.0, 0.0, 0.0, 0.2])
    hold = max(int(RATE / rings / 6.0), 1)  # samples of a binary torque with energy at the resonance
    added = 0.5 * scale * np.repeat(rng.choice([-1.0, 1.0], t.size // hold + 1), hold)[: t.size]
    drive, place = _closed_loop(reference, rates, added, gains, axis, side == "load", COUNT, 1.0 / RATE, FINE)
    truth = {"inertia": inertia, "viscous": axis[2], "coulomb": axis[4], "input_offset": offset}
    if share:
        truth |= {
            "flexible_coupling": 1.0 / stiffness,
            "flexible_coupling__load_share": share,
            "flexible_coupling__damping_ratio": ratio,
            "flexible_coupling__load_coulomb": axis[5],
            "load_viscous": axis[3],
        }
    return drive, place, 1.0 / RATE, truth


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--count", type=int, default=10)
    parser.add_argument("--seed", type=int, default=7100)
    parser.add_argument("--only", default=",".join(SIDES))
    options = parser.parse_args()
    for side in options.only.split(","):
        apart, off, right, white, arx = [], [], 0, 0, []
        for seed in range(options.seed, options.seed + options.count):
            u, y, dt, truth = record(seed, side)
            began = time.process_time()
            found = identify(u, y, dt=dt, units={"input": "Nm", "output": "rad"})
            took = time.process_time() - began
            chosen, numbers, errors = found.recommended, found.model.parameters, found.model.standard_errors
            coupled = "flexible_coupling" in chosen.structure.get("effects", ())
            same = coupled == (side != "rigid") and (not coupled or found.model.side == side)
            right, white = right + same, white + found.white
            arx.append(chosen.score / min(c.score for c in found.models if c.kind == "arx"))
            told = "" if same else " WRONG"
            print(f"{side} {seed}: {chosen.name}{told}, {arx[-1]:.3g} of ARX, {took:.0f} s", flush=True)
            if same and all(k in numbers for k in truth):
                z = {k: (numbers[k] - v) / errors[k] for k, v in truth.items()}
                apart.append(list(z.values()))
                off.append([numbers[k] / v - 1.0 for k, v in truth.items()])
                missed = [k for k in z if abs(z[k]) > 1.96]
                wrong = ", ".join(f"{k} {numbers[k]:.4g} +- {errors[k]:.2g}, is {truth[k]:.4g}" for k in missed)
                print(f"    {wrong}" if wrong else "    all in their intervals", flush=True)
        print(f"{side}: right structure {right} of {options.count}, residual white {white}, "
              f"median of ARX {np.median(arx):.3g}, worst {np.max(arx):.3g}")  # fmt: skip
        if apart:
            for name, z, share in zip(truth, np.array(apart).T, np.array(off).T, strict=True):
                held = 100 * np.mean(np.abs(z) < 1.96)
                print(f"    {name:36} {held:4.0f} % held, error over standard error {np.sqrt(np.mean(z**2)):.2g}, "
                      f"median error {100 * np.median(np.abs(share)):.2g} %")  # fmt: skip


if __name__ == "__main__":
    main()
