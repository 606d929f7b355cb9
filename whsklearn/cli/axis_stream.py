"""What ``stream`` learns: an axis, if a source's columns are one, with its rate and its alarm; else a chain."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from whsklearn.cli.options import build_model
from whsklearn.logs.errors import ColumnError, LogError

AT_FIRST = 200  # rows from which the rate of a stream's file is estimated
EFFECTS = "input_offset,input_delay"  # besides friction; a drive that is held over a sample acts half a sample later
LONGEST_STEP = 2.5  # samples: a longer one begins a new experiment, because no derivative can bridge it


class Learnt(NamedTuple):
    """Inputs of ``stream`` for one kind of system.

    ``model``, ``columns`` and ``alarm`` are the estimator, the columns in the order of a row, and the alarm or its
    interval; ``compare`` compares rows after an alarm, and ``rows`` holds `whsklearn.streaming.Options` of this kind.

    >>> options = {"source": "-", "inputs": ["u"], "output": "y", "time_column": None, "rate": 100.0, "law": "reduced"}
    >>> options |= {"estimator": "rls", "orders": (2, 2, 2, 2), "p": 1, "forgetting": 1.0, "seed": 0}
    >>> chain_stream(options | {"alarm_interval": 1e6}).columns
    ['u', 'y']
    """

    model: Any
    columns: list[str]
    alarm: Any
    compare: Any
    rows: dict[str, Any]


def head_of(source: str, time: str | None) -> tuple[list[str], float | None]:
    r"""Names of a file's columns, and the usual step (s) of its time; no names of stdin, and no step without a time.

    Raises LogError if the first line is no text.

    >>> from tempfile import NamedTemporaryFile
    >>> with NamedTemporaryFile("w+") as file:
    ...     _ = file.write("t_ms;q\n0;0\n2;0\n4;0\n")
    ...     file.flush()
    ...     head_of(file.name, "t_ms")
    (['t_ms', 'q'], 0.002)
    """
    import numpy as np
    import pandas as pd

    from whsklearn.logs.timebase import usual_step
    from whsklearn.logs.units import seconds_of, unit_of
    from whsklearn.streaming.rows import CsvParser

    if source == "-":
        return [], None
    with open(source, "rb") as start:
        CsvParser(start.readline().rstrip(b"\r\n"), [])
    with open(source, encoding="utf-8", errors="replace") as file:
        mark = max(",;\t", key=file.readline().count)
    try:
        head = pd.read_csv(source, nrows=AT_FIRST, sep=mark, dtype=str, encoding_errors="replace")
    except (pd.errors.EmptyDataError, pd.errors.ParserError):  # the stream itself says what is wrong with it
        return [], None
    names = [str(c).strip().strip('"') for c in head.columns]
    if time not in names or len(head) < 3:
        return names, None
    text = head.iloc[:, names.index(time)]
    # a comma inside a field is a decimal sign, as in the rows of a stream
    stamps = pd.to_numeric(text.str.replace(",", "."), errors="coerce").dropna()
    if len(stamps) < 3:
        dates = pd.to_datetime(text, errors="coerce", format="ISO8601", utc=True).dropna()
        time_s = (dates - dates.iloc[0]).dt.total_seconds().to_numpy() if len(dates) > 2 else np.zeros(1)
    else:
        time_s = stamps.to_numpy() * seconds_of(unit_of(time, "s"))
    step = usual_step(time_s[np.r_[True, np.diff(time_s) > 0.0]])  # a stream takes one row of those that share a stamp
    return names, step if step > 0.0 else None


def of_an_axis(options: Mapping[str, Any], chosen: set[str]) -> bool:
    """Whether the input and the output are a drive and a position, and no option of a chain is ``chosen``.

    Raises ColumnError if they are exchanged.
    """
    from whsklearn.logs.roles import says

    (drive, *more), position = options["inputs"], options["output"]
    if chosen & {"estimator", "orders", "p"} or more:
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
    from whsklearn import InverseDynamicsLags, RLSRegressor
    from whsklearn.compare import at_an_alarm
    from whsklearn.lags.axis_rows import effect_terms
    from whsklearn.logs.mend import turns_of
    from whsklearn.logs.units import unit_of
    from whsklearn.streaming.monitor import alarm_of_averages

    source, time, rate = (options[k] for k in ("source", "time_column", "rate"))
    drive, position = options["inputs"][0], options["output"]
    if not of_an_axis(options, chosen):
        return None
    columns = [*([time] if time else []), position, drive]
    begun = source == "-" or has_rows(source, columns, bool(time))
    step = head_of(source, time)[1]
    dt = 1.0 / rate if rate else step
    what = f"{drive} and {position} are the drive and the position of an axis"
    if dt is None and (time is None or source == "-"):
        say(f"{what}, but without {'--time or ' if time is None else ''}--rate they are taken for a chain.")
        return None
    if dt is None:
        if not begun:
            raise LogError(f"{source} holds no rows; give another file, or --rate HZ and --follow for rows to come.")
        raise ColumnError(f"{source} does not show its sample rate by {time} of three rows; give --rate HZ too.")
    law = options["law"] if "law" in chosen else "viscous,coulomb"
    lags = InverseDynamicsLags(float(f"{1.0 / dt:.6g}"), law=law, effects=EFFECTS, causal=True)
    effect_terms(lags.law, lags.effects)  # a wrong name is said now, not at each row
    model = RLSRegressor(lags, forgetting=options["forgetting"])
    alarm = alarm_of_averages(options["alarm_interval"])
    first = (alarm.n_settle + alarm.n_reference) * lags.spacing * dt
    say(
        f"{what}, whose inertia and friction are estimated at {1.0 / dt:.6g} Hz; --orders takes them for a chain. "
        f"A change is told from {first:.3g} s of motion on; where the axis stops or turns within "
        f"{2e3 * lags.spacing * dt:.3g} ms, none counts."
    )
    compare = at_an_alarm(columns, None if time else dt)
    rows = without_holes(time, dt) | {"positions": (int(bool(time)),)}
    rows |= {"turns": (tuple(turns_of(unit_of(position))),)}
    return Learnt(model, columns, alarm, compare, rows)


def has_rows(source: str, columns: list[str], timed: bool) -> bool:
    """Whether a file has more than a header; raises what a stream would raise of that, before its rate is asked for."""
    from whsklearn.streaming.rows import CsvParser

    with open(source, "rb") as file:
        header, row = file.readline(), file.readline()
    if header:
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
    compare = at_an_alarm(columns, 1.0 / rate if rate else None) if time or rate else None
    return Learnt(build_model(options), columns, options["alarm_interval"], compare, {})
