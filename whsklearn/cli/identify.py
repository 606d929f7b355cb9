"""Which structure does a log ask for?  Linear, Wiener-Hammerstein, or an axis as physics.

Fits all of them, compares their free runs on held-out windows, says which one to use and why, and
writes identify.json, model.json and a page with Bode, poles, characteristic and overlay.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from tqdm import tqdm

from whsklearn.cli.job import job, say_where, table, tracker_for, wrapped, writable_folder
from whsklearn.cli.records import longest, read, reading_options

if TYPE_CHECKING:
    from sklearn.utils import Bunch

    from whsklearn.identification import Identification


@job
@click.argument("train", metavar="TRAIN", type=click.Path(exists=True))
@click.option("--input", "input_column", help="Column that drives.")
@click.option("--output", "output_column", help="Column that answers.")
@click.option("--time", "time_column", help="Column of time stamps; without it (or --rate) a sample is 1 s.")
@reading_options
@click.option("--test", type=click.Path(exists=True), help="Another log to report on.")
@click.option("--skip", type=click.IntRange(min=0), default=0, help="First samples of the test that do not count.")
@click.option(
    "--logged",
    type=click.Choice(["auto", "output", "velocity", "position"]),
    default="auto",
    help="What the output is; a position is fitted by its velocity.",
)
@click.option("--out", default="model", type=click.Path(file_okay=False), help="Folder for what is found.")
def main(**options: Any) -> None:
    """Find the model that the log TRAIN asks for: linear, Wiener-Hammerstein or physics.

    \b
    whsklearn identify axis.csv --input torque_nm --output position_rad --time time_s --out model
    """  # noqa: D301 - click reads the backspace
    from whsklearn.identification import identify
    from whsklearn.identification.report import write

    train = log_of(options["train"], options)
    test = log_of(options["test"], options) if options["test"] else None
    writable_folder(options["out"])
    name = Path(options["train"]).stem
    timed = options["time_column"] or options["rate"]
    tracker = tracker_for("identify", options["track"], data=name)
    with tqdm(desc="fitting", unit="model") as bar:

        def progress(candidate: str) -> None:
            bar.set_postfix_str(candidate)
            bar.update()

        found = identify(
            train.X[:, 0],
            train.y,
            dt=1.0 / train.sample_rate if timed else 1.0,
            test=None if test is None else (test.X[:, 0], test.y),
            skip=options["skip"],
            logged=options["logged"],
            units={"input": train.units["drive"], "output": train.units["position"]},
            progress=progress,
        )
    page = write(found, options["out"])
    click.echo(f"\n{comparison(found)}\n\n{wrapped(found.reason)}\n\n{numbers(found)}\n\nThe page is {page}.")
    with tracker.run(f"identify {name}") as run:
        run.log_params({k: v for k, v in options.items() if v not in (None, (), False)})
        run.log_tags({"recommended": found.recommended.name})
        run.log_metrics(found.recommended.test)
        run.log_text(comparison(found), "table.txt")
    say_where(tracker)


def log_of(path: str, options: dict[str, Any]) -> Bunch:
    """The columns of a log; its longest segment if it has gaps."""
    from whsklearn.logs.errors import ColumnError
    from whsklearn.logs.roles import by_number

    if options["columns"]:
        columns: dict[str, Any] = by_number(options["columns"], chain=True)
    elif options["input_column"] and options["output_column"]:
        columns = {"drive": options["input_column"], "position": options["output_column"]}
        columns |= {"time": options["time_column"]}
    else:
        raise ColumnError("Give --input and --output, the names of the columns that drive and that answer.")
    return longest(read(path, options, **columns))


def comparison(found: Identification) -> str:
    """Structures by rows, from the simplest on; the trivial one first."""
    rows: list[list[Any]] = [[found.trivial.name, 0, *found.trivial.windows.values(), None, None, None]]
    for c in found.models:
        windows = [c.windows.get(h) for h in found.trivial.windows]
        rows.append([c.name, c.size or None, *windows, c.test.get("nmse"), c.test.get("rmse"), c.seconds])
    lengths = [f"{h * found.train.dt:.3g} s" for h in found.trivial.windows]
    title = "Root mean square error over held-out windows, and of the free run on the test"
    return table(["structure", "numbers", *lengths, "NMSE", "RMSE", "CPU s"], rows, title=title)


def numbers(found: Identification) -> str:
    """Parameters of the recommended model with 95 % intervals."""
    from whsklearn.identification.report import parameters

    rows = []
    for p in parameters(found):
        value, error = p["value"], p["standard_error"]
        span = f"{value - 1.96 * error:.5g} to {value + 1.96 * error:.5g}" if error else "-"
        rows.append([p["name"], f"{value:.5g}", span, p["unit"]])
    return table(["parameter", "value", "95 % interval", "unit"], rows)
