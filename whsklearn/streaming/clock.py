"""The time of a stream: which rows are in order, how the others are classified, and whether the rate is the model's.

Rows are ordered by their time stamps, and a stamp can be wrong.  A row that continues from the last one is learnt
at once.  One that leaps ahead or falls back waits for the `WAIT` rows after it, which decide what it was:

==================  ==================================================  ==========================================
the row             the rows after it                                   verdict
==================  ==================================================  ==========================================
leaps ahead         continue from it                                    a pause: learnt, with a reason that tells it
leaps ahead         fill the hole before it                             out of order: learnt in time order
leaps ahead         continue from the row before it                     an outlier of the clock: one bad row
falls back          continue from it                                    a restart of the clock: a new experiment
falls back          continue from the row before it                     late: one bad row
was seen before                                                         sent again: skipped
==================  ==================================================  ==========================================

The verdict depends on the rows alone, not on the blocks in which they arrive or on restarts of the process.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, NamedTuple

WAIT = 3  # rows that decide what the one before them was; with one more, two bad stamps in a row pass for a pause
LEAP = 1.5  # typical steps; where a row is lost the step is two
FEWEST_STEPS = 3  # with fewer, the typical step is not known
STEPS = 9  # number of steps whose median is the typical step
HEAD = 256  # first rows of a clock that are remembered, to distinguish a restart from rows sent again
TAIL = 4096  # latest rows that are remembered


def _shown(stamp: float) -> str:
    """The fewest digits that are this stamp and no other."""
    return repr(float(stamp)).removesuffix(".0")


class Verdict(NamedTuple):
    """The class of a row (``row``, ``bad``, ``restart`` or ``repeated``), with its line number and a reason.

    ``missed``: rows that, by the stamps, are missing between a ``row`` and the one before it.

    Examples
    --------
    >>> Verdict("bad", 7, [0.3, 1.0], "time 0.3 after 0.4").what
    'bad'
    """

    what: str
    line: int
    row: list[float]
    reason: str = ""
    missed: int = 0


@dataclass
class Clock:
    """Takes rows whose first value is the time; gives verdicts in the order in which the rows are to be learnt."""

    last: float = float("-inf")
    steps: list[float] = field(default_factory=list)
    ahead: list[list[Any]] = field(default_factory=list)  # [line, row, later-stamped rows since, rows since]
    back: list[list[Any]] = field(default_factory=list)  # [line, row]
    head: dict[float, int] = field(default_factory=dict)
    tail: dict[float, int] = field(default_factory=dict)
    repeating: bool = False
    missing: int = 0  # bad rows since the last one in order; each allows one more step before a row counts as a leap

    def take(self, line: int, row: list[float]) -> Iterator[Verdict]:
        """The verdicts that become possible with one more row."""
        now = row[0]
        if now <= self.last:
            yield from self._fallen_back(line, row)
            return
        self.repeating = False
        yield from self._late()
        if any(row == other[1] for other in self.ahead):
            yield Verdict("repeated", line, row, f"time {_shown(now)} was sent before")
            return
        for other in self.ahead:
            other[2] += now > other[1][0]
            other[3] += 1
        if self._leaps(now):
            self.ahead.append([line, row, 0, 0])
        else:
            yield self._in_order(line, row)
        yield from self._drain()
        while self.ahead and self.ahead[0][3] >= WAIT:
            yield from self._decide()

    def lost(self) -> Iterator[Verdict]:
        """The verdicts that become possible with a line that is not a row."""
        yield from self._late()
        self.missing += 1

    def take_strictly(self, line: int, row: list[float]) -> Verdict:
        """The verdict without waiting, for a stream that ends before its first bad row."""
        if row[0] > self.last:
            return self._in_order(line, row)
        if self._was_there(row):
            return Verdict("repeated", line, row, f"time {_shown(row[0])} was sent before")
        return Verdict("bad", line, row, f"time {_shown(row[0])} does not come after {_shown(self.last)}")

    def get_state(self) -> dict[str, Any]:
        """The complete state, in types that a state file can hold."""
        from numpy import array, float64, int64

        state = {k: getattr(self, k) for k in ("last", "steps", "ahead", "back", "repeating", "missing")}
        for name in ("head", "tail"):
            seen = getattr(self, name)
            state[name] = [array(list(seen), dtype=float64), array(list(seen.values()), dtype=int64)]
        return state

    def set_state(self, state: dict[str, Any]) -> None:
        """Continue from what `get_state` returned."""
        for name, value in state.items():
            if name in ("head", "tail"):
                value = dict(zip(value[0].tolist(), value[1].tolist(), strict=True))
            setattr(self, name, value)

    # -- in order ------------------------------------------------------------------------

    def _leaps(self, now: float) -> bool:
        """Whether there is room for another row before this one."""
        if len(self.steps) < FEWEST_STEPS:
            return False
        # stamps of rows 1.25 ms apart in whole ms are 1, 1, 1 and 2 apart: what came twice of late is no leap
        usual = max(self._usual_step(), sorted(self.steps)[-2])
        return now - self.last > (LEAP + self.missing) * usual

    def _usual_step(self) -> float:
        """The median of the latest steps."""
        return sorted(self.steps)[len(self.steps) // 2]

    def _in_order(self, line: int, row: list[float]) -> Verdict:
        """Remember a row as the last one; a pause before it is told as the reason."""
        now, mark, reason, missed = row[0], hash(tuple(row)), "", self.missing
        if self.last > float("-inf") and len(self.steps) >= FEWEST_STEPS:
            missed = round((now - self.last) / self._usual_step()) - 1
        if self.last > float("-inf") and self._leaps(now):
            steps = (now - self.last) / self._usual_step()
            reason = f"time {_shown(now)} follows {_shown(self.last)}, a pause of {steps:.3g} usual steps"
        if self.last > float("-inf") and not self.missing:
            self.steps = [*self.steps[1 - STEPS :], now - self.last]
        self.last, self.missing = now, 0
        if len(self.head) < HEAD:
            self.head[now] = mark
        self.tail[now] = mark
        if len(self.tail) > TAIL:
            del self.tail[next(iter(self.tail))]
        return Verdict("row", line, row, reason, missed)

    def _drain(self) -> Iterator[Verdict]:
        """Rows that waited and now continue from the last one."""
        while self.ahead:
            first = min(self.ahead, key=lambda other: other[1][0])
            if first[1][0] > self.last and self._leaps(first[1][0]):
                return
            self.ahead.remove(first)
            if first[1][0] > self.last:
                yield self._in_order(first[0], first[1])
            else:
                yield Verdict("bad", first[0], first[1], f"time {_shown(first[1][0])} occurs twice")

    def _decide(self) -> Iterator[Verdict]:
        """The row that has waited longest ended a pause if most rows since come after it; else it is an outlier."""
        line, row, later, since = self.ahead.pop(0)
        if 2 * later <= since:
            self.missing += 1
            yield Verdict(
                "bad", line, row, f"time {_shown(row[0])} is an outlier of the clock, which is at {_shown(self.last)}"
            )
            yield from self._drain()
            return
        before = [other for other in self.ahead if other[1][0] < row[0]]
        for other in sorted([*before, [line, row]], key=lambda other: other[1][0]):
            yield self._in_order(other[0], other[1])
        self.ahead = [other for other in self.ahead if other not in before]
        yield from self._drain()

    # -- fallen back ---------------------------------------------------------------------

    def _fallen_back(self, line: int, row: list[float]) -> Iterator[Verdict]:
        """A row sent again, the first row after a restart of the clock, or a late row."""
        if self._was_there(row):
            self.repeating = True
            yield Verdict(
                "repeated", line, row, f"time {_shown(row[0])} was sent before, the stream is at {_shown(self.last)}"
            )
            return
        if self.back and row[0] <= self.back[-1][1][0]:
            yield from self._late()
        self.back.append([line, row])
        if len(self.back) <= WAIT:
            return
        for other in self.ahead:
            yield Verdict("bad", other[0], other[1], f"time {_shown(other[1][0])} is an outlier of the clock")
        back = self.back
        self.last, self.ahead, self.back, self.head, self.tail = float("-inf"), [], [], {}, {}
        first = back[0]
        yield Verdict("restart", first[0], first[1], f"the clock restarted at {_shown(first[1][0])}")
        for number, other in back:
            yield self._in_order(number, other)

    def _was_there(self, row: list[float]) -> bool:
        """Whether a row was learnt before: its numbers are remembered, or it lies among rows no longer remembered."""
        now, mark = row[0], hash(tuple(row))
        if self.head.get(now) == mark or self.tail.get(now) == mark:
            return True
        head_ends, tail_begins = next(reversed(self.head)), next(iter(self.tail))
        return head_ends < now < tail_begins

    def _late(self) -> Iterator[Verdict]:
        """Rows that fell back and were not continued."""
        for line, row in self.back:
            self.missing += 1
            yield Verdict("bad", line, row, f"time {_shown(row[0])} does not come after {_shown(self.last)}")
        self.back = []


# --- the rate of the rows: the derivatives of an axis or an arm are for that at which its model was begun -------------
# At four times that rate an inertia came out a quarter too large and Coulomb friction twice as large, without a word.
ROWS = 256  # that tell the rate; those of a bus that sends 25 at once are off it by less than `OFF`
OFF = 0.1  # of the step: an inertia would be a fifth wrong


@dataclass
class Pace:
    """Judges the steps of the time from row to row.

    A pause makes the mean step longer, so rows are fast if that is too short, and slow if most of them are late, too.

    Examples
    --------
    >>> pace = Pace()
    >>> [k for k in range(600) if pace.take(0.01 if k < 300 else 0.004, 0.01)]
    [511]
    >>> pace.off
    True
    """

    steps: int = 0  # those judged next, how long they took together, and how many were too long
    elapsed: float = 0.0
    long: int = 0
    off: bool = False

    def take(self, took: float, step: float) -> str:
        """What is to be told after a row that came ``took`` behind the one before it, where the model has ``step``."""
        self.steps, self.elapsed = self.steps + 1, self.elapsed + took
        self.long += took > (1.0 + OFF) * step
        if self.steps < ROWS:
            return ""
        mean, late = self.elapsed / ROWS, 2 * self.long > ROWS
        was, self.off = self.off, mean < (1.0 - OFF) * step or (late and mean > (1.0 + OFF) * step)
        self.steps, self.elapsed, self.long = 0, 0.0, 0
        if was or not self.off:
            return ""
        return (
            f"the last {ROWS} rows came every {mean:.4g}, those of the model every {step:.4g}: rows at another rate "
            "are not learnt; give them a stream of their own"
        )
