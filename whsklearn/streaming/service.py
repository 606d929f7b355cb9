"""A stream as a service: its source, its records, its checkpoint, its signals and its run in MLflow."""

from __future__ import annotations

import contextlib
import functools
import signal
import sys
import threading
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

from sklearn.base import clone

from whsklearn._interruption import insisted
from whsklearn.change import ChangeAlarm
from whsklearn.logs.errors import LogError
from whsklearn.logs.packed import foreign
from whsklearn.logs.units import UNSTATED, unit_of
from whsklearn.state import is_state, read_state, write_state
from whsklearn.streaming.files import Out, alone, check_files, fingerprint
from whsklearn.streaming.monitor import Options, Record, Refused, StreamMonitor
from whsklearn.streaming.rows import CsvParser, FollowedFile, JsonParser, LineSource, PipedLines, text_of
from whsklearn.streaming.sides import Compare
from whsklearn.tracking import BesideRun, estimator_params, open_tracker
from whsklearn.tracking.beside import CLOSE_SECONDS, HURRIED_SECONDS

KIND = "stream"


class Files(NamedTuple):
    """The files that a stream reads and writes, and when.

    Attributes
    ----------
    source : str
        A CSV file, or ``-`` for JSON lines on stdin.
    out : Path or None
        Where the records are written; stdout if None.
    kept : Path
        The checkpoint, from which a restarted stream resumes.
    follow : bool
        Whether to wait for more data at the end of the file.
    fresh : bool
        Whether to start over even if there is a checkpoint.
    checkpoint_seconds : float
        Time between checkpoints (s).
    stops_when_full : bool
        Whether the stream ends if no checkpoint can be written; otherwise it continues without one.

    References
    ----------
    Gray and Reuter 1993, Transaction Processing, Morgan Kaufmann, on checkpoints that are replaced atomically.

    Examples
    --------
    >>> from pathlib import Path
    >>> from whsklearn.streaming import Files
    >>> Files("axis.csv", None, Path("axis.whs")).checkpoint_seconds
    5.0
    """

    source: str
    out: Path | None
    kept: Path
    follow: bool = False
    fresh: bool = False
    checkpoint_seconds: float = 5.0
    stops_when_full: bool = False


Say = Callable[[str], None]
MOVED_SECONDS = 30.0  # for a comparison that runs when its source ends; one takes 1 to 5
FEWEST_COMPARED = 1000  # rows after an alarm for a sentence at the end; fewer say little
# sentences of a kind on the terminal: the first ones, then fewer and fewer
SAID, SAID_AFTER = 10, frozenset(10**k for k in range(2, 19))
GRACE_SECONDS = 1.0  # for the current rows after a stop request, so that a stop takes no longer than 2 s


class Late(BaseException):  # like KeyboardInterrupt, so that a compiler that catches every Exception cannot swallow it
    """Raised when the time allowed for finishing the current rows after a stop request is over."""


class Stopper:
    """SIGTERM and SIGINT request a stop after the current rows; a second one stops at once.

    Rows that take longer than `GRACE_SECONDS` are abandoned; the first rows, which wait for compilers, often do.
    Python delivers signals to the main thread only, so in any other thread this class does nothing.
    """

    def __init__(self) -> None:
        self.by = ""
        self._main = threading.current_thread() is threading.main_thread()
        wanted = (signal.SIGTERM, signal.SIGINT) if self._main else ()
        self._before: dict[int, Any] = {s: signal.signal(s, self._ask) for s in wanted}

    def _ask(self, number: int, frame: Any) -> None:
        self._put_back()
        self.by = signal.Signals(number).name
        if hasattr(signal, "setitimer"):
            self._before[signal.SIGALRM] = signal.signal(signal.SIGALRM, self._give_up)
            signal.setitimer(signal.ITIMER_REAL, GRACE_SECONDS)

    def _give_up(self, number: int, frame: Any) -> None:
        raise Late

    def restore(self) -> None:
        """Restore the previous signal handlers."""
        if self._main and hasattr(signal, "setitimer"):
            signal.setitimer(signal.ITIMER_REAL, 0.0)
        self._put_back()

    def _put_back(self) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)


_to_stderr: Say = functools.partial(print, file=sys.stderr)


def run_stream(
    model: Any,
    columns: list[str],
    files: Files,
    options: Options | None = None,
    alarm: ChangeAlarm | float = 1e6,
    *,
    compare: Compare | None = None,
    root: Path | None = None,
    say: Say = _to_stderr,
) -> None:
    r"""Feed a model from a source until the source ends or a signal arrives; resume from a checkpoint if there is one.

    Parameters
    ----------
    model : estimator
        A recursive estimator of this package; it is fitted in place.
    columns : list of str
        The columns to read: the time if rows have one (``options.timed``), the inputs, the output.
    files : Files
        The files to read and write.
    options : Options, optional
        How rows are handled.
    alarm : ChangeAlarm or float, default=1e6
        The alarm that watches the innovations, or its smallest mean number of rows between false alarms.
    compare : callable, optional
        Compares the rows before and after an alarm, see `StreamMonitor`.
    root : Path, optional
        The folder that holds ``mlruns/``; without one nothing is recorded in MLflow.
    say : callable
        Called with each message for the user; prints to stderr by default.

    Raises
    ------
    ValueError
        If two of the files are the same, if the checkpoint belongs to another model, file or columns, or if another
        stream is using it.
    Refused
        At the first bad row, if ``options.refuse``.
    LogError
        If the source ends and none of its lines was a row.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from whsklearn import RLSRegressor
    >>> from whsklearn.streaming import Files, Options, run_stream
    >>> folder = Path(tempfile.mkdtemp())
    >>> _ = (folder / "log.csv").write_text("u,y\n" + "".join(f"{i % 7},{2 * (i % 7)}\n" for i in range(500)))
    >>> files = Files(str(folder / "log.csv"), folder / "records.jsonl", folder / "log.whs")
    >>> model = RLSRegressor()
    >>> run_stream(model, ["u", "y"], files, Options(every=250), say=lambda sentence: None)
    >>> len((folder / "records.jsonl").read_text().splitlines())
    2
    """
    options = options or Options()
    alarm = alarm if isinstance(alarm, ChangeAlarm) else ChangeAlarm(interval=alarm)
    source, kept = files.source, files.kept
    check_files(source, files.out, kept, files.fresh)
    with alone(kept, files.out):
        place: dict[str, Any] = {"columns": columns, "offset": 0, "number": 0, "header": "", "out": 0, "run": ""}
        loaded = {} if files.fresh or not kept.exists() else _load(kept, model, columns)
        place |= loaded.get("place", {})
        _check_source(source, place)
        writer = Out(files.out, place["out"] if loaded else None, files.fresh)
        called = "stdin" if source == "-" else source
        run = BesideRun(
            lambda: open_tracker("stream", root=root or Path.cwd(), enabled=root is not None),
            Path(called).name,
            params=estimator_params(model) | {"source": called, "columns": ", ".join(map(_with_unit, columns))},
            tags={"resumed_from": place["run"]},
            say=say,
        )
        place["run"] = run.id
        stream = StreamMonitor(model, alarm, options, _to(writer, run, say), compare)
        if loaded:
            stream.set_state(loaded)
        keeper = Keeper(stream, files, place, writer, say)
        hurried = True
        try:
            with contextlib.closing(writer):
                hurried = _run(stream, files, place, keeper)
        finally:
            if lost := run.close(HURRIED_SECONDS if hurried else CLOSE_SECONDS):
                say(f"{lost} sets of metrics did not reach the record of the run in MLflow.")


def _run(stream: StreamMonitor, files: Files, place: dict[str, Any], keeper: Keeper) -> bool:
    """Feed the stream until its source ends or a signal arrives, then write the last checkpoint.

    A bad row that is refused ends the stream with a checkpoint before that row.  After any other error, or if rows are
    abandoned because of a signal, the last periodic checkpoint remains, and the rows since then are read again.
    Returns whether a signal arrived.
    """
    began, rows = time.monotonic(), stream.carried.rows
    if rows:
        keeper.say(f"Resuming after row {rows} from {files.kept}.")
    stopper = Stopper()
    with contextlib.closing(_open(files.source, place, files.follow)) as lines:
        if not rows:  # from here on, the stream can be resumed after a crash at any instant
            keeper.save(lines)
        try:
            with insisted(Late, KeyboardInterrupt):
                _feed(stream, files, place, lines, stopper, keeper)
        except Refused:
            keeper.save(lines)
            raise
        except Late:
            keeper.say("The current rows take too long and are abandoned; a restart reads them again.")
        else:
            stopper.restore()
            stream.tell_moved(0.0 if stopper.by else MOVED_SECONDS)
            keeper.save(lines)
        finally:
            stopper.restore()
        if lines.left:
            keeper.say("The last line has no end and was not read; complete it, or wait for its end with --follow.")
    c, ahead = stream.carried, len(stream.clock.ahead) + len(stream.clock.back)
    repeated, leapt = (sum(len(one.waiting) for one in each) for each in (stream.freezes, stream.jumps))
    held = [name for name, one in zip(stream.options.outputs, stream.freezes, strict=False) if one.waiting and name]
    of = f" of {', '.join(held)}" if held else ""
    waiting = (
        (ahead, "after a leap of the clock"), (repeated, f"that repeat the position{of}"), (leapt, "after a jump"),
        (len(stream.lone.waiting), "with a value beyond all before it"),
    )  # fmt: skip
    for n, what in waiting:
        if n:
            keeper.say(f"{n} rows {what} are still waiting for the rows after them.")
    for said in stream.at_the_end():
        keeper.say(f"At the end {said}.")
    if not stopper.by and stream.sides is not None and (said := stream.sides.so_far(FEWEST_COMPARED)):
        keeper.say(f"So far after the alarm: {said}")
    taken, spent = c.rows - rows, time.monotonic() - began
    keeper.say(
        f"{'Stopped by ' + stopper.by if stopper.by else 'The source ended'} after row {c.rows} "
        f"({taken} rows now, {taken / spent:.0f} rows/s, {c.bad} bad, {c.repeated} repeated, {c.alarms} alarms"
        f"{'; ' * bool(stream.lacking())}{stream.lacking()}); {keeper.outlook(c.rows)}"
    )
    if c.bad and not c.rows and not stopper.by:
        raise LogError(f"None of the {c.bad} lines of {files.source} is a row; see above what is wrong with them.")
    if lines.left and not lines.offset and not stopper.by:
        raise LogError(f"{files.source} has no complete line; a stream reads lines that end with LF or CR LF.")
    if not (c.rows or c.bad or any(n for n, _ in waiting) or stopper.by):
        raise LogError(f"{'stdin' if files.source == '-' else files.source} holds no rows.")
    return bool(stopper.by)


def _feed(
    stream: StreamMonitor, files: Files, place: dict[str, Any], lines: LineSource, stopper: Stopper, keeper: Keeper
) -> None:
    """Feed blocks of lines to the stream, and write a checkpoint every ``checkpoint_seconds``."""
    timed = stream.options.timed
    parse = _parser(files.source, place, timed)
    due = time.monotonic() + files.checkpoint_seconds
    while not stopper.by and (block := lines.read()) is not None:
        if lines.restarted:
            lines.restarted, parse = False, None
            keeper.say(f"{files.source} was replaced or truncated; reading it from its new beginning.")
        if parse is None and block:
            if what := foreign(block[0]):
                raise LogError(f"{files.source} is {what}.")
            place["header"] = text_of(block.pop(0))
            parse = _parser(files.source, place, timed)
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
    """Open the source at the position of the checkpoint; a pipe cannot go back and continues where it is."""
    if source == "-":
        if sys.stdin is None:
            raise ValueError("The standard input is closed; pipe the rows into it, or give a file.")
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
        header = text_of(file.readline().rstrip(b"\n"))
        found = fingerprint(file, place["offset"])
    known = place.get("fingerprint", "")
    if header != place["header"] or Path(source).stat().st_size < place["offset"] or (known and found != known):
        raise ValueError(f"{source} is not the file that the checkpoint was written for; give --fresh to start over.")


def _parser(source: str, place: dict[str, Any], timed: bool) -> Callable[[bytes], list[float] | None] | None:
    """The parser that converts lines to numbers; None until a CSV file's header is known."""
    if source == "-":
        return JsonParser(place["columns"])
    return CsvParser(place["header"].encode(), place["columns"], timed) if place["header"] else None


def _to(writer: Out, run: BesideRun, say: Say) -> Callable[[Record], None]:
    """Send all records to the output, bad rows and alarms to the terminal, and estimates and alarms to MLflow."""
    seen: Counter[str] = Counter()

    def sometimes(what: str, text: str) -> None:
        seen[what] += 1
        n = seen[what]
        if n <= SAID or n in SAID_AFTER:
            say(text + (f" This is the {n}th {what}; the records hold all of them." if n > SAID else ""))

    def emit(record: Record) -> None:
        writer(record)
        metrics = {}
        if record["kind"] == "bad_row":
            sometimes("bad row", f"line {record['line']}: {record['reason']}; skipped.")
        elif record["kind"] == "estimate":
            metrics = {f"path/{k}": v for k, v in record["parameters"].items()}
            rmse = record["innovation_rmse"]
            if isinstance(rmse, dict):
                metrics |= {f"innovation_rmse/{joint}": value for joint, value in rmse.items()}
            elif rmse is not None:
                metrics["innovation_rmse"] = rmse
        elif record["kind"] == "moved":
            say(f"Alarm at row {record['alarm_row']}: {record['sentence']}")
            metrics = {"moved": float(record["verdict"] == "moved")}
        elif record["kind"] == "alarm":
            metrics = {"alarm" if record["cause"] == "change" else record["cause"]: 1.0}
            if record["cause"] == "change":
                at = f" at {record['joint']}" if "joint" in record else ""
                sometimes("change alarm", f"row {record['row']}: alarm change: the errors{at} are not what they were.")
            else:
                sometimes(
                    f"{record['cause']} alarm", f"line {record['line']}: alarm {record['cause']}: {record['reason']}."
                )
        elif record["kind"] == "change":
            text = ", ".join(record["changes"]) or "no parameter moved by more than --smallest-change"
            sometimes("change", f"row {record['row']}: change since row {record['since_row']}: {text}.")
        if metrics:
            run.log_metrics(metrics, step=record["row"])

    return emit


class Keeper:
    """Writes the checkpoint; if the disk is full, the stream ends or continues without one, which is reported once."""

    def __init__(self, stream: StreamMonitor, files: Files, place: dict[str, Any], writer: Out, say: Say = _to_stderr):
        self.stream, self.files, self.place, self.writer, self.say = stream, files, place, writer, say
        self._failing = False
        self._rows: int | None = stream.carried.rows or None  # row of the checkpoint on the disk

    def outlook(self, rows: int) -> str:
        """Where the stream resumes if it is restarted."""
        if not self._failing:
            return f"a restarted stream resumes from {self.files.kept}."
        if self._rows is None:
            return "no checkpoint could be written, so a restarted stream begins at the first row."
        return (
            f"the last checkpoint, {self.files.kept}, was written at row {self._rows}, so a restarted stream reads the "
            f"{rows - self._rows} rows since then again."
        )

    def save(self, lines: LineSource) -> None:
        """Write the checkpoint, after all records up to it are on the disk."""
        stream, self.place["out"] = self.stream, self.writer.settle()
        self.place |= {"offset": lines.offset, "number": lines.number}
        self.place["fingerprint"] = fingerprint(lines.file, lines.offset)
        state = {"place": self.place, **stream.get_state()}
        settled = clone(stream.model).set_params(forgetting=stream.forgetting)
        try:
            write_state(self.files.kept, KIND, {"estimator": settled, "alarm": stream.alarm}, state)
        except OSError as error:
            said = f"The checkpoint {self.files.kept} cannot be written ({error.strerror})"
            if self.files.stops_when_full:
                raise OSError(f"{said}; free some space and start again, nothing is lost.") from None
            if not self._failing:
                self.say(f"{said}; the stream continues without it.")
            self._failing = True
            return
        self._rows = stream.carried.rows
        if self._failing:
            self.say(f"The checkpoint {self.files.kept} can be written again.")
        self._failing = False


def _load(kept: Path, model: Any, columns: list[str]) -> dict[str, Any]:
    """The state in the checkpoint; raises if it cannot be read, or belongs to another model or other columns."""
    try:
        params, state = read_state(kept, KIND)
    except ValueError as error:
        raise ValueError(f"{error} Or give --fresh to start over." if is_state(kept) else str(error)) from None
    other = state["place"]["columns"] != columns or repr(params["estimator"]) != repr(model)
    if other and not state["place"]["offset"]:  # of a start that failed before it read a line
        return {}
    if state["place"]["columns"] != columns:
        learnt, given = (", ".join(map(_with_unit, names)) for names in (state["place"]["columns"], columns))
        raise ValueError(
            f"{kept} was learnt from {learnt}, and this stream reads {given}; a resumed stream must have the same "
            "columns and units. Name those, or give --fresh to start over."
        )
    if (begun := repr(params["estimator"])) != repr(model):
        said = f"{kept} was written with {' '.join(begun.split())}"
        raise ValueError(f"{said}; start with the same options, or give --fresh to start over.")
    return state


def _with_unit(column: str) -> str:
    """A column and its unit, if its name states one.

    >>> _with_unit("drive_mnm"), _with_unit("u")
    ('drive_mnm in mNm', 'u')
    """
    unit = unit_of(column)
    return column if unit in UNSTATED else f"{column} in {unit}"
