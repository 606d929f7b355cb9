"""Two and three large effects at once on a viscous axis: are all of them named, and none that is not there?

    python -m benchmarks.blind_large --count 60 --out blind_large.csv

Logs of the generator in `blind_logs` with pairs and triples of Coulomb friction (and Stribeck's part of it),
gravity, an offset, a spring, cogging and load friction, each 20 to 200 % of the rms drive of the plain axis (load
friction up to 60 %: beyond, a gear locks); the base law is ``viscous`` alone.  An offset beside a spring is found with
the spring, whose place of rest is drawn too: c (q - q_0) + o and c (q - (q_0 - o / c)) are the same torque.
"""

from __future__ import annotations

import csv
import time
from typing import Any

import click
from tqdm import tqdm

from benchmarks.blind import rate, same
from benchmarks.blind_logs.servo import make_large
from whsklearn.effects import get_effect
from whsklearn.gap import GapFinder

FIELDS = "seed truth verdict names right missed wrong closure missing_before missing_after seconds error".split()
COLUMNS = {"time": "time_s", "drive": "torque_nm", "position": "position_rad"}


def diagnose(seed: int) -> dict[str, Any]:
    """One row of the table."""
    case = make_large(seed)
    row: dict[str, Any] = {"seed": seed, "truth": "+".join(case.truth), "error": ""}
    began = time.process_time()
    try:
        d = GapFinder("servo", law="viscous").fit(case.frame, **COLUMNS).diagnosis_
    except (ValueError, ArithmeticError) as error:
        return row | {"verdict": "error", "error": str(error)[:80], "missed": row["truth"], "wrong": "", "right": False}
    names = [e.name for e in d.effects]
    missed = [t for t in case.truth if not any(same("servo", n, t) or t in get_effect(n).covers for n in names)]
    wrong = [n for n in names if not any(same("servo", n, t) for t in case.truth)]
    return row | {
        "verdict": d.verdict, "names": "+".join(names), "missed": "+".join(missed), "wrong": "+".join(wrong),
        "right": not missed and not wrong, "closure": round(d.closure, 3), "missing_before": round(d.figures[0], 4),
        "missing_after": round(d.figures[1], 4), "seconds": round(time.process_time() - began, 1),
    }  # fmt: skip


@click.command(help=__doc__)
@click.option("--count", default=60, help="Logs.")
@click.option("--first-seed", default=9000, help="First seed; development used those below 9000.")
@click.option("--out", default="blind_large.csv", type=click.Path(dir_okay=False))
def main(count: int, first_seed: int, out: str) -> None:
    rows = []
    with open(out, "w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, FIELDS, restval="")
        writer.writeheader()
        for seed in tqdm(range(first_seed, first_seed + count)):
            rows.append(diagnose(seed))
            writer.writerow(rows[-1])
            file.flush()
    click.echo(rate("all right, none wrong", [r["right"] for r in rows], ">= 80"))
    click.echo(rate("a wrong name, whatever the verdict", [bool(r["wrong"]) for r in rows]))
    click.echo(rate("a wrong name that is sure", [bool(r["wrong"]) and r["verdict"] == "named" for r in rows], "0"))
    for r in rows:
        if not r["right"]:
            click.echo(f"  {r['seed']}: {r['truth']} -> {r['verdict']}: {r.get('names', '')} {r['error']}")


if __name__ == "__main__":
    main()
