"""Find the structure that fits a log: linear, Wiener-Hammerstein, or a physical axis.

Fits all of them, compares their free runs on held-out windows, recommends one with the reason, and writes
identify.json, model.json and a page with Bode, poles, characteristic and overlay.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import numpy as np

from whsklearn.cli import job as jobs
from whsklearn.cli import options as opt
from whsklearn.cli import records

if TYPE_CHECKING:
    from sklearn.utils import Bunch

    from whsklearn.identification import Identification
    from whsklearn.tracking import Run

INDICES = ("nmse", "rmse")
UNEVEN = 0.01  # relative difference allowed between the rates of two logs; a clock is a thousand times better


@partial(jobs.job, unused=("seed",))
@click.argument("train", metavar="TRAIN", type=opt.LOG)
@click.argument("more", metavar="[TRAIN ...]", nargs=-1, type=opt.LOG)
@opt.system_options
@opt.reading_options
@opt.robot_options
@click.option(
    "--law", help="Friction of every joint of an arm, and nothing else: viscous,coulomb is what MuJoCo and URDF hold."
)
@click.option("--test", type=opt.LOG, help="Another log to report on.")
@click.option("--skip", type=click.IntRange(min=0), default=0, help="Samples at the start of the test to ignore.")
@opt.logged_option
@click.option("--out", default="model", type=opt.FOLDER, help="Folder for the results.")
def main(**options: Any) -> None:
    """Find the model that describes the log TRAIN best: linear, Wiener-Hammerstein or physics.

    Several logs of one system make one identification: numbers are shared; each log has its own initial state, timing,
    and (on an axis) drive offset.

    \b
    whsklearn identify axis.csv --input torque_nm --output position_rad --time time_s --out model
    whsklearn identify monday.csv tuesday.csv --input torque_nm --output position_rad --out model
    whsklearn identify arm.csv --robot arm.urdf --joints "shoulder:q1,i1;elbow:q2,i2" --out model
    """  # noqa: D301 - click reads the backspace
    if options["robot"]:
        if options["more"]:
            raise click.UsageError("Several logs are supported for one input and one output only; of an arm give one.")
        from whsklearn.cli import arm

        arm.identify(options)
        return
    opt.refuse_without_robot(options)

    from whsklearn.identification.report import write
    from whsklearn.logs.roles import says

    paths = (options["train"], *options["more"])
    logs = [records.liveliest(records.read_system(path, options)) for path in paths]
    train = together(logs)
    test = records.liveliest(records.read_system(options["test"], options)) if options["test"] else None
    if test is not None:
        records.refuse_shared(train, test)
    jobs.writable_folder(options["out"])
    name = Path(options["train"]).stem
    for log in logs:
        if says(log.columns["drive"], "drive") and says(log.columns["position"], "position"):
            records.note_slips(log, options)
    tracker = jobs.tracker_for("identify", options["track"], data=name)
    whose = np.repeat(records.names_of(paths), [log.y.size for log in logs]) if len(logs) > 1 else None
    found = fitted(options, train, test, whose)
    if found.recommended.kind == "axis":  # other structures have no physical numbers
        records.note_assumed(train)
    say(found)
    for log in [] if found.white else logs:
        records.say_clipped(log)
    page = write(found, options["out"], [*map(records.origin, [*logs, *([test] if test else [])])])
    click.echo(f"The page is {page}.")
    with tracker.run(f"identify {name}") as run:
        run.log_params(opt.given(options))
        run.log_tags({"recommended": found.recommended.name})
        track(run, found, page.parent, train.columns["drive"])
    jobs.say_where(tracker)


def fitted(options: dict[str, Any], train: Bunch, test: Bunch | None, whose: Any) -> Identification:
    """The identification of the joined logs, of which ``whose`` names that of each sample, beside a progress bar."""
    from whsklearn.identification import identify

    with jobs.progress_bar(desc="fitting", unit="model") as bar:

        def progress(candidate: str) -> None:
            bar.set_postfix_str(candidate)
            bar.update()

        units = {"input": train.units["drive"], "output": train.units["position"], "time": train.units["time"]}
        found = identify(
            train.X[:, 0], train.y, dt=1.0 if units["time"] == "samples" else 1.0 / train.sample_rate, units=units,
            test=None if test is None else as_train(test, train), skip=options["skip"], logged=options["logged"],
            drive_error=train.drive_error, groups=train.groups, records=whose, progress=progress,
        )  # fmt: skip
    if test is not None and found.test.y.size < test.y.size:
        records.note(
            f"{found.test.y.size} of {test.y.size} samples of {test.name} are used: the other segments are too short "
            "to judge anything."
        )
    return found


def say(found: Identification) -> None:
    """Print the structures, the reason of the recommendation, its numbers, and what is doubtful about them."""
    from whsklearn.identification.report import on_intervals

    bad = jobs.worse_than_mean({found.recommended.name: found.recommended.test.get("nmse", 0.0)})
    click.echo(f"\n{comparison(found)}\n\n{jobs.wrapped(found.reason)}\n\n{numbers(found)}\n")
    for text in filter(None, (found.on_drive, bad)):
        click.echo(jobs.wrapped(text))
    if told := on_intervals(found):
        click.echo(f"{jobs.wrapped(told)}\n")


def track(run: Run, found: Identification, folder: Path, column: str) -> None:
    """Record the recommended model with its files, and a child run for each structure."""
    import pandas as pd

    from whsklearn.identification.report import MODEL_FILE
    from whsklearn.logs.units import UNKNOWN, unit_of

    run.log_metrics({**found.recommended.test, "size": float(found.recommended.size)})
    run.log_text(comparison(found), "table.txt")
    for name in ("identify.html", "identify.json", MODEL_FILE):
        run.log_artifact(folder / name)
    for c in found.models:
        tags = {"kind": c.kind, "recommended": c.name if c is found.recommended else "", "failure": c.failure}
        with run.child(c.name, tags=tags) as child:
            child.log_params({**c.structure, "criterion": c.criterion})
            child.log_metrics({**c.test, **{f"train_{k}": v for k, v in c.train.items()}})
            child.log_metrics({f"window_{n}": e for n, e in c.windows.items() if e == e})
            child.log_metrics({"size": float(c.size), "fit_seconds": c.seconds})
    unit = unit_of(column)
    named = column if unit in (UNKNOWN, found.model.units.get("input")) else "input"  # a current that became a torque
    run.log_file_model(folder / MODEL_FILE, pd.DataFrame({named: found.train.u}))


def together(logs: list[Bunch]) -> Bunch:
    """Join the logs into one with holes between them, in the units of the first.

    Raises LogError if rates or kinds of units differ, or two logs hold the same samples.
    """
    from whsklearn.logs.errors import LogError

    first = logs[0]
    signals = [(first.X[:, 0], first.y, first.groups)]
    for k, log in enumerate(logs[1:], 1):
        if (log.units["time"] == "samples") != (first.units["time"] == "samples"):
            raise LogError(f"Only one of {first.name} and {log.name} has a time; give --rate or --time for both.")
        if abs(log.sample_rate / first.sample_rate - 1.0) > UNEVEN:
            raise LogError(
                f"{first.name} has {first.sample_rate:.6g} samples a second and {log.name} {log.sample_rate:.6g}; "
                "resample them to one rate."
            )
        for other in logs[:k]:
            records.refuse_shared(other, log, records.TWICE)
        signals.append(as_train(log, first))
        records.note(f"{log.name} is used too: {log.y.size} samples.")
    if len(logs) == 1:
        return first
    segments = np.cumsum([0] + [int(groups.max()) + 1 for *_, groups in signals])
    u, y = (np.concatenate([signal[k] for signal in signals]) for k in (0, 1))
    groups = np.concatenate([g + begin for (*_, g), begin in zip(signals, segments, strict=False)])
    return type(first)(**{**first, "X": u[:, None], "y": y, "groups": groups})


def as_train(test: Bunch, train: Bunch) -> tuple[Any, Any, Any]:
    """Drive and output of a test log in the units of the first, and its segments."""
    from whsklearn.logs.errors import LogError
    from whsklearn.logs.units import factor_between

    out = []
    for role, signal in (("drive", test.X[:, 0]), ("position", test.y)):
        try:
            out.append(signal * factor_between(test.units[role], train.units[role]))
        except ValueError as error:
            raise LogError(f"The two logs differ in their {role}: {error}; give logs of one kind.") from None
    return out[0], out[1], test.groups


def comparison(found: Identification) -> str:
    """A table of the structures, from the simplest on; the trivial one comes first."""
    from whsklearn.identification.report import DIVERGED, error_of

    rows: list[list[Any]] = [[found.trivial.name, 0, *found.trivial.windows.values(), None, None, None]]
    for c in found.models:
        windows = [error_of(c.windows.get(h), trivial) for h, trivial in found.trivial.windows.items()]
        free = [error_of(c.test.get("nmse"))] * 2 if c.test.get("nmse", 0.0) > DIVERGED else [*map(c.test.get, INDICES)]
        rows.append([c.name, c.size or None, *windows, *free, c.seconds or None])
    unit = found.model.units.get("output", "")
    told = f" ({unit})" if unit else ""
    title = f"Root mean square error{told} over held-out windows, and of one free run on {found.judged_on}"
    text = jobs.table(["structure", "numbers", *found.window_names, "NMSE", "RMSE", "CPU s"], rows, title=title)
    return "\n".join([text, *(jobs.wrapped(f"{c.name}: {c.failure}") for c in found.models if c.failure)])


def numbers(found: Identification) -> str:
    """Parameters of the recommended model with 95 % intervals."""
    from whsklearn.identification.report import parameters, spelled

    rows = [[p["name"], *spelled(p["value"], p["standard_error"]), p["unit"]] for p in parameters(found)]
    return jobs.table(["parameter", "value", "95 % interval", "unit"], rows)
