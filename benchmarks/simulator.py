"""How long the axis simulator takes: 40 s at 1 kHz, observed once and in 20 sub-steps, bare and with effects.

The observer's pass with the base law is compared with one written by hand for viscous and Coulomb friction alone, so
that the ratio of one run says what it costs to hold any effect.

Run ``python benchmarks/simulator.py``. Times are of the CPU, the least of several runs after one that compiles.
"""

from __future__ import annotations

import time

import click
import numpy as np
from numba import njit
from sklearn.utils import Bunch

from whsklearn.datasets import reference_signal
from whsklearn.datasets.servo import default_axis
from whsklearn.effects import Effect, effect_names, get_effect
from whsklearn.systems import ServoAxis
from whsklearn.systems import _servo_kernel as observer
from whsklearn.systems.servo import pack

REACH = 0.5  # s of CPU, for 40 s of the axis
SMALL = {"saturation": 50.0, "sensor_rectification": 0.05}  # of the others the default is small
TOGETHER = ("backlash", "cogging", "presliding_hysteresis", "friction_drift", "torque_ripple")


@njit(nogil=True, error_model="numpy")
def by_hand(inertia, viscous, coulomb, u, y, dt, gain_1, gain_2, start):
    """The observer of viscous and Coulomb friction alone: predicted position, position, velocity."""
    out = np.empty((3, u.size))
    x, v = start
    for k in range(u.size):
        out[0, k], out[1, k], out[2, k] = x, x, v
        e = y[k] - x
        x += gain_1 * e
        v += gain_2 * e
        s = 1.0 if v > 0.0 else (-1.0 if v < 0.0 else 0.0)
        if s == 0.0:
            s = 1.0 if u[k] > coulomb else (-1.0 if u[k] < -coulomb else 0.0)
            if s == 0.0:
                continue
        new = v + dt * (u[k] - viscous * v - s * coulomb) / (inertia + 0.5 * dt * viscous)
        if new * s >= 0.0:
            x += 0.5 * dt * (v + new)
            v = new
            continue
        past = dt * v / (v - new)
        x += 0.5 * past * v
        s = 1.0 if u[k] > coulomb else (-1.0 if u[k] < -coulomb else 0.0)
        v = (dt - past) * (u[k] - s * coulomb) / inertia if s != 0.0 else 0.0
        x += 0.5 * (dt - past) * v
    return out


def observed(base: ServoAxis, record: Bunch, repeats: int) -> tuple[float, float, float]:
    """Least CPU time (s) of the library's pass and of the one by hand, and how far they differ (rad)."""
    plant, dt, gains = pack(base), 1.0 / base.sample_rate, (0.05, 2.0)
    measured = np.array([record.position, record.velocity])
    start = (float(measured[0, 0]), float(measured[1, 0]))
    viscous, coulomb = base.law.weights

    def library() -> np.ndarray:
        return observer.follow(plant, record.drive, measured, observer.How(dt, 1, gains=gains))[observer.MEASURED]

    def hand() -> np.ndarray:
        return by_hand(base.inertia, viscous, coulomb, record.drive, record.position, dt, *gains, start)[0]

    difference = float(np.abs(library() - hand()).max())
    times = []
    for run in (library, hand):
        best = np.inf
        for _ in range(3 * repeats):
            began = time.process_time()
            run()
            best = min(best, time.process_time() - began)
        times.append(best)
    return times[0], times[1], difference


def cpu_seconds(axis: ServoAxis, reference: np.ndarray, repeats: int) -> float:
    """Least CPU time of a controlled run (s)."""
    axis.simulate(reference, noise=False)
    times = []
    for _ in range(repeats):
        began = time.process_time()
        axis.simulate(reference, noise=False)
        times.append(time.process_time() - began)
    return min(times)


def axes(base: ServoAxis) -> dict[str, ServoAxis]:
    """The bare axis, one with each effect, and one with many."""
    found = {"no effect": base}
    found |= {name: base.with_effect(small(name)) for name in effect_names()}
    crowded = base
    for name in TOGETHER:
        crowded = crowded.with_effect(small(name))
    return found | {"all of " + ", ".join(TOGETHER): crowded}


def small(name: str) -> Effect:
    """An effect at a size that the loop survives."""
    cls = get_effect(name)
    return cls(**{cls.size: SMALL[name]}) if name in SMALL else cls()


@click.command()
@click.option("--repeats", type=click.IntRange(min=1), default=3)
@click.option("--seconds", type=float, default=40.0, help="Length of the simulated record.")
def main(repeats: int, seconds: float) -> None:
    """Print the CPU time of simulated records."""
    base = default_axis()
    reference = reference_signal("rich", seconds, base.sample_rate)
    ours, hand, difference = observed(base, base.simulate(reference), repeats)
    click.echo(
        f"observer, base law: {1e3 * ours:.2f} ms, by hand {1e3 * hand:.2f} ms, ratio {ours / hand:.2f}, "
        f"{difference:.1e} rad apart\n"
    )
    what = f"{seconds:g} s at {base.sample_rate:g} Hz in {base.substeps} sub-steps"
    click.echo(f"{what}, CPU seconds (reach {REACH} for 40 s)\n")
    for name, axis in axes(base).items():
        click.echo(f"{cpu_seconds(axis, reference, repeats):6.3f}  {name}")


if __name__ == "__main__":
    main()
