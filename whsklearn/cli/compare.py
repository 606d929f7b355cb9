"""Compare records of one axis or arm: what changed and by how much, that nothing did, or why they cannot show it.

Writes ``compare.html`` (for a person) and ``compare.json`` (for programs), and records the comparison in MLflow: a
parent run, and a child run for every record.
"""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING, Any

import click

from whsklearn.cli import options as opt
from whsklearn.cli import records
from whsklearn.cli.gap import as_record, read_log
from whsklearn.cli.job import UNUSABLE, job, say_where, table, tracker_for, wrapped, writable_folder

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from sklearn.utils import Bunch

    from whsklearn.compare import Comparison

AN_AXIS = {"kind": "servo", "robot": None, "simulator": None}  # options that `gap` expects besides the columns


@job
@click.argument("logs", metavar="BEFORE AFTER [...]", nargs=-1, required=True, type=opt.LOG)
@opt.axis_options
@opt.robot_options
@opt.reading_options
@click.option("--alpha", type=opt.PROBABILITY, default=0.01, help="Probability of reporting a change where none is.")
@click.option("--out", type=opt.FOLDER, default="compare", help="Folder for the report.")
def main(**options: Any) -> None:
    """Find what changed between records of one axis or one arm, given in the order of time.

    \b
    whsklearn compare before.csv after.csv --drive torque_nm --position position_rad --out compare
    whsklearn compare monday.csv tuesday.csv wednesday.csv --out week
    whsklearn compare empty.csv loaded.csv --robot arm.urdf --joints "shoulder:q1,u1;elbow:q2,u2"
    """  # noqa: D301 - click reads the backspace
    from whsklearn.compare import write_report

    files = options["logs"]
    if len(files) < 2:
        raise click.UsageError("One log cannot be compared; give at least two, in the order of time.")
    folder = writable_folder(options["out"])
    labels = records.names_of(files)
    compared, logs = comparison_of(options, files, labels)
    tracker = tracker_for("compare", options["track"], data=labels[0])
    with tracker.run(f"compare {labels[0]} to {labels[-1]}") as parent:
        found = compared()
        click.echo(wrapped(f"{found.verdict}: {found.sentence}"))
        for text in found.notes:
            records.note(text)
        if found.numbers:
            click.echo("")
            click.echo(numbers_of(found))
        click.echo(f"Report: {write_report(found, folder, [*map(records.origin, logs)])}")
        parent.log_params(opt.given(options))
        track(parent, found, folder)
    say_where(tracker)
    if not found.usable:
        raise SystemExit(UNUSABLE)


def comparison_of(
    options: dict[str, Any], files: tuple[str, ...], labels: list[str]
) -> tuple[Callable[[], Comparison], list[Bunch]]:
    """What compares these files, and their logs."""
    from whsklearn.compare import ArmLog, compare_arms, compare_records

    if not options["robot"]:
        opt.refuse_without_robot(options)
        logs = [log_of(options, file) for file in files]
        for first, second in itertools.combinations(logs, 2):
            records.refuse_shared(first, second, records.TWICE)
        share_units(logs)
        taken = [as_record(options | AN_AXIS, log)[0] for log in logs]
        same_zero = not any("LOG018" in log.report.codes for log in logs)  # an integral begins at 0 in every log
        settings = {"alpha": options["alpha"], "random_state": options["seed"]}
        return lambda: compare_records(taken, labels, same_zero=same_zero, **settings), logs
    from whsklearn.cli.arm_log import read_arm, robot_of  # it loads pandas, which the help does without

    arm = robot_of(options)
    logs = [records.longest(read_arm(file, options, arm)) for file in files]
    arms = [ArmLog(log.sample_rate, log.y, log.X) for log in logs]
    return lambda: compare_arms(arms, arm, labels, alpha=options["alpha"]), logs


def log_of(options: dict[str, Any], file: str) -> Bunch:
    """One log of an axis, with all its long segments."""
    log = records.liveliest(records.long_segments(read_log(options | AN_AXIS | {"log_file": file, "reference": None})))
    records.note_assumed(log)
    return log


def share_units(logs: list[Bunch]) -> None:
    """Give a log that does not state the unit of a column the SI unit that the others state, as `note_assumed` says."""
    from whsklearn.logs.units import UNSTATED, factor_of

    for role, si in (("drive", {"Nm", "N"}), ("position", {"rad", "m"})):
        stated = {factor_of(log.units[role])[1] for log in logs if log.units.get(role, "") not in UNSTATED}
        if len(stated) == 1 and stated <= si:
            for log in logs:
                if log.units.get(role) in UNSTATED:
                    log.units = {**log.units, role: next(iter(stated))}


def numbers_of(found: Comparison) -> str:
    """A table with one line per number and one column per record; of many records, the first and the last ones."""
    from whsklearn.compare.comparison import spoken
    from whsklearn.compare.report import with_error

    shown = range(len(found.labels)) if len(found.labels) <= 4 else (0, 1, -2, -1)
    header = ["number", *(found.labels[k] for k in shown), "std error", "unit"]
    rows = []
    for r in found.numbers:
        if "." in r["name"]:  # combinations of an arm's links are in the report only
            continue
        values = [with_error(r["values"][k], r["standard_errors"][k]).partition(" ")[0] for k in shown]
        rows.append([spoken(r), *values, float(max(r["standard_errors"])), r["unit"]])
    return table(header, rows)


def track(parent: Any, found: Comparison, folder: Path) -> None:
    """Record the answer in the parent run, the numbers of each record in a child run, and the report."""
    first = found.changes[0] if found.changes else None
    parent.log_tags({"verdict": found.verdict, "changes": ", ".join(c.name for c in found.changes)})
    parent.log_metrics({"seconds": found.seconds})
    if first is not None:
        parent.log_metrics({"p_value": first.p_value, "change": first.change, "share_of_drive": first.share})
    for k, label in enumerate(found.labels):
        with parent.child(label) as child:
            for row in found.numbers:
                name = f"{row['name']} {row['part']}".rstrip()
                child.log_metrics({name: row["values"][k], f"{name}_error": row["standard_errors"][k]})
    for name in ("compare.html", "compare.json"):
        parent.log_artifact(folder / name)
