"""What an estimator asks of a way of learning: a state goes in, the state after the samples comes out.

A stream holds settings only.  All that is learnt is in its state, a plain dict of numbers and arrays, so that it can
be copied, saved, compared and put back.
"""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

State = dict[str, Any]  # all that has been learnt, by name


class Learner(Protocol):
    """What an estimator requires of its way of learning; `Undo` learns rows again through it."""

    def initial(self) -> State:
        """The state before any sample."""

    def run(self, state: State, u: Array, y: Array, restart: NDArray[np.bool_], weight: Array | None = None) -> None:
        """Learn from samples, in place; ``weight`` weighs their squared errors."""

    def settle(self, state: State) -> None:
        """Run the record once more, in place, if the stream keeps one."""

    def forget_past(self, state: State, samples: float) -> None:
        """Let what was learnt count for no more than this many samples, in place."""

    def theta(self, state: State) -> Array:
        """The estimate, in the paper's order."""

    def covariance(self, state: State) -> Array:
        """Covariance of `theta`."""
