"""The blind protocol on Wiener-Hammerstein records: rates with Wilson intervals and the confusion matrix.

    python -m benchmarks.blind_blocks --named 3 --none 20 --coloured 20 --foreign 20 --pair 20 --out rows.csv

Sizes are 2, 5 and 15 % of the rms at the effect's port and noise is 15 to 40 dB down, so some records cannot show
what they hide.  ``visible`` are those in which whoever knows the truth finds evidence for it of 60 (delta BIC of
the model with the effect, fitted from the true numbers, over the one without; `benchmarks._evidence`): twice what
a name needs.
"""

from __future__ import annotations

import csv
import time
from collections import Counter
from pathlib import Path
from typing import Any

import click
import numpy as np

from benchmarks.blind import wilson
from benchmarks.blind_logs import wiener_hammerstein as blind
from whsklearn.gap import GapFinder

FIELDS = (
    "kind truth size snr excitation evidence seed verdict names aliases top closure true_closure worse "
    "error_of_size seconds"
).split()
VISIBLE = 60.0


def plan(counts: dict[str, int], first_seed: int) -> list[tuple[str, tuple[str, ...] | None, int]]:
    """(kind, effects, seed) of every case; the kinds take turns so that an early stop is fair."""
    out: list[tuple[int, str, tuple[str, ...] | None, int]] = []
    for i in range(counts["named"]):
        out += [(26 * i + j, "named", (e,), first_seed + 97 * j + i) for j, e in enumerate(blind.EFFECTS)]
    for kind in ("none", "coloured", "foreign", "pair"):
        step = max(1, 26 * counts["named"] // max(counts[kind], 1))
        out += [(i * step, kind, None, first_seed + 10_000 + i) for i in range(counts[kind])]
    return [row[1:] for row in sorted(out, key=lambda r: r[0])]


def diagnose(
    kind: str, effects: tuple[str, ...] | None, seed: int, samples: int, judged: bool = True
) -> dict[str, Any]:
    """One row of the table; seconds of CPU. Without ``judged`` nobody who knows the truth fits it."""
    case = blind.make_case(kind, seed, effects=effects, n=samples)
    began = time.process_time()
    d = GapFinder("wiener-hammerstein").fit(case.frame, **blind.COLUMNS).diagnosis_
    row: dict[str, Any] = {
        "kind": kind, "truth": "+".join(case.truth), "size": case.size, "snr": round(case.snr_db, 1),
        "excitation": case.excitation, "seed": seed, "verdict": d.verdict,
        "names": "+".join(e.name for e in d.effects),
        "aliases": "+".join(sorted({a for e in d.effects for a in e.aliases})),
        "top": next((f"{c.name}:{c.delta_bic:.0f}" for c in sorted(d.candidates, key=lambda c: -c.delta_bic)), ""),
        "closure": round(d.closure, 4), "error_of_size": "", "evidence": "", "true_closure": "", "worse": "",
        "seconds": round(time.process_time() - began, 1),
    }  # fmt: skip
    if kind == "named" and d.effects and d.effects[0].name == case.truth[0]:
        numbers = d.effects[0].effect.labelled()
        found = next(v for k, v in numbers.items() if isinstance(v, float) and k not in ("phase", "order", "frequency"))
        row["error_of_size"] = round(abs(abs(found) / case.parameters[0]["size"] - 1), 4)
    if judged and kind in ("named", "pair", "none") and d.verdict != "data_problem":
        from benchmarks._evidence import evidence, typical

        held = evidence(case)
        row["evidence"] = round(min(held.delta_bic.values(), default=1e6), 1)  # a grid of readings is plain to see
        y, runs = d.pictures["measured"], d.pictures["runs"]
        mask = d.pictures["held"] & ~d.pictures["beside_turned"]
        errors = [(y - runs["before"])[mask], (y - runs["after"])[mask], held.errors[mask]]
        limit = 6.0 * 1.4826 * float(np.median(np.abs(errors[0])))
        before, after, floor = (typical(e, limit) for e in errors)
        row["worse"] = after > 1.01 * before
        if kind != "none" and before > 1.05 * floor and d.effects:
            row["true_closure"] = round(1.0 - (after - floor) / (before - floor), 3)
    return row


def first(row: dict[str, Any]) -> str:
    """The first name."""
    return row["names"].split("+")[0]


def told(row: dict[str, Any]) -> bool:
    """Whether the truth is the first name or among those that the finder told beside it."""
    return right(row, groups=True) or row["truth"] in row["aliases"].split("+")[: 3 if row["truth"] else 0]


def right(row: dict[str, Any], *, groups: bool = False) -> bool:
    """Whether the first name is in the truth (or an alias of it)."""
    truth = tuple(row["truth"].split("+"))
    return blind.right_group(truth, first(row)) if groups else blind.right(truth, first(row))


def summary(rows: list[dict[str, Any]]) -> str:
    """Rates in the order of the targets, then the misses."""

    def rate(label: str, hits: list[bool], goal: str = "") -> str:
        p, low, high = wilson(sum(hits), len(hits))
        return (
            f"{label:<52} {sum(hits):>4}/{len(hits):<4} {100 * p:6.1f} %  [{100 * low:5.1f}, {100 * high:5.1f}]  {goal}"
        )

    def wrong(r: dict[str, Any]) -> bool:
        return r["verdict"] == "named" and not told(r)

    of = {k: [r for r in rows if r["kind"] == k] for k in ("named", "none", "coloured", "foreign", "pair")}

    def visible(r: dict[str, Any]) -> bool:
        return r["evidence"] != "" and float(r["evidence"]) >= VISIBLE

    seen = [r for r in of["named"] if visible(r)]
    spoken, open_ = ("named", "partial", "ambiguous"), ("named", "ambiguous")

    def all_found(r: dict[str, Any]) -> bool:
        return all(any(blind.right_group((t,), n) for n in r["names"].split("+")) for t in r["truth"].split("+"))

    def closed(r: dict[str, Any]) -> bool:
        return r["true_closure"] != "" and r["verdict"] == "named"

    lines = [
        rate("right name first, visible", [r["verdict"] == "named" and right(r) for r in seen], ">= 90"),
        rate("  with alias groups", [r["verdict"] == "named" and told(r) for r in seen], ">= 95"),
        rate("  or ambiguous, among names that hold it", [r["verdict"] in open_ and told(r) for r in seen]),
        rate("right name first, all", [r["verdict"] == "named" and told(r) for r in of["named"]]),
        rate("  where anything is named", [not wrong(r) for r in of["named"] if r["verdict"] == "named"]),
        rate("confident wrong name, all cases", [wrong(r) for r in rows], "<= 2"),
        rate("  leaving out foreign effects", [wrong(r) for r in rows if r["kind"] != "foreign"]),
        rate("nothing named, nothing missing", [r["verdict"] not in spoken for r in of["none"]], ">= 99"),
        rate("nothing named, coloured noise", [r["verdict"] not in spoken for r in of["coloured"]], ">= 97"),
        rate("foreign effect not confidently named", [r["verdict"] != "named" for r in of["foreign"]], ">= 90"),
        rate("both of a pair found, visible", [all_found(r) for r in of["pair"] if visible(r)], ">= 80"),
        rate("both of a pair found, all", [all_found(r) for r in of["pair"]]),
        rate("model made worse", [str(r["worse"]) == "True" for r in rows if r["worse"] != ""], "0"),
    ]  # fmt: skip
    closures = [float(r["true_closure"]) for r in of["named"] if closed(r)]
    errors = [float(r["error_of_size"]) for r in of["named"] if r["error_of_size"] != "" and r["verdict"] == "named"]
    if closures:
        lines.append(f"closure, with the floor of the truth: median {np.median(closures):.3f} of {len(closures)}")
    if errors:
        lines.append(f"error of the size: median {100 * np.median(errors):.1f} % of {len(errors)}")
    seconds = [float(r["seconds"]) for r in rows]
    lines.append(f"seconds a case: median {np.median(seconds):.1f}, worst {max(seconds):.1f}")
    lines.append("confusion of the visible (truth -> verdict names: cases):")
    cells = Counter((r["truth"], r["verdict"], r["names"]) for r in seen)
    lines += [f"  {t:<24} -> {v:<10} {n or '-'}: {k}" for (t, v, n), k in sorted(cells.items())]
    for kind in ("none", "coloured", "foreign", "pair"):
        counts = Counter(
            (r["truth"] if kind in ("foreign", "pair") else "", r["verdict"], r["names"]) for r in of[kind]
        )
        lines += [f"  {kind} {t:<20} -> {v} {n or '-'}: {k}" for (t, v, n), k in sorted(counts.items())]
    return "\n".join(lines)


@click.command(help=__doc__)
@click.option("--named", default=1, help="Records of every effect.")
@click.option("--none", "nothing", default=10, help="Records in which nothing is missing.")
@click.option("--coloured", default=10)
@click.option("--foreign", default=10)
@click.option("--pair", default=10)
@click.option("--samples", default=3000, help="Length of a record.")
@click.option("--first-seed", default=100_000, help="Development used those below 100000.")
@click.option("--out", default="blind_blocks.csv", type=click.Path(dir_okay=False))
def main(
    named: int, nothing: int, coloured: int, foreign: int, pair: int, samples: int, first_seed: int, out: str
) -> None:
    """Draw, diagnose, print."""
    counts = {"named": named, "none": nothing, "coloured": coloured, "foreign": foreign, "pair": pair}
    rows: list[dict[str, Any]] = []
    if Path(out).exists():
        with open(out, newline="", encoding="utf-8") as file:
            rows = list(csv.DictReader(file))
    done = {(r["kind"], int(r["seed"])) for r in rows}
    with open(out, "a", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, FIELDS)
        if not rows:
            writer.writeheader()
        for kind, effects, seed in plan(counts, first_seed):
            if (kind, seed) in done:
                continue
            rows.append(diagnose(kind, effects, seed, samples))
            writer.writerow(rows[-1])
            file.flush()
            click.echo(" ".join(str(rows[-1][k]) for k in FIELDS), err=True)
    click.echo(summary(rows))


if __name__ == "__main__":
    main()
