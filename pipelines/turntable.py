"""The Wiener-Hammerstein reading of a turntable (section 5.2): reference to position, drive to velocity.

Identifies the simulated rig, a measured axis or your own log with MILS and RMILS in both readings, prints
Table 2's indices, draws Fig. 5 and Fig. 6, and says what the excitation cannot show.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from pipelines._linear import BestLinear, verdict
from pipelines._rigs import Task, tasks_of
from whsklearn import WienerHammersteinLags
from whsklearn.cli.comparison import ComparedModel, Outcome, by_name, candidates, compare, results_table
from whsklearn.cli.job import job, say_where, tracker_for, wrapped
from whsklearn.cli.options import ORDERS, given, lags_of
from whsklearn.plot import ConvergenceDisplay, TrackingDisplay
from whsklearn.tracking import Run
from whsklearn.validation import excitation

# Section 5.2's theta(0) and P(0), for the orders and the law that it has.
THETA_0 = [0.04, 0.06, 0.044, 0.0058, 0.001, 0.036, 0.001, 0.11, 0.01]
P_0 = 1e6
UNSEEN = 1e-3  # singular values this far below the largest are lost in the noise of an encoder
TABLE_2 = "The article's own record and indices (Table 2): MILS 2.37e-3, RMILS 3.81e-4."


@job
@click.option("--rig", type=click.Choice(["simulated", "emps", "kr300"]), default="simulated", help="Which axis.")
@click.option("--experiment", type=click.Choice(["sine", "multisine"]), default="sine", help="Of the simulated rig.")
@click.option("--data", type=click.Path(file_okay=False), help="Folder of the measured records; else WHSKLEARN_DATA.")
@click.option("--log", "log_file", type=click.Path(exists=True, dir_okay=False), help="A log of yours.")
@click.option("--time", "time_column", help="Column of time stamps in the log.")
@click.option("--reference", help="Column of the reference in the log.")
@click.option("--drive", help="Column of the drive in the log.")
@click.option("--position", help="Column of the position in the log.")
@click.option("--innovation", "p", type=click.IntRange(min=1), default=4, help="Innovation length p.")
@click.option("--orders", type=ORDERS, default="2,2,2,2", help="Orders of the blocks.")
@click.option("--law", default=None, help="Friction law, names joined by commas; the law (4) if omitted.")
@click.option("--batch", is_flag=True, help="Compare the batch fit too, which takes half a minute.")
@click.option("--figures", type=click.Path(file_okay=False), help="Folder to write the figures to as well.")
def main(**options: Any) -> None:
    """Identify a turntable as a Wiener-Hammerstein system and compare MILS and RMILS in both readings."""
    lags = lags_of(options["orders"], options["law"])
    tasks = tasks_of(options)
    start = {"P0": P_0, "theta0": THETA_0 if lags.n_parameters == len(THETA_0) else 0.01}
    tracker = tracker_for("turntable", options["track"], data=tasks[0].train.name)
    best: tuple[Outcome, Task] | None = None
    with tracker.run(f"turntable {tasks[0].train.name}") as parent:
        parent.log_params(given(options))
        for task in tasks:
            names = ("MILS", "RMILS", "PEM") if options["batch"] else ("MILS", "RMILS")
            every = candidates(lags, p=options["p"], seed=options["seed"], published=start)
            found = [c for c in every if c.name in names]
            found.append(ComparedModel("best ARX or OE", BestLinear(), "linear", stream=False))
            with parent.child(task.title, tags={"data": task.train.name}) as run:
                outcomes = compared(task, found, lags, run, options["figures"])
            leader = min(by_name(outcomes, name="RMILS").values(), key=lambda o: o.indices["nmse"], default=None)
            if leader and (best is None or leader.indices["nmse"] < best[0].indices["nmse"]):
                best = leader, task
        if best:
            parent.log_metrics(best[0].indices)
            parent.log_model(best[0].fitted, best[1].train.X, registered_name="turntable", alias="champion")
    if best and options["track"]:
        click.echo(f"\nThe better RMILS model, {best[1].title}, is models:/turntable@champion.")
    say_where(tracker)


def compared(task: Task, found: list[ComparedModel], lags: Any, run: Run, folder: str | None) -> list[Outcome]:
    """Compare the candidates on one task, print, draw, and check the excitation."""
    outcomes = compare(found, task.train, task.test, parent=run, skip=task.skip)
    text = results_table(outcomes, f"{task.title}, free run on {', '.join(r.name for r in task.test)}")
    if task.title == "reference to position" and task.train.name.startswith("rig"):
        text += f"\n{TABLE_2}"
    advice = excitation_advice(task, lags, outcomes)
    text = f"{text}\n\n{verdict(outcomes)}\n{wrapped(advice)}"
    click.echo(f"\n{text}")
    run.log_text(text, "table.txt")
    run.log_tags({"excitation": advice})
    draw(task, outcomes, run, folder)
    return outcomes


def excitation_advice(task: Task, lags: WienerHammersteinLags, outcomes: list[Outcome]) -> str:
    """Which parameters the record cannot show, by the regressors of the best model."""
    known = [o for o in outcomes if hasattr(o.fitted, "theta_")]
    if not known:
        return "Excitation: not known, no model could be fitted."
    best = min(known, key=lambda o: o.indices["nmse"])
    rows = WienerHammersteinLags(**{**lags.get_params(), "theta": best.fitted.theta_}).fit(task.train.X)
    phi = rows.fit_transform(task.train.X, task.train.y)
    names = [str(n) for n in rows.get_feature_names_out()]
    result = excitation(phi, names, tolerance=UNSEEN)
    if result.advice:
        return f"Excitation: {result.advice}"
    return f"Excitation: all {result.n_params} directions are seen, condition {result.condition:.2g}."


def draw(task: Task, outcomes: list[Outcome], run: Run, folder: str | None) -> None:
    """Fig. 5, a figure a reading, and Fig. 6."""
    import matplotlib.pyplot as plt

    chosen = by_name(outcomes)
    record = task.test[0]
    shown = {k: o.predictions[0] for k, o in chosen.items() if not k.startswith("MILS")}
    window = slice(task.skip, None)
    displays: dict[str, Any] = {
        "fig6_tracking": TrackingDisplay(record.y, shown, output=task.output, window=window, skip=task.skip).plot()
    }
    for reading in ("pseudolinear", "full"):
        paths = {k: o.paths for k, o in by_name(outcomes, reading=reading).items() if o.paths}
        if paths:
            displays[f"fig5_{reading}"] = ConvergenceDisplay(paths).plot()
    for name, display in displays.items():
        run.log_figure(display.figure_, f"{name}.png")
        if folder:
            Path(folder).mkdir(parents=True, exist_ok=True)
            display.figure_.savefig(Path(folder) / f"{task.title.replace(' ', '_')}_{name}.png", dpi=100)
        plt.close(display.figure_)


if __name__ == "__main__":
    main()
