"""A user's log for a command: options that name its columns, reading, and notes on the terminal."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from sklearn.utils import Bunch

    from whsklearn.cli.comparison import ComparedRecord
    from whsklearn.logs.source import Source

_QUIET = ("LOG005", "LOG006", "LOG007")  # in the report only; on the terminal they would appear for nearly every log
MOST_ROWS = 300_000  # of a diagnosis: five minutes at 1 kHz, which take half a GB and a minute or two
_SIGNALS = ("X", "y", "time", "reference", "command", "groups", "frame")


def reading_options(function: Callable[..., Any]) -> Callable[..., Any]:
    """``--columns``, ``--unit``, ``--rate``, ``--torque-constant``, ``--invert-drive``: how a log is to be taken."""
    options = [
        click.option("--columns", help="Columns by name or number from 0: time,drive,position or drive,position."),
        click.option(
            "--unit",
            "units",
            multiple=True,
            metavar="ROLE=UNIT",
            help="Unit of a column, such as position=deg; may be repeated.",
        ),
        click.option(
            "--rate", type=click.FloatRange(min=0, min_open=True), help="Sample rate in Hz, in place of --time."
        ),
        click.option(
            "--torque-constant", metavar="K+-S", help="Nm/A with its standard deviation, for a drive in amperes."
        ),
        click.option("--invert-drive", is_flag=True, help="Change the sign of the drive."),
    ]
    for option in reversed(options):
        function = option(function)
    return function


logged_option = click.option(
    "--logged",
    type=click.Choice(["auto", "output", "velocity", "position"]),
    default="auto",
    help="Kind of output; a position is fitted through its velocity.",
)


def log_options(function: Callable[..., Any]) -> Callable[..., Any]:
    """``--log``, ``--input``, ``--output``, ``--time`` and how the log is to be taken."""
    options = [
        click.option("--log", "log_file", type=click.Path(exists=True), help="A log: CSV, Parquet, MAT, MCAP, ..."),
        click.option("--input", "input_column", help="Input column of the log."),
        click.option("--output", "output_column", help="Output column of the log."),
        click.option("--time", "time_column", help="Column of time stamps; if given, the sampling is checked."),
        logged_option,
    ]
    function = reading_options(function)
    for option in reversed(options):
        function = option(function)
    return function


def units_of(given: tuple[str, ...]) -> dict[str, str]:
    """Units by role from texts such as ``position=deg``."""
    out = {}
    for text in given:
        role, sign, unit = text.partition("=")
        if not (role and sign and unit):
            raise ValueError(f"--unit is {text!r}; expected ROLE=UNIT such as position=deg.")
        out[role.strip()] = unit.strip()
    return out


def roles_of(
    source: Source,
    given: Mapping[str, str | None],
    needed: tuple[str, ...],
    usual: Mapping[str, str],
    options: Mapping[str, Any],
) -> dict[str, str]:
    """The column of every role: as given, by its usual name, or recognised by its name, with a note.

    Raises
    ------
    ColumnError
        If a required role has no column or several, or if the column found for the drive is a current or an effort.
    """
    from whsklearn.logs.current import doubt, is_current
    from whsklearn.logs.errors import ColumnError
    from whsklearn.logs.roles import guess
    from whsklearn.logs.units import unit_of

    roles = {r: source.resolve(c, r) for r, c in given.items() if c is not None}
    for role in needed:
        if role in roles:
            continue
        found = usual[role] if usual.get(role) in source.names else guess(source, role)
        if found is None and role == "position" and (found := guess(source, "velocity")) is not None:
            role = "velocity"  # the log of a speed loop: the position is the integral of the velocity
        if found is None:
            instead = {
                "drive": ", or the command of a position servo with --command",
                "position": ", or the velocity with --velocity",
            }
            raise ColumnError(
                f"{source.name} has no column that is clearly the {role}; it has: {', '.join(source.names[:30])}. "
                f"Name it with --{role}{instead.get(role, '')}, or by number with --columns."
            )
        if role == "drive" and found != usual.get(role) and not units_of(options.get("units", ())).get("drive"):
            unit = source.units.get(found) or unit_of(found)
            if (text := doubt(found, unit)) and not (options.get("torque_constant") and is_current(found, unit)):
                raise ColumnError(f"{source.name} has no column that is clearly a torque. {text}")
        if found != usual.get(role):
            note(f"Column {found!r} is taken for the {role}.")
        roles[role] = found
    return roles


def read(path: str | Path, options: Mapping[str, Any], quiet: tuple[str, ...] = (), /, **columns: Any) -> Bunch:
    """Read the log, invert its drive if requested, and print its notes except those in ``quiet``."""
    from whsklearn.logs import load_log
    from whsklearn.logs.errors import LogWarning

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", LogWarning)
        log = load_log(
            path,
            **columns,
            units=units_of(options.get("units", ())),
            sample_rate=options.get("rate"),
            torque_constant=options.get("torque_constant"),
        )
    for finding in log.report.findings:
        if finding.code == "LOG019" and not finding.explanation.startswith("The unit of time"):
            continue  # `note_assumed` says what is assumed, where a command assumes anything
        if finding.code not in (*_QUIET, *quiet) and not (finding.code == "LOG022" and options.get("gains")):
            note(f"{finding.title}. {finding.explanation}")
    if options.get("invert_drive"):
        log.X = -log.X
        log.notes = (*log.notes, "The sign of the drive was changed.")
    return log


def note(text: str) -> None:
    """Print a note on stderr, separate from the result."""
    click.echo(f"Note: {text}", err=True)


TESTED = "so the test would use data of the fit; give --test a log of another run"
TWICE = "so these samples would count twice; give logs of different runs"


def refuse_shared(train: Bunch, test: Bunch, why: str = TESTED) -> None:
    """Raise if a log contains samples of another one, whatever the file names; ``why`` says why this is refused.

    Raises
    ------
    LogError
        With the span that both contain.
    """
    import numpy as np

    from whsklearn.logs.errors import LogError
    from whsklearn.logs.overlap import shared_run
    from whsklearn.logs.units import factor_of

    signals = []
    for log in (train, test):
        by, far = (factor_of(log.units.get(role, ""))[0] for role in ("drive", "position"))
        signals.append(np.column_stack([log.X * by, log.y * far]))
    found = shared_run(*signals)
    if found is not None:
        i, j, n = found
        raise LogError(
            f"{test.name} from {test.time[j]:.6g} to {test.time[j + n - 1]:.6g} s is {train.name} from "
            f"{train.time[i]:.6g} to {train.time[i + n - 1]:.6g} s, sample by sample ({n} of them), {why}."
        )


def note_assumed(log: Bunch) -> None:
    """Print a note on every unit that the log does not state and that is assumed."""
    from whsklearn.logs.units import UNKNOWN

    for role, si in (("drive", "Nm or N"), ("position", "rad or m")):
        if log.units.get(role) == UNKNOWN:
            note(f"The unit of the {role} is not stated and is taken to be SI ({si}); --unit {role}=UNIT sets another.")


SHORTEST_SEGMENT = 2.0  # s; in shorter segments a filter of 2 Hz and an observer leave nothing to judge


def long_segments(log: Bunch, shortest: float = SHORTEST_SEGMENT) -> Bunch:
    """All segments of a log of at least ``shortest`` s, in order, with a note on what is left out.

    Raises
    ------
    LogError
        If the segments between holes are too short for a diagnosis.
    """
    import numpy as np

    from whsklearn.gap.data_check import FEWEST_SAMPLES, SHORTEST_RECORD
    from whsklearn.logs.errors import LogError

    counts = np.bincount(log.groups)
    if counts.size == 1:
        return log
    kept = counts / log.sample_rate >= shortest
    rows, n = int(counts[kept].sum()), int(counts.max())
    if rows < FEWEST_SAMPLES or rows / log.sample_rate < SHORTEST_RECORD:
        raise LogError(
            f"{log.name}: {counts.size - 1} holes cut its {len(log.y)} samples into {counts.size} segments. The "
            f"longest has {n} samples over {(n - 1) / log.sample_rate:.3g} s, where {FEWEST_SAMPLES} samples and "
            f"{SHORTEST_RECORD:g} s are needed. Log at a lower rate, or over a line that loses no samples."
        )
    part = log if kept.all() else _cut(log, kept[log.groups])
    if not kept.all():
        text = (
            f"{rows} of {len(log.y)} samples are used: {np.count_nonzero(~kept)} of {counts.size} segments are shorter "
            f"than {shortest:g} s."
        )
        note(text)
        part.notes = (*part.notes, text)
    return part


def bridged(log: Bunch) -> Bunch:
    """Cut the log at its longest holes until less is missing than was logged, with a note on what is left out.

    A chain also simulates the samples of a hole, which takes time and shows nothing.
    """
    import numpy as np

    first, last = 0, log.y.size
    while (log.time[last - 1] - log.time[first]) * log.sample_rate > 2 * (last - first):
        cut = first + 1 + int(np.argmax(np.diff(log.time[first:last])))
        first, last = (first, cut) if cut - first >= last - cut else (cut, last)
    if last - first == log.y.size:
        return log
    part = _cut(log, slice(first, last))
    text = (
        f"{last - first} of {log.y.size} samples are used, from {part.time[0]:.6g} to {part.time[-1]:.6g} s: the holes "
        "beside them are longer than what was logged."
    )
    note(text)
    part.notes = (*part.notes, text)
    return part


def longest(log: Bunch) -> Bunch:
    """The longest segment of a log, with a note if there are others."""
    import numpy as np

    counts = np.bincount(log.groups)
    if counts.size == 1:
        return log
    part = _cut(log, log.groups == np.argmax(counts))
    text = (
        f"{len(part.y)} of {len(log.y)} samples, the longest of {counts.size} segments from "
        f"{part.time[0]:.6g} to {part.time[-1]:.6g} s, are used."
    )
    note(text)
    part.notes = (*part.notes, text)
    return part


def liveliest(log: Bunch) -> Bunch:
    """The part of a very long log in which the axis travels most, with a note if something is left out."""
    import numpy as np

    n = log.y.size
    if n <= MOST_ROWS:
        return log
    path = np.r_[0.0, np.cumsum(np.abs(np.diff(log.y)))]
    starts = np.linspace(0, n - MOST_ROWS, 50).astype(int)
    start = int(starts[np.argmax(path[starts + MOST_ROWS - 1] - path[starts])])
    part = _cut(log, slice(start, start + MOST_ROWS))
    text = (
        f"{MOST_ROWS} of {n} samples are used, from {part.time[0]:.6g} to {part.time[-1]:.6g} s, where the axis "
        "travels most; more samples would add little. Another part can be given with --test as a separate file."
    )
    note(text)
    part.notes = (*part.notes, text)
    return part


def _cut(log: Bunch, rows: Any) -> Bunch:
    """Some rows of a log."""
    return type(log)(**{k: v[rows] if k in _SIGNALS and v is not None else v for k, v in log.items()})


def record_of(options: dict[str, Any]) -> ComparedRecord:
    """The record named by the options of `log_options`; a position is replaced by its velocity, as in `identify`."""
    import numpy as np

    from whsklearn.cli.comparison import ComparedRecord
    from whsklearn.identification.view import view
    from whsklearn.logs.errors import LogError
    from whsklearn.logs.roles import by_number

    if options.get("columns"):
        columns: dict[str, Any] = by_number(options["columns"], chain=True)
    elif options["input_column"] and options["output_column"]:
        columns = {"drive": options["input_column"], "position": options["output_column"]}
        columns |= {"time": options["time_column"]}
    else:
        raise ValueError("--log needs --input and --output, the input and output columns.")
    log = read(options["log_file"], options, **columns)
    for role, values in (("drive", log.X), ("position", log.y)):
        if np.ptp(values) == 0:
            raise LogError(
                f"{log.name}: {log.columns[role]} never changes; give a log in which the axis is driven and moves."
            )
    timed = columns.get("time") or options.get("rate")
    seen = view(log.X[:, 0], log.y, 1.0 / log.sample_rate if timed else 1.0, options["logged"], log.groups)
    if seen.y.size < log.y.size:
        note(f"{seen.y.size} of {log.y.size} samples are used: the other segments are too short.")
    if seen.logged == "position":
        note(
            f"{log.columns['position']} is a position: its velocity is fitted, and scores are of the velocity. "
            "`--logged output` fits the column as it is."
        )
    segment = np.repeat(np.arange(seen.bounds.size - 1), np.diff(seen.bounds))
    groups = segment if seen.starts else None
    return ComparedRecord(Path(log.name).stem, seen.u[:, None], seen.target, groups, log.columns["drive"])


def orders_of(text: str) -> dict[str, Any]:
    """The four orders from ``2,2,2,2``."""
    parts = text.split(",")
    if len(parts) != 4 or not all(p.strip().isdigit() for p in parts):
        raise ValueError(f"--orders is {text!r}; expected four whole numbers n_a,n_b,n_c,n_d such as 2,2,2,2.")
    return dict(zip(("n_a", "n_b", "n_c", "n_d"), map(int, parts), strict=True))


def names_of(files: Sequence[str]) -> list[str]:
    """Labels of the records: the file names, with their folders if names repeat.

    Examples
    --------
    >>> names_of(("a.csv", "b.csv")), names_of(("mon/a.csv", "tue/a.csv"))
    (['a.csv', 'b.csv'], ['mon/a.csv', 'tue/a.csv'])
    """
    names = [Path(f).name for f in files]
    return names if len(set(names)) == len(names) else [str(f) for f in files]
