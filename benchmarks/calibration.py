"""Records with nothing missing: how often anything is named, and how the smallest p-value of a record is spread.

    python -m benchmarks.calibration --count 300 --out calibration.csv --figure calibration.png
    python -m benchmarks.calibration --count 60 --kinds chain,simulator --alpha 0.05,0.01

Seven makers take turns: `make_servo_log` of the library, the equations of `blind_logs`, the same as rough logs (slow,
with a coarse encoder and a path that shakes the axis), MuJoCo, chains, a simulator of one's own, and servo logs with a
remainder: coloured torque noise and a foreign effect that follows the motion, each of
0.05 to 0.25 % of the rms drive, so that both together are below the tolerance of 0.4 %. Any name is false, whatever
the verdict; at the level alpha those with a p-value up to alpha. Bounds are exact (Clopper and Pearson 1934,
Biometrika 26(4)), 95 % two-sided. A record's smallest p-value is that over all effects and candidates, corrected for
the number of families by the finder itself: it is calibrated where P(p <= a) <= a, points on or above the diagonal of
the figure. Records in which no candidate got as far as a p-value count as one. A finder without p-values has one
figure for all levels. Seconds are of CPU.
"""

from __future__ import annotations

import csv
import inspect
import math
import time
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import click
import numpy as np
from joblib import Parallel, delayed
from scipy.stats import beta, binomtest
from tqdm import tqdm

from benchmarks import blind_mujoco, blind_simulator
from benchmarks.blind_logs import servo, wiener_hammerstein
from whsklearn.datasets import make_servo_log
from whsklearn.gap import GapFinder, ServoRecord

FIELDS = "kind seed verdict names p_of_names smallest_p alpha seconds error".split()
REMAINDER = (0.0005, 0.0025)  # of the rms drive, each of two: below the tolerance of 0.004 together, and well above 0
FLOOR = 1e-4  # of the figure: no finder makes so many records that a smaller p-value could be checked


def library(seed: int) -> tuple[dict[str, Any], Any, dict[str, str]]:
    """(what the finder is given, the log, its columns); so all makers."""
    return {"model": "servo"}, make_servo_log([], duration=20.0, random_state=seed), servo.COLUMNS


def equations(seed: int) -> tuple[dict[str, Any], Any, dict[str, str]]:
    """An axis of `blind_logs`, white noise of the encoder."""
    case = servo.make_case("none", seed, noise=servo.NOISES[seed % 3], seconds=20.0)
    return {"model": "servo"}, case.frame, servo.COLUMNS


def simulated_by_mujoco(seed: int) -> tuple[dict[str, Any], Any, dict[str, str]]:
    """A hinge or slider of MuJoCo, the step of the encoder stated."""
    case = blind_mujoco.make_case("none", seed, 20.0)
    record = ServoRecord.from_frame(case.frame, **blind_mujoco.COLUMNS, resolution=2 * np.pi / case.rig.counts)
    return {"model": "servo", "law": case.law}, record, {}


def chain(seed: int) -> tuple[dict[str, Any], Any, dict[str, str]]:
    """A drawn chain."""
    case = wiener_hammerstein.make_case("none", seed, n=1500)
    return {"model": "wiener-hammerstein"}, case.frame, wiener_hammerstein.COLUMNS


def own_simulator(seed: int) -> tuple[dict[str, Any], Any, dict[str, str]]:
    """A user's own integrator, its numbers 10 % off."""
    record, rig, _ = blind_simulator.make_case("none", seed)
    return {"model": rig}, record, {}


def remainder(seed: int) -> tuple[dict[str, Any], Any, dict[str, str]]:
    """A coloured and a motion-dependent remainder, both below the tolerance."""
    rng = np.random.default_rng([seed, 22])
    effect = str(rng.choice(servo.OUTSIDE))
    size = float(rng.uniform(*REMAINDER))
    case = servo.make_case("coloured", seed, effects=(effect,), size=size, noise=servo.NOISES[0], seconds=20.0)
    return {"model": "servo"}, case.frame, servo.COLUMNS


def rough(seed: int) -> tuple[dict[str, Any], Any, dict[str, str]]:
    """A slow logger, an encoder of 12 to 16 bits, and a path or a feedforward that shakes the axis."""
    rng = np.random.default_rng([seed, 23])
    case = servo.make_case(
        "none", seed, noise=servo.NOISES[0], seconds=float(rng.uniform(15.0, 40.0)),
        excitation=str(rng.choice(["rich", "small", "random"])), rate=float(rng.choice([200.0, 250.0, 500.0, 1000.0])),
        counts=2 ** int(rng.integers(12, 17)),
    )  # fmt: skip
    return {"model": "servo"}, case.frame, servo.COLUMNS


MAKERS = {
    "library": library,
    "equations": equations,
    "mujoco": simulated_by_mujoco,
    "chain": chain,
    "simulator": own_simulator,
    "remainder": remainder,
    "rough": rough,
}


def p_values(found: Iterable[Any]) -> list[float]:
    """Those p-values that a finder gives its effects or candidates."""
    given = (getattr(e, "p_value", None) for e in found)
    return [float(p) for p in given if p is not None and math.isfinite(p)]


def diagnose(kind: str, seed: int, alpha: float) -> dict[str, Any]:
    """One row of the table; ``alpha`` is the loosest level, and the names at a stricter one are read off their p."""
    row: dict[str, Any] = {"kind": kind, "seed": seed, "names": "", "p_of_names": "", "smallest_p": "", "alpha": "",
                           "error": ""}  # fmt: skip
    options, log, columns = MAKERS[kind](seed)
    if "alpha" in inspect.signature(GapFinder).parameters:
        row["alpha"] = options["alpha"] = alpha
    began = time.process_time()
    try:
        d = GapFinder(**options).fit(log, **columns).diagnosis_
    except Exception as error:  # a benchmark counts crashes, it does not stop at one
        return row | {"verdict": "crash", "seconds": round(time.process_time() - began, 2),
                      "error": f"{type(error).__name__}: {error}"[:100]}  # fmt: skip
    row |= {"verdict": d.verdict, "names": "+".join(e.name for e in d.effects),
            "seconds": round(time.process_time() - began, 2)}  # fmt: skip
    if row["alpha"] != "":
        row["p_of_names"] = "+".join(f"{p:.3g}" for p in p_values(d.effects))
        row["smallest_p"] = min([1.0, *p_values([*d.effects, *d.candidates])])
    return row


def false_name(row: dict[str, Any], alpha: float) -> bool:
    """Whether a record has a name at this level; a name without a p-value stands at every level."""
    if not row["names"]:
        return False
    given = [float(p) for p in str(row["p_of_names"]).split("+") if p]
    return len(given) < len(row["names"].split("+")) or min(given) <= alpha


def exact(k: int, n: int) -> tuple[float, float]:
    """Bounds of a share at 95 %, shape two floats."""
    interval = binomtest(k, n).proportion_ci(method="exact")
    return float(interval.low), float(interval.high)


def summary(rows: list[dict[str, Any]], alphas: list[float]) -> str:
    """False names by maker and level, with bounds, and what a diagnosis costs."""
    lines = [f"{'maker':<14}" + "".join(f"{f'false at {a:g}':>16}{'95 % bounds':>16}" for a in alphas)
             + f"{'crashes':>9}{'CPU median':>12}{'worst':>8}"]  # fmt: skip
    for kind in (*dict.fromkeys(r["kind"] for r in rows), "all"):
        of = [r for r in rows if kind in (r["kind"], "all")]
        line = f"{kind:<14}"
        for alpha in alphas:
            k = sum(false_name(r, alpha) for r in of)
            low, high = exact(k, len(of))
            line += f"{f'{k}/{len(of)}':>16}{f'{100 * low:.1f} to {100 * high:.1f} %':>16}"
        seconds = [float(r["seconds"]) for r in of]
        crashes = sum(r["verdict"] == "crash" for r in of)
        lines.append(f"{line}{crashes:>9}{np.median(seconds):>10.1f} s{max(seconds):>6.0f} s")
    lines += [f"  {r['kind']} seed {r['seed']}: {r['verdict']} {r['names'] or r['error']} p {r['p_of_names'] or '-'}"
              for r in rows if r["names"] or r["error"]]  # fmt: skip
    return "\n".join(lines)


def draw(rows: list[dict[str, Any]], alphas: list[float], path: str) -> None:
    """Quantiles of the smallest p-values against those of a uniform one, both axes in decades.

    Raises
    ------
    ValueError
        If no row has a p-value.
    """
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    held = [r for r in rows if r["smallest_p"] != ""]
    if not held:
        raise ValueError("No record has a p-value: this finder gives none, so there is no figure to draw.")
    n = len(held)
    fig, ax = plt.subplots(figsize=(5.2, 5.0), layout="constrained")
    rank = np.arange(1, n + 1)
    wanted = (rank - 0.5) / n
    band = [np.maximum(beta.ppf(q, rank, n - rank + 1), FLOOR) for q in (0.025, 0.975)]
    ax.fill_between(wanted, *band, color="0.9", label="95 % of uniform p-values")
    ax.plot([FLOOR, 1], [FLOOR, 1], color="0.5", linewidth=0.9)
    for kind in dict.fromkeys(r["kind"] for r in held):
        p = np.sort([max(float(r["smallest_p"]), FLOOR) for r in held if r["kind"] == kind])
        ax.plot((np.arange(p.size) + 0.5) / p.size, p, linewidth=0.9, alpha=0.7, label=f"{kind} ({p.size})")
    p = np.sort([max(float(r["smallest_p"]), FLOOR) for r in held])
    ax.plot(wanted, p, ".", color="black", markersize=4, label=f"all ({n})")
    for alpha in alphas:
        ax.axhline(alpha, color="0.5", linewidth=0.6, linestyle=":")
        ax.annotate(f"{alpha:g}", (1.0, alpha), xytext=(3, 0), textcoords="offset points", va="center", fontsize=8)
    ax.set(xscale="log", yscale="log", xlim=(0.5 / n, 1.0), ylim=(max(FLOOR, 0.05 / n), 1.1),
           xlabel="share of the records with nothing missing", ylabel="smallest p-value of a record")  # fmt: skip
    ax.legend(fontsize=8, loc="lower right")
    fig.savefig(path, dpi=150)
    plt.close(fig)


@click.command(help=__doc__)
@click.option("--count", default=300, help="Records, spread evenly over the makers.")
@click.option("--first-seed", default=52_000, help="First seed of every maker.")
@click.option("--alpha", default="0.05,0.01", help="Levels, joined by commas.")
@click.option("--kinds", default=",".join(MAKERS), help="Makers, joined by commas.")
@click.option("--jobs", default=2, help="Processes.")
@click.option("--out", default="calibration.csv", type=click.Path(dir_okay=False))
@click.option("--figure", type=click.Path(dir_okay=False), help="Draw the p-values there (extra plot).")
@click.option("--resume/--no-resume", default=False, help="Keep the rows that the file has and go on.")
def main(
    count: int, first_seed: int, alpha: str, kinds: str, jobs: int, out: str, figure: str | None, resume: bool
) -> None:
    wanted, alphas = kinds.split(","), [float(a) for a in alpha.split(",")]
    if unknown := set(wanted) - set(MAKERS):
        raise click.BadParameter(f"no maker {sorted(unknown)}; expected some of {', '.join(MAKERS)}.")
    rows: list[dict[str, Any]] = []
    if resume and Path(out).exists():
        with open(out, newline="", encoding="utf-8") as file:
            rows = list(csv.DictReader(file))
    done = {(r["kind"], int(r["seed"])) for r in rows}
    plan = [(wanted[i % len(wanted)], first_seed + i // len(wanted)) for i in range(count)]
    plan = [case for case in plan if case not in done]
    with open(out, "a" if rows else "w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, FIELDS)
        if not rows:
            writer.writeheader()
        found = Parallel(n_jobs=jobs, return_as="generator")(delayed(diagnose)(*case, max(alphas)) for case in plan)
        for row in tqdm(found, total=len(plan)):
            rows.append(row)
            writer.writerow(row)
            file.flush()
            if row["names"] or row["error"]:
                tqdm.write(f"{row['kind']} seed {row['seed']}: {row['verdict']} {row['names'] or row['error']}")
    click.echo(summary(rows, alphas))
    if figure:
        try:
            draw(rows, alphas, figure)
        except ValueError as error:
            raise click.ClickException(str(error)) from error


if __name__ == "__main__":
    main()
