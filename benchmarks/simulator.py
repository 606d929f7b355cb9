"""How long the axis simulator takes: 40 s at 1 kHz in 20 sub-steps, bare and with effects.

Run ``python benchmarks/simulator.py``. Times are of the CPU, the least of several runs after one that compiles.
"""

from __future__ import annotations

import time

import click
import numpy as np

from whsklearn.datasets import reference_signal
from whsklearn.datasets.servo import default_axis
from whsklearn.effects import Effect, effect_names, get_effect
from whsklearn.systems import ServoAxis

REACH = 0.5  # s of CPU, for 40 s of the axis
SMALL = {"saturation": 50.0, "sensor_rectification": 0.05}  # of the others the default is small
TOGETHER = ("backlash", "cogging", "presliding_hysteresis", "friction_drift", "torque_ripple")


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
    what = f"{seconds:g} s at {base.sample_rate:g} Hz in {base.substeps} sub-steps"
    click.echo(f"{what}, CPU seconds (reach {REACH} for 40 s)\n")
    for name, axis in axes(base).items():
        click.echo(f"{cpu_seconds(axis, reference, repeats):6.3f}  {name}")


if __name__ == "__main__":
    main()
