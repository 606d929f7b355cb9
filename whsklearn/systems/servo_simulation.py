"""The checked and completed inputs of an experiment on a servo axis, and its compiled simulation."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.utils import Bunch

from whsklearn.systems._servo_kernel import AxisNumbers
from whsklearn.systems.servo_parts import PIDController

if TYPE_CHECKING:
    import pandas as pd


class Experiment(NamedTuple):
    """An experiment on the axis: arrays of n samples, checked."""

    drive: NDArray[np.float64] | None
    reference: NDArray[np.float64]
    disturbance: NDArray[np.float64]
    measured: NDArray[np.float64]
    every: float
    linear: bool
    initial: NDArray[np.float64]


class Conditions(NamedTuple):
    """Settings of an experiment other than its reference or drive; see `simulate_many`."""

    disturbance: ArrayLike | None = None
    reference_velocity: ArrayLike | None = None
    reference_acceleration: ArrayLike | None = None
    initial_position: float | None = None
    initial_velocity: float | None = None
    position: ArrayLike | None = None
    velocity: ArrayLike | None = None
    resync: float | None = None
    hold: str = "zero"


def record_frame(record: Bunch) -> pd.DataFrame:
    """The log as a logger would write it: time_s, reference_rad, torque_nm, position_rad.

    Parameters
    ----------
    record : Bunch
        The result of `ServoAxis.simulate`.

    Examples
    --------
    >>> from whsklearn import ServoAxis
    >>> from whsklearn.systems import record_frame
    >>> list(record_frame(ServoAxis().simulate([0.0] * 10)))
    ['time_s', 'reference_rad', 'torque_nm', 'position_rad']
    """
    import pandas as pd

    return pd.DataFrame(
        {
            "time_s": record.time,
            "reference_rad": record.reference,
            "torque_nm": record.drive,
            "position_rad": record.position,
        }
    )


def _signal(values: ArrayLike, name: str, n: int | None = None) -> NDArray[np.float64]:
    """A finite one-dimensional signal of the right length."""
    signal = np.asarray(values, dtype=float)
    if signal.ndim != 1 or signal.size == 0 or (n is not None and signal.size != n):
        expected = "a non-empty 1-D array" if n is None else f"{n} samples"
        raise ValueError(f"{name} has shape {signal.shape}, expected {expected}; give one value per sample.")
    if not np.isfinite(signal).all():
        raise ValueError(f"{name} holds NaN or infinity at row {np.flatnonzero(~np.isfinite(signal))[0]}; clean it.")
    return np.ascontiguousarray(signal)


def experiment(
    controller: PIDController,
    sample_rate: float,
    reference: ArrayLike | None,
    drive: ArrayLike | None,
    wanted: Conditions,
) -> Experiment:
    """Check and complete the caller's experiment.

    Raises ValueError if both or none of reference (n,) in rad and drive (n,) in Nm are given, or a signal has another
    length.
    """
    if (reference is None) == (drive is None):
        raise ValueError("Give either a reference (closed loop) or a drive (open loop), not both and not neither.")
    if wanted.hold not in ("zero", "linear"):
        raise ValueError(f"hold is {wanted.hold!r}, expected 'zero' or 'linear'.")
    main = _signal(drive, "drive") if reference is None else _signal(reference, "reference")  # type: ignore[arg-type]
    n = main.size
    if drive is None:
        path = _path(controller, sample_rate, main, wanted.reference_velocity, wanted.reference_acceleration)
    else:
        path = np.full((3, n), np.nan)
    measured, every = _returns(sample_rate, wanted.position, wanted.velocity, wanted.resync, n)
    start = wanted.initial_position
    if start is None:
        start = _first(wanted.position, main[0] if drive is None else 0.0)
    speed = wanted.initial_velocity
    if speed is None:
        speed = measured[1, 0] if wanted.position is not None and drive is not None else 0.0
    return Experiment(
        None if drive is None else main,
        path,
        np.zeros(n) if wanted.disturbance is None else _signal(wanted.disturbance, "disturbance", n),
        measured,
        every,
        wanted.hold == "linear",
        np.array([start, speed, start, speed], dtype=float),
    )


def _first(position: ArrayLike | None, otherwise: float) -> float:
    """Default initial state of a simulation."""
    return float(otherwise if position is None else np.asarray(position, dtype=float)[0])


def _path(
    c: PIDController,
    rate: float,
    reference: NDArray[np.float64],
    velocity: ArrayLike | None,
    acceleration: ArrayLike | None,
) -> NDArray[np.float64]:
    """Reference and its two derivatives; central differences where they are not given."""
    n = reference.size
    path = np.zeros((3, n))
    path[0] = reference
    if velocity is not None:
        path[1] = _signal(velocity, "reference_velocity", n)
    elif (c.velocity_feedforward or c.acceleration_feedforward) and n > 1:
        path[1] = np.gradient(reference) * rate
    if acceleration is not None:
        path[2] = _signal(acceleration, "reference_acceleration", n)
    elif c.acceleration_feedforward and n > 1:
        path[2] = np.gradient(path[1]) * rate
    return path


def _returns(
    rate: float, position: ArrayLike | None, velocity: ArrayLike | None, resync: float | None, n: int
) -> tuple[NDArray[np.float64], int]:
    """Measured position and velocity, and the interval in samples at which to return to them (0: never)."""
    measured = np.zeros((2, n))
    if position is None:
        if resync is not None:
            raise ValueError("resync needs the measured position to return to; pass position=.")
        return measured, 0
    measured[0] = _signal(position, "position", n)
    if velocity is not None:
        measured[1] = _signal(velocity, "velocity", n)
    elif n > 4:
        measured[1] = _smoothed_velocity(measured[0], rate)
    if resync is None:
        return measured, 0
    if not 0.0 < resync < math.inf:
        raise ValueError(f"resync is {resync} s, expected a time above zero, or None for a free run.")
    return measured, max(1, round(resync * rate))


def _smoothed_velocity(position: NDArray[np.float64], rate: float) -> NDArray[np.float64]:
    """Velocity from a local parabola over 20 ms or five samples."""
    from scipy.signal import savgol_filter

    half = max(2, round(0.01 * rate))
    half = min(half, (position.size - 1) // 2)
    return savgol_filter(position, 2 * half + 1, 2, deriv=1, delta=1.0 / rate)


def reading_noise(deviation: float, noise: Any, random_state: Any, n: int) -> NDArray[np.float64]:
    """The noise on n readings (rad): drawn with the sensor's standard deviation, none, or as given."""
    if isinstance(noise, bool):
        if not noise or deviation == 0.0:
            return np.zeros(n)
        return deviation * np.random.default_rng(random_state).standard_normal(n)
    return _signal(noise, "noise", n)


def run(
    plant: AxisNumbers,
    controller: PIDController,
    e: Experiment,
    noise: NDArray[np.float64],
    sample_rate: float,
    substeps: int,
) -> Bunch:
    """Run the compiled simulation of one experiment and name its rows; see `ServoAxis.simulate`."""
    from whsklearn.systems import _servo_kernel as kernel

    n, closed = e.reference.shape[1], e.drive is None
    out = np.zeros((kernel.N_SIGNALS, n))
    if e.drive is not None:
        out[0] = e.drive
    signals = kernel.PassInputs(e.reference, noise, e.disturbance, e.measured)
    how = kernel.How(1.0 / sample_rate, substeps, closed, int(e.every), linear=e.linear and not closed)
    kernel.run(out, plant, controller.row, signals, how, e.initial)
    return Bunch(
        time=np.arange(out.shape[1]) * how.sample_time,
        reference=signals.reference[0],
        drive=out[kernel.DRIVE],
        position=out[kernel.MEASURED],
        true_position=out[kernel.POSITION],
        velocity=out[kernel.VELOCITY],
        torque=out[kernel.TORQUE],
        load_position=out[kernel.LOAD],
        load_velocity=out[kernel.LOAD_VELOCITY],
    )
