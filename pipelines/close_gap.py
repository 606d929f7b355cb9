"""Close the gap: find what a model lacks against a log, name it, add it, and prove that the gap has closed.

Writes ``gap.html`` (for a person), ``gap.json`` (for programs) and ``repaired.json`` (the model with what was
missing) into the report folder and records the diagnosis in MLflow: a parent run, and a child run for every round.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click
import pandas as pd
from tqdm import tqdm

from pipelines._cli import job, say_where, tracker_for, wrapped
from whsklearn.gap import GapFinder
from whsklearn.gap.finder import STEPS


@job
@click.argument("log_file", metavar="LOG.csv", type=click.Path(exists=True, dir_okay=False))
@click.option(
    "--model",
    "kind",
    type=click.Choice(["servo", "wiener-hammerstein"]),
    default="servo",
    help="Kind of the base model.",
)
@click.option("--time", "time_column", default="time_s", help="Column of the time in s, or in ms as time_ms (servo).")
@click.option("--reference", default=None, help="Column of the reference (servo); may be left out.")
@click.option("--drive", default="torque_nm", help="Column of the drive: torque or force (servo).")
@click.option(
    "--position",
    default="position_rad",
    help="Column of the measured position in rad; the ending _deg, _m or _mm tells another unit (servo).",
)
@click.option("--input", "input_column", default="u", help="Column of the input (Wiener-Hammerstein).")
@click.option("--output", "output_column", default="y", help="Column of the output (Wiener-Hammerstein).")
@click.option(
    "--law", default=None, help="Friction terms of the base model, joined by commas, such as viscous,coulomb."
)
@click.option("--tolerance", type=float, default=0.002, help="Smallest effect worth a name, share of the rms drive.")
@click.option("--max-effects", type=click.IntRange(min=1, max=5), default=3, help="Effects added at the most.")
@click.option("--report", "report", type=click.Path(file_okay=False), default="gap", help="Folder for the report.")
def main(**options: Any) -> None:
    """Find, name and close the gap between a model and LOG.csv."""
    frame = read_frame(options["log_file"])
    tracker = tracker_for("close_gap", options["track"], data=Path(options["log_file"]).stem)
    with tracker.run(f"gap of {Path(options['log_file']).name}") as parent, tqdm(total=len(STEPS), leave=False) as bar:
        parent.log_params({k: v for k, v in options.items() if v not in (None, (), False)})

        def progress(step: str) -> None:
            bar.set_description(step)
            bar.update(1)

        finder = GapFinder(
            options["kind"],
            law=options["law"],
            max_effects=options["max_effects"],
            tolerance=options["tolerance"],
            random_state=options["seed"],
            progress=progress,
        )
        finder.fit(frame, **columns_of(options))
        page = finder.report(options["report"])
        record(parent, finder, Path(options["report"]))
    d = finder.diagnosis_
    click.echo(wrapped(f"{d.verdict}: {d.sentence}"))
    if d.interrupted:
        click.echo("Interrupted: the report holds the rounds that were finished.")
    click.echo(f"Report: {page}")
    say_where(tracker)


def read_frame(path: str) -> pd.DataFrame:
    """The log as a frame; comma, semicolon or tab."""
    try:
        frame = pd.read_csv(path, sep=None, engine="python") if Path(path).stat().st_size < 2000 else pd.read_csv(path)
        if frame.shape[1] == 1:
            frame = pd.read_csv(path, sep=None, engine="python")
    except (pd.errors.EmptyDataError, pd.errors.ParserError, UnicodeDecodeError) as error:
        raise ValueError(f"{path} is no table of numbers with a header row ({error}); export the log as CSV.") from None
    if frame.empty:
        raise ValueError(f"{path} has a header and no samples; export the log again.")
    return frame


def columns_of(options: dict[str, Any]) -> dict[str, str | None]:
    """Which columns the kind of model takes."""
    if options["kind"] == "servo":
        return {
            "time": options["time_column"],
            "drive": options["drive"],
            "position": options["position"],
            "reference": options["reference"],
        }
    return {"input": options["input_column"], "output": options["output_column"]}


def record(parent: Any, finder: GapFinder, folder: Path) -> None:
    """The parent run's metrics before and after, a child run for each round, and the report."""
    d = finder.diagnosis_
    parent.log_tags({"verdict": d.verdict, "effects": ", ".join(e.name for e in d.effects)})
    for step, values in enumerate((d.before, d.after)):
        parent.log_metrics({k: v for k, v in values.items() if k in ("nmse", "mu_e", "rmse")}, step=step)
    parent.log_metrics({"closure": d.closure, "noise_floor_rmse": d.floor, "seconds": d.seconds})
    for r in d.rounds:
        with parent.child(f"round {r['number']}: {r['taken']}") as child:
            child.log_metrics({"gap": r["gap"], "delta_bic": r["delta_bic"], "tried": float(r["tried"])})
    for name in ("gap.html", "gap.json", "repaired.json"):
        if hasattr(parent, "log_artifact") and (folder / name).exists():
            parent.log_artifact(folder / name)


if __name__ == "__main__":
    main()
