"""Close the gap: find what a model is missing, name it, add it, and prove that the gap has closed.

Writes ``gap.html`` (for a person), ``gap.json`` (for programs) and ``repaired.json`` (the model with what was
missing) into the report folder and records the diagnosis in MLflow: a parent run, and a child run for every round.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from whsklearn.cli import options as opt
from whsklearn.cli import records
from whsklearn.cli.job import UNUSABLE, job, progress_bar, say_where, tracker_for, wrapped, writable_folder

if TYPE_CHECKING:
    from sklearn.utils import Bunch

    from whsklearn.gap import GapFinder
    from whsklearn.logs.errors import LogError

KINDS = ("servo", "wiener-hammerstein")
USUAL = {"time": "time_s", "drive": "torque_nm", "position": "position_rad"}


@job
@click.argument("log_file", metavar="LOG", type=opt.LOG)
@click.argument("more", metavar="[LOG ...]", nargs=-1, type=opt.LOG)
@click.option("--model", "kind", type=click.Choice(KINDS), default="servo", help="Kind of the base model.")
@opt.axis_options
@click.option("--reference", help="Reference column (servo); optional.")
@click.option("--input", "input_column", default="u", help="Column of the input (Wiener-Hammerstein).")
@click.option("--output", "output_column", default="y", help="Column of the output (Wiener-Hammerstein).")
@opt.reading_options
@click.option(
    "--law",
    help="Terms of the base model's law, joined by commas: friction such as viscous,coulomb; for Wiener-Hammerstein "
    "also linear, offset, polynomial (or polynomial:5), piecewise_linear (or piecewise_linear:12 for 12 kinks), "
    "cubic_spline.",
)
@click.option("--orders", type=opt.ORDERS, help="Orders of the base model (Wiener-Hammerstein).")
@click.option(
    "--direct", type=click.IntRange(0, 2), default=0, help="Blocks with a direct path, 0 to 2 (Wiener-Hammerstein)."
)
@click.option(
    "--tolerance",
    type=opt.FiniteRange(min=0.0),
    default=0.004,
    help="Smallest effect worth naming, as a share of the rms drive or output.",
)
@click.option(
    "--alpha", type=opt.PROBABILITY, default=0.01,
    help="Probability of a false name when nothing is missing (axis with a logged drive).",
)  # fmt: skip
@click.option(
    "--max-effects",
    type=click.IntRange(min=1, max=5),
    default=3,
    help="Maximum number of effects to add (at each joint).",
)
@opt.effects_option
@opt.robot_options
@click.option("--load", help="Known load at the last joint: mass in kg, or with its place in m, KG:X,Y,Z.")
@click.option("--loaded", type=opt.LOG, help="Log with a load (LOG is without): finds it, or with --load the gains.")
@click.option("--simulator", type=opt.FILE, help="A MuJoCo model.xml or an FMU.")
@click.option("--joint", help="Joint of the simulator.")
@click.option("--actuator", help="Actuator whose control was logged, if the joint has several.")
@click.option("--test", "second", type=opt.LOG, help="Another log of the axis, to test the result on.")
@click.option("--out", "--report", "report", type=opt.FOLDER, default="gap", help="Folder for the report.")
def main(**options: Any) -> None:
    """Find, name and close the gap between a model and LOG.

    Several logs of one axis make one diagnosis: numbers are shared, while each log has its own offset and timing. A log
    is a CSV of any dialect, Parquet, MAT, HDF5, TDMS, MDF4, MCAP, a ROS bag or a LeRobot folder.

    \b
    whsklearn gap axis.csv --time time_s --drive torque_nm --position position_rad --out gap
    whsklearn gap axis.csv --effects my_effects.py --out gap
    whsklearn gap arm.csv --robot arm.urdf --joints "shoulder:q1,i1;elbow:q2,i2"
    whsklearn gap robot.mcap --drive /joints.effort.elbow --position /joints.position.elbow
    """  # noqa: D301 - click reads the backspace
    from whsklearn.logs.errors import ColumnError, LogError

    folder = writable_folder(options["report"])
    if options["more"] and (options["robot"] or options["simulator"] or options["kind"] != "servo"):
        raise click.UsageError("Several logs are supported for a servo axis only; give one.")
    if (options["orders"] or options["direct"]) and options["kind"] == "servo" and not options["robot"]:
        raise click.UsageError(
            "--orders and --direct are of a chain; add --model wiener-hammerstein, or leave them out."
        )
    if (options["joint"] or options["actuator"]) and not options["simulator"]:
        raise click.UsageError("--joint and --actuator are of a --simulator; the joints of a --robot are --joints.")
    if options["robot"]:
        from whsklearn.cli.arm import gap_log

        log = gap_log(options)  # with --load, it puts the gains into the options
        again = options | {"log_file": options["second"], "load": None, "loaded": None}
        second = gap_log(again) if options["second"] else None
    else:
        opt.refuse_without_robot(options)
        opt.load_effects(options["effects"])
        try:
            log, second = axis_logs(options)
        except LogError as error:
            if not isinstance(error, ColumnError):
                data_problem(error, folder)
            raise
    if second is not None:
        records.refuse_shared(log, second)
    finder = diagnose(options, log, second, folder)
    if finder.verdict_ == "data_problem":
        raise SystemExit(UNUSABLE)


def axis_logs(options: dict[str, Any]) -> tuple[Bunch, Bunch | None]:
    """What is used of the log of an axis or of a chain, and of that named by ``--test``."""
    whole = read_log(options)
    log = used_of(options, whole)
    if options["kind"] == "servo":  # a chain keeps the units of its log
        records.note_assumed(log)
    log.rows = records.rows_of(log, whole)
    return log, used_of(options, read_log(options, options["second"])) if options["second"] else None


def used_of(options: dict[str, Any], log: Bunch) -> Bunch:
    """The part of a log that this kind of model can use: without short segments, very long holes or too many rows."""
    return records.liveliest(records.long_segments(log) if options["kind"] == "servo" else records.bridged(log))


def diagnose(options: dict[str, Any], log: Bunch, second: Bunch | None, folder: Path) -> GapFinder:
    """Run the finder on a log, write the report, print the result, and record both; recording comes last.

    `second` is another record of the axis, which is not used for the fit.
    """
    from whsklearn.gap import GapFinder
    from whsklearn.gap.finder import STEPS
    from whsklearn.gap.standard_errors import with_drive_error

    record, columns = as_record(options, log)
    record = [record, *map(partial(another, options, log), options["more"])] if options["more"] else record
    if options["kind"] == "servo" and not options["robot"]:
        records.note_slips(log, options)
    if options["more"] and "LOG018" in log.report.codes:  # the position is an integral, which begins at zero in each
        text = "The angle begins at zero in each log, so that waves over it do not add up; "
        text += "diagnose each log alone as well."
        records.note(text)
        log.notes = (*log.notes, text)
    tracker = tracker_for("close_gap", options["track"], data=Path(options["log_file"]).stem)
    with tracker.run(f"gap of {Path(options['log_file']).name}") as parent:
        settings = {k: options[k] for k in ("law", "orders", "direct", "max_effects", "tolerance", "alpha")}
        finder = GapFinder(model_of(options), **settings, random_state=options["seed"])
        with progress_bar(total=len(STEPS)) as bar:

            def progress(step: str) -> None:
                bar.set_description(step)
                bar.update(1)

            finder.set_params(progress=progress).fit(record, **columns)
        with_drive_error(finder.diagnosis_, log.drive_error)
        d = finder.diagnosis_
        d.rows = log.get("rows", {})
        d.file, d.units = log.name, dict(log.units) | d.units
        d.origin, d.notes = records.origin(log), [*log.notes, *d.notes]
        tested = test(options, finder, second) if second is not None and d.verdict != "data_problem" else ""
        for problem in d.problems if options["robot"] else []:
            if not problem.fatal:
                records.note(problem.explanation)
        click.echo(wrapped(f"{d.verdict}: {d.sentence}"))
        if d.verdict not in ("no_gap", "data_problem"):
            records.say_clipped(log, limited=any(e.name == "saturation" for e in d.effects))
        if tested:
            click.echo(wrapped(tested))
        with records.warnings_as_notes():
            page = finder.report(folder)
        if options["robot"]:
            from whsklearn.cli.arm import keep_gains

            keep_gains(folder, log)
        if d.interrupted:
            click.echo("Interrupted: the report holds the rounds that were finished.")
        click.echo(f"Report: {page}")
        parent.log_params(opt.given(options))
        parent.log_input(log.X, log.y, Path(options["log_file"]).stem)
        track(parent, finder, folder)
    say_where(tracker)
    return finder


def another(options: dict[str, Any], first: Bunch, file: str) -> Any:
    """A further log of the axis, with the columns of the first."""
    log = used_of(options, read_log(options, file))
    records.refuse_shared(first, log, records.TWICE)
    first.notes = (*first.notes, f"{log.name} is used too: {log.y.size} samples at {log.sample_rate:.6g} Hz.")
    return as_record(options, log)[0]


def test(options: dict[str, Any], finder: GapFinder, second: Bunch) -> str:
    """Simulate the repaired model on a second record; put the result into the diagnosis and return its sentence."""
    from whsklearn.gap.proof import on_second_record

    record, columns = as_record(options, second)
    d = finder.diagnosis_
    try:
        d.test = on_second_record(finder, record, **columns)
    except ValueError as error:
        text = f"The result was not tested on {second.name}: {error}"
    else:
        unit = d.pictures["units"][1]
        told = ", ".join(f"{r['before']:.3g} to {r['after']:.3g} {unit} over {r['horizon']:g} s" for r in d.test)
        text = f"On {second.name}, which was not used for the fit, the RMSE of the free run goes from {told}."
        if all(r["after"] > r["before"] for r in d.test):
            text += " The repaired model is worse there: the named effect is not in it, or has another size in it."
    d.notes.insert(0, text)
    return text


def read_log(options: dict[str, Any], second: str | None = None) -> Bunch:
    """Read the columns that the options name, or recognised by name; from a ``second`` log those that it has."""
    from whsklearn.logs import open_source
    from whsklearn.logs.errors import ColumnError
    from whsklearn.logs.roles import by_number
    from whsklearn.logs.units import of_an_axis, stated

    servo = options["kind"] == "servo"
    if servo:
        of_an_axis(stated(records.units_of(options["units"])))
    source = open_source(second or options["log_file"])
    if options["columns"]:
        given: dict[str, str | None] = {**by_number(options["columns"], chain=not servo)}
        if servo and "time" not in given and options["rate"] is None and not _own_clock(source):
            raise ColumnError(
                f"--columns {options['columns']} names no time; add --rate HZ, or give three columns, the time first."
            )
    elif servo:
        given = {r: options[r] for r in ("drive", "position", "velocity", "reference", "command")}
        given["time"] = options["time_column"]
    else:
        given = {"drive": options["input_column"], "position": options["output_column"], "time": options["time_column"]}
    if second:  # it may have other units and therefore other names
        given = {r: c if c in source.names else None for r, c in given.items()}
    needed = [r for r in ("drive", "position") if servo]
    if given.get("command"):
        needed.remove("drive")
    if given.get("velocity") and not given.get("position"):
        needed.remove("position")
    if servo and options["rate"] is None and not options["columns"] and source.header and not _own_clock(source):
        needed.append("time")
    return records.read(source, options, **records.roles_of(source, given, tuple(needed), USUAL, options))


def _own_clock(source: Any) -> bool:
    """Whether the file contains time stamps or a rate, so that no time column is needed."""
    return (
        source.clocked
        or source.sample_rate
        or Path(source.name).suffix.lower() in (".mcap", ".bag", ".mf4", ".mdf", ".tdms", "")
    )


def as_record(options: dict[str, Any], log: Bunch) -> tuple[Any, dict[str, Any]]:
    """The log in the form that this kind of model takes (SI for an axis), and the names of its columns."""
    from whsklearn.gap.plants.from_log import taken_from

    record, columns = taken_from(log, "arm" if options["robot"] else options["kind"])
    if said := getattr(record, "in_place_of_drive", ""):
        records.note(said)
    return record, columns


def model_of(options: dict[str, Any]) -> Any:
    """The base model that the options name."""
    if options["robot"]:
        from whsklearn.cli.arm import base_of

        return base_of(options)
    if options["simulator"] is None:
        return options["kind"]
    from whsklearn import simulators

    path = Path(options["simulator"])
    if path.suffix.lower() == ".fmu":
        return simulators.FMUSimulator(path)
    if not options["joint"]:
        raise ValueError("--simulator needs --joint, the name of the joint that was logged.")
    return simulators.MuJoCoSimulator(path, joint=options["joint"], actuator=options["actuator"])


def data_problem(error: LogError, folder: Path) -> None:
    """Write a report that says why the log cannot be used."""
    from whsklearn.gap.data_check import DataProblem
    from whsklearn.gap.finder import data_problem as unusable
    from whsklearn.gap.report import write_report
    from whsklearn.logs.files import utf8

    write_report(unusable([DataProblem("data-unreadable", "The log cannot be used", utf8(str(error)))]), folder)


def track(parent: Any, finder: GapFinder, folder: Path) -> None:
    """Record the metrics before and after in the parent run, each round in a child run, and the report."""
    d = finder.diagnosis_
    parent.log_tags({"verdict": d.verdict, "effects": ", ".join(e.label for e in d.effects)})
    for step, values in enumerate((d.before, d.after)):
        parent.log_metrics({k: v for k, v in values.items() if k in ("nmse", "mu_e", "rmse")}, step=step)
    if d.rounds:
        parent.log_metrics({"missing_share": float(d.rounds[0].get("gap_share", 0.0))})
    parent.log_metrics({"closure": d.closure, "noise_floor_rmse": d.floor, "seconds": d.seconds})
    for r in d.rounds:
        with parent.child(f"round {r['number']}: {r['taken']}") as child:
            child.log_metrics({"gap": r["gap"], "delta_bic": r["delta_bic"], "tried": float(r["tried"])})
    for name in ("gap.html", "gap.json", "repaired.json", "repaired.xml"):
        if (folder / name).exists():
            parent.log_artifact(folder / name)
