"""A stream as a job: its source, its records, its checkpoint and its run in MLflow, apart from the command line."""

from __future__ import annotations

import contextlib
import signal
import sys
import time
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any, NamedTuple

import click
from sklearn.base import clone

from whsklearn.change import ChangeAlarm
from whsklearn.cli.interruption import insisted
from whsklearn.cli.job import root
from whsklearn.cli.stream_files import alone, check_files, fingerprint
from whsklearn.cli.stream_loop import Carried, Options, Record, Refused, Stream
from whsklearn.cli.stream_out import Out
from whsklearn.cli.stream_rows import CsvParser, FollowedFile, JsonParser, LineSource, PipedLines
from whsklearn.logs.units import UNSTATED, unit_of
from whsklearn.state import read_state, write_state
from whsklearn.tracking import BesideRun, estimator_params, open_tracker
from whsklearn.tracking.beside import CLOSE_SECONDS, HURRIED_SECONDS

KIND = "stream"


class Files(NamedTuple):
    """What a stream reads and writes, and when."""

    source: str  # a path, or - for stdin
    out: Path | None
    kept: Path
    follow: bool
    fresh: bool
    checkpoint_seconds: float
    stops_when_full: bool


GRACE_SECONDS = 1.0  # for the rows in hand once a stop is asked for: whoever asks waits for no longer than 2 s


class Late(BaseException):  # as KeyboardInterrupt, which a compiler that catches every Exception must not swallow
    """The time allowed for finishing the current rows after a stop request is over."""


class Stopper:
    """SIGTERM and SIGINT ask for a stop after the rows in hand; a second one stops at once.

    Rows that take long, the first ones above all, which wait for compilers, are given up after `GRACE_SECONDS`.
    """

    def __init__(self) -> None:
        self.by = ""
        self._before = {s: signal.signal(s, self._ask) for s in (signal.SIGTERM, signal.SIGINT)}

    def _ask(self, number: int, frame: Any) -> None:
        self._put_back()
        self.by = signal.Signals(number).name
        if hasattr(signal, "setitimer"):
            self._before[signal.SIGALRM] = signal.signal(signal.SIGALRM, self._give_up)
            signal.setitimer(signal.ITIMER_REAL, GRACE_SECONDS)

    def _give_up(self, number: int, frame: Any) -> None:
        raise Late

    def restore(self) -> None:
        """Put back the handlers that were there."""
        if hasattr(signal, "setitimer"):
            signal.setitimer(signal.ITIMER_REAL, 0.0)
        self._put_back()

    def _put_back(self) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)


def run_stream(
    model: Any, columns: list[str], options: Options, files: Files, alarm: ChangeAlarm, *, track: bool
) -> None:
    """Feed the model from the source until that ends or a signal comes; goes on where a checkpoint stands."""
    source, kept = files.source, files.kept
    check_files(source, files.out, kept, files.fresh)
    with alone(kept, files.out):
        place: dict[str, Any] = {"columns": columns, "offset": 0, "number": 0, "header": "", "out": 0, "run": ""}
        loaded = {} if files.fresh or not kept.exists() else _load(kept, model, columns)
        place |= loaded.get("place", {})
        _check_source(source, place)
        writer = Out(files.out, place["out"] if loaded else None, files.fresh)
        run = BesideRun(
            lambda: open_tracker("stream", root=root(), enabled=track),
            Path(source).name if source != "-" else "stdin",
            params=estimator_params(model) | {"source": source, "columns": ", ".join(map(_with_unit, columns))},
            tags={"resumed_from": place["run"]},
            say=lambda sentence: click.echo(sentence, err=True),
        )
        place["run"] = run.id
        stream = Stream(model, alarm, options, _to(writer, run))
        if loaded:
            _restore(stream, loaded)
        keeper = Keeper(stream, files, place, writer)
        hurried = True
        try:
            with contextlib.closing(writer):
                hurried = _run(stream, files, place, keeper)
        finally:
            if lost := run.close(HURRIED_SECONDS if hurried else CLOSE_SECONDS):
                click.echo(f"{lost} sets of metrics did not reach the record in MLflow.", err=True)


def _run(stream: Stream, files: Files, place: dict[str, Any], keeper: Keeper) -> bool:
    """Feed the stream until its source ends or a signal comes, then write the last checkpoint.

    A bad row that is refused ends it with a checkpoint before that row.  Any other error, and rows that are given up
    for a signal, leave the last periodic checkpoint, from which the rows since are taken again.  Whether a signal came.
    """
    began, rows = time.monotonic(), stream.carried.rows
    if rows:
        click.echo(f"Going on after row {rows} from {files.kept}.", err=True)
    stopper = Stopper()
    with contextlib.closing(_open(files.source, place, files.follow)) as lines:
        if not rows:  # from here on a crash at any instant knows where rows and records stood
            keeper.save(lines)
        try:
            with insisted(Late, KeyboardInterrupt):
                _feed(stream, files, place, lines, stopper, keeper)
        except Refused:
            keeper.save(lines)
            raise
        except Late:
            click.echo(
                "The rows in hand take long and are given up; they are taken again from the checkpoint.", err=True
            )
        else:
            stopper.restore()
            keeper.save(lines)
        finally:
            stopper.restore()
        if lines.left:
            click.echo("The last line has no end; it is left until it is whole, or give --follow.", err=True)
    c, waiting = stream.carried, len(stream.clock.ahead) + len(stream.clock.back)
    if waiting:
        click.echo(f"{waiting} rows after a leap of the clock wait for what comes after them.", err=True)
    taken, spent = c.rows - rows, time.monotonic() - began
    click.echo(
        f"{'Stopped by ' + stopper.by if stopper.by else 'The source ended'} after row {c.rows} "
        f"({taken} rows now, {taken / spent:.0f} rows/s, {c.bad} bad, {c.repeated} repeated, {c.alarms} alarms); "
        f"{keeper.outlook(c.rows)}",
        err=True,
    )
    return bool(stopper.by)


def _feed(
    stream: Stream, files: Files, place: dict[str, Any], lines: LineSource, stopper: Stopper, keeper: Keeper
) -> None:
    """Blocks of lines to the stream, and a checkpoint every so many seconds."""
    parse = _parser(files.source, place)
    due = time.monotonic() + files.checkpoint_seconds
    while not stopper.by and (block := lines.read()) is not None:
        if lines.restarted:
            lines.restarted, parse = False, None
            click.echo(f"{files.source} was replaced or cut; reading it from its new beginning.", err=True)
        if parse is None and block:
            place["header"] = block.pop(0).decode("utf-8", errors="replace")
            parse = _parser(files.source, place)
        if parse is not None and block:
            try:
                stream.feed(block, parse, lines.number - len(block) + 1)
            except Refused:
                lines.hand_back(block[stream.taken :])
                raise
        if time.monotonic() > due:
            keeper.save(lines)
            due = time.monotonic() + files.checkpoint_seconds


def _open(source: str, place: dict[str, Any], follow: bool) -> LineSource:
    """The source, where the checkpoint left it; a pipe cannot go back and goes on where it is."""
    if source == "-":
        return PipedLines(sys.stdin.buffer, number=place["number"], open_end=True)
    path = Path(source)
    if follow:
        return FollowedFile(path, offset=place["offset"], number=place["number"])
    return LineSource(open(path, "rb"), offset=place["offset"], number=place["number"])


def _check_source(source: str, place: dict[str, Any]) -> None:
    """Raise if a file is not the one that was read before."""
    if source == "-" or not place["header"]:
        return
    with open(source, "rb") as file:
        header = file.readline().rstrip(b"\n").decode("utf-8", errors="replace")
    known = place.get("fingerprint", "")
    if (
        header != place["header"]
        or Path(source).stat().st_size < place["offset"]
        or (known and fingerprint(source, place["offset"]) != known)
    ):
        raise ValueError(f"{source} is not the file that the checkpoint was written for; give --fresh to begin anew.")


def _parser(source: str, place: dict[str, Any]) -> Callable[[bytes], list[float]] | None:
    """What turns lines into numbers; None until a CSV file's header is known."""
    if source == "-":
        return JsonParser(place["columns"])
    return CsvParser(place["header"].encode(), place["columns"]) if place["header"] else None


def _to(writer: Out, run: BesideRun) -> Callable[[Record], None]:
    """Where records go: all to the output, bad rows and alarms to the terminal, estimates and alarms to MLflow."""

    def emit(record: Record) -> None:
        writer(record)
        metrics = {}
        if record["kind"] == "bad_row":
            click.echo(f"line {record['line']}: {record['reason']}; passed over.", err=True)
        elif record["kind"] == "estimate":
            metrics = {f"path/{k}": v for k, v in record["parameters"].items()}
            if record["innovation_rmse"] is not None:
                metrics["innovation_rmse"] = record["innovation_rmse"]
        elif record["kind"] == "alarm":
            metrics = {"alarm" if record["cause"] == "change" else record["cause"]: 1.0}
            if record["cause"] != "change":
                click.echo(f"line {record['line']}: alarm {record['cause']}: {record['reason']}.", err=True)
        if metrics:
            run.log_metrics(metrics, step=record["row"])

    return emit


class Keeper:
    """Writes the checkpoint; a full disk ends the stream or leaves it without one, which is reported once."""

    def __init__(self, stream: Stream, files: Files, place: dict[str, Any], writer: Out):
        self.stream, self.files, self.place, self.writer = stream, files, place, writer
        self._failing = False
        self._rows: int | None = stream.carried.rows or None  # up to which a checkpoint is on the disk

    def outlook(self, rows: int) -> str:
        """From where the stream goes on if it is started again."""
        if not self._failing:
            return f"started again, the stream goes on from {self.files.kept}."
        if self._rows is None:
            return "no checkpoint could be written, so started again, the stream begins anew."
        return (
            f"the checkpoint {self.files.kept} is that of row {self._rows}, and started again, the stream takes the "
            f"{rows - self._rows} rows since then once more."
        )

    def save(self, lines: LineSource) -> None:
        """Write the checkpoint; records up to it are on the disk before."""
        stream, self.place["out"] = self.stream, self.writer.settle()
        self.place |= {"offset": lines.offset, "number": lines.number}
        self.place["fingerprint"] = fingerprint(self.files.source, lines.offset) if lines.file.seekable() else ""
        fitted = stream.carried.rows > 0
        state = {
            "place": self.place,
            "carried": asdict(stream.carried),
            "model": stream.model.get_state() if fitted else {},
            "alarm": stream.alarm.get_state() if stream.alarm.started else {},
            "innovations": stream.innovations.get_state() if fitted else {},
            "clock": stream.clock.get_state(),
        }
        settled = clone(stream.model).set_params(forgetting=stream.forgetting)
        try:
            write_state(self.files.kept, KIND, {"estimator": settled, "alarm": stream.alarm}, state)
        except OSError as error:
            said = f"The checkpoint {self.files.kept} cannot be written ({error.strerror})"
            if self.files.stops_when_full:
                raise OSError(f"{said}; make room and start again, nothing is lost.") from None
            if not self._failing:
                click.echo(f"{said}; the stream goes on without it.", err=True)
            self._failing = True
            return
        self._rows = stream.carried.rows
        if self._failing:
            click.echo(f"The checkpoint {self.files.kept} is written again.", err=True)
        self._failing = False


def _load(kept: Path, model: Any, columns: list[str]) -> dict[str, Any]:
    """The checkpoint, if it is of the same model and columns."""
    params, state = read_state(kept, KIND)
    if state["place"]["columns"] != columns:
        learnt, given = (", ".join(map(_with_unit, names)) for names in (state["place"]["columns"], columns))
        raise ValueError(
            f"{kept} was learnt from {learnt}, and this stream reads {given}; a stream goes on in the columns and "
            "units that it began with. Name those, or give --fresh to begin anew."
        )
    if repr(params["estimator"]) != repr(model):
        raise ValueError(
            f"{kept} was written with {params['estimator']!r}; start with the same options, or give --fresh to begin "
            "anew."
        )
    return state


def _with_unit(column: str) -> str:
    """A column and its unit, where its name says one.

    Examples
    --------
    >>> _with_unit("drive_mnm"), _with_unit("u")
    ('drive_mnm in mNm', 'u')
    """
    unit = unit_of(column)
    return column if unit in UNSTATED else f"{column} in {unit}"


def _restore(stream: Stream, state: dict[str, Any]) -> None:
    """Put the stream where the checkpoint stands."""
    stream.resume(Carried(**state["carried"]), state["model"], state["innovations"], state.get("clock", {}))
    if state["alarm"]:
        stream.alarm.set_state(state["alarm"])
