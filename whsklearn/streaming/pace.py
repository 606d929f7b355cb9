"""The rate of a stream's rows: the derivatives of an axis or an arm are for the rate at which its model was begun.

At four times that rate an inertia came out a quarter too large and Coulomb friction twice as large, without a word.
"""

from __future__ import annotations

from dataclasses import dataclass

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
