"""Effects as the flat arrays that the compiled passes of an axis and of an arm take."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from whsklearn.effects import Effect, codes
from whsklearn.effects.own import WHICH, address_of
from whsklearn.systems._servo_torques import Plant


def plant_of(effects: Iterable[Effect], parts: NDArray[np.float64]) -> Plant:
    """Effects and parts as a `Plant`; the rows are in the order of the effects."""
    effects = tuple(effects)
    own = list(dict.fromkeys(type(e) for e in effects if e.evaluate is not None))
    p = np.zeros((len(effects), codes.N_NUMBERS))
    for row, e in zip(p, effects, strict=True):
        if e.code < 0:
            address_of((type(e),))  # which says what is missing
        if e.evaluate is not None:
            if len(e.row) > WHICH:
                raise ValueError(f"{type(e).__name__} has {len(e.row)} numbers, expected {WHICH} at most.")
            row[WHICH] = own.index(type(e))
        row[: len(e.row)] = e.row
    return Plant(np.array([e.code for e in effects], dtype=np.int64), p, parts, address_of(tuple(own)))
