"""A user's log for a command: its columns, reading, the part that is used, and notes on the terminal."""

from __future__ import annotations

import contextlib
import warnings
from collections.abc import Iterator, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import numpy as np

from whsklearn.cli.job import wrapped
from whsklearn.cli.options import units_of

if TYPE_CHECKING:
    from sklearn.utils import Bunch

    from whsklearn.cli.comparison import ComparedRecord
    from whsklearn.logs.source import Source

_QUIET = ("LOG005", "LOG006", "LOG007")  # in the report only; on the terminal they would appear for nearly every log
MOST_ROWS = 300_000  # of a diagnosis: five minutes at 1 kHz, which take half a GB and a minute or two
_SIGNALS = ("X", "y", "time", "reference", "command", "groups", "frame")


def roles_of(
    source: Source,
    given: Mapping[str, str | None],
    needed: tuple[str, ...],
    usual: Mapping[str, str],
    options: Mapping[str, Any],
) -> dict[str, str]:
    """The column of every role: as given, by its usual name, or recognised by its name, with a note.

    Raises ColumnError if a required role has no column or several, or if the column found for the drive is a current or
    an effort.
    """
    from whsklearn.logs.current import doubt, is_current
    from whsklearn.logs.errors import ColumnError
    from whsklearn.logs.roles import guess
    from whsklearn.logs.units import unit_in

    roles = {r: source.resolve(c, r) for r, c in given.items() if c is not None}
    for role in needed:
        if role in roles:
            continue
        found = usual[role] if usual.get(role) in source.names else guess(source, role)
        if found is None and role == "position" and (found := guess(source, "velocity")) is not None:
            role = "velocity"  # the log of a speed loop: the position is the integral of the velocity
        if found is None:
            instead = {
                "drive": ", or the command of a position servo with --command" if "command" in options else "",
                "position": ", or the velocity with --velocity" if "velocity" in options else "",
                "time": ", or the samples per second with --rate",
            }
            raise ColumnError(
                f"{source.name} has no column that is clearly the {role}; it has: {', '.join(source.names[:30])}. "
                f"Name it with --{role}{instead.get(role, '')}, or by number with --columns."
            )
        if role == "drive" and found != usual.get(role) and not units_of(options.get("units", ())).get("drive"):
            unit = unit_in(source.units.get(found, ""), found)
            if (text := doubt(found, unit)) and not (options.get("torque_constant") and is_current(found, unit)):
                raise ColumnError(f"{source.name} has no column that is clearly a torque. {text}")
        if found != usual.get(role):
            note(f"Column {found!r} is taken for the {role}.")
        roles[role] = found
    return roles


def read_system(path: str | Path, options: Mapping[str, Any], logged: str = "") -> Bunch:
    """Read a log by ``--columns`` or `system_options`; columns that are not named are recognised by their names.

    An output may be any motion; if ``logged`` is a position, a velocity is integrated.
    """
    from whsklearn.logs import open_source
    from whsklearn.logs.roles import by_number, guess
    from whsklearn.logs.units import integral_of, unit_in

    source = open_source(path)
    named = {"time": "time_column", "drive": "input_column", "position": "output_column"}
    given: dict[str, str | None] = {role: options[option] for role, option in named.items()}
    if options["columns"]:
        given = {**by_number(options["columns"], chain=True)}
    elif given["time"] is None and not options["rate"] and not source.clocked:
        given["time"] = guess(source, "time")
        if given["time"] is not None:
            note(f"Column {given['time']!r} is taken for the time.")
    roles = roles_of(source, given, ("drive", "position"), {}, options)
    output = roles.pop("velocity", None) or roles.pop("position")
    assert output is not None
    unit = units_of(options.get("units", ())).get("position")
    unit = unit or unit_in(source.units.get(output, ""), output, "position")
    if logged == "position" and integral_of(unit)[1] != unit:
        units = (*(u for u in options.get("units", ()) if not u.startswith("position")), f"velocity={unit}")
        return read(source, {**options, "units": units}, **roles, velocity=output)
    return read(source, options, **roles, position=output)


def read(source: Source, options: Mapping[str, Any], quiet: tuple[str, ...] = (), /, **columns: Any) -> Bunch:
    """Read the log, invert its drive if requested, and print its notes except those in ``quiet``."""
    from whsklearn.logs import load_log
    from whsklearn.logs.errors import LogWarning

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", LogWarning)
        units, constant = units_of(options.get("units", ())), options.get("torque_constant")
        log = load_log(source, **columns, units=units, sample_rate=options.get("rate"), torque_constant=constant)
    for finding in log.report.findings:
        unknown = finding.code == "LOG019" and finding.explanation.startswith("The unit of ")
        if unknown and not finding.explanation.startswith("The unit of time"):
            continue  # `note_assumed` says what is assumed, where a command assumes anything
        if finding.code not in (*_QUIET, *quiet) and not (finding.code == "LOG022" and options.get("gains")):
            note(f"{finding.title}. {finding.explanation}")
    if options.get("invert_drive"):
        log.X = -log.X
        log.notes = (*log.notes, "The sign of the drive was changed.")
    return log


def say_clipped(log: Bunch, *, limited: bool = False) -> None:
    """Print which signals of a log are clipped, where a model leaves something: what is missing may be in there.

    ``limited``: whether the limit of the drive has been named, which is then no defect of the log.
    """
    report = log.get("report")
    for finding in report.findings if report is not None else ():
        if finding.code == "LOG005" and not (limited and finding.explanation.startswith("drive ")):
            click.echo(wrapped(f"{log.name}: {finding.explanation}"))


def note(text: str) -> None:
    """Print a note on stderr, separate from the result; once in a command, however many logs call for it."""
    context = click.get_current_context(silent=True)
    said: set[str] = context.meta.setdefault(f"{__name__}.said", set()) if context is not None else set()
    if text not in said:
        said.add(text)
        click.echo(f"Note: {text}", err=True)


@contextlib.contextmanager
def warnings_as_notes() -> Iterator[None]:
    """Print the warnings of a block of code as notes, each once."""
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always", UserWarning)
        yield
    for text in dict.fromkeys(str(w.message) for w in said if issubclass(w.category, UserWarning)):
        note(text)


TESTED = "so the test would use data of the fit; give --test a log of another run"
TWICE = "so these samples would count twice; give logs of different runs"


def refuse_shared(train: Bunch, test: Bunch, why: str = TESTED) -> None:
    """Raise if a log contains samples of another one, whatever the file names; ``why`` says why this is refused.

    Raises LogError: with the span that both contain.
    """
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
    """Print a note on every unit that the log does not state and that is assumed, and keep it for the `origin`."""
    from whsklearn.logs.units import UNKNOWN, assumed

    stated = {role: log.units.get(role, "") for role in ("drive", "position")}
    units = dict(zip(stated, assumed(*stated.values()), strict=True))
    log.assumed = {role: unit for role, unit in units.items() if stated[role] == UNKNOWN}
    for role, si in (("drive", "Nm or N"), ("position", "rad or m")):
        if role in log.assumed:
            note(f"The unit of the {role} is not stated and is taken to be SI ({si}); --unit {role}=UNIT sets another.")


def note_slips(log: Bunch, options: Mapping[str, Any]) -> None:
    """Print the likely slips of unit and sign in the log of an axis, and keep them among its notes."""
    from whsklearn.logs.slips import slips_in

    for slip in slips_in(log):
        of_velocity = slip.option.startswith("--velocity") and "velocity" not in options
        text = str(slip._replace(option="--unit position=rad/s") if of_velocity else slip)
        if options["invert_drive"]:
            text = text.replace("add --invert-drive", "leave out --invert-drive")
        note(text)
        log.notes = (*log.notes, text)


SHORTEST_SEGMENT = 2.0  # s; in shorter segments a filter of 2 Hz and an observer leave nothing to judge


def long_segments(log: Bunch) -> Bunch:
    """All segments of a log of at least two seconds, in order, with a note on what is left out.

    Raises LogError if the segments between holes are too short for a diagnosis.
    """
    from whsklearn.gap.data_check import FEWEST_SAMPLES, SHORTEST_RECORD
    from whsklearn.logs.errors import LogError

    counts = np.bincount(log.groups)
    if counts.size == 1:
        return log
    kept = counts / log.sample_rate >= SHORTEST_SEGMENT
    rows, n = int(counts[kept].sum()), int(counts.max())
    if rows < FEWEST_SAMPLES or rows / log.sample_rate < SHORTEST_RECORD:
        remedy = "Log at a lower rate, or over a line that loses no samples."
        if "LOG013" in log.report.codes:
            remedy = "The clock begins again: if it is a counter that overflows, give --rate HZ in place of --time."
        raise LogError(
            f"{log.name}: {counts.size - 1} holes cut its {len(log.y)} samples into {counts.size} segments. The "
            f"longest has {n} samples over {(n - 1) / log.sample_rate:.3g} s, where {FEWEST_SAMPLES} samples and "
            f"{SHORTEST_RECORD:g} s are needed. {remedy}"
        )
    if kept.all():
        return log
    short = np.count_nonzero(~kept)
    return _cut(log, kept[log.groups], f": {short} of {counts.size} segments are shorter than {SHORTEST_SEGMENT:g} s.")


def bridged(log: Bunch) -> Bunch:
    """Cut the log at its longest holes until less is missing than was logged, with a note on what is left out.

    A chain also simulates the samples of a hole, which takes time and shows nothing.
    """
    first, last = 0, log.y.size
    while (log.time[last - 1] - log.time[first]) * log.sample_rate > 2 * (last - first):
        cut = first + 1 + int(np.argmax(np.diff(log.time[first:last])))
        first, last = (first, cut) if cut - first >= last - cut else (cut, last)
    if last - first == log.y.size:
        return log
    return _cut(log, slice(first, last), ": the holes beside them are longer than what was logged.")


def longest(log: Bunch) -> Bunch:
    """The longest segment of a log, with a note if there are others."""
    counts = np.bincount(log.groups)
    if counts.size == 1:
        return log
    return _cut(log, log.groups == np.argmax(counts), f": the longest of {counts.size} segments.")


def liveliest(log: Bunch) -> Bunch:
    """The part of a very long log in which the axis travels most, with a note if something is left out."""
    n = log.y.size
    if n <= MOST_ROWS:
        return log
    path = np.r_[0.0, np.cumsum(np.abs(np.diff(log.y)))]
    starts = np.linspace(0, n - MOST_ROWS, 50).astype(int)
    start = int(starts[np.argmax(path[starts + MOST_ROWS - 1] - path[starts])])
    why = "; more samples would add little. Another part can be given with --test as a separate file."
    return _cut(log, slice(start, start + MOST_ROWS), f", where the axis travels most{why}")


def rows_of(used: Bunch, whole: Bunch) -> dict[str, int]:
    """Rows and segments that are used and given, as a report shows them."""
    taken, segments = (len(set(log.groups.tolist())) for log in (used, whole))
    return {"used": len(used.y), "given": len(whole.y), "taken": taken, "segments": segments}


def _cut(log: Bunch, rows: Any, why: str) -> Bunch:
    """Some rows of a log, with a note on how many there are, from when to when, and ``why``."""
    part = type(log)(**{k: v[rows] if k in _SIGNALS and v is not None else v for k, v in log.items()})
    span = f"from {part.time[0]:.6g} to {part.time[-1]:.6g} s"
    text = f"{len(part.y)} of {len(log.y)} samples are used, {span}{why}"
    note(text)
    part.notes = (*part.notes, text)
    return part


def record_of(options: dict[str, Any]) -> ComparedRecord:
    """The record that the options of `tune` name; a position is replaced by its velocity, as in `identify`."""
    from whsklearn.cli.comparison import ComparedRecord
    from whsklearn.identification.view import view
    from whsklearn.logs.errors import LogError

    log = read_system(options["log_file"], options)
    for role, values in (("drive", log.X), ("position", log.y)):
        if np.ptp(values) == 0:
            raise LogError(
                f"{log.name}: {log.columns[role]} never changes; give a log in which the axis is driven and moves."
            )
    dt = 1.0 if log.units["time"] == "samples" else 1.0 / log.sample_rate
    seen = view(log.X[:, 0], log.y, dt, options["logged"], log.groups)
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


def origin(log: Bunch) -> str:
    """File, columns, span, rate, date and version in one sentence."""
    from whsklearn import __version__
    from whsklearn.logs.units import UNSTATED

    units = {role: f" (unit not stated, taken as {unit})" for role, unit in log.get("assumed", {}).items()}
    units |= {role: f" in {unit}" for role, unit in log.get("units", {}).items() if unit not in UNSTATED}
    columns = ", ".join(
        f"{r} from {c[0]!r} and {c[1]!r}" if isinstance(c, tuple) else f"{r} from {c!r}{units.get(r, '')}"
        for r, c in log.columns.items()  # by role, or position and drive by joint
    )
    today = datetime.now(UTC).date().isoformat()
    return (
        f"{log.name}: {columns}; {len(log.y)} samples over {log.time[-1] - log.time[0]:.4g} s at "
        f"{log.sample_rate:.6g} Hz; read on {today} by whsklearn {__version__}."
    )


def names_of(files: Sequence[str]) -> list[str]:
    """Labels of the records: the file names, with their folders if names repeat.

    >>> names_of(("a.csv", "b.csv")), names_of(("mon/a.csv", "tue/a.csv"))
    (['a.csv', 'b.csv'], ['mon/a.csv', 'tue/a.csv'])
    """
    names = [Path(f).name for f in files]
    return names if len(set(names)) == len(names) else [str(f) for f in files]
