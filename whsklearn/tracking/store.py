"""Opening an MLflow store, and keeping MLflow's side effects out of the rest of the library.

All that depends on how MLflow behaves, rather than on what we record, is in this file:
telemetry, migrations of a new database, a server that is down, global state, chatter.
"""

from __future__ import annotations

import contextlib
import functools
import io
import logging
import os
import re
import signal
import socket
import sys
import threading
import time
import urllib.error
import urllib.request
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

_PROBE_SECONDS = 3.0
# How long a server may keep a job waiting in all, beyond FAIR_SECONDS a call.  The record of `gap`, 18 calls, takes 1 s
# on a server that is well and is given up after 15 s at the latest; MLflow itself would try for more than 10 minutes.
PATIENCE_SECONDS = 6.0
FAIR_SECONDS = 0.5
FORGIVEN = 0.1  # seconds of patience that come back in a second of the job's own work
OPENING_SECONDS = 5.0  # fair for the first calls and for a model: a server that has slept loads its own libraries first
UPLOAD_BYTES = 1e6  # a second, fair for a file
THREAD = "record of "  # names of threads that wait for a server begin so; see `whsklearn.__main__`
_DATABASE_PORTS = {"postgresql": 5432, "mysql": 3306, "mssql": 1433}


class TrackingError(RuntimeError):
    """The record cannot be kept; the message says why in one sentence.

    References
    ----------
    MLflow Tracking, https://mlflow.org/docs/latest/ml/tracking/.

    Examples
    --------
    >>> from whsklearn.tracking import TrackingError
    >>> try:
    ...     raise TrackingError("The tracking server does not answer.")
    ... except TrackingError as error:
    ...     print(error)
    The tracking server does not answer.
    """


def import_mlflow() -> Any:
    """MLflow with telemetry off, or an ImportError that names the extra."""
    os.environ.setdefault("MLFLOW_DISABLE_TELEMETRY", "true")  # read at import
    try:
        import mlflow
    except ImportError as error:
        raise ImportError(
            "MLflow is not installed; install it with `pip install 'whsklearn[mlflow]'`, or use --no-track."
        ) from error
    return mlflow


def experiment_id(client: Any, name: str, location: str | None) -> str:
    """Find or make an experiment; another process may make it at the same time."""
    from mlflow.exceptions import MlflowException

    found = client.get_experiment_by_name(name)
    if found is None:
        try:
            return client.create_experiment(name, artifact_location=location)
        except MlflowException:
            found = client.get_experiment_by_name(name)
            if found is None:
                raise
    if found.lifecycle_stage == "deleted":
        client.restore_experiment(found.experiment_id)
    return found.experiment_id


def initialise(database: Path) -> None:
    """Migrate a new database under another name, so that two first users cannot meet in the middle."""
    if database.exists():
        return
    database.parent.mkdir(parents=True, exist_ok=True)
    fresh = database.with_name(f"{database.name}.{os.getpid()}")
    try:
        import_mlflow().MlflowClient(f"sqlite:///{fresh}").search_experiments(max_results=1)
        with contextlib.suppress(FileExistsError):
            os.link(fresh, database)
    finally:
        fresh.unlink(missing_ok=True)


def probe(uri: str) -> None:
    """Fail at once if the server is down; MLflow itself would retry for minutes."""
    parts = urlsplit(uri)
    try:
        if parts.scheme in ("http", "https"):
            urllib.request.urlopen(f"{uri.rstrip('/')}/health", timeout=_PROBE_SECONDS).close()
        elif parts.hostname:
            port = parts.port or _DATABASE_PORTS.get(parts.scheme.split("+")[0])
            if port:
                socket.create_connection((parts.hostname, port), timeout=_PROBE_SECONDS).close()
    except urllib.error.HTTPError:
        return  # it answers, whatever it thinks of the question
    except OSError as error:
        raise TrackingError(
            f"The tracking server at {public(uri)} does not answer ({sentence(error)}); start it, "
            "unset MLFLOW_TRACKING_URI to record locally, or use --no-track."
        ) from error


class Patience:
    """Waits for a server, but only for a limited time: it may be killed, stopped or slow at any moment.

    Each call runs in a thread of its own, so that whoever waits can be interrupted; what takes longer than is fair uses
    up the patience, and when that has gone every further call fails at once.  A store in a file has no server.

    Parameters
    ----------
    uri : str
        Of the store.
    """

    def __init__(self, uri: str):
        timeout = os.environ.get("MLFLOW_HTTP_REQUEST_TIMEOUT", "")
        self.most = float(timeout) if timeout.replace(".", "", 1).isdigit() else PATIENCE_SECONDS
        self.left, self.spent, self.lost = self.most, 0.0, ""
        self.server = urlsplit(uri).scheme.split("+")[0] not in ("sqlite", "file", "")
        self._last = time.monotonic()

    def wait(self, function: Callable[[], Any], fair: float = FAIR_SECONDS) -> Any:
        """What the function returns or raises; TimeoutError where patience ends before."""
        if not self.server:
            return function()
        if self.lost:
            raise TimeoutError(self.lost)
        began = time.monotonic()
        self.left = min(self.most, self.left + FORGIVEN * (began - self._last))
        ended: list[tuple[bool, Any]] = []

        def work() -> None:
            try:
                ended.append((True, function()))
            except BaseException as error:
                ended.append((False, error))

        thread = threading.Thread(target=work, name=f"{THREAD}a call", daemon=True)
        thread.start()
        thread.join(fair + self.left)
        self._last = time.monotonic()
        self.left -= max(0.0, self._last - began - fair)
        if not ended:
            self.lost = f"no answer within {self._last - began:.0f} s"
            raise TimeoutError(self.lost)
        good, result = ended[0]
        if not good:
            raise result
        return result


class InSentences:
    """A client that turns every failure, whatever a database driver raises, into a `TrackingError` of one sentence.

    Parameters
    ----------
    client : MlflowClient
    patience : Patience, optional
        How long it waits in all.
    """

    def __init__(self, client: Any, patience: Patience | None = None):
        self._client = client
        self._patience = patience or Patience("")

    def __getattr__(self, name: str) -> Any:
        value = getattr(self._client, name)
        if not callable(value):
            return value

        @functools.wraps(value)
        def call(*args: Any, fair: float = FAIR_SECONDS, **kwargs: Any) -> Any:
            return self.do(lambda: value(*args, **kwargs), fair)

        return call

    def do(self, function: Callable[[], Any], fair: float = FAIR_SECONDS) -> Any:
        """Call a function that writes to the record; ``fair`` s are not held against the server."""

        def quietly() -> Any:
            with quiet(logging.CRITICAL):  # what fails is said below, in a sentence and not in a traceback
                try:
                    return function()
                except Exception as error:
                    if not _was_there_meanwhile(error):
                        raise
                    return function()  # it finds what it was about to write

        try:
            return self._patience.wait(quietly, fair)
        except Exception as error:
            raise TrackingError(
                f"The record at {public(self._client.tracking_uri)} cannot be written ({sentence(error)}); the "
                "files that the job writes are on the disk. Use --no-track to work without the record."
            ) from error


def public(uri: str) -> str:
    """The address without its password."""
    return re.sub(r"//[^@/]*@", "//", uri)


def _was_there_meanwhile(error: Exception) -> bool:
    """Whether another process wrote the same row between a look and a write; MLflow leaves that to the caller."""
    return any(word in str(error).lower() for word in ("unique constraint", "duplicate"))  # SQLite, PostgreSQL; MySQL


def sentence(error: BaseException) -> str:
    """The first line of an error's text."""
    return (str(getattr(error, "reason", "") or error).strip() or type(error).__name__).splitlines()[0]


@contextlib.contextmanager
def active(mlflow: Any, client: Any, run_id: str) -> Iterator[None]:
    """Make a run the active one of MLflow's fluent calls, and put its globals back after."""
    keys = ("MLFLOW_TRACKING_URI", "MLFLOW_RUN_ID", "MLFLOW_EXPERIMENT_ID")
    before = {k: os.environ.get(k) for k in keys}
    os.environ.pop("MLFLOW_TRACKING_URI", None)  # or an address of the environment would pass for one that was set
    was_set = mlflow.get_tracking_uri() if mlflow.is_tracking_uri_set() else None
    try:
        mlflow.set_tracking_uri(client.tracking_uri)
        with mlflow.start_run(run_id=run_id, nested=True):
            yield
    finally:
        client.update_run(run_id, "RUNNING")  # the block above has ended it, our own has not
        mlflow.set_tracking_uri(was_set)
        for k, value in before.items():
            os.environ.pop(k, None)
            if value is not None:
                os.environ[k] = value


@contextlib.contextmanager
def interruptions_wait() -> Iterator[None]:
    """Ctrl-C and SIGTERM act when the block has ended: an interrupted call would leave a run open for ever.

    A second one acts at once: a server that does not answer holds nobody up.  Outside the main thread, where signals
    never act, nothing is done.
    """
    handlers = {n: signal.getsignal(n) for n in (signal.SIGINT, signal.SIGTERM)}
    if threading.current_thread() is not threading.main_thread() or None in handlers.values():
        yield
        return
    came: list[int] = []

    def note(number: int, _frame: Any) -> None:
        came.append(number)
        if len(came) > 1:
            again()

    def again() -> None:
        for number, handler in handlers.items():
            signal.signal(number, handler)
        if came:
            signal.raise_signal(came.pop())

    for number in handlers:
        signal.signal(number, note)
    try:
        yield
    finally:
        again()


class _OfThisThread(io.TextIOBase):
    """Takes what this thread writes, and passes on what others do: theirs is no chatter."""

    def __init__(self) -> None:
        self._thread, self._behind = threading.get_ident(), sys.stderr

    def write(self, text: str) -> int:
        """Swallow or pass on."""
        return len(text) if threading.get_ident() == self._thread else self._behind.write(text)

    def flush(self) -> None:
        """What was passed on."""
        self._behind.flush()


@contextlib.contextmanager
def quiet(least: int = logging.ERROR) -> Iterator[None]:
    """Keep MLflow's chatter about itself from the terminal: migrations, versions, its own type hints."""
    loggers = [logging.getLogger(n) for n in ("mlflow", "alembic")]
    levels = [logger.level for logger in loggers]
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message=".*Any type hint is inferred as AnyType", category=UserWarning)
        warnings.filterwarnings("ignore", category=DeprecationWarning)  # of pandas, for what MLflow does
        try:
            for logger in loggers:
                logger.setLevel(least)
            with contextlib.redirect_stderr(_OfThisThread()):  # type: ignore[type-var]
                yield
        finally:
            for logger, level in zip(loggers, levels, strict=True):
                logger.setLevel(level)
