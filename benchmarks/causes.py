"""One log for each cause of failure on rigs that nobody tuned on (`blind_logs.causes`): verdict, names, right or not.

    python -m benchmarks.causes [--only wrist,free_swing] [--seeds 3] [--jobs 2]

Right is: every effect that is there is named (or told as the alias of a name), the first name is one of them, no name
is of something else, and the verdict is not ``named`` where something in the log has no name. Sure and wrong is the
verdict ``named`` with any name that is not there, or where something has no name. Seconds are of CPU; a first run on a
machine compiles, which is counted.
"""

from __future__ import annotations

import csv
import time
from collections.abc import Iterable
from typing import Any

import click
import numpy as np
from joblib import Parallel, delayed
from tqdm import tqdm

from benchmarks.blind import same
from benchmarks.blind_logs import causes
from whsklearn.gap import GapFinder

FIELDS = "case seed truth verdict names right wrong closure seconds error".split()


def matched(effect: Any, truths: Iterable[str]) -> set[str]:
    """Those of the truths that a named effect is, or tells as its alias."""
    return {t for t in truths if same("servo", effect.name, t) or t in effect.aliases}


def diagnose(name: str, seed: int) -> dict[str, Any]:
    """One row of the table."""
    cause, log = causes.CASES[name], causes.make(name, seed)
    row: dict[str, Any] = {"case": name, "seed": seed, "truth": cause.truth, "names": "", "error": "",
                           "right": False, "wrong": False, "closure": 0.0}  # fmt: skip
    began = time.process_time()
    try:
        d = GapFinder(log.model, law=log.law).fit(log.frame, **log.columns).diagnosis_
    except Exception as error:  # a benchmark counts crashes, it does not stop at one
        return row | {"verdict": "crash", "error": f"{type(error).__name__}: {error}"[:100],
                      "seconds": round(time.process_time() - began, 1)}  # fmt: skip
    foreign = [e for e in d.effects if not matched(e, (*cause.names, *cause.beside))]
    missed = set(cause.names) - {t for e in d.effects for t in matched(e, cause.names)}
    first = not d.effects or bool(matched(d.effects[0], cause.names))
    sure = d.verdict == "named"
    return row | {
        "verdict": d.verdict, "names": "+".join(e.name for e in d.effects), "closure": round(d.closure, 3),
        "right": not foreign and not missed and first and (cause.sure or not sure),
        "wrong": sure and (bool(foreign) or not cause.sure), "seconds": round(time.process_time() - began, 1),
    }  # fmt: skip


@click.command(help=__doc__)
@click.option("--only", default="", help="Only these cases, joined by commas.")
@click.option("--seeds", default=1, help="Logs of every case.")
@click.option("--first-seed", default=0)
@click.option("--jobs", default=1, help="Processes.")
@click.option("--out", type=click.Path(dir_okay=False), help="Write the table there as CSV.")
def main(only: str, seeds: int, first_seed: int, jobs: int, out: str | None) -> None:
    wanted = only.split(",") if only else list(causes.CASES)
    if unknown := set(wanted) - set(causes.CASES):
        raise click.BadParameter(f"no case {sorted(unknown)}; expected some of {', '.join(causes.CASES)}.")
    plan = [(name, first_seed + i) for name in wanted for i in range(seeds)]
    rows = []
    found = Parallel(n_jobs=jobs, return_as="generator")(delayed(diagnose)(*case) for case in plan)
    for row in tqdm(found, total=len(plan)):
        rows.append(row)
        mark = "sure and wrong" if row["wrong"] else "right" if row["right"] else "-"
        tqdm.write(
            f"{row['case']:<20}{row['seed']:<3}{row['verdict']:<13}{row['names'] or row['error'] or '-':<48}"
            f"{mark:<15}{row['seconds']:6.1f} s"
        )
    if out:
        with open(out, "w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, FIELDS)
            writer.writeheader()
            writer.writerows(rows)
    seconds = [r["seconds"] for r in rows]
    click.echo(
        f"right {sum(r['right'] for r in rows)} of {len(rows)}; sure and wrong {sum(r['wrong'] for r in rows)}; "
        f"crashes {sum(r['verdict'] == 'crash' for r in rows)}; "
        f"CPU seconds: median {np.median(seconds):.1f}, worst {max(seconds):.1f}"
    )


if __name__ == "__main__":
    main()
