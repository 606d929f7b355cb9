"""Logs of a simulated servo axis with any effects."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.utils import Bunch

from whsklearn.datasets.drawn_effects import draw_effect
from whsklearn.datasets.references import reference_signal
from whsklearn.effects import Effect
from whsklearn.systems.servo import ServoAxis
from whsklearn.systems.servo_parts import PIDController, Sensor
from whsklearn.systems.servo_simulation import record_frame


def make_servo_log(
    effects: Effect | str | Iterable[Effect | str] = (),
    *,
    sizes: float | Sequence[float] = 0.05,
    axis: ServoAxis | None = None,
    reference: str | ArrayLike = "rich",
    amplitude: float | None = None,
    duration: float = 40.0,
    sample_rate: float | None = None,
    noise: float | None = None,
    resolution: float | None = None,
    snr_db: float | None = None,
    disturbance: ArrayLike | None = None,
    random_state: Any = 0,
    return_truth: bool = False,
) -> Any:
    """Simulate a log of a servo axis in closed loop.

    Parameters
    ----------
    effects : Effect, str, or iterable of these
        Hidden effects: instances, or names; the shape and phase of a named effect are drawn, and its size is a share of
        the rms drive, see `draw_effect`.
    sizes : float or sequence of float
        The shares of effects given by name.
    axis : ServoAxis, optional
        The axis without these effects; by default a small direct-drive table whose controller has feed-forward.
    reference : str or array-like of shape (n,)
        Kind of reference, see `reference_signal`, or the reference itself (rad).
    amplitude, duration : float
        Of a reference given by kind (rad, s).
    sample_rate : float, optional
        Rate of controller and log (Hz); the axis's own, 1,000 by default.
    noise : float, optional
        Standard deviation of white noise on the encoder (rad); 2e-5 on the default axis.
    resolution : float, optional
        Step of the encoder (rad).
    snr_db : float, optional
        Alternatively, the noise by its ratio to the position: 10 log10(var(position) / var(noise)).
    disturbance : array-like of shape (n,), optional
        A torque that no effect explains (Nm).
    random_state : int, Generator or None
        Of phases, shapes and noise.
    return_truth : bool
        Whether to return the truth as well.

    Returns
    -------
    log : DataFrame
        Columns ``time_s``, ``reference_rad``, ``torque_nm`` (as commanded), ``position_rad``.
    truth : Bunch
        Only with ``return_truth``: ``axis`` (with the effects), ``effects``, ``parameters``
        (by name), ``record`` (all signals).

    Examples
    --------
    >>> from whsklearn.datasets import make_servo_log
    >>> from whsklearn.effects import Cogging
    >>> log = make_servo_log([Cogging(0.1, order=17)], duration=2.0)
    >>> log.shape
    (2000, 4)
    """
    rng = np.random.default_rng(random_state)
    axis = default_axis() if axis is None else axis
    if sample_rate is not None:
        axis = dataclasses.replace(axis, sample_rate=float(sample_rate))
    if isinstance(reference, str):
        reference = reference_signal(reference, duration, axis.sample_rate, amplitude, rng)
    path = np.asarray(reference, dtype=float)
    hidden = _hidden(effects, sizes, axis, path, rng)
    for effect in hidden:
        axis = axis.with_effect(effect)
    sensor = {k: float(v) for k, v in (("noise", noise), ("resolution", resolution)) if v is not None}
    if snr_db is not None:
        quiet = axis.simulate(path, noise=False, disturbance=disturbance)
        sensor["noise"] = float(np.std(quiet.true_position) * 10.0 ** (-snr_db / 20.0))
    axis = dataclasses.replace(axis, sensor=dataclasses.replace(axis.sensor, **sensor))  # type: ignore[arg-type]
    record = axis.simulate(path, random_state=rng, disturbance=disturbance)
    log = record_frame(record)
    if not return_truth:
        return log
    return log, Bunch(axis=axis, effects=hidden, parameters=axis.parameters, record=record)


def default_axis() -> ServoAxis:
    """A small direct-drive table: 0.05 kg m2, 0.12 Nm s/rad, 0.3 Nm, PID with feed-forward at 1 kHz.

    Returns
    -------
    ServoAxis

    Examples
    --------
    >>> from whsklearn.datasets import default_axis
    >>> axis = default_axis()
    >>> axis.inertia, axis.sample_rate
    (0.05, 1000.0)
    """
    controller = PIDController(60.0, 60.0, 2.0, velocity_feedforward=0.12, acceleration_feedforward=0.05)
    return ServoAxis(controller=controller, sensor=Sensor(noise=2e-5))


def _hidden(
    effects: Effect | str | Iterable[Effect | str],
    sizes: float | Sequence[float],
    axis: ServoAxis,
    path: NDArray[np.float64],
    rng: np.random.Generator,
) -> tuple[Effect, ...]:
    """The effects, with those given by name drawn."""
    wanted = [effects] if isinstance(effects, (str, Effect)) else list(effects)
    shares = np.broadcast_to(np.asarray(sizes, dtype=float), (len(wanted),))
    return tuple(
        draw_effect(e, axis, path, float(s), rng) if isinstance(e, str) else e
        for e, s in zip(wanted, shares, strict=True)
    )
