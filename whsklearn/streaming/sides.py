"""The rows on either side of an alarm, which are compared in a thread: the rows that arrive never wait for it."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]
# (numbers of the experiments (n,), rows (n, n_columns) with their time first) before and after -> fields of the record
Compare = Callable[[tuple[Array, Array], tuple[Array, Array]], dict[str, Any]]

MOST_ROWS = 20_000  # of either side: 20 s at 1 kHz, which are compared within seconds and weigh 0.5 MB in a checkpoint


class Sides:
    """Keeps the last rows of a stream; after an alarm it waits for as many new rows, and has both sides compared.

    ``margin``: rows before an alarm that belong to neither side, as the change came some rows before it was noticed.

    References
    ----------
    Basseville and Nikiforov 1993, Detection of Abrupt Changes, Prentice Hall, sec. 1.2, on detection and diagnosis.
    """

    def __init__(self, compare: Compare, margin: int):
        self.compare, self.margin = compare, margin
        self.rows = 0
        self._last: list[Array] = []  # rows, the number of their experiment first
        self._state_since = 1  # the row at which the last change that was found began
        self._before = np.empty((0, 0))
        self._before_end = 0  # its last row
        self._alarm = 0
        self._asked: dict[str, Any] = {}  # what the thread compares
        self._found: dict[str, Any] = {}
        self._ready: list[dict[str, Any]] = []
        self._thread: threading.Thread | None = None

    def take(self, experiments: Array, rows: Array) -> None:
        """Add rows (n, n_columns) that the model has learned, and the number (n,) of their experiment."""
        self.rows += len(rows)
        self._last.append(np.column_stack([experiments, rows]))
        if sum(map(len, self._last[1:])) >= MOST_ROWS + self.margin:
            self._last = [np.concatenate(self._last)[-MOST_ROWS - self.margin :]]
        if self._alarm and self.rows - self._alarm + 1 >= len(self._before):
            self._ask()

    def alarm(self, row: int) -> None:
        """Part the rows at an alarm.

        One that comes before the second side is complete ends it; before as many rows as the margin, it begins it anew.

        ``row``: number of the row that raised it, from 1.
        """
        if self._alarm and row - self._alarm >= self.margin:
            self._ask(row - self._alarm)
        if not self._alarm:
            last = self._all()
            end = len(last) - (self.rows - row) - 1 - self.margin
            self._before, self._before_end = last[max(end - MOST_ROWS, 0) : max(end, 0)], row - self.margin - 1
        self._alarm = row if len(self._before) else 0

    def done(self, wait: float = 0.0) -> list[dict[str, Any]]:
        """Records that are ready, ``wait`` s after a comparison that has begun at the latest."""
        self._join(wait)
        ready, self._ready = self._ready, []
        return ready

    def so_far(self, least: int) -> str:
        """What the rows say that have come since the last alarm; empty without one or with fewer than ``least``."""
        after = self._since_alarm()
        if not self._alarm or len(after) < least:
            return ""
        return str(self._compared(self._before, after)["sentence"])

    def get_state(self) -> dict[str, Any]:
        """Everything that `set_state` needs to continue."""
        return {
            "rows": self.rows, "last": self._all(), "before": self._before, "before_end": self._before_end,
            "alarm": self._alarm, "since": self._state_since, "asked": self._asked, "ready": self._ready,
        }  # fmt: skip

    def set_state(self, state: dict[str, Any]) -> None:
        """Continue from a state that `get_state` returned; a comparison without an answer begins anew."""
        self.rows, self._last = state["rows"], [state["last"]] if state["last"].size else []
        self._before, self._before_end = state["before"], state["before_end"]
        self._alarm, self._state_since, self._ready = state["alarm"], state["since"], list(state["ready"])
        if state["asked"]:
            self._begin(state["asked"])

    def _all(self) -> Array:
        self._last = [np.concatenate(self._last)] if self._last else []
        return self._last[0] if self._last else np.empty((0, 0))

    def _since_alarm(self) -> Array:
        """As many rows as there are before it."""
        last = self._all()
        return last[len(last) - (self.rows - self._alarm + 1) :][: len(self._before)]

    def _ask(self, most: int = MOST_ROWS) -> None:
        """Begin to compare the rows before the alarm with at most so many since.

        The comparison before it has its answer by now, unless rows are read faster than they were logged.
        """
        self._join(threading.TIMEOUT_MAX)
        before, end = self._before, self._before_end
        known = end - self._state_since + 1  # rows before a change that was found are another axis
        if self.margin <= known < len(before):
            before = before[-known:]
        after = self._since_alarm()[:most]
        told = {
            "row": self._alarm + len(after) - 1, "alarm_row": self._alarm, "before_rows": [end - len(before) + 1, end],
            "after_rows": [self._alarm, self._alarm + len(after) - 1],
        }  # fmt: skip
        self._before, self._alarm = np.empty((0, 0)), 0
        self._begin({"told": told, "before": before, "after": after})

    def _begin(self, asked: dict[str, Any]) -> None:
        self._asked = asked
        self._thread = threading.Thread(target=self._work, daemon=True, name="compare")
        self._thread.start()

    def _join(self, seconds: float) -> None:
        """Take the answer of the thread, if it is there in time."""
        if self._thread is not None:
            self._thread.join(seconds)
        if self._found:
            if self._found.get("verdict") == "moved":
                self._state_since = self._found["alarm_row"]
            self._ready.append(self._found)
            self._found, self._asked, self._thread = {}, {}, None

    def _work(self) -> None:
        self._found = self._asked["told"] | self._compared(self._asked["before"], self._asked["after"])

    def _compared(self, before: Array, after: Array) -> dict[str, Any]:
        try:
            return self.compare(*((x[:, 0], x[:, 1:]) for x in (before, after)))
        except Exception as error:  # whatever went wrong, the stream goes on
            return {"verdict": "cannot_tell", "sentence": f"It cannot be said what changed. {error}", "changes": []}
