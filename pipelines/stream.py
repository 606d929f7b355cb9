"""Identify an axis from rows as they come, day and night: estimates, predictions, alarms.

Rows come from a CSV file, from the same file as it grows (``--follow``), or as JSON lines on stdin (``-``).
What was learnt is kept in a checkpoint that is replaced in one step; started again, by hand or
after a crash, the stream goes on where the checkpoint stands.

Records are JSON lines: ``estimate``, ``prediction``, ``alarm``, ``change``, ``bad_row``.
"""

from __future__ import annotations

import contextlib
import json
import math
import os
import signal
import sys
import time
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any, BinaryIO

import click
from sklearn.base import clone

from pipelines._cli import job, say_where, tracker_for
from pipelines._stream_loop import Carried, Options, Record, Refused, Stream
from pipelines._stream_rows import CsvParser, FollowedFile, JsonParser, LineSource, PipedLines
from whsklearn import estimators
from whsklearn.change import ChangeAlarm
from whsklearn.lags import WienerHammersteinLags
from whsklearn.state import read_state, write_state
from whsklearn.tracking import Run, estimator_params

ESTIMATORS = {"rls": "RLSRegressor", "mils": "MILSRegressor", "rmils": "RMILSRegressor"}
KIND = "stream"


class Out:
    """Records to a file that a resumed stream cuts back to its checkpoint, or to stdout."""

    def __init__(self, path: Path | None, offset: int):
        self.path = path
        self.file: BinaryIO = sys.stdout.buffer if path is None else open(path, "ab")
        if path is not None:
            if os.fstat(self.file.fileno()).st_size < offset:
                raise ValueError(f"{path} is shorter than when the checkpoint was written; give another --out.")
            self.file.truncate(offset)

    def __call__(self, record: Record) -> None:
        """Write one record as a line of JSON; what is not finite is null."""
        self.file.write(json.dumps(_finite(record)).encode() + b"\n")

    def settle(self) -> int:
        """Flush, to the disk if it is a file; the number of bytes written."""
        self.file.flush()
        if self.path is None:
            return 0
        os.fsync(self.file.fileno())
        return self.file.tell()

    def close(self) -> None:
        """Close the file, but not stdout."""
        if self.path is not None:
            self.file.close()


class Stopper:
    """SIGTERM and SIGINT ask for a stop after the rows in hand; a second one stops at once."""

    def __init__(self) -> None:
        self.by = ""
        self._before = {s: signal.signal(s, self._ask) for s in (signal.SIGTERM, signal.SIGINT)}

    def _ask(self, number: int, frame: Any) -> None:
        self.by = signal.Signals(number).name
        self.restore()

    def restore(self) -> None:
        """Put back the handlers that were there."""
        for number, handler in self._before.items():
            signal.signal(number, handler)


@job
@click.argument("source")
@click.option("--input", "inputs", multiple=True, default=["u"], help="Input column; several times for several.")
@click.option("--output", default="y", help="Output column.")
@click.option("--time", "time_column", default=None, help="Time column; its values must increase.")
@click.option("--max-step", type=float, default=math.inf, help="A longer pause in time begins a new experiment.")
@click.option("--follow", is_flag=True, help="Wait for rows that are appended to the file.")
@click.option("--estimator", type=click.Choice(sorted(ESTIMATORS)), default="rmils", help="What learns.")
@click.option("--orders", default="2,2,2,2", help="n_a, n_b, n_c, n_d of the Wiener-Hammerstein model.")
@click.option("--law", default="reduced", help="Friction law: names joined by commas.")
@click.option("--p", type=int, default=4, help="Innovation length.")
@click.option("--forgetting", type=float, default=1.0, help="Forgetting factor.")
@click.option("--every", type=click.IntRange(1), default=1000, help="Rows between estimates.")
@click.option("--predictions/--no-predictions", default=False, help="Write the one-step prediction of every row.")
@click.option("--smallest-change", type=float, default=5.0, help="Per cent; lesser changes are not reported.")
@click.option("--alarm-interval", type=float, default=1e6, help="Rows between false alarms, on average, at least.")
@click.option("--bad-rows", type=click.Choice(["skip", "refuse"]), default="skip", help="Report and go on, or stop.")
@click.option("--gap", type=click.Choice(["hold", "restart"]), default="hold", help="In place of a bad row.")
@click.option(
    "--out", type=click.Path(dir_okay=False, path_type=Path), default=None, help="Records; stdout if left out."
)
@click.option("--checkpoint", type=click.Path(dir_okay=False, path_type=Path), default=None, help="[SOURCE.whs]")
@click.option("--checkpoint-every", type=float, default=5.0, help="Seconds between checkpoints.")
@click.option("--fresh", is_flag=True, help="Begin anew even if there is a checkpoint.")
def main(
    source: str, inputs: tuple[str, ...], output: str, time_column: str | None, max_step: float, follow: bool,
    estimator: str, orders: str, law: str, p: int, forgetting: float, every: int, predictions: bool,
    smallest_change: float, alarm_interval: float, bad_rows: str, gap: str, out: Path | None, checkpoint: Path | None,
    checkpoint_every: float, fresh: bool, seed: int, track: bool,
) -> None:  # fmt: skip
    """Identify from SOURCE, a CSV file or - for JSON lines on stdin, row by row; resumes by itself."""
    columns = [*([time_column] if time_column else []), *inputs, output]
    kept = checkpoint or Path("stdin.whs" if source == "-" else f"{source}.whs")
    model = build_model(estimator, orders, law, p, forgetting, seed)
    alarm = ChangeAlarm(interval=alarm_interval)
    options = Options(every, predictions, bad_rows == "refuse", gap == "restart", max_step, smallest_change)
    place: dict[str, Any] = {"columns": columns, "offset": 0, "number": 0, "header": "", "out": 0, "run": ""}
    loaded = {} if fresh or not kept.exists() else _load(kept, model, columns)
    place |= loaded.get("place", {})
    writer = Out(
        out, place["out"] if loaded else (0 if fresh or out is None or not out.exists() else out.stat().st_size)
    )
    tracker = tracker_for("stream", track)
    with (
        contextlib.closing(writer),
        tracker.run(Path(source).name if source != "-" else "stdin", tags={"resumed_from": place["run"]}) as run,
    ):
        run.log_params(estimator_params(model) | {"source": source, "columns": ",".join(columns)})
        place["run"] = run.id
        stream = Stream(model, alarm, options, _to(writer, run), timed=time_column is not None)
        if loaded:
            _restore(stream, loaded)
        _run(stream, source, place, follow, kept, checkpoint_every, writer)
    say_where(tracker)


def _run(
    stream: Stream, source: str, place: dict[str, Any], follow: bool, kept: Path, seconds: float, writer: Out
) -> None:
    """Feed the stream until its source ends or a signal comes, then write the last checkpoint.

    A bad row that is refused ends it with a checkpoint before that row.  Any other error leaves the
    last periodic checkpoint, from which the rows since are taken again.
    """
    began, rows = time.monotonic(), stream.carried.rows
    if rows:
        click.echo(f"Going on after row {rows} from {kept}.", err=True)
    stopper = Stopper()
    with contextlib.closing(_open(source, place, follow)) as lines:
        if not rows:  # from here on a crash at any instant knows where rows and records stood
            _save(stream, kept, place, lines, writer)
        try:
            _feed(stream, source, place, lines, stopper, lambda: _save(stream, kept, place, lines, writer), seconds)
        except Refused:
            _save(stream, kept, place, lines, writer)
            raise
        finally:
            stopper.restore()
        _save(stream, kept, place, lines, writer)
    taken, spent = stream.carried.rows - rows, time.monotonic() - began
    click.echo(
        f"{'Stopped by ' + stopper.by if stopper.by else 'The source ended'} after row {stream.carried.rows} "
        f"({taken} rows now, {taken / spent:.0f} rows/s, {stream.carried.bad} bad, {stream.carried.alarms} alarms); "
        f"started again, the stream goes on from {kept}.",
        err=True,
    )


def _feed(
    stream: Stream, source: str, place: dict[str, Any], lines: LineSource, stopper: Stopper,
    save: Callable[[], None], seconds: float,
) -> None:  # fmt: skip
    """Blocks of lines to the stream, and a checkpoint every so many seconds."""
    parse = _parser(source, place)
    due = time.monotonic() + seconds
    while not stopper.by and (block := lines.read()) is not None:
        if lines.restarted:
            lines.restarted, parse = False, None
            click.echo(f"{source} was replaced or cut; reading it from its new beginning.", err=True)
        if parse is None and block:
            place["header"] = block.pop(0).decode("utf-8", errors="replace")
            parse = _parser(source, place)
        if parse is not None and block:
            try:
                stream.feed(block, parse, lines.number - len(block) + 1)
            except Refused:
                lines.hand_back(block[stream.taken :])
                raise
        if time.monotonic() > due:
            save()
            due = time.monotonic() + seconds


def build_model(estimator: str, orders: str, law: str, p: int, forgetting: float, seed: int) -> Any:
    """The estimator that the options ask for."""
    try:
        n_a, n_b, n_c, n_d = (int(n) for n in orders.split(","))
    except ValueError:
        raise ValueError(f"--orders is {orders!r}, expected four whole numbers such as 2,2,2,2.") from None
    cls = getattr(estimators, ESTIMATORS[estimator])
    wanted = {"p": p, "forgetting": forgetting, "random_state": seed}
    lags = WienerHammersteinLags(n_a=n_a, n_b=n_b, n_c=n_c, n_d=n_d, law=None if law == "reduced" else law)
    return cls(lags=lags).set_params(**{k: v for k, v in wanted.items() if k in cls().get_params()})


def _open(source: str, place: dict[str, Any], follow: bool) -> LineSource:
    """The source, where the checkpoint left it; a pipe cannot go back and goes on where it is."""
    if source == "-":
        return PipedLines(sys.stdin.buffer, number=place["number"])
    path = Path(source)
    with open(path, "rb") as file:
        header = file.readline().rstrip(b"\n").decode("utf-8", errors="replace")
    if place["header"] and (header != place["header"] or path.stat().st_size < place["offset"]):
        raise ValueError(f"{source} is not the file that the checkpoint was written for; give --fresh to begin anew.")
    if follow:
        return FollowedFile(path, offset=place["offset"], number=place["number"])
    return LineSource(open(path, "rb"), offset=place["offset"], number=place["number"])


def _parser(source: str, place: dict[str, Any]) -> Callable[[bytes], list[float]] | None:
    """What turns lines into numbers; None until a CSV file's header is known."""
    if source == "-":
        return JsonParser(place["columns"])
    return CsvParser(place["header"].encode(), place["columns"]) if place["header"] else None


def _to(writer: Out, run: Run) -> Callable[[Record], None]:
    """Where records go: all to the output, bad rows to the eye, estimates and alarms to MLflow."""
    silenced = False

    def emit(record: Record) -> None:
        nonlocal silenced
        writer(record)
        if record["kind"] == "bad_row":
            click.echo(f"line {record['line']}: {record['reason']}; passed over.", err=True)
        metrics = {}
        if record["kind"] == "estimate":
            metrics = {f"path/{k}": v for k, v in record["parameters"].items()}
            if record["innovation_rmse"] is not None:
                metrics["innovation_rmse"] = record["innovation_rmse"]
        elif record["kind"] == "alarm":
            metrics = {"alarm": 1.0}
        try:
            run.log_metrics(metrics, step=record["row"])
        except Exception as error:  # a tracking server that is down must not stop the stream
            if not silenced:
                click.echo(f"The record in MLflow has gaps from row {record['row']} on: {error}", err=True)
            silenced = True

    return emit


def _save(stream: Stream, kept: Path, place: dict[str, Any], lines: LineSource, writer: Out) -> None:
    """Write the checkpoint; records up to it are on the disk before."""
    place |= {"offset": lines.offset, "number": lines.number, "out": writer.settle()}
    fitted = stream.carried.rows > 0
    state = {
        "place": place,
        "carried": asdict(stream.carried),
        "model": stream.model.get_state() if fitted else {},
        "alarm": stream.alarm.get_state() if stream.alarm.started else {},
        "innovations": stream.innovations.get_state() if fitted else {},
    }
    settled = clone(stream.model).set_params(forgetting=stream.forgetting)
    write_state(kept, KIND, {"estimator": settled, "alarm": stream.alarm}, state)


def _load(kept: Path, model: Any, columns: list[str]) -> dict[str, Any]:
    """The checkpoint, if it is of the same model and columns."""
    params, state = read_state(kept, KIND)
    if repr(params["estimator"]) != repr(model) or state["place"]["columns"] != columns:
        raise ValueError(
            f"{kept} was written with {params['estimator']!r} on columns {','.join(state['place']['columns'])}; "
            "start with the same options, or give --fresh to begin anew."
        )
    return state


def _restore(stream: Stream, state: dict[str, Any]) -> None:
    """Put the stream where the checkpoint stands."""
    stream.resume(Carried(**state["carried"]), state["model"], state["innovations"])
    if state["alarm"]:
        stream.alarm.set_state(state["alarm"])


def _finite(value: Any) -> Any:
    """The record with null for what is not finite, as JSON wants it."""
    if isinstance(value, dict):
        return {k: _finite(v) for k, v in value.items()}
    return None if isinstance(value, float) and not math.isfinite(value) else value


if __name__ == "__main__":
    main()
