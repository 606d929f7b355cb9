"""A log as the workflow takes it, and what is read off it once."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from whsklearn.gap import evidence as rules

Array = NDArray[Any]


TIMES = {"s": ("s", 1.0), "ms": ("s", 1e-3), "us": ("s", 1e-6)}
LENGTHS = {
    "rad": ("rad", 1.0), "mrad": ("rad", 1e-3), "deg": ("rad", np.pi / 180), "turns": ("rad", 2 * np.pi),
    "m": ("m", 1.0), "mm": ("m", 1e-3), "um": ("m", 1e-6),
}  # fmt: skip
SPLIT = "60 % of the record in five parts is used for fitting, the 40 % between them for judging."
DRIVES = {"nm": ("Nm", 1.0), "n": ("N", 1.0), "v": ("V", 1.0), "a": ("A", 1.0)}


def _unit(column: str, known: dict[str, tuple[str, float]], default: str = "") -> tuple[str, float]:
    """Unit and factor that the ending of a column's name tells."""
    return known.get(str(column).rpartition("_")[2].lower(), (default, 1.0))


@dataclass(frozen=True)
class ServoRecord:
    """Time, drive, position and, if logged, the reference; shape (n,) each, evenly sampled.

    Parameters
    ----------
    time : ndarray of shape (n,)
        Evenly spaced (s).
    drive, position : ndarray of shape (n,)
        As logged, in ``units``.
    reference : ndarray of shape (n,), optional
        What the position should have been.
    units : tuple of two str
        Of drive and position.
    resolution : float
        Step of the encoder where the log states it (a log in counts), in the position's unit; 0 where it does not.
    error_for_drive : bool
        Whether command minus position stands for a drive that was not logged.

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
    """

    time: Array
    drive: Array
    position: Array
    reference: Array | None = None
    units: tuple[str, str] = ("Nm", "rad")
    resolution: float = 0.0
    error_for_drive: bool = False

    @property
    def is_following_error(self) -> bool:
        """Whether command minus position stands for the drive: it was made so, or is logged as an angle or a length.

        Equal units alone say nothing: a converter's counts and an encoder's are both ``counts``.
        """
        return self.error_for_drive or (self.units[0] == self.units[1] and self.units[1] in ("rad", "m"))

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
        """Pick the columns of a log; a name that ends in a unit, ``_deg`` or ``_ms``, is brought to rad, m and s.

        Parameters
        ----------
        frame : DataFrame
        time, drive, position : str
            Names of columns.
        reference : str, optional
            Name of a column.
        resolution : float
            Step of the encoder in rad or m, where its data sheet says it.

        Examples
        --------
        >>> import numpy as np, pandas as pd
        >>> log = pd.DataFrame({"time_ms": [0.0, 1.0], "force_n": [5.0, 6.0], "position_deg": [0.0, 180.0]})
        >>> record = ServoRecord.from_frame(log, time="time_ms", drive="force_n", position="position_deg")
        >>> record.time, record.position, record.units
        (array([0.   , 0.001]), array([0.        , 3.14159265]), ('N', 'rad'))

        Raises
        ------
        ValueError
            If a column is not there or is not numeric.
        """
        picked = {}
        wanted = {"time": time, "drive": drive, "position": position}
        if reference is not None:
            wanted["reference"] = reference
        for role, column in wanted.items():
            if column not in frame.columns:
                have = ", ".join(map(str, frame.columns))
                raise ValueError(f"The log has no column {column!r} for the {role}; it has {have}. Name the right one.")
            values = pd.to_numeric(frame[column], errors="coerce").to_numpy(dtype=float)
            known: dict[str, tuple[str, float]] = {"time": TIMES, "drive": {}}.get(role, LENGTHS)
            picked[role] = values * _unit(column, known)[1]
        units = (_unit(drive, DRIVES, "Nm")[0], _unit(position, LENGTHS, "rad")[0])
        return cls(**picked, units=units, resolution=resolution)

    @property
    def dt(self) -> float:
        """Sampling time in s."""
        return float((self.time[-1] - self.time[0]) / (self.time.size - 1))

    def __len__(self) -> int:
        return self.time.size


def rms(x: ArrayLike) -> float:
    """Root mean square of all entries."""
    return float(np.sqrt(np.mean(np.asarray(x) ** 2)))


def noise_level(position: ArrayLike) -> float:
    """Standard deviation of white noise in a smooth signal, from its sixth differences without the largest 2 %.

    The squares of their weights (1, 6, 15, 20, ...) sum to 924.
    """
    d = np.abs(np.diff(np.asarray(position, dtype=float), 6))
    kept = np.sort(d)[: max(1, int(rules.NOISE_KEPT * d.size))]
    return float(np.sqrt(np.mean(kept**2) / 924.0) * rules.NOISE_MADE_UP)


def lattice(position: ArrayLike) -> float:
    """Step of the grid on which all samples lie, 0 if there is none.

    The smallest difference between distinct values is the step if nearly all differences
    are whole multiples of it.
    """
    values = np.unique(np.asarray(position, dtype=float))
    if values.size < 3:
        return 0.0
    gaps = np.diff(values)
    span = values[-1] - values[0]
    gaps = gaps[gaps > 1e-12 * span]
    if gaps.size < 3:
        return 0.0
    step = float(np.median(gaps[gaps < rules.ONE_STEP * gaps.min()]))
    ratio = gaps / step
    on_grid = np.abs(ratio - np.round(ratio)) < rules.ON_GRID * np.maximum(1.0, np.round(ratio) ** 0.5)
    if np.mean(on_grid) < rules.MOSTLY_ON_GRID or values.size > rules.DISTINCT * np.asarray(position).size:
        return 0.0
    offsets = (values - values[0]) / step
    slack = np.abs(offsets - np.round(offsets))
    if np.mean(slack) > rules.STEP_ROUNDED:
        step = span / np.round(span / step)
    return step


def held_out_blocks(
    n: int, n_pairs: int = rules.PARTS, share: float = rules.HELD_OUT
) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
    """Number of the held-out block (or -1) and the training mask of every sample: 60 and 40 % interleaved."""
    period = n / n_pairs
    phase = (np.arange(n) % period) / period
    number = (np.arange(n) / period).astype(np.intp)
    held = phase >= 1.0 - share
    return np.where(held, number, -1), ~held
