"""A log as the candidates see it: which signal is fitted, how noisy it is, what is held out."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from whsklearn.recursion.best_linear import IOData, least_squares_arx

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    Array = NDArray[np.float64]

HOLDOUT = 0.3
LEAST_MOTION = 0.1  # of the range: of eight XL330 logs (benchmarks/which_structure.py) four end at rest, in 0.01 of it
LEAST_FITTED = 60  # samples
SMOOTHING = 0.03  # s over which a parabola is laid for the velocity of a logged position
INTEGRATES = 0.1  # a time constant above that share of the record is an integrator to anyone who reads the log


@dataclass(frozen=True)
class View:
    """A record as the candidates of a comparison see it.

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

    @property
    def floor(self) -> float:
        """Standard deviation of the output's noise from third differences; 0 where y is not slow against dt."""
        return noise_floor(self.y)

    def part(self, start: int, stop: int) -> View:
        """Some of the samples.

        Parameters
        ----------
        start, stop : int
            Samples, the last one left out.
        """
        return replace(self, u=self.u[start:stop], y=self.y[start:stop], target=self.target[start:stop])


def view(u: ArrayLike, y: ArrayLike, dt: float, logged: str) -> View:
    """Check a record, and see what was logged if ``logged`` is ``auto``."""
    u, y = np.asarray(u, dtype=float).reshape(-1), np.asarray(y, dtype=float).reshape(-1)
    if u.shape != y.shape or u.size < 100:
        raise ValueError(f"The record has {u.size} inputs and {y.size} outputs; expected as many, and 100 at least.")
    for name, signal in (("input", u), ("output", y)):
        if not np.isfinite(signal).all():
            raise ValueError(
                f"The {name} is not finite at row {np.argmin(np.isfinite(signal))}; repair or cut the log."
            )
        if np.ptp(signal) == 0:
            raise ValueError(f"The {name} never changes; give a log in which the axis is driven and moves.")
    if not (np.isfinite(dt) and dt > 0):
        raise ValueError(f"dt is {dt!r}, expected a sampling time above zero in s.")
    if logged == "auto":
        logged = "position" if integrates(u, y) else "output"
    if logged not in ("output", "velocity", "position"):
        raise ValueError(f"logged is {logged!r}, expected 'auto', 'output', 'velocity' or 'position'.")
    target = derivative(y, dt)[0] if logged == "position" else y
    return View(np.ascontiguousarray(u), np.ascontiguousarray(y), np.ascontiguousarray(target), float(dt), logged)


def integrates(u: Array, y: Array) -> bool:
    """Whether y is a motion that keeps its place when the drive is gone: a pole at 1."""
    data = IOData(np.append(0.0, u[:-1])[None, :], y - y[0], np.array([0, y.size]), np.arange(y.size) >= 10)
    arx = least_squares_arx(data, 3, 2)
    slowest = float(np.abs(np.roots(arx.a)).max(initial=0.0))
    return slowest > np.exp(-1.0 / (INTEGRATES * y.size)) and smooth(y)


def smooth(y: Array) -> bool:
    """Whether y is slow against its sampling, as the position of anything with mass is."""
    return bool(np.std(np.diff(y, 2)) < 0.1 * np.std(y))


def held_out_from(y: Array) -> int:
    """The first sample that is held out: after 70 % of the record, or earlier where what follows hardly moves.

    An axis that stands says nothing of a model; held out is then what follows from where 30 % of the range are to come.
    """
    cut, whole = int((1 - HOLDOUT) * y.size), np.ptp(y)
    if np.ptp(y[cut:]) >= LEAST_MOTION * whole:
        return cut
    back = y[::-1]
    range_left = np.maximum.accumulate(back) - np.minimum.accumulate(back)
    return max(y.size - 1 - int(np.argmax(range_left >= HOLDOUT * whole)), min(LEAST_FITTED, cut))


def noise_floor(y: Array) -> float:
    """median |third difference| / (0.6745 sqrt 20): of white noise its deviation, of a slow signal nothing."""
    return float(np.median(np.abs(np.diff(y, 3))) / (0.6745 * np.sqrt(20.0))) if smooth(y) else 0.0


def derivative(y: Array, dt: float) -> tuple[Array, Array]:
    """First and second derivative by a sliding parabola (Savitzky and Golay 1964)."""
    from scipy.signal import savgol_filter

    window = min(max(5, 2 * round(SMOOTHING / dt / 2) + 1), 2 * ((y.size - 1) // 2) - 1)
    return savgol_filter(y, window, 2, 1, delta=dt), savgol_filter(y, window, 2, 2, delta=dt)
