"""A log prepared for the candidates: the fitted signal, its noise, and the held-out part."""

from __future__ import annotations

import functools
import itertools
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from whsklearn.effects.base import Array
from whsklearn.filtering.records import fine_drive
from whsklearn.logs.check import stillness
from whsklearn.logs.errors import LogError
from whsklearn.logs.units import UNKNOWN
from whsklearn.recursion.batch.best_linear import IOData, Ratio, filter_rows, least_squares_arx

HOLDOUT = 0.3
LEAST_MOTION = (
    0.1  # share of the range; four of eight XL330 logs end at rest, within 0.01 (benchmarks/which_structure.py)
)
LEAST_FITTED = 60  # samples
LEAST_SEGMENT = 30  # samples; a shorter one has less information than its initial state needs
DRIVES, RATES = (
    ("Nm", "N", "A", "Arms", "Apk", "V", "Vrms", "%"),
    ("rad/s", "m/s", "counts/s"),
)  # SI units of what moves an axis; of a velocity
PLACES = ("rad", "m", "counts")  # SI units of a position
SMOOTHING = 0.03  # s, width of the parabola for the velocity of a logged position
# Of the squared equation error: a constant that removes more than a fifth belongs to an operating point, and the pole
# is judged with it.  Valves about 50 % are left 0.56 or less, axes 0.9 and more (tests/identification/test_view.py)
A_CONSTANT = 0.8
INTEGRATES = 0.1  # a time constant above this share of the record cannot be distinguished from an integrator


@dataclass(frozen=True)
class View:
    """A record in the form that the candidates of a comparison use.

    Attributes
    ----------
    u, y : ndarray of shape (n,)
        Drive and logged output.
    target : ndarray of shape (n,)
        What is fitted: y, or the velocity of a logged position.
    dt : float
        Sampling time (s).
    logged : {"output", "velocity", "position"}
        What y is.
    si : tuple of two float
        Factors that convert u and y to SI, in which the candidates are fitted.
    starts : tuple of int
        Start of each segment after a hole or a restart, besides sample 0.
    steps : int
        Fine steps per sample in the simulation of an axis.
    hold : {"zero", "cubic"}
        Behaviour of the drive between samples, see `whsklearn.filtering.records.fine_drive`.
    settles : bool
        Whether a logged position does not keep its value without a drive, as that of an axis with gravity. A linear
        model of it is fitted to the position itself.
    angle : bool
        Whether the output may be an angle, of which gravity is a sine: not if it counts anything, nor if the drive is
        the command of a position or a speed.

    References
    ----------
    Savitzky and Golay 1964, Smoothing and Differentiation of Data by Simplified Least Squares Procedures, Anal. Chem.
    36(8), 1627-1639, of the velocity of a logged position.

    Examples
    --------
    >>> import numpy as np
    >>> from whsklearn.identification import View
    >>> y = np.sin(np.arange(400) / 40)
    >>> record = View(u=np.cos(np.arange(400) / 40), y=y, target=y, dt=0.01, logged="output")
    >>> record.part(0, 100).y.size, record.floor < 1e-4
    (100, True)
    """

    u: Array
    y: Array
    target: Array
    dt: float
    logged: str
    si: tuple[float, float] = (1.0, 1.0)
    starts: tuple[int, ...] = ()
    steps: int = 4
    hold: str = "zero"
    settles: bool = False
    angle: bool = True

    @functools.cached_property
    def drive(self) -> Array:
        """The drive in every fine step of an axis' run, shape (n, steps)."""
        return fine_drive(self.u, self.steps, self.hold, self.bounds)

    @property
    def bounds(self) -> NDArray[np.int64]:
        """First sample of every segment, and the number of samples."""
        return np.array([0, *self.starts, self.y.size], dtype=np.int64)

    @property
    def longest(self) -> View:
        """The longest segment."""
        k = int(np.argmax(np.diff(self.bounds)))
        return self.part(int(self.bounds[k]), int(self.bounds[k + 1]))

    @property
    def as_response(self) -> View:
        """The record as a linear model is fitted to it: to the velocity of a position only if that integrates."""
        return replace(self, logged="output", target=self.y) if self.settles else self

    @property
    def in_si(self) -> View:
        """The record in Nm or N, rad or m."""
        by, far = self.si
        if self.si == (1.0, 1.0):
            return self
        return replace(self, u=self.u * by, y=self.y * far, target=self.target * far, si=(1.0, 1.0))

    @property
    def floor(self) -> float:
        """Standard deviation of the output's noise from third differences; 0 if y is not slow compared with dt."""
        return noise_floor(self.y, self.bounds)

    def part(self, start: int, stop: int) -> View:
        """Some of the samples. ``start``, ``stop``: range of samples; ``stop`` is excluded."""
        starts = tuple(b - start for b in self.starts if start < b < stop)
        u, y, target = (x[start:stop] for x in (self.u, self.y, self.target))
        return replace(self, u=u, y=y, target=target, starts=starts)


def view(
    u: ArrayLike,
    y: ArrayLike,
    dt: float,
    logged: str,
    groups: ArrayLike | None = None,
    si: tuple[tuple[float, str], tuple[float, str]] = ((1.0, UNKNOWN), (1.0, UNKNOWN)),
) -> View:
    """Check a record, and determine what was logged if ``logged`` is ``auto``; ``groups`` gives its segments.

    Segments of fewer than `LEAST_SEGMENT` samples are omitted. ``si`` holds the factors to SI and the SI units.
    """
    u, y = np.asarray(u, dtype=float).reshape(-1), np.asarray(y, dtype=float).reshape(-1)
    starts: tuple[int, ...] = ()
    if groups is not None and u.shape == y.shape:
        u, y, starts = _segments(u, y, np.asarray(groups).reshape(-1))
    if u.shape != y.shape:
        raise ValueError(f"The record has {u.size} inputs and {y.size} outputs; expected equal numbers.")
    if u.size < 100:
        raise ValueError(f"The record has {u.size} samples; expected at least 100. Log longer, or at a higher rate.")
    for name, signal in (("input", u), ("output", y)):
        if not np.isfinite(signal).all():
            raise ValueError(
                f"The {name} is not finite at row {np.argmin(np.isfinite(signal))}; repair or cut the log."
            )
        if np.ptp(signal) == 0:
            raise LogError(f"The {name} never changes; give a log in which the axis is driven and moves.")
    bounds = np.array([0, *starts, y.size], dtype=np.int64)
    if not (np.isfinite(dt) and dt > 0):
        raise ValueError(f"dt is {dt!r}, expected a sampling time above zero in s.")
    drive, output = (unit for _, unit in si)
    if logged == "position" or (logged == "auto" and output in PLACES):
        if still := stillness(y, _differences(y, 1, bounds)):
            raise LogError(": ".join(still))
    # the motion of an axis under a torque is a position whether it hangs or not; a rate never is one
    placed = output in PLACES and drive in DRIVES
    settles = logged in ("auto", "position") and not integrates(u, y, bounds)
    if logged == "auto":
        logged = "output" if output in RATES or (settles and not placed) else "position"
    if logged not in ("output", "velocity", "position"):
        raise ValueError(f"logged is {logged!r}, expected 'auto', 'output', 'velocity' or 'position'.")
    target = derivative(y, dt, bounds)[0] if logged == "position" else y
    u, y, target = (np.ascontiguousarray(x) for x in (u, y, target))
    settles = settles and logged == "position"
    factors = si[0][0], si[1][0]
    # what moves an axis against its weight is a torque: a commanded position or speed is not
    angle = drive not in (*PLACES, *RATES) and (
        output == "rad" or (output == UNKNOWN and bool(np.any(y != np.round(y))))
    )
    return View(u, y, target, float(dt), logged, factors, starts, settles=settles, angle=angle)


def _segments(u: Array, y: Array, groups: NDArray[Any]) -> tuple[Array, Array, tuple[int, ...]]:
    """The sufficiently long segments, concatenated, and the starts of all but the first."""
    if groups.shape != y.shape:
        raise ValueError(f"There are {groups.size} groups for {y.size} samples; expected one for each.")
    bounds = np.r_[0, np.flatnonzero(groups[1:] != groups[:-1]) + 1, y.size]
    kept = [(a, b) for a, b in itertools.pairwise(bounds.tolist()) if b - a >= LEAST_SEGMENT]
    if not kept:
        if bounds.size == 2:
            raise LogError(f"The record has {y.size} samples, where {LEAST_SEGMENT} are needed; log longer.")
        raise LogError(
            f"Holes cut the record into {bounds.size - 1} segments, none of {LEAST_SEGMENT} samples; log without them."
        )
    starts = np.cumsum([b - a for a, b in kept])[:-1]
    u, y = (np.concatenate([x[a:b] for a, b in kept]) for x in (u, y))
    return u, y, tuple(int(s) for s in starts)


def since_start(bounds: NDArray[np.int64]) -> NDArray[np.int64]:
    """Number of samples before each sample in its segment."""
    return np.concatenate([np.arange(n) for n in np.diff(bounds)])


def one_later(u: Array, bounds: NDArray[np.int64]) -> Array:
    """A signal delayed by one sample, zero at the start of each segment."""
    out = np.append(0.0, u[:-1])
    out[bounds[:-1]] = 0.0
    return out


def _differences(y: Array, order: int, bounds: NDArray[np.int64] | None) -> Array:
    """Differences within the segments."""
    pieces = np.split(y, bounds[1:-1]) if bounds is not None else [y]
    return np.concatenate([np.diff(p, order) for p in pieces])


def integrates(u: Array, y: Array, bounds: NDArray[np.int64]) -> bool:
    """Whether y keeps its value when the drive is zero: a pole at 1.

    About an operating point (a valve half open, a heater at half power) drive and output are constants apart, and
    without one the fit would have that pole.
    """
    since = since_start(bounds)
    data = IOData(one_later(u, bounds)[None, :], y - y[np.arange(y.size) - since], bounds, since >= 10)
    plain, level = (least_squares_arx(d, 3, 2) for d in (data, data._replace(level=True)))
    left = float(np.mean(_equation_error(plain, data) ** 2))
    arx = level if np.var(_equation_error(level, data)) < A_CONSTANT * left else plain
    slowest = float(np.abs(np.roots(arx.a)).max(initial=0.0))
    return slowest > np.exp(-1.0 / (INTEGRATES * y.size)) and smooth(y, bounds)


def _equation_error(arx: Ratio, data: IOData) -> Array:
    """a(q) y - b(q) u at the samples that count."""
    one = np.ones(1)
    error = filter_rows(arx.a, one, data.y[None, :], data.bounds) - filter_rows(arx.b, one, data.u[:1], data.bounds)
    return error[0][data.counts]


def smooth(y: Array, bounds: NDArray[np.int64] | None = None) -> bool:
    """Whether y is slow compared with its sampling, like the position of a mass."""
    return bool(np.std(_differences(y, 2, bounds)) < 0.1 * np.std(y))


def held_out_from(y: Array) -> int:
    """The first held-out sample: after 70 % of the record, or earlier if the remainder hardly moves.

    An axis at rest does not test a model; the split is then placed so that 30 % of the range is still to come.
    """
    cut, whole = int((1 - HOLDOUT) * y.size), np.ptp(y)
    if np.ptp(y[cut:]) >= LEAST_MOTION * whole:
        return cut
    back = y[::-1]
    range_left = np.maximum.accumulate(back) - np.minimum.accumulate(back)
    return max(y.size - 1 - int(np.argmax(range_left >= HOLDOUT * whole)), min(LEAST_FITTED, cut))


def noise_floor(y: Array, bounds: NDArray[np.int64] | None = None) -> float:
    """median |third difference| / (0.6745 sqrt 20): the deviation of white noise, and zero for a slow signal."""
    third = _differences(y, 3, bounds)
    return float(np.median(np.abs(third)) / (0.6745 * np.sqrt(20.0))) if smooth(y, bounds) else 0.0


def derivative(y: Array, dt: float, bounds: NDArray[np.int64] | None = None) -> tuple[Array, Array]:
    """First and second derivative by a sliding parabola (Savitzky and Golay 1964), segment by segment."""
    from scipy.signal import savgol_filter

    if bounds is not None and bounds.size > 2:
        pieces = [derivative(p, dt) for p in np.split(y, bounds[1:-1])]
        return np.concatenate([first for first, _ in pieces]), np.concatenate([second for _, second in pieces])
    window = window_of(y.size, dt)
    return savgol_filter(y, window, 2, 1, delta=dt), savgol_filter(y, window, 2, 2, delta=dt)


def window_of(n: int, dt: float) -> int:
    """Samples under the parabola, an odd number."""
    return min(max(5, 2 * round(SMOOTHING / dt / 2) + 1), 2 * ((n - 1) // 2) - 1)
