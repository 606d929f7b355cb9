"""Run a model file with the drive of a log, from the drive alone."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from whsklearn.cli.job import job, writable_file
from whsklearn.cli.records import longest, read, reading_options, roles_of


@job
@click.argument("model", metavar="MODEL.json", type=click.Path(exists=True, dir_okay=False))
@click.argument("log_file", metavar="LOG", type=click.Path(exists=True))
@click.option("--time", "time_column", help="Column of the time; by its name if left out.")
@click.option("--input", "input_column", help="Column of the drive; by its name if left out.")
@click.option("--output", "output_column", help="Column of the measured output, to compare with.")
@reading_options
@click.option("--skip", type=click.IntRange(min=0), default=0, help="Samples at the start not to judge.")
@click.option("--out", default="simulated.csv", type=click.Path(dir_okay=False), help="Table to write.")
def main(**options: Any) -> None:
    """Simulate MODEL.json with the drive of LOG and write time, drive, output and measurement.

    Example: whsklearn simulate model.json second.csv --output position_rad --out simulated.csv
    """
    import numpy as np
    import pandas as pd

    from whsklearn.logs import open_source
    from whsklearn.logs.roles import guess
    from whsklearn.metrics import nmse, rmse
    from whsklearn.models import load_model

    out = writable_file(options["out"])
    model = load_model(options["model"])
    given = {"time": options["time_column"], "drive": options["input_column"], "position": options["output_column"]}
    source = open_source(options["log_file"])
    if given["time"] is None and not options["rate"]:
        given["time"] = guess(source, "time")
    roles = roles_of(source, given, ("drive", "position"), {})
    log = longest(read(options["log_file"], options, **roles))
    if abs(1.0 / log.sample_rate / model.dt - 1.0) > 0.01 and log.units["time"] == "s" and model.dt != 1.0:
        raise ValueError(
            f"The model has a sample every {model.dt:.6g} s, the log every {1 / log.sample_rate:.6g} s; give a log at "
            "the model's rate."
        )
    start = float(log.y[0]) if model.logged == "position" else 0.0
    y = np.asarray(model.simulate(log.X[:, 0], start=start))
    table = pd.DataFrame({"time": log.time, "drive": log.X[:, 0], "simulated": y, "measured": log.y})
    table.to_csv(out, index=False)
    kept = slice(min(options["skip"], y.size - 2), None)
    unit = log.units["position"]
    unit = "" if unit == "as logged" else f" {unit}"
    click.echo(f"Free run: NMSE {nmse(log.y[kept], y[kept]):.3g}, RMSE {rmse(log.y[kept], y[kept]):.4g}{unit}.")
    click.echo(f"Written: {Path(out)}")


if __name__ == "__main__":
    main()
