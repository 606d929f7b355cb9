"""Chains made with SciPy's filters, a scan and an ODE (`blind_logs.filtered_chain`): one effect hidden, or nothing.

    python -m benchmarks.blind_filtered --seeds 3

The generator shares no equation and no sample loop with the library.  Printed: a line a record, then how many are
named right by effect, wrong names given with confidence, and names in records with nothing missing.
"""

from __future__ import annotations

import time
from collections import defaultdict

import click
import numpy as np

from benchmarks.blind import wilson
from benchmarks.blind_logs import filtered_chain
from whsklearn.gap import GapFinder


@click.command(help=__doc__)
@click.option("--seeds", default=3, help="Records of every effect.")
@click.option("--first-seed", default=0)
@click.option("--only", default="", help="Only these effects (or none), joined by commas.")
def main(seeds: int, first_seed: int, only: str) -> None:
    """Draw, diagnose, print."""
    rows = []
    for truth in (*filtered_chain.EFFECTS, ""):
        if only and (truth or "none") not in only.split(","):
            continue
        for seed in range(first_seed, first_seed + seeds):
            case = filtered_chain.record(truth, seed)
            began = time.process_time()
            d = GapFinder("wiener-hammerstein").fit(case.frame, **filtered_chain.COLUMNS).diagnosis_
            names = [e.name for e in d.effects]
            rows.append((truth, d.verdict, names, time.process_time() - began))
            click.echo(
                f"{truth or 'none':<22}{seed:<4}{d.verdict:<14}{'+'.join(names) or '-':<44}{d.closure:7.3f}"
                f"{rows[-1][3]:7.1f} s"
            )
    hits = defaultdict(list)
    for truth, verdict, names, _ in rows:
        hits[truth].append(verdict == "named" and names[:1] == [truth] if truth else not names)
    for truth, right in hits.items():
        p, low, high = wilson(sum(right), len(right))
        what = "named right" if truth else "nothing named"
        interval = f"[{100 * low:.0f}, {100 * high:.0f}]"
        click.echo(f"{truth or 'none':<22}{what:<14}{sum(right):>3}/{len(right):<3}{100 * p:6.0f} %  {interval}")
    wrong = sum(v == "named" and t not in n for t, v, n, _ in rows)
    click.echo(f"confident wrong names: {wrong} of {len(rows)}; median {np.median([r[3] for r in rows]):.1f} s of CPU")


if __name__ == "__main__":
    main()
