"""A drive limit under a controller that winds up, so that the logged drive is many times what reaches the axis.

    python -m benchmarks.blind_wind_up --seeds 200:216

A PID loop without anti-windup moves an axis with viscous and dry friction along sines or through steps (which give its
differentiator kicks); the axis is integrated here, by a clamp that sticks exactly.  The limit is 0.5 to 1.1 of the rms
torque that the path would take, so that some loops stay at it nearly always.  Printed: a line a log, with the rms
drive in multiples of the limit, the share of the time in which the limit is reached, and the limit found as a multiple
of the true one with its standard error; and the rates.
"""

from __future__ import annotations

import time
from typing import Any

import click
import numpy as np
from numba import njit

from benchmarks.blind import wilson
from whsklearn.gap import GapFinder, ServoRecord

RATE, DURATION, FINE = 500.0, 20.0, 10  # Hz, s, steps of the axis a sample
SHARES = (0.5, 0.7, 0.9, 1.1)  # of the limit in the rms torque of the path, in turn


@njit(cache=True)
def _loop(path, axis, gains, limit, step):
    """(drive as the controller asks for it, position as the encoder reads it), shape (n,) each."""
    inertia, viscous, dry = axis
    h = 1.0 / RATE / FINE
    q, v, total, rate, before = path[0], 0.0, 0.0, 0.0, 0.0
    drive, position = np.empty(path.size), np.empty(path.size)
    for k in range(path.size):
        position[k] = np.round(q / step) * step
        error = path[k] - position[k]
        total += gains[1] * error / RATE
        if k > 0:
            rate = 0.8 * rate + 0.2 * (error - before) * RATE
        before = error
        drive[k] = gains[0] * error + total + gains[2] * rate
        given = min(max(drive[k], -limit), limit)
        for _ in range(FINE):
            torque = given - viscous * v
            if v == 0.0 and abs(torque) <= dry:
                continue
            way = np.sign(v) if v != 0.0 else np.sign(torque)
            faster = v + h * (torque - dry * way) / inertia
            v = 0.0 if faster * v < 0.0 else faster
            q += h * v
    return drive, position


def record(seed: int) -> tuple[ServoRecord, float]:
    """One log and the limit of its drive (Nm)."""
    r = np.random.default_rng(seed)
    inertia, turn, reach = 10 ** r.uniform(-3, 0), 2.0 * np.pi * r.uniform(1.5, 4.0), r.uniform(0.3, 1.5)
    t = np.arange(int(DURATION * RATE)) / RATE
    if seed % 2:
        path = np.repeat(reach * r.uniform(-1.0, 1.0, int(DURATION)), int(RATE))
    else:
        path = reach * np.sin(2.0 * np.pi * r.uniform(0.2, 1.2, (3, 1)) * t + r.uniform(0.0, 6.28, (3, 1))).sum(0) / 1.7
    torque = 0.7 * inertia * reach * (2.0 * np.pi) ** 2  # rms, of a sine of 1 Hz
    axis = inertia, inertia * r.uniform(0.3, 2.0), torque * r.uniform(0.05, 0.3)
    gains = inertia * turn**2 * np.array([1.0, turn * r.uniform(0.05, 0.3), 1.4 / turn])
    limit = SHARES[seed % 4] * torque
    drive, position = _loop(path, axis, gains, limit, 2e-5 * reach)
    return ServoRecord(t, drive, position), limit


def diagnose(seed: int) -> dict[str, Any]:
    """One row of the table."""
    log, limit = record(seed)
    began = time.process_time()
    d = GapFinder("servo").fit(log).diagnosis_
    names = [e.name for e in d.effects]
    first = names[:1] == ["saturation"]
    found = d.effects[0].effect.limit / limit if first else np.nan  # type: ignore[attr-defined]
    error = next(iter(d.effects[0].standard_errors.values())) / limit if first else np.nan
    return {
        "seed": seed, "drive": f"{np.std(log.drive) / limit:.3g}", "at_limit": f"{np.mean(abs(log.drive) > limit):.2f}",
        "verdict": d.verdict, "names": "+".join(names), "limit": f"{found:.4f} +- {error:.4f}",
        "first": first, "wrong": d.verdict == "named" and names != ["saturation"],
        "seconds": round(time.process_time() - began, 1),
    }  # fmt: skip


@click.command(help=__doc__)
@click.option("--seeds", default="200:216", help="From the first up to, without, the last.")
def main(seeds: str) -> None:
    rows = []
    for seed in range(*map(int, seeds.split(":"))):
        rows.append(diagnose(seed))
        click.echo("  ".join(f"{k} {v}" for k, v in rows[-1].items()))
    for what, k in (
        ("limit first", sum(r["first"] for r in rows)),
        ("limit named", sum(r["first"] and r["verdict"] == "named" for r in rows)),
        ("wrong with certainty", sum(r["wrong"] for r in rows)),
    ):
        share, low, high = wilson(k, len(rows))
        click.echo(f"{what}: {k} of {len(rows)}, {100 * share:.0f} % [{100 * low:.0f}, {100 * high:.0f}]")


if __name__ == "__main__":
    main()
