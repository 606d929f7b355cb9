"""A servo axis as the flat arrays that the compiled simulator takes."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numba import njit
from numba.core.errors import NumbaError

from whsklearn.effects import Effect, codes
from whsklearn.systems._servo_torques import USER_SIGNATURE, no_user_effect

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from whsklearn.systems.servo import ServoAxis

N_NUMBERS = 8
_USER_INDEX = 7


class Packed(NamedTuple):
    """What `whsklearn.systems._servo_kernel.run` needs to know of an axis."""

    axis: NDArray[np.float64]
    drive: NDArray[np.float64]
    controller: NDArray[np.float64]
    effects: NDArray[np.int64]
    p: NDArray[np.float64]
    sensors: NDArray[np.int64]
    sp: NDArray[np.float64]
    user: Any


def pack(axis: ServoAxis) -> Packed:
    """Flat arrays of an axis; effects of neutral size are left out, so they change nothing at all."""
    present = [e for e in axis.effects if e.magnitude != e.neutral]
    mechanical: list[tuple[int, tuple[float, ...]]] = [(t.code, (t.magnitude, *t.term_shape)) for t in axis.law.terms]
    sensors: list[tuple[int, tuple[float, ...]]] = []
    functions: list[Any] = []
    for e in present:
        if e.code >= 0 and e.place not in ("sensor", "transmission") and e.code not in _DRIVE_CODES:
            mechanical.append((e.code, e.numbers))
        elif e.code >= 0 and e.place == "sensor":
            sensors.append((e.code, e.numbers))
        elif e.code < 0:
            rows, code = (sensors, codes.USER_OUTPUT) if e.port == "output" else (mechanical, codes.USER_TORQUE)
            rows.append((code, _user_row(e, len(functions))))
            functions.append(_compiled(type(e)))  # type: ignore[arg-type]
    return Packed(
        _axis_numbers(axis, present),
        _drive_numbers(axis, present),
        _controller_numbers(axis),
        *_table(mechanical),
        *_table(sensors),
        _chained(tuple(functions)),
    )


_DRIVE_CODES = (codes.DEAD_ZONE, codes.SATURATION, codes.INPUT_DELAY, codes.ACTUATOR_LAG)


def _table(rows: list[tuple[int, tuple[float, ...]]]) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Codes and numbers of effects as two arrays."""
    p = np.zeros((len(rows), N_NUMBERS))
    for row, (_, numbers) in zip(p, rows, strict=True):
        row[: len(numbers)] = numbers
    return np.array([code for code, _ in rows], dtype=np.int64), p


def _total(present: list[Effect], code: int) -> float:
    """Sum of the sizes of the effects of one code."""
    return sum(e.magnitude for e in present if e.code == code)


def _drive_numbers(axis: ServoAxis, present: list[Effect]) -> NDArray[np.float64]:
    """Gain, limit, delay, two lags, dead zone, resolution."""
    d = axis.drive
    limits = [e.magnitude for e in present if e.code == codes.SATURATION]
    delay = d.delay + _total(present, codes.INPUT_DELAY)
    if delay < 0:
        raise ValueError(f"The drive's delay is {delay} s, expected none below zero; the drive cannot act early.")
    extra = _total(present, codes.ACTUATOR_LAG)
    width = _total(present, codes.DEAD_ZONE)
    return np.array([d.gain, min([d.limit, *limits]), delay, d.lag, extra, width, axis.sensor.resolution])


def _controller_numbers(axis: ServoAxis) -> NDArray[np.float64]:
    """Gains, limit, derivative's source and filter."""
    c = axis.controller
    return np.array(
        [
            c.kp,
            c.ki,
            c.kd,
            c.velocity_feedforward,
            c.acceleration_feedforward,
            c.limit,
            float(c.derivative_on == "measurement"),
            c.derivative_filter,
        ]
    )


def _axis_numbers(axis: ServoAxis, present: list[Effect]) -> NDArray[np.float64]:
    """Inertia, load share (0: rigid), stiffness, damping, gap, kappa."""
    kappa = 1.0 / axis.smoothing if axis.friction == "tanh" else math.inf
    split = [e for e in present if e.place == "transmission"]
    part = axis.transmission
    if part is None and not split:
        return np.array([axis.inertia, 0.0, 0.0, 0.0, 0.0, kappa])
    share = part.load_share if part is not None else split[0].shape["load_share"]
    reduced = axis.inertia * share * (1.0 - share)
    compliance = (1.0 / part.stiffness if part is not None else 0.0) + _total(split, codes.FLEXIBLE_COUPLING)
    gap = (part.gap if part is not None else 0.0) + _total(split, codes.BACKLASH)
    ratios = [part.damping_ratio] if part is not None else []
    ratios += [e.shape["damping_ratio"] for e in split if e.code == codes.FLEXIBLE_COUPLING]
    if compliance <= 0.0:
        contact = split[0].shape
        compliance = 1.0 / (reduced * (2.0 * math.pi * contact["frequency"]) ** 2)
        ratios = [contact["damping_ratio"]]
    damping = 2.0 * ratios[-1] * math.sqrt(reduced / compliance)
    return np.array([axis.inertia, share, 1.0 / compliance, damping, gap, kappa])


def _user_row(effect: Effect, index: int) -> tuple[float, ...]:
    """Numbers of an effect of one's own and, last, which function is its own."""
    if len(effect.numbers) > _USER_INDEX:
        raise ValueError(f"{type(effect).__name__} has {len(effect.numbers)} numbers, expected {_USER_INDEX} at most.")
    return (*effect.numbers, *[0.0] * (_USER_INDEX - len(effect.numbers)), float(index))


@lru_cache(maxsize=128)
def _compiled(cls: type[Effect]) -> Any:
    """The compiled torque of an effect of one's own."""
    if cls.evaluate is None:
        raise ValueError(
            f"{cls.__name__} cannot be simulated; give it a static method evaluate(p, time, position, velocity, drive)."
        )
    plain = njit(cls.evaluate)

    def numbered(index, p, time, position, velocity, drive):
        return plain(p, time, position, velocity, drive)

    try:
        return njit(USER_SIGNATURE)(numbered)
    except NumbaError as error:
        raise ValueError(
            f"{cls.__name__}.evaluate cannot be compiled; write it with numbers and the math module only. ({error})"
        ) from error


@lru_cache(maxsize=128)
def _chained(functions: tuple[Any, ...]) -> Any:
    """One compiled function that calls the index-th of several."""
    if not functions:
        return no_user_effect
    if len(functions) == 1:
        return functions[0]
    first, rest = functions[0], _chained(functions[1:])

    def either(index, p, time, position, velocity, drive):
        if index == 0:
            return first(index, p, time, position, velocity, drive)
        return rest(index - 1, p, time, position, velocity, drive)

    return njit(USER_SIGNATURE)(either)
