"""A log in the form that the gap workflow takes, and what is computed from it once."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
import pandas as pd
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import ArrayLike, NDArray

from whsklearn.logs.source import as_frame
from whsklearn.logs.units import UNKNOWN, factor_between, factor_of, is_known, own_units, respelled, unit_in

Array = NDArray[Any]

# Standard deviation of a Gaussian over its median absolute deviation: what "robust deviations" are counted in.
MAD = 1.4826
# Robust deviations beyond which an error is an outlier: chance puts six of 1e5 Gaussian ones there.
OUTLYING = 4.0
# Parts of a record, and the share at the end of each that is held out: 60 % fit and 40 % judge. If a record drifts,
# both see every part of it.
PARTS, HELD_OUT = 5, 0.4
# Share of the sixth differences from which the noise is computed, and the factor that corrects for dropping the largest
# ones, which are due to impacts and steps of the drive: 1.07 for a Gaussian.
NOISE_KEPT, NOISE_MADE_UP = 0.98, 1.06
# Least white noise of an encoder beside its rounding, as a share of all its noise: the variance of the rounding is only
# nearly a twelfth of the step's square, so that less is not told. The share itself was not measured.
LEAST_WHITE = 0.3
# Samples before and after one of the drive, which tell it but for the noise of its reading, and rows, evenly spaced,
# that determine their 26 weights: an hour at 1 kHz would take 2 GB.
NEIGHBOURS, ENOUGH_ROWS = 6, 20_000


SPLIT = (
    "60 % of the record, or of the motion of one that mostly rests, is used for fitting, in five parts; the 40 % "
    "between them is for judging."
)
KINDS = {"time": ("s",), "drive": ("Nm", "N", "V", "A", "Arms", "Apk", "Vrms", "%", "counts")}  # SI symbols of a role
MOTIONS = ("rad", "m", "counts")


def _unit(role: str, column: str, default: str) -> str:
    """The unit that a column's name ends in, if it is one of the role or not known."""
    unit = unit_in("", column, role)
    foreign = unit != UNKNOWN and not is_known(unit)
    return unit if foreign or factor_of(unit)[1] in KINDS.get(role, MOTIONS) else default


class Segmented:
    """A record with holes: its time (n,), and the samples before which it has one, ``starts``."""

    time: Array
    starts: tuple[int, ...]

    @property
    def dt(self) -> float:
        """Sampling time in s."""
        spans = sum(float(self.time[s.stop - 1] - self.time[s.start]) for s, _ in self.pieces)
        return spans / (self.time.size - 1 - len(self.starts))

    @property
    def clock(self) -> Array:
        """Time of every sample since the first, shape (n,), in steps of `dt` where there is no hole (s)."""
        return np.concatenate([t + np.arange(s.stop - s.start) * self.dt for s, t in self.pieces])

    @property
    def pieces(self) -> list[tuple[slice, float]]:
        """The samples of every segment, and the time of its first sample (s since the start of the record)."""
        bounds = (0, *self.starts, self.time.size)
        return [(slice(a, b), float(self.time[a] - self.time[0])) for a, b in pairwise(bounds)]

    def by_piece(self, function: Callable[..., Any], *signals: Array) -> Any:
        """Results of a ``function`` of all ``*signals`` (n, ...) for every segment, joined: an array or a tuple."""
        found = [function(*(x[s] for x in signals)) for s, _ in self.pieces]
        if len(found) == 1:
            return found[0]
        if isinstance(found[0], tuple):
            return tuple(np.concatenate(parts) for parts in zip(*found, strict=True))
        return np.concatenate(found)


@dataclass(frozen=True)
class ServoRecord(Segmented):
    """Time, drive, position and, if logged, the reference; shape (n,) each, evenly sampled, converted to SI.

    Parameters
    ----------
    time : ndarray of shape (n,)
        Evenly spaced (s).
    drive, position : ndarray of shape (n,)
        In ``units``; the record keeps them in Nm or N, rad or m. A drive in A, V, % or counts stays as it is.
    reference : ndarray of shape (n,), optional
        The commanded position, in the unit of the position.
    units : tuple of two str
        Units of drive and position as given; in the record they become the SI symbols.
    resolution : float
        Step of the encoder in the position's unit, if the log states it (a log in counts); otherwise 0.
    quantum : float
        Step on which the readings lay, in the position's unit, if they were resampled since; otherwise not needed.
    in_place_of_drive : str
        A remark on what stands for a drive that was not logged; empty if one was.
    starts : tuple of int
        Samples before which the log has a hole: filters, simulations and free runs restart there.
    speed_noise : float
        Standard deviation of the noise of a logged velocity whose integral is the position, in the position's unit per
        s; 0 if the position itself was logged.
    logged : tuple of two str, optional
        The units of drive and position as logged, which reports use; by default `units` as given.

    References
    ----------
    Swevers, Verdonck and De Schutter 2007, IEEE Control Systems Magazine 27(5), 58-71, on what to log.

    Examples
    --------
    >>> import numpy as np
    >>> from whsklearn.gap import ServoRecord
    >>> t = np.arange(100) / 1000
    >>> record = ServoRecord(time=t, drive=np.sin(t), position=np.zeros(100), units=("N", "m"))
    >>> len(record), round(record.dt, 6)
    (100, 0.001)
    >>> record = ServoRecord(t, np.full(100, 30.0), np.full(100, 180.0), units=("mNm", "deg"))
    >>> float(record.drive[0]), round(float(record.position[0]), 4), record.units, record.logged
    (0.03, 3.1416, ('Nm', 'rad'), ('mNm', 'deg'))
    """

    time: Array
    drive: Array
    position: Array
    reference: Array | None = None
    units: tuple[str, str] = ("Nm", "rad")
    resolution: float = 0.0
    quantum: float = 0.0
    in_place_of_drive: str = ""
    logged: tuple[str, str] = ("", "")
    starts: tuple[int, ...] = ()
    speed_noise: float = 0.0

    def __post_init__(self) -> None:
        if not any(self.logged):
            object.__setattr__(self, "logged", self.units)
        (by, drive), (turn, motion) = map(factor_of, self.units)
        for name, factor in (("time", 1.0), ("drive", by), ("position", turn), ("reference", turn)):
            if (given := getattr(self, name)) is not None:  # a factor of one changes no bit
                object.__setattr__(self, name, np.asarray(given, dtype=float) * factor)
        for name in ("resolution", "quantum", "speed_noise"):
            object.__setattr__(self, name, getattr(self, name) * turn)
        object.__setattr__(self, "units", (drive, motion))

    @cached_property
    def drive_noise(self) -> float:
        """Largest standard deviation that white noise in the drive's reading can have, see `reading_noise`."""
        return reading_noise([self.drive[s] for s, _ in self.pieces], [self.position[s] for s, _ in self.pieces])

    @property
    def shown(self) -> dict[str, str]:
        """SI symbol of drive and motion -> the unit in which a report states them."""
        return own_units(self.units, self.logged)

    def told(self, value: float, unit: str) -> str:
        """A ``value`` in the compound SI ``unit`` as a report states it, such as ``0.012 deg``."""
        factor, spelled = respelled(unit, self.shown)
        return f"{value / factor:.3g} {spelled}"

    @property
    def is_following_error(self) -> bool:
        """Whether command minus position stands for the drive, or the drive is logged as an angle or a length.

        Equal units alone prove nothing: the counts of a converter and of an encoder are both ``counts``.
        """
        return bool(self.in_place_of_drive) or (self.units[0] == self.units[1] and self.units[1] in ("rad", "m"))

    @classmethod
    def from_frame(
        cls,
        frame: pd.DataFrame,
        *,
        time: str = "time_s",
        drive: str = "torque_nm",
        position: str = "position_rad",
        reference: str | None = None,
        resolution: float = 0.0,
    ) -> ServoRecord:
        """Pick the columns of a log; one whose name ends in a unit, ``_deg``, ``_mnm`` or ``_ms``, is converted to SI.

        ``frame``: the log. ``time``, ``drive``, ``position``, ``reference``: names of its columns. ``resolution``: step
        of the encoder in the position's unit, if its data sheet states it. Raises ValueError if a column does not exist
        or is not numeric.

        Examples
        --------
        >>> import numpy as np, pandas as pd
        >>> log = pd.DataFrame({"time_ms": [0.0, 1.0], "force_n": [5.0, 6.0], "position_deg": [0.0, 180.0]})
        >>> record = ServoRecord.from_frame(log, time="time_ms", drive="force_n", position="position_deg")
        >>> record.time, record.position, record.units
        (array([0.   , 0.001]), array([0.        , 3.14159265]), ('N', 'rad'))
        """
        picked, units, frame = {}, {}, as_frame(frame)
        wanted = {"time": (time, "s"), "drive": (drive, "Nm"), "position": (position, "rad")}
        if reference is not None:
            wanted["reference"] = (reference, _unit("position", position, "rad"))
        for role, (column, default) in wanted.items():
            if column not in frame.columns:
                have = ", ".join(map(str, frame.columns))
                raise ValueError(f"The log has no column {column!r} for the {role}; it has {have}. Name the right one.")
            picked[role] = pd.to_numeric(frame[column], errors="coerce").to_numpy(dtype=float)
            units[role] = _unit(role, column, default)
        picked["time"] = picked["time"] * factor_of(units["time"])[0]
        if reference is not None:
            picked["reference"] = picked["reference"] * factor_between(units["reference"], units["position"])
        return cls(**picked, units=(units["drive"], units["position"]), resolution=resolution)

    @property
    def segments(self) -> list[ServoRecord]:
        """Every segment as a separate record, with the times of the whole; the record itself if it has no hole."""
        if not self.starts:
            return [self]
        signals = {k: x for k in ("time", "drive", "position", "reference") if (x := getattr(self, k)) is not None}
        return [replace(self, starts=(), **{k: x[s] for k, x in signals.items()}) for s, _ in self.pieces]

    def smoothed(self, function: Callable[..., Any], x: Array, reach: int) -> Any:
        """`by_piece` for a filter that reaches ``reach`` samples either way; every segment is extended beyond its ends.

        Point symmetry at the last sample keeps position and speed; a constant continuation would halve the
        speed from which a simulation of the segment starts.

        ``function``: takes one array and returns one of the same length, or a tuple of them. ``x`` (n,): the signal.
        """
        if not self.starts:
            return function(x)

        def inside(part: Array) -> Any:
            room = min(reach, part.size - 1)
            found = function(np.pad(part, room, mode="reflect", reflect_type="odd"))
            cut = slice(room, room + part.size)
            return tuple(f[cut] for f in found) if isinstance(found, tuple) else found[cut]

        return self.by_piece(inside, x)

    def near_a_hole(self, before: int, after: int) -> NDArray[np.bool_]:
        """Samples close to a hole, shape (n,): as many as ``before`` and ``after`` it."""
        near = np.zeros(len(self), dtype=bool)
        for k in self.starts:
            near[max(k - before, 0) : k + after] = True
        return near

    def __len__(self) -> int:
        return self.time.size


def noise_level(position: ArrayLike) -> float:
    """Standard deviation of white noise in a smooth signal, from its sixth differences without the largest 2 %.

    The squares of their weights (1, 6, 15, 20, ...) sum to 924.
    """
    d = np.abs(np.diff(np.asarray(position, dtype=float), 6))
    kept = np.sort(d)[: max(1, int(NOISE_KEPT * d.size))]
    return float(np.sqrt(np.mean(kept**2) / 924.0) * NOISE_MADE_UP)


def white_noise(noise: Any, step: Any) -> Any:
    """Standard deviation of an encoder's noise beside the rounding to its ``step``, at least `LEAST_WHITE` of all.

    >>> float(white_noise(5e-4, 12**0.5 * 4e-4).round(6)), float(white_noise(1e-4, 1e-3).round(6))
    (0.0003, 3e-05)
    """
    return np.sqrt(np.maximum(noise**2 - step**2 / 12.0, (LEAST_WHITE * noise) ** 2))


def reading_noise(drives: Sequence[Array], positions: Sequence[Array]) -> float:
    """Standard deviation of what neither the neighbours of a sample of the drive tell of it nor those of the position.

    An upper bound on white noise of the reading, because all else that no neighbour tells is in it.  A controller
    answers every step of the encoder, so that the sixth differences of a drive can be thirty times its noise; of 56
    logs with 0.5 or 0.6 % of noise this finds 0.4 to 1.1 %.

    Parameters
    ----------
    drives, positions : sequences of ndarray of shape (n,)
        A segment of the log each.

    Examples
    --------
    >>> rng, t = np.random.default_rng(0), np.arange(4000) / 1000
    >>> q = np.round(np.sin(9 * t) / 1e-3) * 1e-3  # an encoder of coarse steps, and a controller with a gain of 200
    >>> u = 200.0 * (np.sin(9 * t + 0.1) - q) + 0.05 * rng.standard_normal(4000)
    >>> round(reading_noise([u], [q]), 3), round(noise_level(u), 3)
    (0.052, 0.075)
    """
    width = 2 * NEIGHBOURS + 1
    every, rows = 1 + sum(u.size for u in drives) // ENOUGH_ROWS, []
    for u, q in zip(drives, positions, strict=True):
        if u.size >= width:
            around = sliding_window_view(u - u.mean(), width), sliding_window_view(q - q.mean(), width)
            rows.append(np.concatenate([x[::every] for x in around], axis=1))
    x = np.concatenate(rows) if rows else np.zeros((0, 2 * width))
    if len(x) <= x.shape[1]:
        return 0.0
    target, x = x[:, NEIGHBOURS], np.delete(x, NEIGHBOURS, axis=1)
    x /= np.maximum(np.linalg.norm(x, axis=0), 1e-300)
    left = target - x @ np.linalg.lstsq(x, target, rcond=1e-12)[0]
    usual = np.abs(left) < np.quantile(np.abs(left), NOISE_KEPT)  # a step of the drive, at a reversal, is no noise
    left = target - x @ np.linalg.lstsq(x[usual], target[usual], rcond=1e-12)[0]
    return MAD * float(np.median(np.abs(left)))


def training_samples(position: Array) -> NDArray[np.bool_]:
    """Mask of the samples that are fitted, shape (n,); the others, at the end of each of `PARTS` parts, judge.

    ``position``: (n,), or (n, joints).

    The parts are equally long, unless less than half of the motion that is due would be held out; then they hold
    equally much of it.  An arm whose joints take steps one after the other moved in the fitted parts only, so that no
    model came closer to the rest.
    """

    def fitted(done: Array, whole: float) -> NDArray[np.bool_]:
        period = whole / PARTS
        return np.asarray((done % period) / period < 1.0 - HELD_OUT)

    n = len(position)
    mask = fitted(np.arange(n), n)
    way = np.abs(np.diff(position, axis=0, prepend=position[:1])).reshape(n, -1)
    moved = np.mean(way / np.maximum(way.sum(axis=0), 1e-300), axis=1)
    if moved[~mask].sum() >= 0.5 * HELD_OUT * moved.sum():
        return mask
    return fitted(np.minimum(np.cumsum(moved), (1.0 - 1e-12) * moved.sum()), float(moved.sum()))
