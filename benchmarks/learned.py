"""Unnamed, and closed all the same: what no effect of the catalogue explains, learned as splines.

    python -m benchmarks.learned

Logs of the blind generator (`blind_logs`), 20 s each, with effects outside the catalogue: a bump of torque at one
angle, a sticky patch, a hump of friction at one speed, a spring that gives way, damping that depends on the angle,
friction that grows above a speed. Each is diagnosed from its table alone. The targets: 80 % of the gap in
simulation closed in 80 % of them, and no free run on held-out samples worse than the base model's; three effects that
are functions of time or acceleration (``beyond``) and coloured torque noise must not get worse either.
"""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

import click
from tqdm import tqdm

from benchmarks.blind import rate
from benchmarks.blind_logs import servo
from whsklearn.gap import GapFinder

LEARNABLE = (*servo.LEARNABLE, "theta_v", "dead_velocity", "sine_drag")
BEYOND = ("square_beat", "warm_spring", "angle_inertia")
FIELDS = "kind truth size seed verdict names on learned closure worse seconds".split()


def diagnose(kind: str, truth: str, size: float, seed: int) -> dict[str, Any]:
    """One log: verdict, what was learned over which signals, closure, whether any horizon runs worse than before."""
    effects = (truth,) if truth else ()
    case = servo.make_case(kind, seed, effects=effects, size=size, noise=servo.NOISES[seed % 3], seconds=20.0)
    d = GapFinder("servo").fit(case.frame, **servo.COLUMNS).diagnosis_
    return {
        "kind": kind, "truth": truth, "size": size, "seed": seed, "verdict": d.verdict,
        "names": "+".join(e.name for e in d.effects), "on": " and ".join(d.learned.signals) if d.learned else "",
        "learned": round(d.learned.closure, 3) if d.learned else 0.0, "closure": round(d.closure, 3),
        "worse": any(h["after"] > 1.001 * h["before"] for h in d.horizons), "seconds": round(d.seconds, 1),
    }  # fmt: skip


def summary(rows: list[dict[str, Any]]) -> str:
    """Closure of what can be learned, harm to what cannot."""
    learnable = [r for r in rows if r["truth"] in LEARNABLE]
    lines = [
        rate("at least 0.8 of the gap closed", [float(r["closure"]) >= 0.8 for r in learnable], ">= 80"),
        rate("  of that without any name", [float(r["closure"]) >= 0.8 and not r["names"] for r in learnable]),
        rate("a free run worse than the base model's", [str(r["worse"]) == "True" for r in rows], "0"),
        rate("confidently named", [r["verdict"] == "named" for r in learnable], "0"),
    ]
    for kind, truths in (("beyond: something learned", BEYOND), ("coloured noise: something learned", ("",))):
        some = [r for r in rows if r["truth"] in truths]
        if some:
            lines.append(rate(kind, [float(r["learned"]) > 0 for r in some]))
    return "\n".join(lines)


@click.command(help=__doc__)
@click.option("--count", default=2, help="Seeds a cell.")
@click.option("--first-seed", default=700)
@click.option("--sizes", default="0.05,0.15")
@click.option("--effects", default=",".join((*LEARNABLE, *BEYOND, "coloured")), help="Which of them.")
@click.option("--out", default="learned.csv", type=click.Path(dir_okay=False), help="Rows are added to it.")
def main(count: int, first_seed: int, sizes: str, effects: str, out: str) -> None:
    new = not Path(out).exists()
    cases = [
        (e, float(s), first_seed + i) for e in effects.split(",") if e for s in sizes.split(",") for i in range(count)
    ]
    with open(out, "a", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, FIELDS)
        if new:
            writer.writeheader()
        for name, size, seed in tqdm(cases):
            coloured = name == "coloured"
            row = diagnose("coloured" if coloured else "foreign", "" if coloured else name, size, seed)
            click.echo(", ".join(f"{k} {v}" for k, v in row.items()))
            writer.writerow(row)
            file.flush()
    with open(out, newline="", encoding="utf-8") as file:
        click.echo(summary(list(csv.DictReader(file))))


if __name__ == "__main__":
    main()
