"""Does what a dry run promises come true?

    python -m benchmarks.design --cases 20

Axes drawn by seed, each with one of four rivals at 0.5 to 10 % of its drive, and limits that are drawn too. The dry
run says whether the rival would be named, would not, or that it depends on the noise; then the axis is run again, with
new noise. ``--poor``: small limits and a coarse reading. Printed: how often the promise held.
"""

from __future__ import annotations

import click
import numpy as np

from benchmarks.compare import told
from whsklearn import ServoAxis
from whsklearn.datasets import draw_effect
from whsklearn.gap.design import Limits, closed_loop, is_named, reference_within, surely_named

RIVALS = ("gravity_imbalance", "cable_spring", "cogging", "stribeck")
LAW = "viscous,coulomb"


@click.command(help=__doc__)
@click.option("--cases", default=20)
@click.option("--seeds", default=0, help="First seed.")
@click.option("--poor", is_flag=True, help="Logs that show little: a tenth of the travel, ten times the noise.")
def main(cases: int, seeds: int, poor: bool) -> None:
    kept: dict[bool | None, list[bool]] = {True: [], False: [], None: []}
    far, loud = (0.1, 10.0) if poor else (1.0, 1.0)
    for k in range(cases):
        rng = np.random.default_rng([seeds + k, 25])
        inertia = float(np.exp(rng.uniform(np.log(0.01), np.log(0.5))))
        plain = ServoAxis(inertia=inertia, law=LAW, sample_rate=float(rng.choice([250.0, 500.0, 1000.0])))
        axis = closed_loop(plain, float(loud * np.exp(rng.uniform(np.log(3e-6), np.log(1e-4)))))
        limits = Limits(far * rng.uniform(0.5, 4.0), far * rng.uniform(1.0, 6.0), 1e3 * inertia, rng.uniform(6.0, 20.0))
        reference, *_ = reference_within(axis, limits, k)
        share = float(np.exp(rng.uniform(np.log(0.005), np.log(0.1))))
        rival = draw_effect(RIVALS[k % len(RIVALS)], axis, reference, share, rng)
        promise = surely_named(axis, rival, reference, LAW, alpha=0.01, seed=1000 * (k + 1))
        true = is_named(axis, rival, reference, LAW, alpha=0.01, seed=1000 * (k + 1) + 500)
        kept[promise].append(bool(true) if promise is None else promise == true)
        click.echo(f"{rival.name:<20} share {share:.3f}  promised {promise!s:<6} came {true}")
    click.echo(told("promised named, and was", kept[True], ""))
    click.echo(told("promised not named, and was not", kept[False], ""))
    click.echo(told("said to depend on the noise, and named", kept[None], ""))
    click.echo(told("promises that came true", kept[True] + kept[False], ">= 90 %"))


if __name__ == "__main__":
    main()
