"""What stands beside an effect in a fitted model, by which the effect can tell that it cannot be there."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Surroundings(NamedTuple):
    """The record and the rest of the model, as `Effect.implausible` takes them.

    Attributes
    ----------
    position, velocity, drive : ndarray of shape (n,)
        In SI, or in the unit of the drive.
    inertia : float
        Infinite if it is not one number.
    sizes : mapping of str to float
        Total size of all terms of each name in the model, the effect's own included.
    limit : float
        The least limit of the drive in the model; infinite if there is none.
    carried : bool
        Whether a torque beside the drive may move the axis, as gravity does.
    step : float
        Step of the encoder; zero if it is not known.
    dt : float
        Sampling period in s.
    turns : bool
        Whether the axis turns, so that what goes round repeats.
    command : ndarray of shape (n,) or None
        Where the drive is not measured, the command whose following error takes its place.
    silent : bool
        Whether nothing worth naming is left with the effect: what acted between the rows is then known.

    References
    ----------
    Ljung 1999, System Identification: Theory for the User, 2nd ed., Prentice Hall, ch. 16, on the feasibility of
    physical parameters.

    Examples
    --------
    >>> import numpy as np
    >>> from whsklearn.effects import EndStop, Surroundings
    >>> position = np.linspace(-1.0, 1.0, 100)
    >>> seen = Surroundings(position, np.ones(100), np.ones(100))
    >>> EndStop(10.0, 0.9).implausible(seen)
    ''
    >>> EndStop(10.0, 0.2).implausible(seen)
    'it would give way over 80 % of the travel: a spring'
    """

    position: Array
    velocity: Array
    drive: Array
    inertia: float = math.inf
    sizes: Mapping[str, float] = {}
    limit: float = math.inf
    carried: bool = False
    step: float = 0.0
    dt: float = 1.0
    turns: bool = True
    command: Array | None = None
    silent: bool = False

    def size(self, name: str) -> float:
        """Total size of the terms called ``name``; zero if there are none."""
        return self.sizes.get(name, 0.0)

    @property
    def never_moved(self) -> str:
        """The objection that the drive could never have set the axis in motion: dry friction at rest is no smaller.

        It concerns a limit of the drive and a friction that falls with speed, whose height at rest few samples show. A
        limit at the Coulomb friction stood, with certainty, for the chatter of a valve whose encoder is coarse.
        """
        rest = self.size("coulomb") + self.size("stribeck")
        if self.carried or rest < min(float(np.abs(self.drive).max()), self.limit):
            return ""
        return "with as much dry friction at rest, the drive would never have moved the axis"

    def unknown_between(self, taken: Array) -> str:
        """The objection that what an effect takes off the drive, ``taken`` (n,), chatters while something else is left.

        A controller that is faster than the log sends other values between the rows, and an effect takes of those, too.
        """
        said = "what it takes off the drive changes from row to row, and what acts between the rows is unknown"
        return said if chatters(taken) and not self.silent else ""


def chatters(x: Array) -> bool:
    """Whether the rows before and after do not predict most of a signal's power, so that no row says what was between.

    ``x`` (n,): the signal, without its mean where that counts for nothing.

    >>> noise = np.random.default_rng(0).standard_normal(900)
    >>> chatters(np.sin(0.1 * np.arange(900))), chatters(noise), chatters(np.repeat(noise, 9))
    (False, True, False)
    """
    off = x[1:-1] - 0.5 * (x[:-2] + x[2:])
    return bool(off @ off > 0.5 * (x @ x))
