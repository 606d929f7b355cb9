"""Helpers for the inverse dynamics: terms and their columns, pieces of a stream, checks, and slices by group."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from whsklearn.effects import Coulomb, Effect, FrictionLaw, LoadFriction, as_law, get_effect
from whsklearn.effects.base import ArgumentError, Array
from whsklearn.filtering.records import Motion

# Effects whose columns depend on the drive.
DRIVEN = ("load_friction", "dead_zone", "saturation", "input_delay", "actuator_lag", "torque_ripple")
NOISY = 5.0  # standard deviations of the velocity's noise below which an axis may be at rest
MEAN_DEVIATION = (2.0 / np.pi) ** 0.5  # E|x| of a standard normal number
# Friction whose columns jump with the sign of the velocity.
DRY = (Coulomb, LoadFriction)


def effect_terms(law: Any, effects: str | Iterable[str | Effect]) -> tuple[Effect, ...]:
    """Terms of the law and effects as instances; raises for an effect without columns."""
    for name, given in (("law", law), ("effects", effects)):
        if not (isinstance(given, (str, FrictionLaw, Iterable)) or (name == "law" and given is None)):
            raise ValueError(f"{name} is {given!r}, expected names joined by commas or effects.")
    friction = as_law(law).terms if law is None or isinstance(law, (str, FrictionLaw)) else tuple(law)
    names = [n.strip() for n in effects.split(",") if n.strip()] if isinstance(effects, str) else list(effects)
    terms = (*friction, *(get_effect(e)() if isinstance(e, str) else e for e in names))
    for term in terms:
        if not isinstance(term, Effect):
            raise ValueError(f"{term!r} is not an effect; expected a catalogue name or an instance such as Coulomb().")
        if term.column_kind == "none":
            raise ArgumentError(
                f"{term.name} has no columns and can only be simulated; remove it from law and effects."
            )
    return terms


def column_names(terms: tuple[Effect, ...]) -> list[str]:
    """One name per column: that of the effect, numbered if it recurs, with cos and sin if there are two columns."""
    names = [t.name for t in terms]
    out = []
    for i, term in enumerate(terms):
        label = term.name if names.count(term.name) == 1 else f"{term.name}{names[: i + 1].count(term.name)}"
        out += [f"{label}_cos", f"{label}_sin"] if term.phased else [label]
    return out


def sized_effects(terms: tuple[Effect, ...], weights: Array) -> tuple[Effect, ...]:
    """The terms with the magnitudes and phases that follow from the weights of their columns."""
    found, at = [], 0
    for term in terms:
        n = len(term.coefficients)
        fixed = {k: v for k, v in {**term.shape, **term.options}.items() if not (term.phased and k == "phase")}
        found.append(type(term).from_coefficients(weights[at : at + n], **fixed))
        at += n
    return tuple(found)


def stack_columns(
    terms: tuple[Effect, ...],
    moved: Motion,
    drive: Array,
    time: Array,
    turning: Array | None = None,
    drive_rate: Array | None = None,
) -> Array:
    """Acceleration and every term's columns side by side.

    ``turning`` (n,): the sign of dry friction is tanh of it; that of the velocity if not given. ``drive_rate`` (n,):
    slope of the drive, if it is known better than from these samples.
    """
    signals = dry = SimpleNamespace(time=time, drive=drive, drive_rate=drive_rate, **moved._asdict())
    if turning is not None:
        dry = SimpleNamespace(**vars(signals) | {"velocity": turning, "kappa": 1.0})
    return np.column_stack([moved.acceleration, *(t.columns(dry if isinstance(t, DRY) else signals) for t in terms)])


class RowState(NamedTuple):
    """State of a causal transformer: last samples, and how many came before.

    ``path``, ``drive``, ``torque``: as logged. ``signals``: columns, torque and speed before their average.
    ``sums``: number, squared speed, and distance of the position from its polynomial, of the samples so far.
    """

    path: Array
    drive: Array
    torque: Array
    signals: Array
    sums: Array
    seen: int


def rest_sums(moved: Motion, middle: Array, before: Array, warm: NDArray[np.bool_]) -> Array:
    """Number of samples, squared speeds, and distances from the polynomial, summed up to each sample.

    ``middle`` (n,) or (n, n_joints): the positions as logged where ``moved`` is their polynomial. ``before`` (3,) or
    (n_joints, 3): the sums so far. ``warm`` (n,): samples without a motion yet, which do not count. Returns (n, 3) or
    (n, n_joints, 3).
    """
    now = np.stack([np.ones(middle.shape), moved.velocity**2, np.abs(middle - moved.position)], axis=-1)
    now[warm] = 0.0
    return np.cumsum(np.concatenate([before[None], now]), axis=0)[1:]


def least_speed(sums: Array, kernels: Array, slow: float) -> Array:
    """Speed below which an axis of a stream may be at rest or reverse, for each row of `rest_sums` (m, 3).

    Five times the noise of the velocity, and the share ``slow`` of the rms speed so far. ``kernels``: as
    `causal_kernels` gives them.
    """
    n, squares, away = np.maximum(sums.T, [[1.0], [0.0], [0.0]])
    position, velocity = kernels[:2]
    noise = away / n / MEAN_DEVIATION / np.sqrt(1.0 - position[position.size // 2])
    return np.asarray(np.maximum(slow * np.sqrt(squares / n), NOISY * noise * np.linalg.norm(velocity)))


def period_of(sample_rate: float, cutoff: float) -> int:
    """Samples of a period of a cut-off, both in Hz."""
    return max(round(sample_rate / cutoff), 1)


def averaging(period: int) -> Array:
    """Weights of a stream's averages over two periods (Hann), (2 period + 1,)."""
    taps = np.hanning(2 * period + 3)[1:-1]
    return taps / taps.sum()


_NONE = np.empty(0)
AT_START = RowState(_NONE, _NONE, _NONE, _NONE, np.zeros(3), 0)


def checked_torque(y: ArrayLike, n: int, *, moving: bool = True) -> Array:
    """The target as an array; raises an error that explains what is wrong."""
    torque = np.asarray(y, dtype=float).ravel()
    if len(torque) != n:
        raise ValueError(f"y has {len(torque)} values and X {n} rows; give one torque per position.")
    if not np.isfinite(torque).all():
        raise ValueError("y holds values that are not finite; fill or cut those rows first.")
    if moving and not torque.any():
        raise ValueError("The torque is zero throughout, so nothing drove the axis; check the column and the enable.")
    return torque


def experiments(groups: ArrayLike | None, n: int) -> Iterator[slice]:
    """Slices of equal consecutive group labels; one slice without groups."""
    if groups is None:
        yield slice(0, n)
        return
    labels = np.asarray(groups)
    if len(labels) != n:
        raise ValueError(f"groups has {len(labels)} labels and X {n} rows; give one label per row.")
    edges = [0, *(np.flatnonzero(labels[1:] != labels[:-1]) + 1).tolist(), n]
    for start, stop in itertools.pairwise(edges):
        yield slice(start, stop)


def rows_and_samples(lags: Any, groups: ArrayLike | None, n: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Indices of the rows of a transformer behind its warm-up, and of the samples to which they belong, shape (m,).

    Both are all of the ``n`` samples if its rows are not late. Raises ValueError if there is no such row.
    """
    late, warmup = (int(getattr(lags, name, 0)) for name in ("delay_", "warmup_"))
    rows = np.concatenate([np.arange(min(s.start + warmup, s.stop), s.stop) for s in experiments(groups, n)])
    if not rows.size:
        raise ValueError(f"X has {n} samples, expected more than the {warmup} that warm up its filter.")
    return rows, rows - late
