"""Simulate a model file from the drive of a log alone."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import click
import numpy as np

from whsklearn.cli.job import WrongOption, job, worse_than_mean, wrapped, writable_file
from whsklearn.cli.options import FILE, LOG, NEW_FILE, joint_options, reading_options, system_options
from whsklearn.cli.records import note, read_system

TRIED = 17  # speeds, of which the middle is rest
SEEN = 1000  # samples at most that are simulated to find the first velocity


@partial(job, unused=("seed", "track"))
@click.argument("model", metavar="MODEL.json", type=FILE)
@click.argument("log_file", metavar="LOG", type=LOG)
@system_options
@reading_options
@joint_options
@click.option("--skip", type=click.IntRange(min=0), default=0, help="Samples at the start to ignore.")
@click.option("--out", default="simulated.csv", type=NEW_FILE, help="Table to write.")
def main(**options: Any) -> None:
    """Simulate MODEL.json with the drive of LOG and write time, drive, output and measurement, with their units.

    Example: whsklearn simulate model.json second.csv --output position_rad --out simulated.csv
    """
    import pandas as pd

    from whsklearn.logs.errors import LogError
    from whsklearn.logs.files import atomic_write
    from whsklearn.logs.units import UNSTATED
    from whsklearn.metrics import nmse, rmse
    from whsklearn.models import load_model

    out = writable_file(options["out"], options["model"], options["log_file"])
    model = load_model(options["model"])
    if model.kind == "arm":
        from whsklearn.cli import arm

        arm.simulate(options, model)
        return
    log = read_system(options["log_file"], options, model.logged)
    timed = log.units["time"] == model.units.get("time", "s" if model.dt != 1.0 else "samples") == "s"
    if timed and abs(1.0 / log.sample_rate / model.dt - 1.0) > 0.01:
        raise LogError(
            f"The model has a sample every {model.dt:.6g} s, the log every {1 / log.sample_rate:.6g} s; give a log at "
            "the model's rate."
        )
    drive, unit = note_unstated(log, model)
    by, far = model.column_factor("input", drive), model.column_factor("output", unit)
    if options["skip"] >= (longest := int(np.bincount(log.groups).max())) - 1:
        raise WrongOption(f"--skip is {options['skip']}, and the longest segment has {longest} samples; skip fewer.")
    y, kept = np.empty(log.y.size), np.zeros(log.y.size, dtype=bool)
    for segment in range(int(log.groups[-1]) + 1):  # each starts from the state of the log
        rows = np.flatnonzero(log.groups == segment)
        u, measured = by * log.X[rows, 0], far * log.y[rows]
        y[rows] = model.simulate(u, **state_of(model, u, measured)) / far
        kept[rows[min(options["skip"], rows.size - 1) :]] = True
    table = pd.DataFrame({"time": log.time, "drive": log.X[:, 0], "simulated": y, "measured": log.y})
    unit_of_each = {"time": log.units["time"], "drive": drive, "simulated": unit, "measured": unit}
    table.columns = [f"{n} [{u}]" if u not in UNSTATED else n for n, u in unit_of_each.items()]
    if log.groups[-1]:
        table["segment"] = log.groups
        note(f"The log has holes; each of its {log.groups[-1] + 1} segments is simulated from its own start.")
    atomic_write(out, table.to_csv(index=False).encode())
    drive, unit = (
        model.units.get(column, "") if u in UNSTATED else u for column, u in (("input", drive), ("output", unit))
    )
    told = [f"{names} in {u}" for names, u in (("drive", drive), ("simulated and measured", unit)) if u not in UNSTATED]
    unit = f" {unit}" if unit else ""
    still = bool(np.ptp(log.y[kept]) == 0.0)
    index = math.nan if still else nmse(log.y[kept], y[kept])
    share = "the measured output never changes, so it has no NMSE; " if still else f"NMSE {index:.3g}, "
    click.echo(f"Free run: {share}RMSE {rmse(log.y[kept], y[kept]):.4g}{unit}.")
    if bad := worse_than_mean({Path(options["model"]).name: index}):
        grows = (
            " Or its error only grew: without its loop an axis drifts, or gravity tips it, in a free run over a whole "
            "record. `whsklearn gap` restarts the run twice a second."
        )
        click.echo(wrapped(bad + (grows if model.kind == "axis" and model.logged == "position" else "")))
    click.echo(f"Written: {out}{': ' if told else ''}{', '.join(told)}")


def note_unstated(log: Any, model: Any) -> tuple[str, str]:
    """The units of drive and position in a log; a note on each that the log or the model does not state."""
    from whsklearn.logs.units import UNKNOWN, UNSTATED

    for column, role in (("input", "drive"), ("output", "position")):
        units = {log.units[role], model.units.get(column, UNKNOWN)}
        if units & UNSTATED:
            known = units - UNSTATED
            note(
                f"The unit of the {role} is not stated by {'the log' if known else 'log or model'}; it is taken for "
                f"{known.pop() if known else 'that of the model, SI'}."
            )
    return log.units["drive"], log.units["position"]


def state_of(model: Any, u: Any, measured: Any) -> dict[str, float]:
    """The state of a model at the start of a log: its position if it has one, and its velocity if it is an axis.

    ``u``, ``measured`` (n,): drive and output, in the units of the model.
    """
    first = float(measured[0])
    if model.logged != "position":
        return {"speed": first} if model.kind == "axis" else {}
    if model.kind != "axis":
        return {"start": first}

    def run(speed: float) -> Any:
        return model.simulate(u[:SEEN], start=first, speed=speed)

    return {"start": first, "speed": first_speed(measured[:SEEN], model.dt, run)}


def first_speed(position: Any, dt: float, run: Callable[[float], Any]) -> float:
    """The velocity at the start of a position (n,), sampled every ``dt`` s; 0 if its noise may have made it.

    ``run``: the model's position (m,) from such a velocity. The velocity is the one whose run is the closest: where a
    drive steps or friction turns, no polynomial tells an acceleration from a velocity.

    >>> import numpy as np
    >>> t = np.arange(300) / 100
    >>> round(first_speed(3.0 * t - t**2, 0.01, lambda v: v * t - t**2), 6)
    3.0
    >>> first_speed(np.random.default_rng(0).normal(size=300), 0.01, lambda v: v * t)
    0.0
    """
    from scipy.optimize import minimize_scalar

    from whsklearn.identification.view import window_of

    if len(position) < 7:
        return 0.0
    samples = window_of(len(position), dt)
    first, stride = np.asarray(position[:samples]), max(samples // 8, 1)

    def left(speed: float) -> float:
        with np.errstate(all="ignore"):
            return float(np.nan_to_num(np.sum((first - run(speed)[:samples]) ** 2), nan=np.inf))

    most = 2.0 * float(np.abs(np.diff(first[::stride])).max()) / (stride * dt)
    tried, apart = np.linspace(-most, most, TRIED, retstep=True)
    near = float(min(tried, key=left))
    best = minimize_scalar(left, bounds=(near - apart, near + apart), method="bounded", options={"xatol": 1e-9 * most})
    is_noise = left(0.0) <= best.fun * (1.0 + 9.0 / samples)  # three standard errors
    return 0.0 if is_noise else float(best.x)
