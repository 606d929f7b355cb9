"""Twins of two public benchmarks that are no axis: is what their linear model lacks named, and the free run closed?

    python -m benchmarks.twins --count 3

Coupled electric drives (`make_coupled_drives`, 500 samples): a sensor that reads |speed|.  A mass on
a hardening spring after the Silverbox (`benchmarks.blind_logs.mass_on_spring`, 3,000 samples): the spring, and nothing
where it is linear.
"""

from __future__ import annotations

import time

import click

from benchmarks._twins import make_coupled_drives
from benchmarks.blind_logs import mass_on_spring
from whsklearn.gap import GapFinder


@click.command(help=__doc__)
@click.option("--count", default=3, help="Records of every kind.")
@click.option("--first-seed", default=0)
def main(count: int, first_seed: int) -> None:
    for seed in range(first_seed, first_seed + count):
        for kind in ("prbs", "uniform", "hardening", "linear"):
            began = time.process_time()
            if kind in ("prbs", "uniform"):
                finder = GapFinder("wiener-hammerstein", law="linear")
                finder.fit(*make_coupled_drives(kind=kind, random_state=seed))
            else:
                log = mass_on_spring.record(seed, cubic=mass_on_spring.CUBIC if kind == "hardening" else 0.0)
                finder = GapFinder("wiener-hammerstein", law="linear", direct=1).fit(log, **mass_on_spring.COLUMNS)
            names = "+".join(e.name for e in finder.effects_) or "-"
            closure, spent = finder.diagnosis_.closure, time.process_time() - began
            click.echo(f"{kind:<12}{seed:<8}{finder.verdict_:<14}{names:<32}closed {closure:6.3f}{spent:8.1f} s")


if __name__ == "__main__":
    main()
