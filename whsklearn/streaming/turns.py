"""Positions in a stream that a register or an encoder of one turn wraps: they are continued from turn to turn.

`whsklearn.logs.mend.turn_in` finds the turn of a log from all its rows, a stream from those so far: at the first leap
that, less one turn, goes on as the axis moved before. A leap that was taken for motion drowned every other.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import copysign, inf

from whsklearn.logs.mend import OUTSIDE

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
