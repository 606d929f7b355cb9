"""Simulate one or many servo axes in one call."""

from __future__ import annotations

import math
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from sklearn.utils import Bunch

if TYPE_CHECKING:
    import pandas as pd
    from numpy.typing import ArrayLike, NDArray

    from whsklearn.systems.servo import ServoAxis


class Experiment(NamedTuple):
    """What is done to the axis: arrays of n samples, checked."""

    drive: NDArray[np.float64] | None
    reference: NDArray[np.float64]
    disturbance: NDArray[np.float64]
    measured: NDArray[np.float64]
    every: float
    linear: bool
    initial: NDArray[np.float64]


def simulate_many(
    axes: Sequence[ServoAxis],
    *,
    reference: ArrayLike | None = None,
    drive: ArrayLike | None = None,
    noise: Any = True,
    random_state: Any = 0,
    n_jobs: int = 1,
    **options: Any,
) -> list[Bunch]:
    """Simulate several axes in the same experiment; the compiled part runs in ``n_jobs`` threads.

    Parameters
    ----------
    axes : sequence of ServoAxis
        The axes; they may differ in everything, including their effects.
    reference : array-like of shape (n,), optional
        Reference of the closed loop (rad).
    drive : array-like of shape (n,), optional
        Drive to replay in open loop (Nm); give this or ``reference``.
    noise : bool, array-like of shape (n,), or list of these
        True adds white noise with the sensor's standard deviation; an array is added as it is (rad).
    random_state : int, Generator, None, or list of these
        Draws the noise; a list gives each axis its own.
    n_jobs : int
        Number of threads.
    **options
        ``disturbance`` (n,) in Nm, added to the torque; ``reference_velocity``, ``reference_acceleration``
        (n,); ``initial_position``, ``initial_velocity``; in open loop ``position``, ``velocity`` (n,),
        ``resync`` (s), ``hold`` ("zero" or "linear").

    Returns
    -------
    list of Bunch
        One record per axis, see `ServoAxis.simulate`; a simulation that diverges contains non-finite values.

    Examples
    --------
    >>> import numpy as np
    >>> from whsklearn.systems import ServoAxis, simulate_many
    >>> axes = [ServoAxis(inertia=j) for j in (0.04, 0.05)]
    >>> [r.position.size for r in simulate_many(axes, reference=np.zeros(10))]
    [10, 10]
    """
    axes = list(axes)
    noises = noise if isinstance(noise, list) else [noise] * len(axes)
    seeds = random_state if isinstance(random_state, list) else [random_state] * len(axes)
    wanted = Conditions(**options)
    jobs = [
        _job(a, _experiment(a, reference, drive, wanted), n, s) for a, n, s in zip(axes, noises, seeds, strict=True)
    ]
    if n_jobs == 1 or len(jobs) == 1:
        return [_run(job) for job in jobs]
    with ThreadPoolExecutor(n_jobs) as pool:
        return list(pool.map(_run, jobs))


def simulate_one(axis: ServoAxis, **options: Any) -> Bunch:
    """One simulation that must stay finite."""
    record = simulate_many([axis], **options)[0]
    bad = np.flatnonzero(~np.isfinite(record.true_position) | ~np.isfinite(record.drive))
    if bad.size:
        raise FloatingPointError(
            f"The simulation is no longer finite after {record.time[bad[0]]:.3g} s; "
            f"use more substeps than {axis.substeps}, lower gains or other parameters."
        )
    return record


def record_frame(record: Bunch) -> pd.DataFrame:
    """The log as a logger would have written it: time_s, reference_rad, torque_nm, position_rad.

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
        raise ValueError(f"{name} has shape {signal.shape}, expected {expected}; give one value a sample.")
    if not np.isfinite(signal).all():
        raise ValueError(f"{name} holds NaN or infinity at row {np.flatnonzero(~np.isfinite(signal))[0]}; clean it.")
    return np.ascontiguousarray(signal)


class Conditions(NamedTuple):
    """What an experiment is besides its reference or drive; see `simulate_many`."""

    disturbance: ArrayLike | None = None
    reference_velocity: ArrayLike | None = None
    reference_acceleration: ArrayLike | None = None
    initial_position: float | None = None
    initial_velocity: float | None = None
    position: ArrayLike | None = None
    velocity: ArrayLike | None = None
    resync: float | None = None
    hold: str = "zero"


def _experiment(
    axis: ServoAxis, reference: ArrayLike | None, drive: ArrayLike | None, wanted: Conditions
) -> Experiment:
    """Check what the caller wants and complete it."""
    if (reference is None) == (drive is None):
        raise ValueError("Give either a reference (closed loop) or a drive (open loop), not both and not neither.")
    if wanted.hold not in ("zero", "linear"):
        raise ValueError(f"hold is {wanted.hold!r}, expected 'zero' or 'linear'.")
    main = _signal(drive, "drive") if reference is None else _signal(reference, "reference")  # type: ignore[arg-type]
    n = main.size
    if drive is None:
        path = _path(axis, main, wanted.reference_velocity, wanted.reference_acceleration)
    else:
        path = np.full((3, n), np.nan)
    measured, every = _returns(axis, wanted.position, wanted.velocity, wanted.resync, n)
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
    """Where a simulation starts if nothing is said."""
    return float(otherwise if position is None else np.asarray(position, dtype=float)[0])


def _path(
    axis: ServoAxis, reference: NDArray[np.float64], velocity: ArrayLike | None, acceleration: ArrayLike | None
) -> NDArray[np.float64]:
    """Reference and its two derivatives; central differences where they are not given."""
    n, rate = reference.size, axis.sample_rate
    c = axis.controller
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
    axis: ServoAxis, position: ArrayLike | None, velocity: ArrayLike | None, resync: float | None, n: int
) -> tuple[NDArray[np.float64], int]:
    """Measured position and velocity, and every how many samples to return to them (0: never)."""
    measured = np.zeros((2, n))
    if position is None:
        if resync is not None:
            raise ValueError("resync needs the measured position to return to; pass position=.")
        return measured, 0
    measured[0] = _signal(position, "position", n)
    if velocity is not None:
        measured[1] = _signal(velocity, "velocity", n)
    elif n > 4:
        measured[1] = _smoothed_velocity(measured[0], axis.sample_rate)
    if resync is None:
        return measured, 0
    if not 0.0 < resync < math.inf:
        raise ValueError(f"resync is {resync} s, expected a time above zero, or None for a free run.")
    return measured, max(1, round(resync * axis.sample_rate))


def _smoothed_velocity(position: NDArray[np.float64], rate: float) -> NDArray[np.float64]:
    """Velocity from a local parabola over 20 ms or five samples."""
    from scipy.signal import savgol_filter

    half = max(2, round(0.01 * rate))
    half = min(half, (position.size - 1) // 2)
    return savgol_filter(position, 2 * half + 1, 2, deriv=1, delta=1.0 / rate)


def _noise(axis: ServoAxis, noise: Any, random_state: Any, n: int) -> NDArray[np.float64]:
    """The sensor's noise along a record."""
    if isinstance(noise, bool):
        if not noise or axis.sensor.noise == 0.0:
            return np.zeros(n)
        return axis.sensor.noise * np.random.default_rng(random_state).standard_normal(n)
    return _signal(noise, "noise", n)


def _job(axis: ServoAxis, e: Experiment, noise: Any, random_state: Any) -> tuple[Any, ...]:
    """Everything the compiled run needs, in its order."""
    from whsklearn.systems._servo_kernel import N_SIGNALS, How, Signals
    from whsklearn.systems._servo_pack import controller_of, pack

    n = e.reference.shape[1]
    out = np.zeros((N_SIGNALS, n))
    if e.drive is not None:
        out[0] = e.drive
    signals = Signals(e.reference, _noise(axis, noise, random_state, n), e.disturbance, e.measured)
    closed = e.drive is None
    how = How(1.0 / axis.sample_rate, int(axis.substeps), closed, int(e.every), linear=e.linear and not closed)
    return out, pack(axis), controller_of(axis), signals, how, e.initial


def _run(job: tuple[Any, ...]) -> Bunch:
    """Run the compiled simulation and name its rows."""
    from whsklearn.systems import _servo_kernel as kernel

    kernel.run(*job)
    out, signals, how = job[0], job[3], job[4]
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
