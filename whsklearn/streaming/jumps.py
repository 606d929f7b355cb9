"""Readings of an axis in a stream that no motion can have made: of its position, or of a drive that moves nothing.

A motion has inertia, so each step lies near those around it, as in a log (`whsklearn.logs.mend.jumps_in`). One reading
of 65535 between two sound ones was taken for a motion whose square drowned every other: nothing was learnt from then
on. The rows after a suspicious one show what it was, as they do for a time stamp.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise
from math import inf
from typing import Any, NamedTuple

from whsklearn.logs.mend import ANSWERED, OUTSIDE, RESOLVED

AFTER = 3  # rows: two beside a wrong reading, from which it is interpolated, and one more whose step is of the motion


class Passed(NamedTuple):
    """A row that may go on, whether it begins a new experiment, and what is to be told of it."""

    row: list[Any]
    anew: bool = False
    told: str = ""


@dataclass
class Jumps:
    """Holds back a row after a step that no motion so far comes near, or with a drive far beyond all before it.

    The next rows show what it was.

    Examples
    --------
    >>> jumps, out = Jumps(), []
    >>> path = [0.1 * k + 0.01 * (k % 2) for k in range(60)]
    >>> path[40] = 65535.0
    >>> for k, q in enumerate(path):
    ...     out += jumps.take([k, [q, 0.0]], 0, 1)
    >>> [(one.row[0], round(one.row[1][0], 2), one.anew) for one in out if one.told]
    [(40, 4.01, False)]
    """

    path: list[float] = field(default_factory=list)  # the last two positions that went on
    waiting: list[list[Any]] = field(default_factory=list)
    most: float = 0.0  # largest change from one step to the next, of the motion so far
    fastest: float = 0.0  # its largest step
    low: float = inf
    high: float = -inf
    drive: float = 0.0  # of the last row that went on
    largest: float = 0.0  # drive so far

    def take(self, row: list[Any], at: int, by: int) -> list[Passed]:
        """The rows that may go on.

        ``row``: its number and its values, of which the one ``at`` is the position and the one ``by`` the drive.
        """
        self.waiting.append(row)
        if len(self.waiting) == 1 and not self._leaps(row[1][at]) and not self._kicks(row[1][by]):
            return [self._go_on(at, by)]
        if len(self.waiting) <= AFTER:
            return []
        return self._judged(at, by)

    def end(self) -> list[list[Any]]:
        """The rows that wait, at the end of an experiment: what follows does not show what they are."""
        rows, self.waiting, self.path = self.waiting, [], []
        return rows

    @property
    def _far(self) -> float:
        """A change of the step that is none of the motion; infinite before the motion shows itself."""
        return OUTSIDE * self.most if self.high - self.low > RESOLVED * self.fastest > 0.0 else inf

    def _leaps(self, position: float) -> bool:
        """Whether a position is far from where the motion would have gone on."""
        return len(self.path) == 2 and abs(position - 2.0 * self.path[1] + self.path[0]) > self._far

    def _kicks(self, drive: float) -> bool:
        """Whether a drive is far beyond all before it."""
        return abs(drive) > OUTSIDE * self.largest > 0.0

    def _go_on(self, at: int, by: int) -> Passed:
        """The first row that waits, as a part of the motion."""
        row = self.waiting.pop(0)
        q, self.drive = row[1][at], row[1][by]
        self.largest = max(self.largest, abs(self.drive))
        if len(self.path) == 2:
            self.fastest = max(self.fastest, abs(q - self.path[1]))
            if q != self.path[1]:  # an old reading that is repeated is no motion, see `whsklearn.streaming.freeze`
                self.most = max(self.most, abs(q - 2.0 * self.path[1] + self.path[0]))
        self.low, self.high = min(self.low, q), max(self.high, q)
        self.path = [*self.path[-1:], q]
        return Passed(row)

    def _judged(self, at: int, by: int) -> list[Passed]:
        """The rows that waited, once those after the first show what it was."""
        told, anew = self._leapt(at) if self._leaps(self.waiting[0][1][at]) else ("", False)
        told = "; ".join(filter(None, (told, self._kicked(at, by))))
        out = [self._go_on(at, by)._replace(anew=anew, told=told)]
        rows, self.waiting = self.waiting, []
        for row in rows:
            out += self.take(row, at, by)
        return out

    def _leapt(self, at: int) -> tuple[str, bool]:
        """What is to be told of the step of the position to the first row, which is put right, and if all is anew."""
        first, far = self.waiting[0], self._far
        q = [*self.path, *(row[1][at] for row in self.waiting)]
        before, step, back, *after = (b - a for a, b in pairwise(q))
        if all(abs(s - before) <= (far if before else 0.0) for s in (back, *after)):  # from rest, to rest elsewhere
            self.path, self.low, self.high = [], inf, -inf  # its range so far was counted from another zero
            return f"the position jumps by {step - before:.4g} and goes on as before, as no axis moves", True
        if abs(step + back - 2.0 * before) <= 2.0 * far and all(abs(s - before) <= far for s in after):
            first[1] = list(first[1])
            first[1][at] = (4.0 * (q[1] + q[3]) - q[0] - q[4]) / 6.0  # the cubic through its neighbours
            return f"the position is {q[2]:.6g} in one row and then goes on as before, as no axis moves", False
        return "", False

    def _kicked(self, at: int, by: int) -> str:
        """What is to be told of the drive in the first row, which is put right if it stands alone and moved nothing."""
        (_, first), (_, then), *_ = self.waiting
        steps = [b - a for a, b in pairwise([*self.path, *(row[1][at] for row in self.waiting)])]
        bend = max(abs(b - a) for a, b in pairwise(steps))
        if not self._kicks(first[by]) or self._kicks(then[by]) or bend > ANSWERED * self.most:
            return ""
        self.waiting[0][1] = [*first[:by], 0.5 * (self.drive + then[by]), *first[by + 1 :]]
        return f"the drive is {first[by]:.6g} in one row, and the motion does not answer"
