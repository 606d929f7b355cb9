"""Small pure helpers of the inverse dynamics: terms, their columns, the torque checked, runs of groups."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING, Any

import numpy as np
from sklearn.utils import Bunch

from whsklearn.effects import Effect, FrictionLaw, as_law, get_effect

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from numpy.typing import ArrayLike, NDArray

    from whsklearn.filtering import Motion

    Array = NDArray[np.float64]

# Effects whose columns hold the drive.
DRIVEN = ("load_friction", "dead_zone", "saturation", "input_delay", "actuator_lag", "torque_ripple")


def effect_terms(law: Any, effects: str | Iterable[str | Effect]) -> tuple[Effect, ...]:
    """Terms of the law and effects as instances that have columns."""
    friction = as_law(law).terms if law is None or isinstance(law, (str, FrictionLaw)) else tuple(law)
    names = [n.strip() for n in effects.split(",") if n.strip()] if isinstance(effects, str) else list(effects)
    terms = (*friction, *(get_effect(e)() if isinstance(e, str) else e for e in names))
    for term in terms:
        if not isinstance(term, Effect):
            raise ValueError(f"{term!r} is no effect; expected a catalogue name or an instance such as Coulomb().")
        if term.column_kind == "none":
            raise ValueError(f"{term.name} has no columns, it can only be simulated; leave it out of law and effects.")
    return terms


def stack_columns(terms: tuple[Effect, ...], moved: Motion, drive: Array, time: Array) -> Array:
    """Acceleration and every term's columns side by side."""
    signals = Bunch(time=time, drive=drive, **moved._asdict())
    return np.column_stack([moved.acceleration, *(t.columns(signals) for t in terms)])


def checked_torque(y: ArrayLike, n: int) -> Array:
    """The target as an array, or the sentence about what is wrong with it."""
    torque = np.asarray(y, dtype=float).ravel()
    if len(torque) != n:
        raise ValueError(f"y has {len(torque)} values and X {n} rows; give one torque a position.")
    if not np.isfinite(torque).all():
        raise ValueError("y holds values that are not finite; fill or cut those rows first.")
    if not torque.any():
        raise ValueError("The torque is zero throughout, so nothing drove the axis; check the column and the enable.")
    return torque


def runs(groups: ArrayLike | None, n: int) -> Iterator[slice]:
    """Slices of equal consecutive group labels; one slice without groups."""
    if groups is None:
        yield slice(0, n)
        return
    labels = np.asarray(groups)
    if len(labels) != n:
        raise ValueError(f"groups has {len(labels)} labels and X {n} rows; give one a row.")
    edges = [0, *(np.flatnonzero(labels[1:] != labels[:-1]) + 1).tolist(), n]
    for start, stop in itertools.pairwise(edges):
        yield slice(start, stop)
