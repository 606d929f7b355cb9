"""From the drive, logged or commanded by a controller, to the torque on the motor in a fine step."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from whsklearn._numba import njit, part
from whsklearn.effects import codes
from whsklearn.effects.equations import dead_zone, lagged, saturation
from whsklearn.systems._servo_torques import DELAY, LAG, LIMIT


class DriveStage(NamedTuple):
    """The path from the drive to the motor: delay (s), two lags (s), width of the dead zone, limit."""

    delay: Any
    lag: Any
    second_lag: Any
    width: Any
    limit: Any


@part
def chain_of(plant):
    """The drive with its effects: delays, lags and dead zones add up, and the lowest limit applies."""
    delay, limit = plant.parts[DELAY], plant.parts[LIMIT]
    second, width = 0.0, 0.0
    for i in range(plant.codes.size):
        code = plant.codes[i]
        if code == codes.INPUT_DELAY:
            delay += plant.p[i, 0]
        elif code == codes.ACTUATOR_LAG:
            second += plant.p[i, 0]
        elif code == codes.DEAD_ZONE:
            width += plant.p[i, 0]
        elif code == codes.SATURATION:
            limit = min(limit, plant.p[i, 0])
    return DriveStage(delay, plant.parts[LAG], second, width, limit)


@part
def hold_weights(delay, substeps, linear):
    """For each fine step of a sample: the sample that acts, counted from the current one, and its weight against the
    next.

    Together they give the mean of the drive ``delay`` samples ago over the fine step, held or interpolated.
    """
    first = np.zeros(substeps, dtype=np.int64)
    weight = np.ones(substeps)
    width = 1.0 / substeps
    for j in range(substeps):
        start = j * width - delay
        if linear:
            s = start + 0.5 * width
            first[j] = math.floor(s)
            weight[j] = 1.0 - (s - first[j])
        else:
            first[j] = math.floor(start + 1e-9)
            if math.floor(start + width - 1e-9) > first[j]:
                weight[j] = (first[j] + 1.0 - start) / width
    return first, weight


@njit(cache=False, forceinline=True, error_model="numpy")
def held(u, i, weight, before):
    """The drive between samples i and i + 1; ``before`` is its value before the record, and the last value holds after
    it.
    """
    last = u.size - 1
    a = before if i < 0 else u[min(i, last)]
    if weight == 1.0:
        return a
    b = before if i + 1 < 0 else u[min(i + 1, last)]
    return weight * a + (1.0 - weight) * b


@njit(cache=False, forceinline=True, error_model="numpy")
def effective(chain, u, first, second, h):
    """Mean torque over a fine step behind dead zone, limit and lags, and the new states of the lags."""
    if chain.width > 0.0:
        u -= dead_zone(chain.width, u)
    if chain.limit < math.inf:
        u -= saturation(chain.limit, u)
    if chain.lag > 0.0:
        u, first = lagged(u, first, chain.lag, h)
    if chain.second_lag > 0.0:
        u, second = lagged(u, second, chain.second_lag, h)
    return u, first, second
