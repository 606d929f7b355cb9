"""Rows of a stream in which a moving axis is logged at one place, as an encoder or a bus repeats its last reading.

Only the motion after such rows shows what they were, and `whsklearn.logs.mend` tells it as in a log: `frozen` rows
begin and end at a speed that inertia lets no axis lose in one sample, and a leap is one that no motion so far comes
near. An axis that stops from full speed in one sample waits for this; one that comes to rest first shows nothing that
would be learnt, and only its leap is judged. A reading that stays for good is told once no more rows may wait.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from math import inf
from typing import Any

import numpy as np

from whsklearn.logs.mend import FROZEN_STEPS, OUTSIDE, evenly_moving, frozen

MOST_WAITING = 5000  # rows: 5 s at 1 kHz.  An axis at one place shows nothing that would be learnt late
COUNTS = 3.0  # of an encoder, in one sample: a slower motion may stop within a sample, between two of them
PAST = FROZEN_STEPS + 2  # positions before those that repeat


@dataclass
class Freeze:
    """Holds back rows that repeat the position of a moving axis, until it moves on.

    Examples
    --------
    >>> freeze = Freeze()
    >>> path = [0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.5, 0.5, 0.5, 0.9, 1.0, 1.1, 1.2]
    >>> [freeze.take([k], q) for k, q in enumerate(path)][-2:]
    [([], '', []), ([], 'the position repeats for 3 rows and then leaps on, as no axis moves', [[9], [10], [11], [12]])]
    """

    path: list[float] = field(default_factory=list)  # the last positions, the one that repeats at the end
    repeats: int = 0
    after: list[float] = field(default_factory=list)  # positions since it does no longer
    waiting: list[list[Any]] = field(default_factory=list)
    fastest: float = 0.0  # step of the motion so far; one leap is none
    finest: float = inf  # step other than zero

    def take(self, row: list[Any], position: float) -> tuple[list[list[Any]], str, list[list[Any]]]:
        """Rows that continue the motion, what is told of the rows after them, and rows of a new experiment.

        ``row``: whatever is to come out again. ``position``: the axis's in that row.
        """
        if self.path and position == self.path[-1] and not self.after:
            return self._repeated(row)
        if self.repeats >= FROZEN_STEPS:
            self.waiting.append(row)
            self.after.append(position)
            return self._judged() if len(self.after) > FROZEN_STEPS else ([], "", [])
        rows = [*self.waiting, row]
        if len(self.path) > 1:
            self.fastest = max(self.fastest, min(abs(position - self.path[-1]), abs(self.path[-1] - self.path[-2])))
        if self.path and position != self.path[-1]:
            self.finest = min(self.finest, abs(position - self.path[-1]))
        self.path = [*self.path, *self.path[-1:] * self.repeats, position][-PAST:]
        self.waiting, self.repeats = [], 0
        return rows, "", []

    def end(self) -> list[list[Any]]:
        """The rows that wait, at the end of an experiment: what follows does not show what they are."""
        rows = self.waiting
        self.path, self.repeats, self.after, self.waiting = [], 0, [], []
        return rows

    def _repeated(self, row: list[Any]) -> tuple[list[list[Any]], str, list[list[Any]]]:
        """What `take` returns for a row at the last position; such rows wait if the axis stopped from full speed."""
        self.repeats += 1
        if not self.waiting and not (self.repeats == 1 and self._moved()):
            return [row], "", []
        self.waiting.append(row)
        if len(self.waiting) <= MOST_WAITING:
            return [], "", []
        rows, self.waiting = self.waiting, []
        told = ""
        if np.abs(np.diff(self.path)[1:-1]).min() > COUNTS * self.finest:
            told = f"the position has stopped within one row and repeats for {self.repeats} rows, as no axis stops"
        return [], told, rows  # without the stop, whose polynomial is no motion

    def _moved(self) -> bool:
        """Whether the axis moved evenly until now, or until it jumped to the reading that repeats."""
        if len(self.path) < PAST:
            return False
        steps = np.diff(self.path)
        before = steps[1:] if evenly_moving(steps[1:]) else steps[:-1]
        return evenly_moving(before) and bool(OUTSIDE * np.abs(before).min() > self.fastest)

    def _judged(self) -> tuple[list[list[Any]], str, list[list[Any]]]:
        """The rows that waited, once the axis has moved on."""
        path = np.array([*self.path, *self.path[-1:] * min(self.repeats, PAST), *self.after])
        steps = np.diff(self.after)
        most = max(self.fastest, float(np.abs(steps).max()))
        leapt = self.fastest > 0 and evenly_moving(steps) and abs(self.after[0] - self.path[-1]) > OUTSIDE * most
        still = leapt or frozen(path, np.zeros(path.size, dtype=np.int64))[0].any()
        told = f"the position repeats for {self.repeats} rows and then leaps on, as no axis moves"
        after, rows = self.after, self.end()
        self.path = after
        return ([], told, rows[-len(after) :]) if still else (rows, "", [])
