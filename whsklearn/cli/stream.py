"""Identify an axis or an arm continuously, row by row: estimates, predictions, alarms.

Rows come from a CSV file, from the same file as it grows (``--follow``), or as JSON lines on stdin (``-``).
The state is kept in a checkpoint that is replaced atomically. When the stream is restarted, by hand or after a crash,
it resumes from the checkpoint.

Records are JSON lines: ``estimate``, ``prediction``, ``alarm``, ``change``, ``moved``, ``bad_row``.  After an alarm of
an axis or an arm whose columns state their units, as many rows as before are compared as `whsklearn compare` does.
"""

from __future__ import annotations

import functools
import math
from pathlib import Path
from typing import Any

import click
from click.core import ParameterSource

from whsklearn.cli.job import job, root

OF_A_CHAIN = ("inputs", "output", "estimator", "orders", "law", "p")  # options that do not apply to an arm
ESTIMATORS = {"rls": "RLSRegressor", "mils": "MILSRegressor", "rmils": "RMILSRegressor"}


@job
@click.argument("source")
@click.option("--input", "inputs", multiple=True, default=["u"], help="Input column; repeat for several.")
@click.option("--output", default="y", help="Output column.")
@click.option(
    "--robot", type=click.Path(exists=True, dir_okay=False), help="model.json of an arm, in place of --orders."
)
@click.option("--joints", help='Columns of each joint of an arm: "NAME:POSITION,DRIVE;...".')
@click.option("--gains", help='Torque constants of an arm: "NAME:NM_PER_AMPERE;...", where drives are currents.')
@click.option("--time", "time_column", default=None, help="Time column; its values must increase.")
@click.option("--max-step", type=float, default=math.inf, help="A longer pause in time begins a new experiment.")
@click.option("--follow", is_flag=True, help="Wait for rows that are appended to the file.")
@click.option("--estimator", type=click.Choice(sorted(ESTIMATORS)), default="rmils", help="Estimator.")
@click.option("--orders", default="2,2,2,2", help="n_a, n_b, n_c, n_d of the Wiener-Hammerstein model.")
@click.option("--law", default="reduced", help="Friction law: names joined by commas.")
@click.option("--p", type=int, default=4, help="Innovation length.")
@click.option("--forgetting", type=float, default=1.0, help="Forgetting factor.")
@click.option("--every", type=click.IntRange(1), default=1000, help="Rows between estimates.")
@click.option("--predictions/--no-predictions", default=False, help="Write the one-step prediction of every row.")
@click.option("--smallest-change", type=float, default=5.0, help="Smallest change to report, in per cent.")
@click.option("--alarm-interval", type=float, default=1e6, help="Minimum average number of rows between false alarms.")
@click.option("--bad-rows", type=click.Choice(["skip", "refuse"]), default="skip", help="Report and continue, or stop.")
@click.option("--hole", type=click.Choice(["hold", "restart"]), default="hold", help="What replaces a bad row.")
@click.option("--most-held", type=click.IntRange(0), default=10, help="Maximum number of consecutive bad rows to hold.")
@click.option(
    "--disk-full", type=click.Choice(["go-on", "stop"]), default="go-on", help="If there is no space for a checkpoint."
)
@click.option(
    "--out",
    type=click.Path(dir_okay=False, path_type=Path),
    default=None,
    help="File for the records; stdout if omitted.",
)
@click.option("--checkpoint", type=click.Path(dir_okay=False, path_type=Path), default=None, help="[SOURCE.whs]")
@click.option("--checkpoint-every", type=float, default=5.0, help="Seconds between checkpoints.")
@click.option("--fresh", is_flag=True, help="Start from the beginning even if there is a checkpoint.")
def main(
    source: str, inputs: tuple[str, ...], output: str, robot: str | None, joints: str | None, gains: str | None,
    time_column: str | None, max_step: float, follow: bool, estimator: str, orders: str, law: str, p: int,
    forgetting: float, every: int, predictions: bool, smallest_change: float, alarm_interval: float, bad_rows: str,
    hole: str, most_held: int, disk_full: str, out: Path | None, checkpoint: Path | None, checkpoint_every: float,
    fresh: bool, seed: int, track: bool,
) -> None:  # fmt: skip
    """Identify from SOURCE, a CSV file or - for JSON lines on stdin, row by row; it resumes automatically.

    Example: whsklearn stream axis.csv --input torque_nm --output velocity_rad_s --follow --out records.jsonl

    With --robot the rows are those of an arm, and the parameters of its joints are estimated.
    """
    from whsklearn.compare import at_an_alarm, at_an_alarm_of
    from whsklearn.streaming import Files, Options, run_stream

    kept = checkpoint or Path("stdin.whs" if source == "-" else f"{source}.whs")
    outputs: tuple[str, ...] = ("",)
    factors: tuple[float, ...] = ()
    if robot:
        from whsklearn.cli.arm import arm_stream

        context = click.get_current_context()
        given = [name for name in OF_A_CHAIN if context.get_parameter_source(name) == ParameterSource.COMMANDLINE]
        if given:
            raise click.UsageError(f"--robot is an arm's model, to which {given[0]} does not apply; leave it out.")
        arm = arm_stream({**context.params, "joints": joints, "gains": gains})
        model, columns, factors, outputs = arm.model, arm.columns, arm.factors, arm.joints
        max_step, hole = min(max_step, arm.max_step), "restart"
        compare: Any = at_an_alarm_of(arm.arm, arm.dt, bool(time_column))
    else:
        model = build_model(estimator, orders, law, p, forgetting, seed)
        columns = [*([time_column] if time_column else []), *inputs, output]
        compare = at_an_alarm(columns) if time_column else None
    options = Options(
        every, predictions, bad_rows == "refuse", hole == "restart", max_step, smallest_change, most_held,
        bool(time_column), outputs, factors,
    )  # fmt: skip
    files = Files(source, out, kept, follow, fresh, checkpoint_every, disk_full == "stop")
    say = functools.partial(click.echo, err=True)
    run_stream(model, columns, files, options, alarm_interval, compare=compare, root=root() if track else None, say=say)


def build_model(estimator: str, orders: str, law: str, p: int, forgetting: float, seed: int) -> Any:
    """The estimator that the options ask for."""
    from whsklearn import estimators
    from whsklearn.lags import WienerHammersteinLags

    try:
        n_a, n_b, n_c, n_d = (int(n) for n in orders.split(","))
    except ValueError:
        raise ValueError(f"--orders is {orders!r}, expected four whole numbers such as 2,2,2,2.") from None
    cls = getattr(estimators, ESTIMATORS[estimator])
    wanted = {"p": p, "forgetting": forgetting, "random_state": seed}
    lags = WienerHammersteinLags(n_a=n_a, n_b=n_b, n_c=n_c, n_d=n_d, law=None if law == "reduced" else law)
    return cls(lags=lags).set_params(**{k: v for k, v in wanted.items() if k in cls().get_params()})


if __name__ == "__main__":
    main()
