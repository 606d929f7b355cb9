"""Chains made with SciPy's filters, a scan and an ODE (`blind_logs.filtered_chain`): one effect hidden, or nothing.

    python -m benchmarks.blind_filtered --seeds 3

The generator shares no equation and no sample loop with the library.  Printed: a line a record, then how many are
named right by effect, wrong names given with confidence, and names in records with nothing missing.
"""

from __future__ import annotations

import time
from typing import Any

import click
import numpy as np

from benchmarks.blind import wilson
from benchmarks.blind_logs import filtered_chain
from whsklearn.gap import GapFinder


def diagnose(effect: str, seed: int) -> dict[str, Any]:
    """One row of the table; ``effect`` as in `filtered_chain.record`."""
    case = filtered_chain.record(effect, seed)
    began = time.process_time()
    d = GapFinder("wiener-hammerstein").fit(case.frame, **filtered_chain.COLUMNS).diagnosis_
    names = [e.name for e in d.effects]
    return {
        "effect": effect, "truth": case.truth, "seed": seed, "verdict": d.verdict, "names": "+".join(names),
        "closure": round(d.closure, 3), "seconds": round(time.process_time() - began, 1),
        "right": d.verdict == "named" and names[:1] == [case.truth] if case.truth else not names,
        "wrong": d.verdict == "named" and not {case.truth}.issuperset(names),
    }  # fmt: skip


@click.command(help=__doc__)
@click.option("--seeds", default=3, help="Records of every effect.")
@click.option("--first-seed", default=0)
@click.option("--only", default="", help="Only these effects (or none), joined by commas.")
def main(seeds: int, first_seed: int, only: str) -> None:
    """Draw, diagnose, print."""
    rows = []
    for effect in (*filtered_chain.EFFECTS, *filtered_chain.PORTS, ""):
        if only and (effect or "none") not in only.split(","):
            continue
        for seed in range(first_seed, first_seed + seeds):
            rows.append(diagnose(effect, seed))
            r = rows[-1]
            click.echo(
                f"{effect or 'none':<22}{seed:<4}{r['verdict']:<14}{r['names'] or '-':<44}{r['closure']:7.3f}"
                f"{r['seconds']:7.1f} s"
            )
    for effect in dict.fromkeys(r["effect"] for r in rows):
        right = [r["right"] for r in rows if r["effect"] == effect]
        p, low, high = wilson(sum(right), len(right))
        what = "named right" if effect else "nothing named"
        interval = f"[{100 * low:.0f}, {100 * high:.0f}]"
        click.echo(f"{effect or 'none':<22}{what:<14}{sum(right):>3}/{len(right):<3}{100 * p:6.0f} %  {interval}")
    seconds = np.median([r["seconds"] for r in rows])
    click.echo(f"confident wrong names: {sum(r['wrong'] for r in rows)} of {len(rows)}; median {seconds:.1f} s of CPU")


if __name__ == "__main__":
    main()
