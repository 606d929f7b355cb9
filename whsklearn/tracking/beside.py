"""A run that is recorded in the background: identification never waits for a server or a database.

Metrics go into a bounded queue that is emptied by a separate thread. A full queue, a server that is down or a locked
database loses metrics but no time, and lost metrics are counted.
"""

from __future__ import annotations

import contextlib
import queue
import threading
from collections.abc import Callable, Mapping
from typing import Any

from whsklearn.tracking.runs import Run, Tracker
from whsklearn.tracking.store import THREAD, sentence

WAITING = 10_000  # sets of metrics that may be queued: some hours of estimates, a few MB
POLL_SECONDS = 2.0
OPEN_SECONDS = 10.0  # the first import of MLflow takes 3 of them
CLOSE_SECONDS = 10.0  # for metrics that are still queued at the end of a job
HURRIED_SECONDS = 0.5  # the same after SIGTERM, which must end the job within 2 s


class BesideRun:
    """A run that is opened, written and ended by a thread.

    Parameters
    ----------
    open_tracker : callable
        Opens the record; called in the thread.
    name : str
        Of the run.
    params, tags : mapping
        Logged when the run is open.
    say : callable, optional
        Called once with a sentence when metrics are lost.

    Attributes
    ----------
    id : str
        Of the run; empty until it is open.
    lost : int
        Sets of metrics that were not recorded.

    References
    ----------
    MLflow Tracking, https://mlflow.org/docs/latest/ml/tracking/.

    Examples
    --------
    >>> from whsklearn.tracking import BesideRun, open_tracker
    >>> run = BesideRun(lambda: open_tracker("axis", enabled=False), "stream")
    >>> run.log_metrics({"nmse": 0.01}, step=100)  # returns at once, whatever the server does
    >>> run.close()  # sets of metrics that were lost
    0
    """

    def __init__(
        self, open_tracker: Callable[[], Tracker], name: str, *, params: Mapping[str, Any] | None = None,
        tags: Mapping[str, str] | None = None, say: Callable[[str], None] = lambda sentence: None,
    ):  # fmt: skip
        self.id = ""
        self.lost = 0
        self._sent = 0
        self._given = 0
        self._open_tracker, self._name, self._params, self._tags, self._say = open_tracker, name, params, tags, say
        self._held = 0
        self._said = False
        self._end = threading.Event()
        self._queue: queue.Queue[Any] = queue.Queue(maxsize=WAITING)
        self._opened = threading.Event()
        self._thread = threading.Thread(target=self._work, name=f"{THREAD}{name}", daemon=True)
        self._thread.start()
        self._opened.wait(OPEN_SECONDS)

    def log_metrics(self, metrics: Mapping[str, float], step: int = 0) -> None:
        """Hand ``metrics`` over, by name, of one ``step``, such as the samples seen; returns at once."""
        self._given += 1
        try:
            self._queue.put_nowait((dict(metrics), step))
        except queue.Full:
            self._lose("it takes metrics more slowly than they come")

    def close(self, seconds: float = CLOSE_SECONDS) -> int:
        """End the run within so many ``seconds``; return the number of lost sets of metrics."""
        self._end.set()
        self._thread.join(seconds)
        self.lost = self._given - self._sent
        if self.lost:
            self._lose("it did not answer in time")
        return self.lost

    def _lose(self, reason: str) -> None:
        """Say once that the record is incomplete."""
        if not self._said:
            self._said = True
            self._say(f"The record in MLflow is incomplete: {reason}; the stream continues.")

    def _work(self) -> None:
        """Open, write, end."""
        try:
            tracker = self._open_tracker()
            with tracker.run(self._name, tags=self._tags) as run:
                self.id = run.id
                run.log_params(self._params or {})
                self._opened.set()
                while self._write(run):
                    self._end.wait(POLL_SECONDS)
        except Exception as error:  # no error of a database driver may end the stream
            self._lose(sentence(error))
        finally:
            self._opened.set()

    def _write(self, run: Run) -> bool:
        """Write everything that is queued; what fails is tried again. Return whether more may come."""
        ending, taken = self._end.is_set(), 0
        with contextlib.suppress(queue.Empty):
            while self._held + taken < WAITING:
                metrics, step = self._queue.get_nowait()
                run.log_metrics(metrics, step)
                taken += 1
        self._held += taken
        try:
            run.flush()
            self._sent, self._held = self._sent + self._held, 0
        except Exception as error:
            self._lose(sentence(error))
        return not ending
