"""Open an MLflow store, and isolate MLflow's side effects from the rest of the library.

Everything that depends on how MLflow behaves, rather than on what we record, is in this file: telemetry, migrations of
a new database, a server that is down, global state, log output.
"""

from __future__ import annotations

import contextlib
import functools
import http.client
import io
import json
import logging
import os
import re
import signal
import socket
import sqlite3
import sys
import threading
import time
import urllib.error
import urllib.request
import warnings
import weakref
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

_PROBE_SECONDS = 3.0
# How long a server may keep a job waiting in all, beyond a fair time for each call.  MLflow itself would retry for more
# than 10 minutes.
PATIENCE_SECONDS = 6.0
FAIR_SECONDS = 0.5  # of a call; more where the server was slower at the beginning, when it was well
MOST_FAIR_SECONDS = 3.0
FORGIVEN = 0.1  # seconds of patience that come back in a second of the job's own work
LIBRARIES_SECONDS = 5.0  # also fair for the first calls and for a model: a server that has slept loads its libraries
UPLOAD_BYTES = 1e6  # a second, also fair for a file
LISTEN_SECONDS = 2.0  # between two questions whether the server is well, while the job works
THREAD = "record of "  # prefix of the names of threads that wait for a server; see `whsklearn.__main__`
_DATABASE_PORTS = {"postgresql": 5432, "mysql": 3306, "mssql": 1433}


class TrackingError(RuntimeError):
    """Runs cannot be recorded; the message gives the reason in one sentence.

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
    """Find or create an experiment; another process may create it at the same time."""
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
    """Migrate a new database under another name, so that two first users do not interfere.

    Raises sqlite3.Error at once if the file cannot be opened; MLflow would try again for minutes.
    """
    if database.exists():
        _open_file(database)
        return
    database.parent.mkdir(parents=True, exist_ok=True)
    fresh = database.with_name(f"{database.name}.{os.getpid()}")
    _open_file(fresh)
    try:
        import_mlflow().MlflowClient(f"sqlite:///{fresh}").search_experiments(max_results=1)
        with contextlib.suppress(FileExistsError):
            os.link(fresh, database)
    finally:
        fresh.unlink(missing_ok=True)


def _open_file(database: Path) -> None:
    """Open a database as MLflow would, but only once."""
    with contextlib.closing(sqlite3.connect(database)) as opened:
        opened.execute("PRAGMA schema_version")


def probe(uri: str, seconds: float = _PROBE_SECONDS) -> None:
    """Fail at once if the server is down, or after some seconds without an answer; MLflow would retry for minutes."""
    parts = urlsplit(uri)
    try:
        if parts.scheme in ("http", "https"):
            urllib.request.urlopen(f"{uri.rstrip('/')}/health", timeout=seconds).close()
        elif parts.hostname:
            port = parts.port or _DATABASE_PORTS.get(parts.scheme.split("+")[0])
            if port:
                socket.create_connection((parts.hostname, port), timeout=seconds).close()
    except urllib.error.HTTPError:
        return  # any response shows that the server is up
    except (OSError, http.client.HTTPException) as error:
        raise TrackingError(
            f"The tracking server at {public(uri)} does not answer ({sentence(error)}); start it, "
            "unset MLFLOW_TRACKING_URI to record locally, or use --no-track."
        ) from error


class Patience:
    """Waits for a server, but only for a limited time: it may be killed, stopped or slow at any moment.

    Each call runs in a thread of its own, so that whoever waits can be interrupted. What takes longer than is fair uses
    up the patience, and when it is used up every further call fails at once. A server that falls silent while the job
    works uses it up too (`listen`), so the job does not have to wait at its end for a server that died long before.
    A store in a file has no server.
    """

    def __init__(self, uri: str):
        timeout = os.environ.get("MLFLOW_HTTP_REQUEST_TIMEOUT", "")
        self.most = float(timeout) if timeout.replace(".", "", 1).isdigit() else PATIENCE_SECONDS
        self.left, self.lost = self.most, ""
        self.fair = FAIR_SECONDS
        self.silent = 0.0  # seconds over which every question in a row was left without an answer
        self.server = urlsplit(uri).scheme.split("+")[0] not in ("sqlite", "file", "")
        self._uri = uri
        self._last = time.monotonic()

    def opened(self, function: Callable[[], Any]) -> Any:
        """What the first calls return; they show how fast this server is on this machine while it is well."""
        began = time.monotonic()
        result = self.wait(function, LIBRARIES_SECONDS)
        self.fair = min(max(FAIR_SECONDS, time.monotonic() - began), MOST_FAIR_SECONDS)
        self.listen()
        return result

    def listen(self) -> None:
        """Ask a server every two seconds whether it is well, for as long as this object lives."""
        if urlsplit(self._uri).scheme in ("http", "https"):
            mine = weakref.ref(self)
            threading.Thread(target=_listen, args=(mine, self._uri), name="is the server well", daemon=True).start()

    def wait(self, function: Callable[[], Any], extra: float = 0.0) -> Any:
        """What the function returns or raises; TimeoutError where patience ends before. `extra` s are fair too."""
        if not self.server:
            return function()
        if self.lost:
            raise TimeoutError(self.lost)
        began = time.monotonic()
        self.left = min(self.most, self.left + FORGIVEN * (began - self._last))
        fair = self.fair + extra
        ended: list[tuple[bool, Any]] = []

        def work() -> None:
            try:
                ended.append((True, function()))
            except BaseException as error:
                ended.append((False, error))

        thread = threading.Thread(target=work, name=f"{THREAD}a call", daemon=True)
        thread.start()
        thread.join(self.fair)
        while thread.is_alive() and self.silent < self.most and time.monotonic() - began < fair + self.left:
            thread.join(0.1)
        self._last = time.monotonic()
        self.left -= max(0.0, self._last - began - fair)
        if not ended:
            self.lost = f"no answer within {max(self._last - began, self.silent):.0f} s"
            raise TimeoutError(self.lost)
        good, result = ended[0]
        if not good:
            raise result
        return result


def _listen(patience: weakref.ref[Patience], uri: str) -> None:
    """The work of `Patience.listen`."""
    began = None  # of the first question that was left without an answer
    while True:
        time.sleep(LISTEN_SECONDS)
        asked = time.monotonic()
        try:
            probe(uri)
        except TrackingError:
            began = asked if began is None else began
        else:
            began = None
        whose = patience()
        if whose is None or whose.lost:
            return
        whose.silent = 0.0 if began is None else time.monotonic() - began
        del whose  # or it would live through the next sleep


class InSentences:
    """A client that turns every failure, whatever a database driver raises, into a `TrackingError` of one sentence."""

    def __init__(self, client: Any, patience: Patience | None = None):
        self._client = client
        self._patience = patience or Patience("")

    def __getattr__(self, name: str) -> Any:
        value = getattr(self._client, name)
        if not callable(value):
            return value

        @functools.wraps(value)
        def call(*args: Any, extra: float = 0.0, **kwargs: Any) -> Any:
            return self.do(lambda: value(*args, **kwargs), extra)

        return call

    def do(self, function: Callable[[], Any], extra: float = 0.0) -> Any:
        """Call a function that writes to the record; ``extra`` s more than usual are not held against the server."""

        def quietly() -> Any:
            with quiet(logging.CRITICAL):  # failures are reported below, in a sentence and not in a traceback
                try:
                    return function()
                except Exception as error:
                    if not _was_there_meanwhile(error):
                        raise
                    return function()  # it finds the row that it was about to write

        try:
            return self._patience.wait(quietly, extra)
        except Exception as error:
            raise TrackingError(
                f"The record at {public(self._client.tracking_uri)} cannot be written ({sentence(error)}); the "
                "files that the job writes are on the disk. Use --no-track to work without the record."
            ) from error


def public(uri: str) -> str:
    """The address without its password."""
    return re.sub(r"//[^@/]*@", "//", uri)


def _was_there_meanwhile(error: Exception) -> bool:
    """Whether another process wrote the same row between a read and a write; MLflow does not handle this."""
    return any(word in str(error).lower() for word in ("unique constraint", "duplicate"))  # SQLite, PostgreSQL; MySQL


def sentence(error: BaseException) -> str:
    r"""The first line of an error's text that is about the error: SQLAlchemy begins with when it noticed it.

    >>> sentence(RuntimeError("(raised as a result of Query-invoked autoflush; ...)\ndisk is full\n[SQL: ...]"))
    'disk is full'
    """
    lines = (str(getattr(error, "reason", "") or error).strip() or type(error).__name__).splitlines()
    return next((line for line in lines if not line.startswith("(raised as a result of")), lines[0])


@contextlib.contextmanager
def active(mlflow: Any, client: Any, run_id: str) -> Iterator[None]:
    """Make a run the active one of MLflow's fluent calls, and put its globals back after."""
    keys = ("MLFLOW_TRACKING_URI", "MLFLOW_RUN_ID", "MLFLOW_EXPERIMENT_ID")
    before = {k: os.environ.get(k) for k in keys}
    os.environ.pop("MLFLOW_TRACKING_URI", None)  # or an address from the environment would count as one that was set
    was_set = mlflow.get_tracking_uri() if mlflow.is_tracking_uri_set() else None
    try:
        mlflow.set_tracking_uri(client.tracking_uri)
        with mlflow.start_run(run_id=run_id, nested=True):
            yield
    finally:
        client.update_run(run_id, "RUNNING")  # the block above has ended the run, which is still open for us
        mlflow.set_tracking_uri(was_set)
        for k, value in before.items():
            os.environ.pop(k, None)
            if value is not None:
                os.environ[k] = value


@contextlib.contextmanager
def interruptions_wait() -> Iterator[None]:
    """Delay Ctrl-C and SIGTERM until the block has ended, because an interrupted call would leave a run open for ever.

    A second signal acts at once, in case the server does not answer. Outside the main thread, where signals never act,
    this does nothing.
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
    """Discards what this thread writes, and passes on what other threads write."""

    def __init__(self) -> None:
        self._thread, self._behind = threading.get_ident(), sys.stderr

    def write(self, text: str) -> int:
        """Discard or pass on."""
        return len(text) if threading.get_ident() == self._thread else self._behind.write(text)

    def flush(self) -> None:
        """Flush what was passed on."""
        self._behind.flush()


@contextlib.contextmanager
def quiet(least: int = logging.ERROR) -> Iterator[None]:
    """Suppress MLflow's messages about itself: migrations, versions, its own type hints."""
    loggers = [logging.getLogger(n) for n in ("mlflow", "alembic")]
    levels = [logger.level for logger in loggers]
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message=".*Any type hint is inferred as AnyType", category=UserWarning)
        warnings.filterwarnings("ignore", category=DeprecationWarning)  # of pandas, caused by MLflow
        try:
            for logger in loggers:
                logger.setLevel(least)
            with contextlib.redirect_stderr(_OfThisThread()):  # type: ignore[type-var]
                yield
        finally:
            for logger, level in zip(loggers, levels, strict=True):
                logger.setLevel(level)


# --- what MLflow's own page shows of an experiment -------------------------------------------------------------------
VIEW = "comparison"  # the key of the link
VIEW_NAME = "whsklearn"  # in the menu "Views" of MLflow's own run list, from 3.15 on
_OF = {"t": "tags", "m": "metrics", "p": "params"}
_INDICES = "m.nmse m.mu_e m.rmse"
_LAGS = "p.lags__n_a p.lags__n_b p.lags__n_c p.lags__n_d p.lags__law"
# By experiment: the column to order by, whether it is ascending, and the columns besides name and data set.
_COLUMNS: dict[str, tuple[str, bool, str]] = {
    "close_gap": ("start_time", False, f"t.verdict t.effects m.closure m.missing_share {_INDICES} t.data"),
    "compare": ("start_time", False, "t.verdict t.changes m.change m.p_value m.share_of_drive"),
    "tune": ("m.nmse", True, f"p.p p.P0 p.forgetting {_LAGS} {_INDICES} m.fit_seconds"),
    "identify": ("start_time", False, f"t.recommended t.data {_INDICES} m.size m.fit_seconds t.failure"),
    "fleet": ("m.nmse", False, f"t.axis t.status t.why {_INDICES} m.failed m.outliers"),
    "stream": ("start_time", False, "p.source m.innovation_rmse m.alarm t.resumed_from"),
}
_COMPARISON = ("m.nmse", True, f"{_INDICES} m.delta p.p p.P0 t.data t.reading m.fit_seconds")


def _column(short: str) -> str:
    """MLflow's spelling of ``m.nmse``, a metric, or of ``start_time``, an attribute."""
    kind, dot, name = short.partition(".")
    return f"{_OF[kind]}.`{name}`" if dot else f"attributes.{short}"


def view_of(experiment: str) -> dict[str, Any]:
    """Order and columns of an experiment's runs on MLflow's page."""
    key, ascending, columns = _COLUMNS.get(experiment, _COMPARISON)
    return {"orderByKey": _column(key), "orderByAsc": ascending, "selectedColumns": list(map(_column, columns.split()))}


def page_of(server: str, experiment_id: str) -> str:
    """The address of an experiment's runs with its columns, in the view for models rather than for chat traces.

    >>> page_of("http://127.0.0.1:5000", "3")
    'http://127.0.0.1:5000/#/experiments/3/runs?workflowType=machine_learning&viewStateShareKey=comparison'
    """
    base = server.rstrip("/")
    return f"{base}/#/experiments/{experiment_id}/runs?workflowType=machine_learning&viewStateShareKey={VIEW}"


def set_view(client: Any, experiment_id: str, name: str) -> None:
    """The order and the columns of an experiment's page, at the address that `page_of` gives and in its menu "Views".

    MLflow 3.15 and later read a named view with its state as text, earlier ones the state itself: the tag holds both.
    """
    view = view_of(name)
    now = int(time.time() * 1000)
    saved = {"name": VIEW_NAME, "createdAt": now, "updatedAt": now, "state": json.dumps(view), **view}
    client.set_experiment_tag(experiment_id, f"mlflow.sharedViewState.{VIEW}", json.dumps(saved))
