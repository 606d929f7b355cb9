"""A servo axis as the flat arrays that the compiled pass takes."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np

from whsklearn.effects import Effect, codes
from whsklearn.effects.own import WHICH, address_of
from whsklearn.systems._servo_drive import chain_of
from whsklearn.systems._servo_torques import Plant

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from whsklearn.systems.servo import ServoAxis


def pack(axis: ServoAxis) -> Plant:
    """Flat arrays of an axis; effects of neutral size are left out, so they change nothing at all.

    Raises
    ------
    ValueError
        If the drive would act early, or a user-defined effect cannot be simulated.
    """
    present = [e for e in (*axis.law.terms, *axis.effects) if e.magnitude != e.neutral]
    plant = plant_of(present, parts_of(axis))
    delay = chain_of(plant).delay
    if delay < 0:
        raise ValueError(f"The drive's delay is {delay} s, expected none below zero; the drive cannot act early.")
    return plant


def plant_of(effects: Iterable[Effect], parts: NDArray[np.float64]) -> Plant:
    """Effects and parts as a `Plant`; the rows are in the order of the effects."""
    effects = tuple(effects)
    own = list(dict.fromkeys(type(e) for e in effects if e.evaluate is not None))
    p = np.zeros((len(effects), codes.N_NUMBERS))
    for row, e in zip(p, effects, strict=True):
        if e.code < 0:
            address_of((type(e),))  # which says what is missing
        if e.evaluate is not None:
            if len(e.row) > WHICH:
                raise ValueError(f"{type(e).__name__} has {len(e.row)} numbers, expected {WHICH} at most.")
            row[WHICH] = own.index(type(e))
        row[: len(e.row)] = e.row
    return Plant(np.array([e.code for e in effects], dtype=np.int64), p, parts, address_of(tuple(own)))


def parts_of(axis: ServoAxis) -> NDArray[np.float64]:
    """Numbers of an axis that are no effects, in the order of `Plant.parts`."""
    kappa = 1.0 / axis.smoothing if axis.friction == "tanh" else math.inf
    d, part = axis.drive, axis.transmission
    coupling = (0.0, 0.0, 0.0, 0.0)
    if part is not None:
        coupling = (part.load_share, part.stiffness, part.damping_ratio, part.gap)
    resolution, on_load = axis.sensor.resolution, float(axis.sensor.side == "load")
    return np.array([axis.inertia, kappa, d.gain, d.limit, d.delay, d.lag, *coupling, resolution, on_load])


def controller_of(axis: ServoAxis) -> tuple[float, ...]:
    """Gains, limit, derivative's source and filter of the controller."""
    c = axis.controller
    gains = (c.kp, c.ki, c.kd, c.velocity_feedforward, c.acceleration_feedforward, c.limit)
    return tuple(float(g) for g in (*gains, c.derivative_on == "measurement", c.derivative_filter))
