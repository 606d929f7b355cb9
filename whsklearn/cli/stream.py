"""Identify an axis, an arm or a chain continuously, row by row: estimates, predictions, alarms.

Rows come from a CSV file, from the same file as it grows (``--follow``), or as JSON lines on stdin (``-``).
The state is kept in a checkpoint that is replaced atomically. When the stream is restarted, by hand or after a crash,
it resumes from the checkpoint.

Records are JSON lines: ``estimate``, ``prediction``, ``alarm``, ``change``, ``moved``, ``bad_row``.  After an alarm of
an axis or an arm whose columns state their units, as many rows as before are compared as `whsklearn compare` does.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click
from click.core import ParameterSource

from whsklearn.cli.job import job, root
from whsklearn.cli.options import (
    FILE,
    NEW_FILE,
    POSITIVE,
    FiniteRange,
    joint_options,
    model_options,
    rate_option,
    refuse_without_robot,
)

OF_A_CHAIN = ("inputs", "output", "estimator", "orders", "law", "p")  # options that do not apply to an arm


@job
@click.argument("source", type=click.Path(exists=True, dir_okay=False, allow_dash=True))
@click.option("--input", "--drive", "inputs", multiple=True, default=["u"], help="Input column; repeat for several.")
@click.option("--output", "--position", "output", default="y", help="Output column.")
@click.option("--robot", type=FILE, help="model.json of an arm, in place of --orders.")
@joint_options
@click.option("--time", "time_column", help="Time column, numbers or ISO 8601; must increase.")
@rate_option
@click.option("--max-step", type=POSITIVE, help="A longer pause in time begins a new experiment.")
@click.option("--follow", is_flag=True, help="Wait for rows that are appended to the file.")
@model_options
@click.option("--every", type=click.IntRange(1), default=1000, help="Rows between estimates.")
@click.option("--predictions/--no-predictions", default=False, help="Write the one-step prediction of every row.")
@click.option("--smallest-change", type=FiniteRange(min=0), default=5.0, help="Smallest change to report, in per cent.")
@click.option(
    "--alarm-interval", type=POSITIVE, default=1e6, help="Minimum average number of rows between false alarms."
)
@click.option("--bad-rows", type=click.Choice(["skip", "refuse"]), default="skip", help="Report and continue, or stop.")
@click.option("--hole", type=click.Choice(["hold", "restart"]), default="hold", help="What replaces a bad row.")
@click.option("--most-held", type=click.IntRange(0), default=10, help="Maximum number of consecutive bad rows to hold.")
@click.option(
    "--disk-full", type=click.Choice(["go-on", "stop"]), default="go-on", help="If there is no space for a checkpoint."
)
@click.option("--out", type=NEW_FILE, help="File for the records; stdout if omitted.")
@click.option("--checkpoint", type=NEW_FILE, help="File for the state, from which it resumes; SOURCE.whs if omitted.")
@click.option("--checkpoint-every", type=FiniteRange(min=0), default=5.0, help="Seconds between checkpoints.")
@click.option("--fresh", is_flag=True, help="Start from the beginning even if there is a checkpoint.")
def main(**options: Any) -> None:
    """Identify from SOURCE, a CSV file or - for JSON lines on stdin, row by row; it resumes automatically.

    A drive and a position, by the names or units of the columns, are taken for an axis, whose inertia and friction are
    estimated; anything else, and with --orders these too, for a chain. With --robot the rows are those of an arm, and
    the parameters of its joints are estimated.

    \b
    whsklearn stream axis.csv --input torque_nm --output position_rad --time time_s --out log.jsonl
    """  # noqa: D301 - click reads the backspace
    try:
        run = _prepared(options)
    except KeyboardInterrupt:  # a stop that was asked for, as one of the running stream is
        click.echo("Stopped before the first row; nothing was read.", err=True)
        return
    run()


def _prepared(options: dict[str, Any]) -> Callable[[], None]:
    """What runs the stream that the options ask for; imports, which take seconds, are done here."""
    from whsklearn.cli.axis_stream import axis_stream, chain_stream
    from whsklearn.streaming import Files, Options, run_stream

    source, robot, timed = (options[k] for k in ("source", "robot", "time_column"))
    say = functools.partial(click.echo, err=True)
    source_of = click.get_current_context().get_parameter_source
    chosen = {name for name in options if source_of(name) == ParameterSource.COMMANDLINE}
    axis = None
    if not robot:
        refuse_without_robot(options)
        axis = axis_stream(options, chosen, say)
    if timed and options["rate"] and not axis:
        raise click.UsageError("--rate is for rows without a time; leave out --time or --rate.")
    if robot:
        from whsklearn.cli.arm import arm_stream

        if of_chain := [name for name in OF_A_CHAIN if name in chosen]:
            raise click.UsageError(f"--robot is an arm's model, to which {of_chain[0]} does not apply; leave it out.")
    learnt = arm_stream(options) if robot else axis or chain_stream(options)
    max_step = min(options["max_step"] or math.inf, learnt.rows.get("max_step", math.inf))
    asked = {k: options[k] for k in ("every", "predictions", "smallest_change", "most_held")}
    asked |= {"refuse": options["bad_rows"] == "refuse", "restart_after_hole": options["hole"] == "restart"}
    rows = Options(**asked | learnt.rows | {"max_step": max_step, "timed": bool(timed)})
    files = Files(
        source, options["out"], options["checkpoint"] or Path("stdin.whs" if source == "-" else f"{source}.whs"),
        options["follow"], options["fresh"], options["checkpoint_every"], options["disk_full"] == "stop",
    )  # fmt: skip
    return functools.partial(
        run_stream, learnt.model, learnt.columns, files, rows, learnt.alarm, compare=learnt.compare,
        root=root() if options["track"] else None, say=say,
    )  # fmt: skip
