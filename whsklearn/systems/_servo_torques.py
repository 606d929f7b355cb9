"""The torques on a servo axis at one instant: sums of the effects' equations over the rows of an axis.

The equations are those of `whsklearn.effects`; this module contains none of them. An axis is an `AxisNumbers` of flat
arrays, so a fit can change its numbers without creating objects.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from whsklearn._numba import njit, part
from whsklearn.effects import Effect, codes
from whsklearn.effects.equations import AHEAD, advance_hysteresis, hysteresis_torque, parameter_change
from whsklearn.effects.own import WHICH, address_of
from whsklearn.effects.rows import has_memory, load_torque, motor_torque, on_load, reading

# inlined into the pass; otherwise its arrays are reference-counted at every call
_inlined = njit(cache=False, forceinline=True, error_model="numpy")

N_PARTS = 12
(
    INERTIA, KAPPA, GAIN, LIMIT, DELAY, LAG, SHARE, STIFFNESS, RATIO, GAP, RESOLUTION, ON_LOAD,
) = range(N_PARTS)  # fmt: skip


class AxisNumbers(NamedTuple):
    """An axis as kernels take it.

    ``codes`` (n,) and ``p`` (n, 8) are the effects as `Effect.code` and `Effect.row`, the law's terms among them;
    ``parts`` (12,) holds inertia, kappa (inf: true stiction), drive gain, limit, delay and lag in s, the load's share
    of the inertia (0: rigid), stiffness (0: none given), damping ratio and gap of the transmission, the encoder's
    resolution, and 1 if the encoder is on the load.  ``own`` calls the user-defined effects (None: there are none).
    """

    codes: Any
    p: Any
    parts: Any
    own: Any


class Ends(NamedTuple):
    """Where each kind of row ends in an arranged axis: plain torques on the motor's side, user-defined ones, those with
    a memory, torques on the load's side, additions to the reading, changes of the inertia.

    Plain indices rather than arrays of indices: an array inside a tuple is reference-counted at every use in a fine
    step.
    """

    plain: Any
    own: Any
    memory: Any
    load: Any
    sensor: Any
    inertia: Any


@part
def kind_of(code):
    """The field of `Ends` that a code belongs to; 6 if it is neither a torque nor an effect on the reading."""
    if code == codes.CHANGE_INERTIA:
        return 5
    if code == codes.DEAD_ZONE or code == codes.SATURATION:
        return 6
    if code <= codes.CHANGE_GAIN:
        return 0
    if code == codes.USER_TORQUE:
        return 1
    if has_memory(code):
        return 2
    if on_load(code):
        return 3
    if code == codes.USER_OUTPUT or codes.OUTPUT_OFFSET <= code < codes.QUANTIZATION:
        return 4
    return 6


@part
def arranged(effects, p):
    """Copies of codes (n,) and numbers (n, 8) with the rows in the order of `Ends`, and where each kind ends."""
    n = effects.size
    rows = np.empty(n, dtype=np.int64)
    ends = np.zeros(6, dtype=np.int64)
    filled = 0
    for kind in range(6):
        for i in range(n):
            if kind_of(effects[i]) == kind:
                rows[filled] = i
                filled += 1
        ends[kind] = filled
    return effects[rows[:filled]], p[rows[:filled]], Ends(ends[0], ends[1], ends[2], ends[3], ends[4], ends[5])


@_inlined
def motor_sum(effects, p, own, ends, z, t, q, v, s, ds, u):
    """Torque of all effects on the motor's side (Nm), and its slope by velocity; s is sign(v)."""
    total, slope = 0.0, 0.0
    for i in range(ends.plain):
        f, df = motor_torque(effects[i], p, i, t, q, v, s, ds, u)
        total += f
        slope += df
    if own is not None:
        for i in range(ends.plain, ends.own):
            which = int(p[i, WHICH])
            f = own(which, p[i], t, q, v, u)
            step = 1e-6 * (1.0 + abs(v))
            slope += (own(which, p[i], t, q, v + step, u) - f) / step
            total += f
    for i in range(ends.own, ends.memory):
        f, df = hysteresis_torque(effects[i], p, z, i, v)
        total += p[i, 0] * f
        slope += p[i, 0] * df
    return total, slope


@_inlined
def load_sum(effects, p, ends, t, q, v):
    """Torque of all effects on the load's side (Nm)."""
    total = 0.0
    for i in range(ends.memory, ends.load):
        total += load_torque(effects[i], p, i, t, q, v)
    return total


@_inlined
def added_inertia(p, ends, t):
    """The sum of all changes of the inertia up to the time t."""
    total = 0.0
    for i in range(ends.sensor, ends.inertia):
        total += parameter_change(p[i, 0], p[i, 1], t, 1.0)
    return total


@_inlined
def advance_memories(effects, p, ends, z, dx, v):
    """Move every effect with a memory along what the last step left of its path, and along ``dx``.

    Their states refer to the middle of a step, where the torque is evaluated, so one advance per step is enough: from
    middle to middle, at the velocity ``v`` between them.
    """
    dx += z[ends.own, AHEAD]
    for i in range(ends.own, ends.memory):
        advance_hysteresis(effects[i], p, z, i, dx, v)


@_inlined
def read(effects, p, own, ends, t, x):
    """The encoder's reading of the position x, before noise and rounding."""
    y = x
    for i in range(ends.load, ends.sensor):
        if effects[i] == codes.USER_OUTPUT:
            if own is not None:
                y += own(int(p[i, WHICH]), p[i], t, x, 0.0, 0.0)
        else:
            y += reading(effects[i], p, i, t, x)
    return y


def plant_of(effects: Iterable[Effect], parts: NDArray[np.float64]) -> AxisNumbers:
    """Effects and parts as a `AxisNumbers`; the rows are in the order of the effects."""
    effects = tuple(effects)
    own = list(dict.fromkeys(type(e) for e in effects if e.evaluate is not None))
    p = np.zeros((len(effects), codes.N_NUMBERS))
    for row, e in zip(p, effects, strict=True):
        if e.code < 0:
            address_of((type(e),))  # which says what is missing
        if e.evaluate is not None:
            if len(e.row) > WHICH:
                raise ValueError(f"{type(e).__name__} has {len(e.row)} numbers, expected at most {WHICH}.")
            row[WHICH] = own.index(type(e))
        row[: len(e.row)] = e.row
    return AxisNumbers(np.array([e.code for e in effects], dtype=np.int64), p, parts, address_of(tuple(own)))
