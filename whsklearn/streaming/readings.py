"""Readings of a stream that no axis can have made: wrapped at a turn, wrong in one row, or repeated as it moved on.

`whsklearn.logs.mend` tells them in a log, from all of its rows.  Here the rows that follow a suspicious one show what
it was, as they do for a time stamp (`clock`).  One reading of 65535 between two sound ones was taken for a motion whose
square drowned every other: nothing was learnt from then on.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from math import copysign, inf
from typing import Any, NamedTuple

import numpy as np

from whsklearn.logs.mend import ANSWERED, FROZEN_STEPS, OUTSIDE, RESOLVED, evenly_moving, frozen

NEW_EXPERIMENT = "a new experiment begins"


class Passed(NamedTuple):
    """A row that may go on, whether it begins a new experiment, and what is to be told of it."""

    row: list[Any]  # its number and its values
    anew: bool = False
    told: str = ""


# --- positions that a register or an encoder of one turn wraps: they are continued from turn to turn -----------------
# The turn is found at the first leap that, less one turn, goes on as the axis moved before.
MOST_OF = 0.9  # of a turn, which a wrapped position has covered at its first leap, as in a log
WITHIN = 1.0 + 1e-6  # turns: a wrapped position covers no more


@dataclass
class Turns:
    """Takes positions as logged and returns them without the leaps at full turns.

    Examples
    --------
    >>> turns, out = Turns(), []
    >>> for q in [350.0, 354.0, 358.0, 2.0, 6.0, 1.0, 356.0]:
    ...     out.append(turns.take(q, [360.0])[0])
    >>> out
    [350.0, 354.0, 358.0, 362.0, 366.0, 361.0, 356.0]
    """

    logged: list[float] = field(default_factory=list)  # the last two
    step: float = 0.0  # the last one, without its turn
    low: float = inf
    high: float = -inf
    turn: float = 0.0  # 0 until it is found
    offset: float = 0.0

    def take(self, q: float, turns: Sequence[float]) -> tuple[float, bool]:
        """The position without its leaps, and whether this row shows that it is wrapped.

        ``turns``: those at which a position of its unit may be wrapped.
        """
        anew = False
        if self.logged:
            step = q - self.logged[-1]
            if not self.turn and (found := self._found(q, step, turns)):
                self.turn, anew = found, True
            if 0.5 * self.turn < abs(step) <= WITHIN * self.turn:
                self.offset -= copysign(self.turn, step)
                step -= copysign(self.turn, step)
            self.step = step
        self.logged = [*self.logged[-2:], q]
        if len(self.logged) == 3:  # one wrong reading is not its range
            middle = sorted(self.logged)[1]
            self.low, self.high = min(self.low, middle), max(self.high, middle)
            if self.high - self.low > WITHIN * self.turn > 0.0:  # it counts its turns: that was none
                self.turn = 0.0
        return q + self.offset, anew

    def _found(self, q: float, step: float, turns: Sequence[float]) -> float:
        """The turn at which the position is wrapped, if a step shows one; else 0."""
        span = max(self.high, q, *self.logged) - min(self.low, q, *self.logged)
        for turn in turns:
            left = step - copysign(turn, step)
            goes_on = OUTSIDE * abs(left - self.step) <= abs(step - self.step)
            if MOST_OF * turn < span <= WITHIN * turn and abs(step) > 0.5 * turn and goes_on:
                return turn
        return 0.0


# --- one wrong reading, of the position or of a drive that moves nothing; and a position that is reset ---------------
# Rows behind a suspicious one: two beside a wrong reading, from which it is interpolated, and one whose step is of the
# motion; for a chain, in which its signals are again as they were, as one may be small by chance.
AFTER = 3


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
        """Whether a drive is far beyond all before it, which those before a motion do not show."""
        return abs(drive) > OUTSIDE * self.largest > 0.0 and self._far < inf

    def _go_on(self, at: int, by: int) -> Passed:
        """The first row that waits, as a part of the motion."""
        row = self.waiting.pop(0)
        q, self.drive = row[1][at], row[1][by]
        self.largest = max(self.largest, abs(self.drive))
        if len(self.path) == 2:
            self.fastest = max(self.fastest, abs(q - self.path[1]))
            if q != self.path[1]:  # an old reading that is repeated is no motion, see `Freeze`
                self.most = max(self.most, abs(q - 2.0 * self.path[1] + self.path[0]))
        self.low, self.high = min(self.low, q), max(self.high, q)
        self.path = [*self.path[-1:], q]
        return Passed(row)

    def _judged(self, at: int, by: int) -> list[Passed]:
        """The rows that waited, once those after the first show what it was."""
        told, anew = self._leapt(at) if self._leaps(self.waiting[0][1][at]) else ("", False)
        if told := "; ".join(filter(None, (told, self._kicked(at, by)))):
            told += f"; {NEW_EXPERIMENT if anew else 'it is replaced by what lies between its neighbours'}"
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


# --- rows that repeat the position of a moving axis, as an encoder or a bus repeats its last reading -----------------
# `frozen` rows begin and end at a speed that inertia lets no axis lose in one sample, and a leap is one that no motion
# so far comes near.  An axis that stops from full speed in one sample waits for this; one that comes to rest first
# shows nothing that would be learnt, and only its leap is judged.  A reading that stays for good is told once no more
# rows may wait: of a slow axis, which may stop within a sample, if the drive goes on as in motion.
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
    >>> out = [one for k, q in enumerate(path) for one in freeze.take([k, [q, 0.0]], 0, 1)]
    >>> [one.row[0] for one in out] == list(range(6)) + list(range(9, 13)), out[6].anew
    (True, True)
    >>> out[6].told.partition("; ")[0]
    'the position repeats for 3 rows and then leaps on, as no axis moves'
    """

    path: list[float] = field(default_factory=list)  # the last positions, the one that repeats at the end
    repeats: int = 0
    after: list[float] = field(default_factory=list)  # positions since it does no longer
    waiting: list[list[Any]] = field(default_factory=list)
    fastest: float = 0.0  # step of the motion so far; one leap is none
    finest: float = inf  # step other than zero
    driven: list[list[float]] = field(default_factory=lambda: [[0.0] * 3, [0.0] * 3])  # see `_goes_on`

    def take(self, row: list[Any], at: int, by: int) -> list[Passed]:
        """The rows that may go on.

        ``row``: its number and its values, of which the one ``at`` is the position and the one ``by`` the drive.
        """
        position, drive = row[1][at], row[1][by]
        repeats = bool(self.path) and position == self.path[-1]
        if not repeats:
            self.driven = [[a + b for a, b in zip(*self.driven, strict=True)], [0.0] * 3]
        self.driven[1] = [a + b for a, b in zip(self.driven[1], (1.0, drive, drive * drive), strict=True)]
        if repeats and not self.after:
            return self._repeated(row)
        if self.repeats >= FROZEN_STEPS:
            self.waiting.append(row)
            self.after.append(position)
            return self._judged() if len(self.after) > FROZEN_STEPS else []
        rows = [*self.waiting, row]
        if len(self.path) > 1:
            self.fastest = max(self.fastest, min(abs(position - self.path[-1]), abs(self.path[-1] - self.path[-2])))
        if self.path and position != self.path[-1]:
            self.finest = min(self.finest, abs(position - self.path[-1]))
        self.path = [*self.path, *self.path[-1:] * self.repeats, position][-PAST:]
        self.waiting, self.repeats = [], 0
        return list(map(Passed, rows))

    def end(self) -> list[list[Any]]:
        """The rows that wait, at the end of an experiment: what follows does not show what they are."""
        rows = self.waiting
        self.path, self.repeats, self.after, self.waiting = [], 0, [], []
        return rows

    def _repeated(self, row: list[Any]) -> list[Passed]:
        """What `take` returns for a row at the last position; such rows wait if the axis stopped from full speed."""
        self.repeats += 1
        if self.waiting or (self.repeats == 1 and self._moved()):
            self.waiting.append(row)
        if self.repeats != MOST_WAITING + 1:
            return [] if self.waiting else [Passed(row)]
        told = ""
        if self._at_once:
            told = f"the position has stopped within one row and repeats for {self.repeats} rows, as no axis stops"
        elif self._goes_on():
            told = (
                f"the position repeats for {self.repeats} rows while the drive goes on as in motion: the encoder is "
                "dead, or a brake or an end of the travel holds the axis"
            )
        rows, self.waiting = self.waiting, []
        return self._anew(rows or [row], told) if rows or told else [Passed(row)]

    def _goes_on(self) -> bool:
        """Whether the spread of the drive since the position repeats is nearer to that before than to none.

        ``driven`` holds number, sum and sum of squares before and since.
        """
        before, since = (max(squares / n - (total / n) ** 2, 0.0) if n else inf for n, total, squares in self.driven)
        return since > 0.25 * before

    def _anew(self, rows: list[list[Any]], told: str) -> list[Passed]:
        """Rows of a new experiment, and what is to be told of those before them."""
        told = f"{told}; they show no motion, and {NEW_EXPERIMENT}" if told else ""
        return [Passed(rows[0], True, told), *map(Passed, rows[1:])]

    def _moved(self) -> bool:
        """Whether the axis moved evenly until now, or until it jumped to the reading that repeats."""
        if len(self.path) < PAST:
            return False
        steps = np.diff(self.path)
        before = steps[1:] if evenly_moving(steps[1:]) else steps[:-1]
        return evenly_moving(before) and bool(OUTSIDE * np.abs(before).min() > self.fastest)

    @property
    def _at_once(self) -> bool:
        """Whether rows wait behind an even motion that was too fast to stop between two counts."""
        waited = len(self.waiting) > len(self.after)
        return waited and bool(np.abs(np.diff(self.path)[1:-1]).min() > COUNTS * self.finest)

    def _judged(self) -> list[Passed]:
        """The rows that waited, once the axis has moved on."""
        path = np.array([*self.path, *self.path[-1:] * min(self.repeats, PAST), *self.after])
        steps = np.diff(self.after)
        most = max(self.fastest, float(np.abs(steps).max()))
        leapt = self.fastest > 0 and abs(self.after[0] - self.path[-1]) > OUTSIDE * most
        still = leapt or frozen(path, np.zeros(path.size, dtype=np.int64))[0].any()
        told = f"the position repeats for {self.repeats} rows and then leaps on, as no axis moves"
        if not still and self._at_once:
            still = True
            told = (
                f"the position stops within one row and repeats for {self.repeats} rows, as at an end of the range of "
                "its sensor or of the travel"
            )
        after, rows = self.after, self.end()
        self.path = after
        return self._anew(rows[-len(after) :], told) if still else list(map(Passed, rows))


# --- one value of a chain's stream beyond all before it -------------------------------------------------------------
# A chain has no inertia that forbids it, so only what no signal of a record does is taken for a wrong reading: its
# square outweighs all others, and after one 1e9 nothing else was learnt.
BEYOND = 1000.0  # times any value before; a change of unit, mostly of a thousand, stays
FIRST = 100  # rows that show the size of the signals


@dataclass
class Lone:
    """Holds back a row with a value beyond all before it, until the next rows show whether it stands alone.

    Examples
    --------
    >>> lone, out = Lone(), []
    >>> for k in range(300):
    ...     out += lone.take([k, [float(k % 7), 1e9 if k == 200 else float(k % 5)]])
    >>> [(row[0], wrong) for row, wrong in out if wrong], len(out)
    ([(200, [1])], 300)
    """

    rows: int = 0
    largest: list[float] = field(default_factory=list)
    waiting: list[list[Any]] = field(default_factory=list)

    def take(self, row: list[Any]) -> list[tuple[list[Any], list[int]]]:
        """The rows that may go on, each with the columns that are wrong in it; ``row``: its number and its values."""
        self.waiting.append(row)
        first, *after = self.waiting
        beyond = self._beyond(first, BEYOND)
        if beyond and len(after) < AFTER:
            return []
        wrong = [k for k in beyond if not any(k in self._beyond(other, OUTSIDE) for other in after)]
        self.waiting = []
        if not wrong:
            self.rows += 1
            self.largest = [
                max(abs(v), m) for v, m in zip(first[1], self.largest or [0.0] * len(first[1]), strict=True)
            ]
        return [(first, wrong), *(passed for other in after for passed in self.take(other))]

    def end(self) -> list[list[Any]]:
        """The rows that wait, at the end of an experiment: what follows does not show what they are."""
        rows, self.waiting = self.waiting, []
        return rows

    def _beyond(self, row: list[Any], times: float) -> list[int]:
        """The columns whose values are more than so many times the largest before them."""
        if self.rows < FIRST:
            return []
        return [k for k, (v, most) in enumerate(zip(row[1], self.largest, strict=True)) if abs(v) > times * most > 0.0]
