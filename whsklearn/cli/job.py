"""Shared code of all commands: options, one-sentence errors, tables that fit 100 columns."""

from __future__ import annotations

import contextlib
import errno
import functools
import os
import signal
import textwrap
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from whsklearn._interruption import insisted
from whsklearn.cli import WIDTH

if TYPE_CHECKING:
    from whsklearn.tracking import Tracker

ANSWERS = 20.0  # s within which a Dask scheduler has to answer
NARROWEST = 8  # columns of a table's names
USAGE, UNUSABLE, ENDED, INTERRUPTED = 2, 3, 143, 130  # besides 0 for a result and 1 for any other failure


class WrongOption(click.ClickException):
    """An option that does not fit the log, such as a column that does not exist.

    >>> error = WrongOption("The log has no column 'u'.")
    >>> error.exit_code, error.format_message()
    (2, "The log has no column 'u'.")
    """

    exit_code = USAGE


class UnusableLog(click.ClickException):
    """A log from which nothing can be learned.

    >>> UnusableLog("Row 17 has 3 cells, the header 4.").exit_code
    3
    """

    exit_code = UNUSABLE


class RecordLost(click.ClickException):
    """The tracking server was lost during the run; the files that the job writes are on the disk.

    >>> RecordLost("The record cannot be written.").exit_code
    1
    """


class Ended(KeyboardInterrupt):
    """SIGTERM, treated like Ctrl-C, so that runs are closed and temporary files are removed.

    >>> issubclass(Ended, KeyboardInterrupt), ENDED
    (True, 143)
    """


def command(function: Callable[..., None]) -> click.Command:
    """A click command whose expected errors are one clear sentence."""

    @click.command(help=function.__doc__, context_settings={"show_default": True, "max_content_width": WIDTH})
    @functools.wraps(function)
    def guarded_function(**kwargs: Any) -> None:
        guarded(function, **kwargs)

    return guarded_function


SEED: dict[str, Any] = {"type": click.IntRange(min=0), "default": 0, "help": "Random seed."}
seed_option = click.option("--seed", **SEED)


def job(function: Callable[..., None], unused: tuple[str, ...] = ()) -> click.Command:
    """A `command` with ``--seed`` and ``--no-track`` behind its own options.

    Every job takes both; its help leaves out the ``unused``, which change nothing in it.
    """
    made = command(function)
    made.params += [
        click.Option(["--seed"], hidden="seed" in unused, **SEED),
        click.Option(
            ["--track/--no-track"], hidden="track" in unused, default=True, help="Record the runs in MLflow.",
        ),
    ]  # fmt: skip
    return made


def guarded(function: Callable[..., None], **kwargs: Any) -> None:
    """Run a job; expected errors become one sentence and an exit status."""
    from whsklearn.logs.errors import ColumnError, LogError

    before = _end_as_interrupt()
    try:
        with insisted(KeyboardInterrupt):
            function(**kwargs)
    except LogError as error:
        raise (WrongOption if isinstance(error, ColumnError) else UnusableLog)(str(error)) from error
    except BrokenPipeError:  # whoever read the output has ended; click ends in silence
        raise
    except OSError as error:
        raise click.ClickException(no_room(error) or str(error)) from error
    except (ValueError, ImportError) as error:
        if type(error).__name__ == "ArgumentError":  # of effects, whose import takes a second
            raise WrongOption(str(error)) from error
        raise click.ClickException(str(error)) from error
    except RuntimeError as error:
        if type(error).__name__ != "TrackingError":  # not imported for this, because that takes a quarter of a second
            raise
        raise RecordLost(str(error)) from error
    except KeyboardInterrupt as error:
        click.echo("Interrupted.", err=True)
        raise SystemExit(ENDED if isinstance(error, Ended) else INTERRUPTED) from None
    finally:
        if before is not None:
            signal.signal(signal.SIGTERM, before)


def no_room(error: OSError) -> str:
    """A sentence if a file did not fit on the disk or would exceed a limit; empty for any other error.

    >>> print(no_room(OSError(errno.ENOSPC, "No space left on device", "gap.html")))
    gap.html cannot be written (No space left on device); make room or name another folder.
    """
    if error.errno not in (errno.ENOSPC, errno.EFBIG, errno.EDQUOT):
        return ""
    return f"{error.filename or 'A file'} cannot be written ({error.strerror}); make room or name another folder."


def _end_as_interrupt() -> Any:
    """Let SIGTERM raise in the main thread; return the previous handler, or None if no handler can be set."""

    def end(_number: int, _frame: Any) -> None:
        raise Ended

    try:
        return signal.signal(signal.SIGTERM, end)
    except ValueError:  # not in the main thread
        return None


def root() -> Path:
    """The folder that holds ``mlruns/``: where the command was called; within a checkout, that checkout."""
    checkout, here = Path(__file__).resolve().parents[2], Path.cwd()
    return checkout if here.is_relative_to(checkout) and (checkout / "pyproject.toml").is_file() else here


def writable_folder(path: str | os.PathLike[str]) -> Path:
    """Create the folder if necessary and check that files can be written to it, before the work and not after.

    If the command then writes nothing into it, it is removed at the end.

    Raises OSError if nothing can be written there.
    """
    folder = Path(path)
    probe = folder / f".whsklearn-{os.getpid()}"
    try:
        made = [f for f in (folder, *folder.parents) if not f.exists()]
        folder.mkdir(parents=True, exist_ok=True)
        if context := click.get_current_context(silent=True):
            context.call_on_close(functools.partial(_remove_empty, made))
        probe.write_bytes(b"")
        probe.unlink()
    except OSError as error:
        reason = error.strerror or str(error)
        raise OSError(f"Cannot write to {folder} ({reason}); name another folder.") from None
    return folder


def _remove_empty(folders: list[Path]) -> None:
    """Remove folders, the innermost first, that hold nothing."""
    with contextlib.suppress(OSError):
        for folder in folders:
            folder.rmdir()


def writable_file(path: str | os.PathLike[str], *read: str | os.PathLike[str]) -> Path:
    """The path of a file to write; its folder is created if necessary. See `whsklearn.logs.files.check_writable`.

    ``*read``: files that the command reads, none of which it may replace.

    Raises ValueError if it is a folder, or cannot be written, WrongOption if it is one of those that are read. Raises
    OSError if the folder cannot be made.
    """
    from whsklearn.logs.files import check_writable, is_same

    file = Path(path)
    for source in map(Path, read):
        if is_same(file, source):
            raise WrongOption(f"--out is {path}, which is read; give another name, or {source.name} would be lost.")
    if not file.is_dir():
        writable_folder(file.parent)
    check_writable(file)
    return file


@contextlib.contextmanager
def progress_bar(**options: Any) -> Iterator[Any]:
    """A progress bar if stderr is a terminal; log messages appear above it, errors below.

    ``**options``: as `tqdm.tqdm` takes them.
    """
    import logging

    from tqdm import tqdm
    from tqdm.contrib.logging import logging_redirect_tqdm

    with logging_redirect_tqdm([logging.getLogger("whsklearn")]), tqdm(disable=None, leave=False, **options) as bar:
        yield bar


@contextlib.contextmanager
def dask_client(scheduler: str | None, n_workers: int, settings: Mapping[str, Any] | None = None) -> Iterator[Any]:
    """A client of a Dask scheduler, or of a cluster of so many processes on this machine if there is none.

    ``settings``: of Dask, for the scheduler and the workers of such a cluster.

    Raises ImportError without Dask, OSError if the scheduler does not answer.
    """
    try:
        import dask
        from distributed import Client, LocalCluster
    except ImportError as error:
        raise ImportError("Dask is not installed; install it with `pip install 'whsklearn[dask]'`.") from error
    with dask.config.set(settings or {}), contextlib.ExitStack() as stack:
        if scheduler is None:
            local = LocalCluster(n_workers=n_workers, threads_per_worker=1, dashboard_address=":0")
            scheduler = stack.enter_context(local).scheduler_address
        try:
            client = stack.enter_context(Client(scheduler, timeout=ANSWERS))
        except (OSError, TimeoutError) as error:
            text = f"The Dask scheduler at {scheduler} does not answer; start it, or omit --scheduler."
            raise OSError(text) from error
        yield client


def tracker_for(experiment: str, track: bool, **tags: str) -> Tracker:
    """The record of a job, beneath mlruns/ in `root` unless the environment names another."""
    from whsklearn.tracking import TrackingError, open_tracker

    if track:
        click.echo("Opening the MLflow store (the first time takes a few seconds) ...", err=True)
    try:
        return open_tracker(experiment, root=root(), enabled=track, tags=tags)
    except TrackingError as error:  # nothing has been recorded yet, so nothing is lost
        raise click.ClickException(str(error)) from error


def say_where(tracker: Tracker) -> None:
    """Print where the runs are and how to see them."""
    if tracker.client is not None:
        click.echo(f"\nRecorded in MLflow, experiment {tracker.experiment}: {tracker.place}\n`whsklearn ui` shows it.")


def worse_than_mean(nmse: Mapping[str, float]) -> str:
    """A sentence on models whose free run is worse than a constant; empty if there are none.

    >>> worse_than_mean({"ARX": 0.2, "axis": 0.9})
    ''
    >>> print(wrapped(worse_than_mean({"ARX": 0.2, "axis": 1.4})))
    Worse than the mean of the output (an NMSE above 1): axis. It does not describe this record.
    >>> print(wrapped(worse_than_mean({"axis": 1.4})))
    Worse than the mean of the output (an NMSE above 1): axis. It does not describe this record; check
    columns, units and the sign of the drive.
    """
    bad = [name for name, value in nmse.items() if value > 1.0]
    if not bad:
        return ""
    text = f"Worse than the mean of the output (an NMSE above 1): {', '.join(bad)}."
    who = "It does" if len(bad) == 1 else "They do"
    advice = "; check columns, units and the sign of the drive" if len(bad) == len(nmse) else ""  # no model is right
    return f"{text} {who} not describe this record{advice}."


def wrapped(text: str) -> str:
    """The text wrapped to 100 columns."""
    return textwrap.fill(text, WIDTH)


def entry(text: str) -> str:
    """An entry of a list, wrapped to 100 columns behind its indent."""
    return textwrap.fill(text, WIDTH, initial_indent="  ", subsequent_indent="    ")


def table(header: Sequence[str], rows: Iterable[Sequence[Any]], *, title: str = "") -> str:
    """A plain table of at most 100 columns; the first column is left-aligned and wrapped, the others right-aligned.

    >>> print(table(["model", "NMSE"], [["PEM", 0.01234], ["RLS", None]]))
    model    NMSE
    -------------
    PEM    0.0123
    RLS         -
    """
    cells = [list(header), *[[cell(v) for v in row] for row in rows]]
    widths = [max(len(r[i]) for r in cells) for i in range(len(header))]
    spare = WIDTH - sum(widths) - 2 * (len(widths) - 1)
    if spare < 0:
        widths[0] = max(NARROWEST, widths[0] + spare)
    lines = []
    for name, *values in cells:
        begun, *more = textwrap.wrap(name, widths[0], subsequent_indent="  ") or [""]
        lines.append(
            "  ".join([begun.ljust(widths[0]), *(v.rjust(w) for v, w in zip(values, widths[1:], strict=True))])
        )
        lines += ["-" * len(lines[0])] if len(lines) == 1 else more
    return "\n".join([*([title, ""] if title else []), *lines])


def cell(value: Any) -> str:
    """A number with three significant digits; a dash for None."""
    if value is None:
        return "-"
    if isinstance(value, float):
        return f"{value:.3g}" if 1e-3 <= abs(value) < 1e5 or value == 0 else f"{value:.2e}"
    return str(value)
