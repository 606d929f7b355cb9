"""Blind logs under a simulator of the user's own: one effect hidden, or nothing missing.

    python -m benchmarks.blind_simulator --cases 40 --empties 40

`Rig` is such a simulator: three methods around an integrator of its own (Heun's rule, a tanh for dry friction, its own
equations of twelve effects), in closed loop from the logged reference or in open loop from the logged drive. The log
comes from the same integrator at another step with one effect that the simulator does not have. Printed: the share
named right, confident wrong names, closure, seconds.
"""

from __future__ import annotations

import dataclasses
import math
import time
from collections import Counter
from dataclasses import dataclass
from typing import Any

import click
import numpy as np
from numba import njit
from scipy.optimize import least_squares
from tqdm import tqdm

from benchmarks.blind import wilson
from whsklearn.effects import get_effect
from whsklearn.gap import GapFinder, ServoRecord

KINDS = (
    "cogging gravity_imbalance cable_spring hardening_spring input_offset quadratic_drag asymmetric_viscous stribeck "
    "disturbance_tone load_friction torque_ripple end_stop"
).split()
OWN = "magnet"  # an effect of the user's own, which `benchmarks.own_effect` defines
RATE = 250.0


@njit(cache=True)
def _effect(kind, p, t, q, v, s, u):
    """The torque of one effect, written here and nowhere else."""
    if kind == 0:
        return p[0] * math.cos(p[1] * q + p[2])
    if kind == 1:
        return p[0] * math.cos(q + p[1])
    if kind == 2:
        return p[0] * (q - p[1])
    if kind == 3:
        return p[0] * (q - p[1]) ** 3
    if kind == 4:
        return p[0]
    if kind == 5:
        return p[0] * v * abs(v)
    if kind == 6:
        return p[0] * abs(v)
    if kind == 7:
        return p[0] * s * math.exp(-((abs(v) / p[1]) ** p[2]))
    if kind == 8:
        return p[0] * math.cos(2 * math.pi * p[1] * t + p[2])
    if kind == 9:
        return p[0] * abs(u) * s
    if kind == 10:
        return u * p[0] * math.cos(p[1] * q + p[2])
    if kind == 12:
        return p[0] * math.exp(-((q / p[1]) ** 2))
    over = abs(q) - p[1]
    return p[0] * over * (1.0 if q > 0 else -1.0) if over > 0 else 0.0


@njit(cache=True)
def _acceleration(numbers, kinds, p, t, q, v, u):
    s = math.tanh(v / 0.05)
    torque = u - numbers[1] * v - numbers[2] * s - numbers[3] * q
    for i in range(kinds.size):
        torque -= _effect(kinds[i], p[i], t, q, v, s, u)
    return torque / numbers[0]


@njit(cache=True)
def _run(numbers, kinds, p, reference, drive, closed, gains, dt, fine, start):
    """(position, drive): PD on the reference where ``closed``, else the drive as logged."""
    n = reference.size
    y, out = np.empty(n), np.empty(n)
    q, v = start, 0.0
    h = dt / fine
    for k in range(n):
        y[k] = q
        u = drive[k]
        if closed:
            rate = (reference[k] - reference[k - 1]) / dt if k else 0.0
            u = gains[0] * (reference[k] - q) + gains[1] * (rate - v)
        out[k] = u
        for j in range(fine):
            t = k * dt + j * h
            a = _acceleration(numbers, kinds, p, t, q, v, u)
            b = _acceleration(numbers, kinds, p, t + h, q + h * v, v + h * a, u)
            q += h * v + 0.5 * h * h * a
            v += 0.5 * h * (a + b)
    return y, out


@dataclass(frozen=True)
class Rig:
    """Inertia, viscous and dry friction, a spring; a PD controller where ``closed``."""

    numbers: tuple[float, float, float, float]
    closed: bool
    gains: tuple[float, float]
    effects: tuple[Any, ...] = ()

    def simulate(self, record: Any, fine: int = 6) -> np.ndarray:
        """Predicted position, shape (n,)."""
        return self.run(record.reference, record.drive, record.dt, fine)[0]

    def run(self, reference: np.ndarray, drive: np.ndarray, dt: float, fine: int) -> tuple[np.ndarray, np.ndarray]:
        """(position, drive)."""
        kinds = np.array([(*KINDS, OWN).index(e.name) for e in self.effects], dtype=np.int64)
        p = np.zeros((len(kinds), 3))
        for row, e in zip(p, self.effects, strict=True):
            numbers = (e.magnitude, *e.shape.values())
            row[: len(numbers)] = numbers
        return _run(np.array(self.numbers), kinds, p, reference, drive, self.closed, self.gains, dt, fine, 0.0)

    def refit(self, record: Any, keep: np.ndarray) -> Rig:
        """Its numbers fitted to the samples where ``keep`` is True."""
        first = np.array(self.numbers)
        free = first != 0.0

        def residual(x: np.ndarray) -> np.ndarray:
            numbers = first.copy()
            numbers[free] = first[free] * np.exp(x)
            return (record.position - dataclasses.replace(self, numbers=tuple(numbers)).simulate(record))[keep]

        x = least_squares(residual, np.zeros(int(free.sum())), bounds=(-1.5, 1.5), max_nfev=6).x
        numbers = first.copy()
        numbers[free] = first[free] * np.exp(x)
        return dataclasses.replace(self, numbers=tuple(numbers))

    def with_effect(self, effect: Any) -> Rig:
        """One effect more."""
        if effect.name not in (*KINDS, OWN):
            raise NotImplementedError(f"this simulator has no {effect.name}")
        return dataclasses.replace(self, effects=(*self.effects, effect))


def make_case(kind: str, seed: int, seconds: float = 20.0, share: float | None = None) -> tuple[ServoRecord, Rig, Any]:
    """(log, the simulator that its user has, the hidden effect); ``share`` of the rms drive, or drawn."""
    rng = np.random.default_rng([seed, KINDS.index(kind) if kind in KINDS else 99, 11])
    closed = bool(seed % 2)
    t = np.arange(int(seconds * RATE)) / RATE
    inertia = 0.05 * rng.uniform(0.7, 1.4)
    numbers = (inertia, inertia * rng.uniform(1, 4), inertia * rng.uniform(2, 6), 0.0 if closed else inertia * 30.0)
    w = rng.uniform(25.0, 40.0)
    gains = (inertia * w * w, 1.4 * inertia * w)
    tones = [(f, rng.uniform(0, 2 * np.pi)) for f in (0.13, *rng.uniform(0.4, 3.5, 6))]
    reference = sum(np.sin(2 * np.pi * f * t + a) / f for f, a in tones)
    reference = 2.0 * (reference - reference[0]) / np.max(np.abs(reference)) * np.minimum(1.0, t / 0.5) ** 2
    drive = inertia * 60.0 * sum(np.sin(2 * np.pi * f * t + a) for f, a in tones) / 3.0
    truth = Rig(numbers, closed, gains)
    y, u = truth.run(reference, drive, 1.0 / RATE, 12)
    hidden = None
    if kind in (*KINDS, OWN):
        size = (share or rng.uniform(0.05, 0.25)) * float(np.sqrt(np.mean(u**2)))
        hidden = _drawn(kind, size, y, rng)
        truth = truth.with_effect(hidden)
        y, u = truth.run(reference, drive, 1.0 / RATE, 12)
    else:
        y, u = truth.run(reference, drive, 1.0 / RATE, 12)
    y = y + 1e-4 * rng.standard_normal(y.size)
    has = dataclasses.replace(truth, effects=(), numbers=tuple(x * rng.uniform(0.9, 1.1) for x in numbers))
    return ServoRecord(t, u, y, reference), has, hidden


def _drawn(kind: str, size: float, y: np.ndarray, rng: np.random.Generator) -> Any:
    """One effect whose torque has about the rms ``size`` along the motion."""
    v = np.gradient(y) * RATE
    speed, reach, phase = float(np.sqrt(np.mean(v**2))), float(np.max(np.abs(y))), rng.uniform(-3, 3)

    def rms(x: np.ndarray) -> float:
        return float(np.sqrt(np.mean(x**2)))

    order, hz, velocity = float(rng.integers(3, 12)), rng.uniform(4, 11), 0.15 * speed
    fields: dict[str, tuple[float, ...]] = {
        "cogging": (1.4 * size, order, phase), "gravity_imbalance": (size / rms(np.cos(y + phase)), phase),
        "cable_spring": (size / rms(y - 0.3), 0.3), "hardening_spring": (size / rms(y**3), 0.0),
        "input_offset": (size,), "quadratic_drag": (size / rms(v**2),), "asymmetric_viscous": (size / rms(v),),
        "stribeck": (size / rms(np.exp(-((v / velocity) ** 2))), velocity, 2.0),
        "disturbance_tone": (1.4 * size, hz, phase), "load_friction": (0.2,), "torque_ripple": (0.25, order, phase),
        "end_stop": (size / rms(np.maximum(np.abs(y) - 0.8 * reach, 0)), 0.8 * reach),
        OWN: (size / rms(np.exp(-((y / (0.2 * reach)) ** 2))), 0.2 * reach),
    }  # fmt: skip
    return get_effect(kind)(*fields[kind])


def diagnose(kind: str, seed: int) -> dict[str, Any]:
    """One row of the table; ``kind`` is one of `KINDS` or ``none``."""
    record, rig, _ = make_case(kind, seed)
    began = time.process_time()
    finder = GapFinder(rig).fit(record)
    names = [e.name for e in finder.effects_]
    truth = {kind, *get_effect(kind).aliases} if kind in KINDS else set()
    if kind == "cable_spring" and not rig.closed:  # the rig has a spring of its own: what is left is its centre
        truth = {kind, "input_offset"}
    return {
        "kind": kind, "seed": seed, "loop": "closed" if rig.closed else "open", "verdict": finder.verdict_,
        "names": "+".join(names), "right": bool(names) and names[0] in truth,
        "wrong": finder.verdict_ == "named" and not truth.issuperset(names),
        "closure": finder.diagnosis_.closure, "seconds": time.process_time() - began,
    }  # fmt: skip


@click.command(help=__doc__)
@click.option("--cases", default=40, help="Logs with a hidden effect, spread over the effects.")
@click.option("--empties", default=40, help="Logs with nothing missing.")
@click.option("--seeds", default=0, help="First seed.")
@click.option("--only", default="", help="Only these effects (or none), joined by commas.")
def main(cases: int, empties: int, seeds: int, only: str) -> None:
    plan = [(KINDS[i % len(KINDS)], seeds + i // len(KINDS)) for i in range(cases)]
    plan += [("none", seeds + i) for i in range(empties)]
    rows = []
    for kind, seed in tqdm([p for p in plan if not only or p[0] in only.split(",")]):
        r = diagnose(kind, seed)
        rows.append(r)
        tqdm.write(
            f"{kind:<20}{seed:<4}{r['loop']:<8}{r['verdict']:<14}{r['names'] or '-':<44}"
            f"{r['closure']:8.3f}{r['seconds']:8.1f} s"
        )
    hidden, empty = [r for r in rows if r["kind"] != "none"], [r for r in rows if r["kind"] == "none"]
    for label, hits, goal in (
        ("named right, or its alias", [r["right"] and r["verdict"] == "named" for r in hidden], ">= 36 of 40"),
        ("first name right, whatever the verdict", [r["right"] for r in hidden], ""),
        ("confident wrong", [r["wrong"] for r in rows], "0"),
        ("empty log, a name given", [bool(r["names"]) for r in empty], "0 of 40"),
    ):
        p, low, high = wilson(sum(hits), len(hits))
        click.echo(
            f"{label:<42}{sum(hits):>4}/{len(hits):<4}{100 * p:6.1f} %  [{100 * low:.1f}, {100 * high:.1f}]  {goal}"
        )
    click.echo(f"verdicts of empty logs: {dict(Counter(r['verdict'] for r in empty))}")
    seconds = [r["seconds"] for r in rows]
    click.echo(f"CPU seconds a log: median {np.median(seconds):.1f}, worst {max(seconds):.1f}")


if __name__ == "__main__":
    main()
