"""Unnamed, and closed all the same: what no effect of the catalogue explains, learned as splines.

    python -m benchmarks.learned
    python -m benchmarks.learned --effects named --out named.csv      the shares of catalogued effects

Logs of the blind generator (`blind_logs`), 20 s each, with effects outside the catalogue: a bump of torque at one
angle, a sticky patch, a hump of friction at one speed, a spring that gives way, damping that depends on the angle,
friction that grows above a speed. Each is diagnosed from its table alone. The targets: 80 % of the gap in
simulation closed in 80 % of them, and no free run on held-out samples worse than the base model's; three effects that
are functions of time or acceleration (``beyond``) and coloured torque noise must not get worse either.

Two numbers of the engine rest on the last lines, which print the shares of both: `whsklearn.gap.search.LEAST_SHARE`, of
the power that nameless functions of the motion explain, that the best single name must explain, and
`whsklearn.gap.conclude.STILL`, of the rms gap, that may follow the motion beside names that are sure.
"""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

import click
import numpy as np
from tqdm import tqdm

from benchmarks.blind import rate
from benchmarks.blind_logs import servo
from whsklearn.gap import GapFinder

LEARNABLE = (*servo.LEARNABLE, "theta_v", "dead_velocity", "sine_drag")
BEYOND = ("square_beat", "warm_spring", "angle_inertia")
FIELDS = "kind truth size seed verdict names on learned closure worse explains still seconds".split()


def diagnose(kind: str, truth: str, size: float, seed: int) -> dict[str, Any]:
    """One log: verdict, what was learned over which signals, closure, whether any horizon runs worse than before."""
    effects = (truth,) if truth else ()
    case = servo.make_case(kind, seed, effects=effects, size=size, noise=servo.NOISES[seed % 3], seconds=20.0)
    finder = GapFinder("servo").fit(case.frame, **servo.COLUMNS)
    d, found = finder.diagnosis_, finder.found_
    first = found.steps[0]

    def nameless(looks: list[Any]) -> float:
        sizes = (k.size for k in looks if not k.name and k.p_value <= finder.alpha)
        return max(sizes, default=0.0) / finder.plant_.scale

    follows, best = nameless(first.looks), max((f.size for f in first.fitted), default=0.0)
    return {
        "kind": kind, "truth": truth, "size": size, "seed": seed, "verdict": d.verdict,
        "names": "+".join(e.name for e in d.effects), "on": " and ".join(d.learned.signals) if d.learned else "",
        "learned": round(d.learned.closure, 3) if d.learned else 0.0, "closure": round(d.closure, 3),
        "explains": round(min(1.0, (best / follows) ** 2), 3) if follows else "",
        "still": round(nameless(found.remainder) * finder.plant_.scale / first.gap, 3) if found.taken else "",
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
    for what in ("explains", "still"):
        for kind in ("named", "foreign"):
            some = [float(r[what]) for r in rows if r["kind"] == kind and r[what] != ""]
            if some:
                tenths = " ".join(f"{x:.2f}" for x in np.quantile(some, [0.0, 0.1, 0.5, 0.9, 1.0]))
                lines.append(f"{what} ({kind}, {len(some)} logs): least, 10, 50, 90 %, most {tenths}")
    return "\n".join(lines)


@click.command(help=__doc__)
@click.option("--count", default=2, help="Seeds a cell.")
@click.option("--first-seed", default=700)
@click.option("--sizes", default="0.05,0.15")
@click.option("--effects", default=",".join((*LEARNABLE, *BEYOND, "coloured")), help="Which of them, or `named`.")
@click.option("--out", default="learned.csv", type=click.Path(dir_okay=False), help="Rows are added to it.")
def main(count: int, first_seed: int, sizes: str, effects: str, out: str) -> None:
    new = not Path(out).exists()
    effects = ",".join(servo.EFFECTS) if effects == "named" else effects
    cases = [
        (e, float(s), first_seed + i) for e in effects.split(",") if e for s in sizes.split(",") for i in range(count)
    ]
    with open(out, "a", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, FIELDS)
        if new:
            writer.writeheader()
        for name, size, seed in tqdm(cases):
            kind = "named" if name in servo.EFFECTS else "coloured" if name == "coloured" else "foreign"
            row = diagnose(kind, "" if kind == "coloured" else name, size, seed)
            click.echo(", ".join(f"{k} {v}" for k, v in row.items()))
            writer.writerow(row)
            file.flush()
    with open(out, newline="", encoding="utf-8") as file:
        click.echo(summary(list(csv.DictReader(file))))


if __name__ == "__main__":
    main()
