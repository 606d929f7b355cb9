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
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import click

from whsklearn.cli import options as opt
from whsklearn.cli.job import job, root

OF_A_CHAIN = ("inputs", "output", "estimator", "orders", "law", "p")  # options that do not apply to an arm
ASKED_FOR = {"estimator", "orders", "p"}  # where one of these is given, a chain is meant
AT_FIRST = 200  # rows from which the rate of a stream's file is estimated
EFFECTS = "input_offset,input_delay"  # besides friction; a drive that is held over a sample acts half a sample later
A_ROW = 1.0  # P(0) of a stream: the file's numbers weigh as much as one row, so the first rows do not discard them
LONGEST_STEP = 2.5  # samples: a longer one begins a new experiment, because no derivative can bridge it


@job
@click.argument("source", type=click.Path(exists=True, dir_okay=False, allow_dash=True))
@click.option("--input", "--drive", "inputs", multiple=True, default=["u"], help="Input column; repeat for several.")
@click.option("--output", "--position", "output", default="y", help="Output column.")
@click.option("--robot", type=opt.FILE, help="model.json of an arm, in place of --orders.")
@opt.joint_options
@click.option("--time", "time_column", help="Time column, numbers or ISO 8601; must increase.")
@opt.rate_option
@click.option("--max-step", type=opt.POSITIVE, help="A longer pause in time begins a new experiment.")
@click.option("--follow", is_flag=True, help="Wait for rows that are appended to the file.")
@opt.model_options
@click.option("--every", type=click.IntRange(1), default=1000, help="Rows between estimates.")
@click.option("--predictions/--no-predictions", default=False, help="Write the one-step prediction of every row.")
@click.option(
    "--smallest-change", type=opt.FiniteRange(min=0), default=5.0, help="Smallest change to report, in per cent."
)
@click.option(
    "--alarm-interval", type=opt.POSITIVE, default=1e6, help="Minimum average number of rows between false alarms."
)
@click.option("--bad-rows", type=click.Choice(["skip", "refuse"]), default="skip", help="Report and continue, or stop.")
@click.option("--hole", type=click.Choice(["hold", "restart"]), default="hold", help="What replaces a bad row.")
@click.option("--most-held", type=click.IntRange(0), default=10, help="Maximum number of consecutive bad rows to hold.")
@click.option(
    "--disk-full", type=click.Choice(["go-on", "stop"]), default="go-on", help="If there is no space for a checkpoint."
)
@click.option("--out", type=opt.NEW_FILE, help="File for the records; stdout if omitted.")
@click.option(
    "--checkpoint", type=opt.NEW_FILE, help="File for the state, from which it resumes; SOURCE.whs if omitted."
)
@click.option("--checkpoint-every", type=opt.FiniteRange(min=0), default=5.0, help="Seconds between checkpoints.")
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
    from whsklearn.logs.errors import LogError
    from whsklearn.streaming import Files, Options, run_stream

    source, robot, timed = (options[k] for k in ("source", "robot", "time_column"))
    if source != "-" and not Path(source).is_file():
        raise LogError(f"{source} is a pipe or a device, which cannot be read twice; send JSON lines to stdin (-).")
    say = functools.partial(click.echo, err=True)
    axis, chosen = None, opt.chosen_of(options)
    if not robot:
        opt.refuse_without_robot(options)
        axis = axis_stream(options, chosen, say)
    if timed and options["rate"] and not axis:
        raise click.UsageError("--rate is for rows without a time; leave out --time or --rate.")
    if robot:
        if of_chain := [name for name in OF_A_CHAIN if name in chosen]:
            raise click.UsageError(f"--robot is an arm's model, to which {of_chain[0]} does not apply; leave it out.")
    learnt = arm_stream(options) if robot else axis or chain_stream(options)
    if source != "-":
        has_rows(source, learnt.columns, bool(timed))  # a wrong column is told before anything is written
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


# --- what it learns: an axis, if the source's columns are one, with its rate and its alarm; a chain; an arm ----------
class Learnt(NamedTuple):
    """What ``stream`` learns from one kind of system."""

    model: Any
    columns: list[str]  # in the order of a row
    alarm: Any  # or its interval
    compare: Any  # compares rows after an alarm
    rows: dict[str, Any]  # fields of `whsklearn.streaming.Options`


def head_of(source: str, time: str | None) -> tuple[list[str], float | None, dict[str, str]]:
    r"""Names of a file's columns, the usual step (s) of its time, and names with units where the rows state them.

    There are no names of stdin, and no step without a time. Units are those in the first line of rows, and that of a
    time whose stamps count another than its name says, as ms since 1970 do. Raises LogError if the first line is no
    text.

    >>> from tempfile import NamedTemporaryFile
    >>> with NamedTemporaryFile("w+") as file:
    ...     _ = file.write("stamp;q\n;deg\n1700000000000;0\n1700000000002;0\n1700000000004;0\n")
    ...     file.flush()
    ...     head_of(file.name, "stamp")
    (['stamp', 'q'], 0.002, {'q': 'q [deg]', 'stamp': 'stamp [ms]'})
    """
    import numpy as np
    import pandas as pd

    from whsklearn.logs.timebase import to_seconds, usual_step
    from whsklearn.logs.units import seconds_of, symbol_of, unit_of
    from whsklearn.streaming.rows import CsvParser

    if source == "-":
        return [], None, {}
    with open(source, "rb") as start:
        mark = CsvParser(start.readline().rstrip(b"\r\n"), []).delimiter
    try:
        head = pd.read_csv(source, nrows=AT_FIRST, sep=mark, dtype=str, encoding_errors="replace")
    except (pd.errors.EmptyDataError, pd.errors.ParserError):  # the stream itself says what is wrong with it
        return [], None, {}
    names = [str(c).strip().strip('"') for c in head.columns]
    first = head[:1].fillna("").to_numpy().ravel()
    stated = {n: str(cell).strip() for n, cell in zip(names, first, strict=False) if cell}
    called = {n: f"{n} [{w}]" for n, w in stated.items()} if all(map(symbol_of, stated.values())) else {}
    if time not in names:
        return names, None, called
    text, second = head.iloc[:, names.index(time)], seconds_of(unit_of(called.get(time, time), "s"))
    # a comma inside a field is a decimal sign, as in the rows of a stream
    stamps = pd.to_numeric(text.str.replace(",", "."), errors="coerce").dropna().to_numpy()
    if len(stamps) < 3:
        dates = pd.to_datetime(text, errors="coerce", format="ISO8601", utc=True).dropna()
        stamps = (dates - dates.min()).dt.total_seconds().to_numpy() / second
    stamps = stamps[np.diff(stamps, prepend=-np.inf) > 0.0]  # of rows that share a stamp a stream takes one
    if stamps.size < 3:
        return names, None, called
    time_s = to_seconds(stamps, unit_of(called.get(time, time)), time)[0]
    counts = float(f"{(time_s[-1] - time_s[0]) / (stamps[-1] - stamps[0]):.6g}")
    if counts != second:
        called[time] = f"{time} [{next((u for u in ('ms', 'us', 'ns') if seconds_of(u) == counts), f'{counts:g} s')}]"
    return names, usual_step(time_s) or None, called


def of_an_axis(options: Mapping[str, Any], chosen: set[str]) -> bool:
    """Whether the input and the output are a drive and a position, and no option of a chain is ``chosen``.

    Raises ColumnError if they are exchanged.
    """
    from whsklearn.logs.errors import ColumnError
    from whsklearn.logs.roles import says

    (drive, *more), position = options["inputs"], options["output"]
    if chosen & ASKED_FOR or more:
        return False
    if says(position, "drive") and says(drive, "position"):
        raise ColumnError(
            f"--input is {drive}, a position, and --output {position}, a drive; exchange them, or give --orders for a "
            "chain from the position to the drive."
        )
    return says(drive, "drive") and says(position, "position")


def axis_stream(options: Mapping[str, Any], chosen: set[str], say: Any) -> Learnt | None:
    """``stream SOURCE``: recursive least squares of an axis if the columns are its drive and its position.

    ``chosen``: the options given on the command line; those of a chain ask for one. ``say``: called with the sentence
    that tells what is taken, and why it is not an axis where the columns alone would be one.
    """
    from whsklearn.compare import at_an_alarm
    from whsklearn.logs.errors import ColumnError, LogError
    from whsklearn.logs.mend import turns_of
    from whsklearn.logs.roles import says
    from whsklearn.logs.units import unit_of
    from whsklearn.streaming.clock import OFF
    from whsklearn.streaming.monitor import alarm_of_averages

    source, time, rate = (options[k] for k in ("source", "time_column", "rate"))
    drive, position = options["inputs"][0], options["output"]
    if not of_an_axis(options, chosen):
        if says(drive, "drive") and says(position, "velocity") and not chosen & ASKED_FOR:
            say(
                f"{position} is a velocity, so the columns are taken for a chain; inertia and friction of an axis are "
                "estimated from its position."
            )
        return None
    columns = [*([time] if time else []), position, drive]
    begun = source == "-" or has_rows(source, columns, bool(time))
    step, stated = head_of(source, time)[1:]
    called = [stated.get(c, c) for c in columns]
    *_, position, drive = called
    dt = 1.0 / rate if rate else step
    if rate and step and abs(step * rate - 1.0) > OFF:
        raise ColumnError(
            f"--rate is {rate:g} Hz, and {time} of the first rows shows {1.0 / step:.6g}; leave out --rate."
        )
    what = f"{drive} and {position} are the drive and the position of an axis"
    if dt is None and (time is None or source == "-"):
        say(f"{what}, but without {'--time or ' if time is None else ''}--rate they are taken for a chain.")
        return None
    if dt is None:
        if not begun:
            raise LogError(f"{source} holds no rows; give another file, or --rate HZ and --follow for rows to come.")
        said = f"{source} does not show its sample rate by {time} of three rows in order"
        raise ColumnError(f"{said}; sort them, or give --rate HZ too.")
    model = axis_model(options, chosen, float(f"{1.0 / dt:.6g}"))
    spacing = model.lags.spacing * dt
    alarm = alarm_of_averages(options["alarm_interval"])
    say(
        f"{what}, whose inertia and friction are estimated at {1.0 / dt:.6g} Hz; --orders takes them for a chain. "
        f"A change is told from {alarm.lacking_ * spacing:.3g} s of motion on; where the axis stops or turns within "
        f"{2e3 * spacing:.3g} ms, none counts."
    )
    compare = at_an_alarm(called, None if time else dt)
    rows = without_holes(called[0] if time else None, dt) | {"positions": (int(bool(time)),)}
    rows |= {"turns": (tuple(turns_of(unit_of(position))),), "units": units_of_numbers(model.lags, drive, position)}
    return Learnt(model, columns, alarm, compare, rows)


def units_of_numbers(lags: Any, drive: str, position: str) -> dict[str, str]:
    """Units of an axis's numbers by name, as its rows are in the units of these columns; in SI if they state none.

    >>> from whsklearn import InverseDynamicsLags
    >>> units_of_numbers(InverseDynamicsLags(100, law="viscous"), "torque_mnm", "angle_deg")
    {'inertia': 'mNm s²/deg', 'viscous': 'mNm s/deg', 'input_offset': 'mNm'}
    """
    from whsklearn.lags.axis_rows import column_names, effect_terms
    from whsklearn.logs.units import assumed, inertia_unit, respelled, unit_of
    from whsklearn.models.axis import unit_of_field

    own = dict(zip(("Nm", "rad"), assumed(unit_of(drive), unit_of(position)), strict=True))
    terms = effect_terms(lags.law, lags.effects)
    sizes = [unit_of_field(term, term.size) for term in terms for _ in range(1 + term.phased)]
    of_terms = zip(column_names(terms), sizes, strict=True)
    return {"inertia": inertia_unit(*own.values())} | {name: respelled(unit, own)[1] for name, unit in of_terms}


def axis_model(options: Mapping[str, Any], chosen: set[str], rate: float) -> Any:
    """Recursive least squares of an axis; raises ValueError for a wrong name of a term, before the first row."""
    from whsklearn import InverseDynamicsLags, RLSRegressor
    from whsklearn.lags.axis_rows import effect_terms

    law = options["law"] if "law" in chosen else "viscous,coulomb"
    lags = InverseDynamicsLags(rate, law=law, effects=EFFECTS, causal=True)
    effect_terms(lags.law, lags.effects)
    return RLSRegressor(lags, forgetting=options["forgetting"])


def has_rows(source: str, columns: list[str], timed: bool) -> bool:
    """Whether a file has more than a header; raises what a stream would raise of that, before its rate is asked for."""
    from whsklearn.logs.packed import foreign
    from whsklearn.streaming.rows import CsvParser

    with open(source, "rb") as file:
        header, row = file.readline(), file.readline()
    if header.endswith(b"\n") and not foreign(header):  # one that is still being written is waited for
        CsvParser(header.rstrip(b"\r\n"), columns, timed)
    return bool(row)


def without_holes(time: str | None, dt: float) -> dict[str, Any]:
    """How rows are taken of which derivatives are made: a bad one, or a step of some ``dt`` s, ends the experiment."""
    from whsklearn.logs.units import seconds_of, unit_of

    clock = seconds_of(unit_of(time, "s")) if time else 1.0
    return {"restart_after_hole": True, "max_step": LONGEST_STEP * dt / clock, "step": dt / clock if time else 0.0}


def chain_stream(options: Mapping[str, Any]) -> Learnt:
    """``stream SOURCE``: a chain from its inputs to its output."""
    from whsklearn.compare import at_an_alarm

    time, rate = options["time_column"], options["rate"]
    columns = [*([time] if time else []), *options["inputs"], options["output"]]
    if len(set(columns)) < len(columns):
        raise click.UsageError(f"The columns are {', '.join(columns)}; expected a different one for each role.")
    compare = at_an_alarm(columns, 1.0 / rate if rate else None) if time or rate else None
    return Learnt(opt.build_model(options), columns, options["alarm_interval"], compare, {})


def arm_stream(options: Mapping[str, Any]) -> Learnt:
    """``stream SOURCE --robot model.json``: recursive least squares that starts from the model's numbers.

    Joints are weighted by the torques that the model predicts; numbers that the motion does not excite keep their
    values.
    """
    import numpy as np

    from whsklearn import RigidBodyLags, RLSRegressor
    from whsklearn.cli.arm_log import columns_of, gains_used, to_si
    from whsklearn.compare import at_an_alarm_of
    from whsklearn.logs.errors import ColumnError
    from whsklearn.logs.mend import turns_of
    from whsklearn.logs.units import seconds_of, unit_of
    from whsklearn.models import load_model

    path, source, time = options["robot"], options["source"], options["time_column"]
    known = load_model(path)
    if known.kind != "arm":
        raise ValueError(f"{path} is a model of kind {known.kind}, expected one of an arm, as `identify` writes it.")
    arm, dt = known.arm, 1.0 / options["rate"] if options.get("rate") else known.dt
    if source == "-" and not options["joints"]:
        raise ColumnError('Lines on stdin have no column names; give them with --joints "NAME:POSITION,DRIVE;...".')
    names, step, stated = head_of(source, time)
    dt, clock = step or dt, stated.get(time or "", time)
    given = columns_of(options, arm, names)
    pairs = [given[j] for j in arm.joints]
    gains = gains_used(options, arm, {j: unit_of(given[j][1]) for j in arm.joints})
    factors = [
        to_si(j, bool(slides), unit_of(q), unit_of(u), gains)
        for j, slides, (q, u) in zip(arm.joints, arm.slides, pairs, strict=True)
    ]
    weights = 1.0 / np.sqrt(np.mean(arm.inverse_dynamics(*arm.drawn_motion(AT_FIRST)) ** 2, axis=0))
    lags = RigidBodyLags.of_arm(arm, 1.0 / dt, causal=True, weights=weights, reversals=known.reversals)
    lags.partial_rows(*np.zeros((2, 1, arm.n_joints)))  # an effect that a stream cannot represent is refused here
    theta = [known.numbers.get(name, 0.0) for name in lags.base_.names]
    lags = RigidBodyLags.of_arm(arm, 1.0 / dt, causal=True, weights=weights, reversals=known.reversals)
    model = RLSRegressor(lags, P0=A_ROW, theta0=theta, forgetting=options["forgetting"])
    columns = [*([time] if time else []), *(q for q, _ in pairs), *(u for _, u in pairs)]
    second = [seconds_of(unit_of(clock, "s"))] if clock else []
    scale = (*second, *(far for far, _ in factors), *(by for _, by in factors))
    compare = at_an_alarm_of(arm, None if time else dt)
    turns = [() if slides else turns_of(unit_of(q)) for slides, (q, _) in zip(arm.slides, pairs, strict=True)]
    at = tuple(range(int(bool(time)), len(pairs) + int(bool(time))))
    rows = without_holes(clock, dt) | {"outputs": arm.joints, "factors": scale}
    rows |= {"positions": at, "turns": tuple(map(tuple, turns))}
    return Learnt(model, columns, options["alarm_interval"], compare, rows)
