"""An effect as a user writes one: the example of the documentation.

Its place keeps it out of the catalogue, which all tests of a process share: else every search of every test would try
it.  A test that wants it there lists it for itself.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from whsklearn.effects import Effect, Quantity


@dataclass(frozen=True)
class Magnet(Effect):
    """A magnet beside the path pulls at one place, c exp(-(q/w)^2) (Nm)."""

    torque: float = 0.1
    width: float = 0.2

    name: ClassVar[str] = "magnet"
    place: ClassVar[str] = "static"
    equation: ClassVar[str] = "c exp(-(q/w)^2)"
    size: ClassVar[str] = "torque"
    quantities: ClassVar[dict[str, Quantity]] = {
        "torque": Quantity("Nm", -1.0, 1.0),
        "width": Quantity("rad", 0.01, 1.0, log=True),
    }

    @staticmethod
    def evaluate(p, time, position, velocity, drive):
        return p[0] * math.exp(-((position / p[1]) ** 2))
