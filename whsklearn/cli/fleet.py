"""Identify every axis of a fleet: one model per axis, one table for all, the outliers in MLflow."""

from __future__ import annotations

import contextlib
import io
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from whsklearn.cli import job as jobs
from whsklearn.cli.options import NEW_FILE, build_model, chosen_of, model_options

if TYPE_CHECKING:
    from whsklearn.cli.fleet_axis import Row
    from whsklearn.tracking import Run

Work = Callable[[list[str]], "list[Row]"]  # identifies axes by their names
MOST_CHILDREN = 50  # of each kind
EVERY_SECONDS = 30.0  # between two writes of the finished rows
SHOWN = 10


@jobs.job
@click.argument("folder", type=click.Path(exists=True, file_okay=False, path_type=Path))
@click.option("--axis", default="axis", help="Partition key: the folder holds AXIS=NAME/*.parquet.")
@click.option("--input", "inputs", multiple=True, default=["u"], help="Input column; repeat for several.")
@click.option("--output", default="y", help="Output column.")
@click.option("--time", "time_column", help="Time column; rows are sorted by it.")
@model_options
@click.option(
    "--test-share", type=click.FloatRange(0, 0.9), default=0.25, help="Share held out as a test at the end of a log."
)
@click.option("--in-process", is_flag=True, help="Use this machine's cores through joblib, without a cluster.")
@click.option("--scheduler", help="Address of a Dask scheduler; a local cluster if omitted.")
@click.option("--workers", type=click.IntRange(1), default=2, help="Worker processes on this machine.")
@click.option("--batch", type=click.IntRange(1), default=10, help="Axes per task.")
@click.option("--out", type=NEW_FILE, default="fleet.parquet", help="Table to write.")
def main(**options: Any) -> None:
    """Identify every axis of FOLDER, a Parquet folder partitioned by axis, and write one table of all.

    A drive and a position, by the names or units of the columns, are those of a servo axis, whose inertia and friction
    are found by inverse dynamics; other columns are those of a chain.

    If it is stopped, the finished axes are kept in OUT.part, and the same command resumes from there. The exit status
    is 3 if axes failed; the table of all axes is written first.

    Example: whsklearn fleet logs/ --input torque_nm --output position_rad --time time_s --out fleet.parquet
    """
    from whsklearn.cli.fleet_axis import axes_of, identify_axes, outliers
    from whsklearn.tracking import estimator_params

    folder, axis, out, batch = (options[k] for k in ("folder", "axis", "out", "batch"))
    test_share, workers = options["test_share"], options["workers"]
    jobs.writable_file(out, *folder.rglob("*.parquet"))
    names = axes_of(folder, axis)
    model = model_of(options)
    source = {"folder": str(folder.resolve()), "axis": axis, "inputs": list(options["inputs"])}
    source |= {k: options[k] for k in ("output", "time_column")}
    began = time.perf_counter()
    kept = Kept(out, f"{model!r} {source} {test_share!r}", folder, axis)
    rows = kept.rows(names)
    if rows:
        click.echo(f"Resuming: {len(rows)} of {len(names)} axes are finished in {kept.path}.", err=True)
    todo = sorted(set(names) - {row["axis"] for row in rows})
    batches = [todo[i : i + batch] for i in range(0, len(todo), batch)]
    with jobs.progress_bar(total=len(names), initial=len(rows), unit="axis", desc="fleet") as bar, kept:
        work = partial(identify_axes, model, source=source, test_share=test_share)
        spread = run_here if options["in_process"] else partial(run_on_cluster, scheduler=options["scheduler"])
        for done in spread(work, batches, workers) if batches else ():
            rows += done
            kept.add(done)
            bar.update(len(done))
    seconds = time.perf_counter() - began
    found = to_table(rows, names)
    write_table(found, out)
    kept.path.unlink(missing_ok=True)
    apart, failed = outliers(found), found[found["failure"] != ""]
    click.echo(summary(found, apart, failed, out, seconds))
    tracker = jobs.tracker_for("fleet", options["track"])
    with tracker.run(folder.name) as run:
        run.log_params(estimator_params(model) | {"axes": len(found), "workers": workers})
        record(run, found, apart, failed, out, seconds)
    jobs.say_where(tracker)
    if len(failed):
        raise SystemExit(jobs.UNUSABLE)


def model_of(options: dict[str, Any]) -> Any:
    """The estimator that is cloned for every axis: of a servo axis, if the columns are its drive and position."""
    from whsklearn.cli.stream import axis_model, of_an_axis
    from whsklearn.logs.units import UNSTATED, unit_of

    chosen = chosen_of(options)
    if not of_an_axis(options, chosen):
        return build_model(options)
    drive, position = options["inputs"][0], options["output"]
    if options["time_column"] is None:
        raise click.UsageError(
            f"{drive} and {position} are the drive and the position of an axis; give --time, or --orders for a chain."
        )
    units = [u for u in (unit_of(drive), unit_of(position)) if u not in UNSTATED]
    text = f"with numbers in {' and '.join(units)}" if len(units) == 2 else "with numbers in the columns' units"
    click.echo(f"{drive} and {position} are those of servo axes, {text}; --orders takes them for chains.", err=True)
    # averages away from standstill, as of a stream: with all rows, numbers depend on how often an axis sticks
    return axis_model(options, chosen, rate=1.0)


def run_here(work: Work, batches: list[list[str]], workers: int) -> Iterator[list[Row]]:
    """Results of each batch as they are ready, from this machine's cores."""
    from joblib import Parallel, delayed

    yield from Parallel(n_jobs=workers, return_as="generator_unordered")(delayed(work)(names) for names in batches)


def run_on_cluster(work: Work, batches: list[list[str]], workers: int, scheduler: str | None) -> Iterator[list[Row]]:
    """Results of each batch as they are ready, from a Dask cluster; the work of a lost worker is repeated."""
    settings = {"distributed.scheduler.allowed-failures": 20, "distributed.worker.daemon": False}
    with jobs.dask_client(scheduler, workers, settings) as client:
        from distributed import as_completed

        for future in as_completed(client.map(work, batches, pure=False, retries=3)):
            yield future.result()
            future.release()


def to_table(rows: list[Row], names: list[str]) -> Any:
    """One row per axis, in the order of names, in whatever order they were finished."""
    import pandas as pd

    found = pd.DataFrame(rows).drop(columns="digest", errors="ignore").drop_duplicates("axis").set_index("axis")
    lost = sorted(set(names) - set(found.index))
    if lost:
        raise ValueError(f"{len(lost)} axes returned no result, the first is {lost[0]}; run the command again.")
    first = ["rows", "failure", "seconds", "nmse", "mu_e", "rmse"]
    found = found.reindex(columns=[*first, *[c for c in found.columns if c not in first]])
    return found.loc[names].reset_index()


def record(run: Run, found: Any, apart: Any, failed: Any, out: Path, seconds: float) -> None:
    """Record the results of a fleet, with a child run for each outlier and each failed axis."""
    quantiles = found[["nmse", "rmse"]].astype(float).quantile([0.5, 0.95])
    metrics = {f"{c}_{round(100 * q)}": quantiles.at[q, c] for q in (0.5, 0.95) for c in ("nmse", "rmse")}
    counts = {"failed": float(len(failed)), "outliers": float(len(apart)), "seconds": seconds}
    run.log_metrics({k: float(v) for k, v in metrics.items() if v == v} | counts)
    run.log_artifact(out)
    for status, rows in (("outlier", apart), ("failed", failed.assign(why=failed["failure"]))):
        for _, row in rows.head(MOST_CHILDREN).iterrows():
            tags = {"axis": str(row["axis"]), "status": status, "why": row["why"]}
            with run.child(f"axis {row['axis']}", tags=tags) as child:
                values = row.drop(["axis", "failure", "why"]).astype(float)
                child.log_metrics({k: float(v) for k, v in values.items() if v == v})


def summary(found: Any, apart: Any, failed: Any, out: Path, seconds: float) -> str:
    """The summary for the terminal: outliers first, then failures by reason."""
    text = (
        f"{len(found)} axes, {int(found['rows'].sum())} rows in {seconds:.1f} s "
        f"({1e3 * found['seconds'].sum() / len(found):.1f} ms of work per axis); {len(apart)} "
        f"outlier{'s' * (len(apart) != 1)}, {len(failed)} failed; table in {out}."
    )
    lines = [jobs.wrapped(text)]
    bad = int((found["nmse"].astype(float) > 1.0).sum())
    if bad:
        lines.append(
            jobs.wrapped(f"{bad} have an NMSE above 1, worse than the mean of their output; their models are useless.")
        )
    if len(apart):
        lines += ["", "Outliers, worst first: distance from the median in robust standard deviations"]
        told = (f"{r['axis']}: NMSE {jobs.cell(r['nmse'])}; {r['why']}" for _, r in apart.head(SHOWN).iterrows())
        lines += map(jobs.entry, told)
        lines += _and_more(len(apart))
    if len(failed):
        reasons = failed.groupby("failure", sort=False)["axis"].apply(list)
        ordered = sorted(reasons.items(), key=lambda item: -len(item[1]))
        lines += ["", "Failed"]
        for reason, axes in ordered[:SHOWN]:
            who = ", ".join(axes[:SHOWN]) + (f" and {len(axes) - SHOWN} more" if len(axes) > SHOWN else "")
            lines.append(jobs.entry(f"{who}: {reason}"))
        lines += _and_more(len(ordered))
    return "\n".join(lines)


def _and_more(count: int) -> list[str]:
    return [f"  ... and {count - SHOWN} more; see the table."] if count > SHOWN else []


# --- finished axes, saved while the others are computed: stopping the command loses at most one batch -----------------
def write_table(found: Any, out: Path) -> None:
    """Write a table as Parquet, atomically."""
    from whsklearn.logs.files import atomic_write

    buffer = io.BytesIO()
    found.to_parquet(buffer, index=False)
    atomic_write(out, buffer.getvalue())


class Kept(contextlib.AbstractContextManager["Kept"]):
    """The finished rows of a fleet in ``OUT.part``, next to the table to be written, and in the same format.

    A row is reused if the settings (model, columns, share of the test) and the files of its axis have not changed.

    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as made:
    ...     kept = Kept(Path(made, "fleet.parquet"), "rls", Path(made), "axis")
    ...     print(kept.path.name, kept.rows(["one"]))
    fleet.parquet.part []
    """

    def __init__(self, out: Path, settings: str, folder: Path, axis: str):
        self.path = out.with_name(f"{out.name}.part")
        self._settings, self._folder, self._axis = settings, folder, axis
        self._done: list[Row] = []
        self._written, self._due = 0, time.monotonic() + EVERY_SECONDS

    def rows(self, names: list[str]) -> list[Row]:
        """Rows of an earlier start that are still valid."""
        import pandas as pd
        import pyarrow as pa

        from whsklearn.cli.fleet_axis import digest_of

        try:
            frame = pd.read_parquet(self.path)
            same = frame[(frame["settings"] == self._settings) & frame["axis"].isin(names)]
        except (OSError, KeyError, pa.ArrowException):  # there is none, or it is not ours
            return []
        digests = [digest_of(self._folder, self._axis, n) for n in same["axis"]]
        found = same[same["digest"] == digests].drop(columns="settings")
        # a column that an axis does not have is missing in its row, and NaN in the table
        self._done = [{k: v for k, v in row.items() if v == v} for row in found.to_dict("records")]
        self._written = len(self._done)
        return list(self._done)

    def add(self, rows: list[Row]) -> None:
        """Add finished rows; they are written every half minute and at the end."""
        self._done += rows
        if time.monotonic() > self._due:
            self.write()

    def write(self) -> None:
        """Write all rows so far."""
        import pandas as pd

        write_table(pd.DataFrame(self._done).assign(settings=self._settings), self.path)
        self._written, self._due = len(self._done), time.monotonic() + EVERY_SECONDS

    def __exit__(self, kind: Any, error: Any, trace: Any) -> None:
        if kind is None:
            return
        if len(self._done) > self._written:
            self.write()
        count = len(self._done)
        if count:
            what = "1 axis is" if count == 1 else f"{count} axes are"
            click.echo(f"{what} kept in {self.path}; the same command resumes from there.", err=True)
        elif issubclass(kind, KeyboardInterrupt):
            click.echo("Stopped before the first axes were finished: nothing is kept.", err=True)
