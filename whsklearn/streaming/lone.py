"""One row of a chain's stream in which a signal is a thousand times any value before it, and then no longer.

A chain has no inertia that forbids it, as that of an axis does (`whsklearn.streaming.jumps`), so only what no signal of
a record does is taken for a wrong reading. Its square outweighs all others: after one 1e9 nothing else was learnt.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from whsklearn.logs.mend import OUTSIDE

BEYOND = 1000.0  # times any value before; a change of unit, mostly of a thousand, stays
FIRST = 100  # rows that show the size of the signals
AFTER = 3  # rows in which it is again as it was before; of a change of unit, one may be small by chance


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
