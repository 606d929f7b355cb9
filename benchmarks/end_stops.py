"""Does `identify` find the ends of the travel that an axis strikes, and the axis between them?

    python benchmarks/end_stops.py [--count 12] [--seed 0]      # ten seconds to two minutes of CPU a log

Axes are drawn and simulated here, by equations of this file: dry friction that holds exactly, steps of 20 us, a
controller that follows four waves into the stops, an encoder of 4,096 to 2^20 counts, 0 to 1 % of noise in the logged
drive, and 100 to 1,000 rows a second.  A stop returns a share of the velocity (Newton's restitution), is a spring with
a damper, or one that hardens (Hunt and Crossley 1975); six of ten axes have two, four of ten have a weight.  Axes that
never reach a stop are to be found without.  An error is in % of the truth, "z" in standard errors.
"""

from __future__ import annotations

import argparse
import time

import numpy as np

from whsklearn._numba import njit
from whsklearn.identification import identify

STEP, NEVER = 2e-5, 1e9
NAMES = {
    (False, False): "axis, viscous and Coulomb", (True, False): "axis with gravity",
    (False, True): "axis with end stops", (True, True): "axis with gravity and end stops",
}  # fmt: skip
KINDS = ("restitution", "spring", "hardening")


@njit(cache=True, error_model="numpy")
def _closed_loop(reference, rates, axis, ends, kind, contact, gains, limit, every):
    """Drive and position (2, n) of a controller that acts at every sample; contact: restitution, or stiffness and
    damping.
    """
    inertia, viscous, dry, weight, phase = axis
    low, high = ends
    out = np.zeros((2, reference.size // every))
    q, v, u = min(max(reference[0], low), high), 0.0, 0.0
    for i in range(out.shape[1] * every):
        if i % every == 0:
            u = gains[0] * (reference[i] - q) + gains[1] * (rates[i] - v)
            u = min(max(u, -limit), limit)
            out[0, i // every], out[1, i // every] = u, q
        side = 1.0 if q > high else -1.0
        depth, push = max(q - high, low - q), 0.0
        if kind == 1 and depth > 0.0:
            push = side * max(contact[0] * depth + contact[1] * side * v, 0.0)
        if kind == 2 and depth > 0.0:
            push = side * max(contact[0] * depth**1.5 * (1.0 + contact[1] * side * v), 0.0)
        net = u - weight * np.cos(q + phase) - push
        if v == 0.0:
            new = STEP / inertia * (net - np.sign(net) * dry) if abs(net) > dry else 0.0
        else:
            new = v + STEP / inertia * (net - viscous * v - np.sign(v) * dry)
            new = 0.0 if new * v < 0.0 else new
        q, v = q + 0.5 * STEP * (v + new), new
        if kind == 0 and (q > high or q < low):
            side = 1.0 if q > high else -1.0
            q = high if q > high else low
            if side * v > 0.0:
                v = -contact[0] * v if contact[0] * side * v > 1e-3 else 0.0
    return out


def record(seed: int) -> tuple[np.ndarray, np.ndarray, float, dict[str, float], tuple[float, ...], str]:
    """Drive, position, sampling time, numbers, the ends that are reached and the kind of contact of a drawn axis."""
    rng = np.random.default_rng(640_000 + seed)
    inertia, far, turns = 10.0 ** rng.uniform(-4.0, 0.5), rng.uniform(0.4, 2.5), 2.0 * np.pi * rng.uniform(0.1, 1.0, 4)
    scale = inertia * far * np.sqrt(np.mean((0.4 * turns**2) ** 2))
    viscous, dry = inertia * rng.uniform(0.2, 4.0), scale * rng.uniform(0.05, 0.8)
    weight = scale * rng.uniform(0.5, 4.0) if rng.random() < 0.4 else 0.0
    axis = inertia, viscous, dry, weight, rng.uniform(0.0, 6.0)
    both, high, low = rng.random() < 0.6, far * rng.uniform(0.4, 0.8), -far * rng.uniform(0.4, 0.8)
    kind, rate, ratio = int(rng.integers(3)), rng.uniform(60.0, 600.0), rng.uniform(0.05, 1.0)
    contact = np.array(
        [
            (0.6 * ratio, 0.0),
            (inertia * rate**2, 2.0 * ratio * inertia * rate),
            (inertia * rate**2 / np.sqrt(0.01), ratio),
        ][kind]
    )
    dt = float(rng.choice([0.001, 0.002, 0.004, 0.01]))
    every = round(dt / STEP)
    t = np.arange(int(rng.choice([10.0, 15.0, 20.0]) / dt) * every) * STEP
    phases, sizes = rng.uniform(0.0, 6.0, 4), rng.uniform(0.3, 1.0, 4)
    waves = [(far * s / sizes.sum(), w, p) for s, w, p in zip(sizes, turns, phases, strict=True)]
    reference, rates = (sum(a * w**k * f(w * t + p) for a, w, p in waves) for k, f in ((0, np.sin), (1, np.cos)))
    wide, limit = 2.0 * np.pi * rng.uniform(2.0, 6.0), rng.uniform(2.0, 5.0) * (scale + dry + weight)
    gains, ends = inertia * np.array([wide**2, 1.4 * wide]), (low if both else -NEVER, high)
    drive, place = _closed_loop(reference, rates, axis, ends, kind, contact, gains, limit, every)
    count, noise = 2.0 * np.pi / 2.0 ** rng.choice([12, 14, 17, 20]), rng.choice([0.0, 0.003, 0.01])
    drive = drive + noise * np.std(drive) * rng.standard_normal(drive.size)
    names = ("inertia", "viscous", "coulomb", "gravity_imbalance")
    truth = {n: float(x) for n, x in zip(names, axis, strict=False) if x}
    # a bounce between two samples is a strike too
    near = 2e-3 * np.ptp(place)
    reached = tuple(e for e, at in zip(ends, (place.min(), place.max()), strict=True) if abs(at) >= abs(e) - near)
    return drive, count * np.round(place / count), dt, truth, reached, KINDS[kind]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--count", type=int, default=12)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    right, errors = [], []
    for seed in range(options.seed, options.seed + options.count):
        u, q, dt, truth, reached, kind = record(seed)
        begin = time.process_time()
        found = identify(u, q, dt=dt, units={"input": "Nm", "output": "rad"})
        seconds = time.process_time() - begin
        right.append(found.recommended.name == NAMES["gravity_imbalance" in truth, bool(reached)])
        told = f"{len(reached)} ends, {kind}, {1.0 / dt:.0f} Hz, {seconds:.0f} s of CPU"
        print(f"{seed}: {found.recommended.name}{'' if right[-1] else ', WRONG'}; {told}")
        if not right[-1]:
            continue
        numbers, spread = found.model.parameters, found.model.standard_errors
        for name, value in truth.items():
            errors.append([name, 100.0 * (numbers[name] / value - 1.0), (numbers[name] - value) / spread[name]])
            print(f"    {name:20s} {errors[-1][1]:+.3f} %, z {errors[-1][2]:+.1f}")
        ends = [e for x in found.model.effects if x.name == "end_stop" for e in x.ends if np.isfinite(e)]
        off = [min(abs(e - known) for known in reached) / np.ptp(q) for e in ends]
        print(f"    {len(ends)} of {len(reached)} ends, {', '.join(f'{100 * x:.2g}' for x in off)} % of the travel off")
    print(f"\nright: {sum(right)} of {len(right)}")
    for name in ("inertia", "viscous", "coulomb", "gravity_imbalance"):
        rows = np.array([e[1:] for e in errors if e[0] == name])
        if len(rows):
            size, inside = np.abs(rows[:, 0]), np.mean(np.abs(rows[:, 1]) < 1.96)
            print(
                f"{name:20s} {np.median(size):.3f} % off in the median, {size.max():.3f} at most; {inside:.0%} inside"
            )


if __name__ == "__main__":
    main()
