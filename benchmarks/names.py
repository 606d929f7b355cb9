"""All blind suites at a glance, small: right names, names that are sure and wrong, and what a diagnosis costs.

    python -m benchmarks.names                    every suite once through its effects, on two processes
    python -m benchmarks.names --share 0.2        every fifth log, some 5 minutes of CPU
    python -m benchmarks.names --suites chains,simulator --first-seed 41000 --out names.csv

Logs and rules are those of the suites' own scripts, which print much more. *Right* is the first name (or its alias)
with the verdict ``named``, silence where nothing is missing, and all names of a log with several effects; of MuJoCo's
logs, the first name whatever the verdict. *Sure and wrong* is ``named`` with any name that is not there. ``--share``
takes other logs for another ``--first-seed``. Seconds are of CPU, one diagnosis each.
"""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import click
import numpy as np
from joblib import Parallel, delayed
from tqdm import tqdm

from benchmarks import blind, blind_blocks, blind_filtered, blind_large, blind_mujoco, blind_simulator, causes
from benchmarks import own_effect as own
from benchmarks.blind_logs import filtered_chain, servo
from benchmarks.blind_logs.causes import CASES as CAUSES

FIELDS = "suite case seed verdict names right wrong seconds error".split()
SILENT = ("no_gap", "unknown", "coloured_noise", "not_testable", "data_problem")


class Task(NamedTuple):
    """One log: its suite, what it hides, its seed, and the function that draws, diagnoses and judges it."""

    suite: str
    case: str
    seed: int
    judge: Callable[[Task], dict[str, Any]]


def _servo(task: Task) -> dict[str, Any]:
    name, _, size = task.case.partition(" ")
    if name == "none":
        noise = servo.NOISES[task.seed % len(servo.NOISES)]
        row = blind.diagnose(("servo", "none", None, 0.05, noise, task.seed), False)
    else:
        case = ("servo", "named", (name,), float(size), servo.NOISES[0], task.seed)
        row = blind.diagnose(case, False)
    sure = row["verdict"] == "named"
    names = [n for n in row["names"].split("+") if n]
    wrong = sure and not all(row["truth"] and blind.same("servo", n, row["truth"]) for n in names)
    right = sure and blind.hit(row) if row["truth"] else row["verdict"] in SILENT
    return row | {"right": right, "wrong": wrong}


def _mujoco(task: Task) -> dict[str, Any]:
    row = blind_mujoco.diagnose(blind_mujoco.make_case(task.case, task.seed))
    return row | {"right": not row["names"] and row["verdict"] != "crash"} if task.case == "none" else row


def _own(task: Task) -> dict[str, Any]:
    kind, _, share = task.case.partition(" ")
    one = {"servo": own.diagnose, "chain": own.diagnose_chain, "simulator": own.diagnose_simulator}[kind]
    row = one(float(share), task.seed)
    sure, names = row["verdict"] == "named", row["names"]
    right = sure and names == ["magnet"] if float(share) else not names
    wrong = sure and names != (["magnet"] if float(share) else [])
    return row | {"right": right, "wrong": wrong, "names": "+".join(names)}


def _simulator(task: Task) -> dict[str, Any]:
    row = blind_simulator.diagnose(task.case, task.seed)
    right = row["right"] and row["verdict"] == "named" if task.case != "none" else not row["names"]
    return row | {"right": right}


def _large(task: Task) -> dict[str, Any]:
    row = blind_large.diagnose(task.seed)
    return row | {"wrong": bool(row["wrong"]) and row["verdict"] == "named"}


def _chains(task: Task) -> dict[str, Any]:
    kind = "none" if task.case == "none" else "named"
    row = blind_blocks.diagnose(kind, None if kind == "none" else (task.case,), task.seed, 1500, judged=False)
    sure = row["verdict"] == "named"
    right = sure and blind_blocks.told(row) if kind == "named" else row["verdict"] in SILENT
    truth = (task.case,)
    names = [n for n in row["names"].split("+") if n]
    wrong = sure and not (blind_blocks.told(row) and all(blind_blocks.blind.right_group(truth, n) for n in names[1:]))
    return row | {"right": right, "wrong": wrong}


def _filtered(task: Task) -> dict[str, Any]:
    return blind_filtered.diagnose("" if task.case == "none" else task.case, task.seed)


def _causes(task: Task) -> dict[str, Any]:
    return causes.diagnose(task.case, task.seed)


def _servo_tasks(seed: int) -> Iterator[Task]:
    for j, effect in enumerate(servo.EFFECTS):
        yield from (Task("servo", f"{effect} {size}", seed + 97 * j, _servo) for size in (0.05, 0.15))
    yield from (Task("servo", "none", 1000 * seed + j, _servo) for j in range(6))


def _own_tasks(seed: int) -> Iterator[Task]:
    for share in (0.05, 0.15):
        yield from (Task("own effects", f"{kind} {share}", seed + 1, _own) for kind in ("servo", "chain", "simulator"))
    yield Task("own effects", "servo 0", seed, _own)


def _mujoco_tasks(seed: int) -> Iterator[Task]:
    names = [n for n in blind_mujoco.EFFECTS if n not in blind_mujoco.ON_LOAD]
    yield from (Task("mujoco", n, seed, _mujoco) for n in names)
    yield from (Task("mujoco", "none", seed + j, _mujoco) for j in range(4))


def _simulator_tasks(seed: int) -> Iterator[Task]:
    yield from (Task("simulator", k, seed + j % 2, _simulator) for j, k in enumerate(blind_simulator.KINDS))
    yield from (Task("simulator", "none", seed + j, _simulator) for j in range(4))


def _chain_tasks(seed: int) -> Iterator[Task]:
    effects = blind_blocks.blind.EFFECTS
    yield from (Task("chains", e, seed + 97 * j, _chains) for j, e in enumerate(effects))
    yield from (Task("chains", "none", seed + 10_000 + j, _chains) for j in range(4))


SUITES: dict[str, Callable[[int], Iterator[Task]]] = {
    "servo": _servo_tasks,
    "mujoco": _mujoco_tasks,
    "own": _own_tasks,
    "simulator": _simulator_tasks,
    "large": lambda seed: (Task("large", "two or three", seed + j, _large) for j in range(8)),
    "chains": _chain_tasks,
    "filtered": lambda seed: (
        Task("filtered chains", n, seed, _filtered) for n in (*filtered_chain.EFFECTS, *filtered_chain.PORTS, "none")
    ),
    "causes": lambda seed: (Task("causes", n, seed, _causes) for n in CAUSES),
}


def plan(suites: list[str], first_seed: int, count: int, share: float) -> list[Task]:
    """The logs: ``count`` rounds of each suite, thinned evenly, from another log on for another first seed."""
    step = 1.0 / share
    tasks = []
    for suite in suites:
        every = [t for i in range(count) for t in SUITES[suite](first_seed + i)]
        offset = first_seed % max(1, round(step))
        tasks += [every[int(x)] for x in np.arange(min(offset, len(every) - 1), len(every), step)]
    return tasks


def judged(task: Task) -> dict[str, Any]:
    """A row of the table; a crash is one, too."""
    row: dict[str, Any] = {"suite": task.suite, "case": task.case, "seed": task.seed}
    try:
        return {"error": ""} | task.judge(task) | row
    except Exception as error:  # a benchmark counts crashes, it does not stop at one
        return row | {"verdict": "crash", "names": "", "right": False, "wrong": False, "seconds": 0.0,
                      "error": f"{type(error).__name__}: {error}"[:100]}  # fmt: skip


def table(rows: list[dict[str, Any]]) -> str:
    """Suite, logs, right, sure and wrong, crashes, CPU seconds."""
    lines = [f"{'suite':<18}{'right':>10}{'sure and wrong':>16}{'crashes':>9}{'CPU median':>12}{'worst':>8}"]
    for suite in (*dict.fromkeys(r["suite"] for r in rows), "all"):
        of = [r for r in rows if suite in (r["suite"], "all")]
        seconds = [float(r.get("seconds") or 0.0) for r in of]
        right, wrong = sum(bool(r["right"]) for r in of), sum(bool(r["wrong"]) for r in of)
        crashes = sum(r["verdict"] in ("crash", "error") for r in of)
        lines.append(
            f"{suite:<18}{f'{right}/{len(of)}':>10}{wrong:>16}{crashes:>9}"
            f"{np.median(seconds):>10.1f} s{max(seconds):>6.0f} s"
        )
    return "\n".join(lines)


@click.command(help=__doc__)
@click.option("--suites", default=",".join(SUITES), help="Suites, joined by commas.")
@click.option("--count", default=1, help="Rounds of every suite; a round has another seed.")
@click.option("--first-seed", default=41_000, help="First seed of every suite.")
@click.option("--share", default=1.0, type=click.FloatRange(0.0, 1.0, min_open=True), help="Share of the logs.")
@click.option("--jobs", default=2, help="Processes.")
@click.option("--out", default="names.csv", type=click.Path(dir_okay=False))
def main(suites: str, count: int, first_seed: int, share: float, jobs: int, out: str) -> None:
    wanted = suites.split(",")
    if unknown := set(wanted) - set(SUITES):
        raise click.BadParameter(f"no suite {sorted(unknown)}; expected some of {', '.join(SUITES)}.")
    tasks = plan(wanted, first_seed, count, share)
    rows = []
    with open(out, "w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, FIELDS, restval="", extrasaction="ignore")
        writer.writeheader()
        for row in tqdm(
            Parallel(n_jobs=jobs, return_as="generator")(delayed(judged)(t) for t in tasks), total=len(tasks)
        ):
            rows.append(row)
            writer.writerow(row)
            file.flush()
            if not row["right"] or row["wrong"]:
                mark = "WRONG " if row["wrong"] else "missed"
                tqdm.write(
                    f"{mark} {row['suite']:<16}{row['case']:<28}{row['seed']:<9}{row['verdict']:<13}"
                    f"{row['names'] or row['error'] or '-'}"
                )
    click.echo(table(rows))


if __name__ == "__main__":
    main()
