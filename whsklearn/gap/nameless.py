"""Functions of the motion that have no name: whether anything at all is missing, whatever its law.

A remainder that they explain better than they explain the model's own records follows the motion, and a name must
explain a share of what they do. One basis serves every plant with a position; a chain has its own, because its
signals are not those of an axis (`whsklearn.gap.plants.chain_looks`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from whsklearn.effects import Scales
from whsklearn.gap.record import Array
from whsklearn.gap.tangent import Family

ORDERS = range(1, 13)  # of waves over a turn, and of an inertia that varies with the angle
HATS = (0.08, 0.03, 0.01)  # of the travel: a stop or a bump at one angle is narrower than any wave up to order 12


def generic_basis(scene: Scales, angle: Array, v: Array, u: Array) -> list[tuple[str, Array]]:
    """Blocks of nameless columns, shape (n, k) each: functions of position, speed, drive and time, and products.

    With each block the signal of which it is any function, ``position`` or ``velocity``; empty if of several.
    """
    t = np.arange(angle.size) / angle.size
    q = (angle - scene.centre) / scene.reach
    v, u = v / (2 * scene.speed), u / (2 * scene.torque)
    s = np.sign(v)
    powers = [q, v, u, q * v, q * q, v * v, q**3, v**3, q * q * v, q * v * v, s, s * q, s * v, s * q * q, q * u]
    waves = [f(k * angle) for k in ORDERS for f in (np.sin, np.cos)]
    return [
        ("", np.column_stack(powers)),
        ("velocity", np.column_stack([np.exp(-0.5 * ((v - c) / 0.12) ** 2) for c in np.linspace(-1, 1, 16)])),
        ("position", np.column_stack(waves)),
        ("", np.column_stack([w * x for w in waves[:8] for x in (np.ones_like(v), v, s, u)])),
        ("", np.column_stack([p * t for p in powers])),
        ("", np.column_stack([np.roll(x, k) for x in (u, v, s) for k in (0, 1, 2, 4, 8)])),
        *(("position", hats(q, 2.0 * width)) for width in HATS),
    ]


def hats(q: Array, width: float) -> Array:
    """Piecewise linear functions, each around one position within -1 to 1, shape (n, k); they sum to one.

    >>> hats(np.array([-1.0, -0.25, 1.0]), 0.5)
    array([[1. , 0. , 0. , 0. , 0. ],
           [0. , 0.5, 0.5, 0. , 0. ],
           [0. , 0. , 0. , 0. , 1. ]])
    """
    centres = np.linspace(-1.0, 1.0, round(2.0 / width) + 1)
    return np.maximum(0.0, 1.0 - np.abs(q[:, None] - centres) / (centres[1] - centres[0]))


def without_name(columns: Array, **fields: Any) -> Family:
    """The family of all functions that columns of shape (n, k) span, at once."""
    return Family("", lambda _: iter([([()], columns[:, None, :], 1.0)]), lambda *_: None, columns.shape[1], **fields)


def nameless(scene: Scales, position: Array, speed: Array, drive: Array, **fields: Any) -> Iterator[Family]:
    """A family for each block of the basis.

    ``position``, ``speed``, ``drive`` (n,): at the samples of the tangent. ``**fields``: of every `Family`, such as its
    place.
    """
    for signal, block in generic_basis(scene, position, speed, drive):
        yield without_name(block / (block.std(axis=0) + 1e-12), signal=signal, **fields)
    for width in HATS:
        yield bump(hats((position - scene.centre) / scene.reach, 2.0 * width), **fields)


def bump(columns: Array, **fields: Any) -> Family:
    """One bump of the position, whose place is scanned over columns of shape (n, s): as many numbers as a wave has."""
    seen = columns[:, columns.any(axis=0)]
    blocks = [(list(range(seen.shape[1])), seen[:, :, None], 1.0)] if seen.size else []
    return Family("", lambda _: iter(blocks), lambda *_: None, 3, signal="position", **fields)


def varying_inertia(motion: Any, behind: Callable[[Array], Array], **fields: Any) -> Family:
    """An inertia that varies with the angle, as behind a crank, at one whole order: J a + J' v^2 / 2 (Nm).

    It has no name, but an eccentric encoder, a torque ripple and a wave of friction of one order add up to it, and had
    been named in its place with certainty: to first order they are its coordinate, its gain and its friction.

    ``motion``: position, velocity and acceleration at full rate. ``behind``: what a filter leaves at the samples of the
    tangent.
    """

    def block(order: int) -> tuple[list[int], Array, float]:
        c, s = np.cos(order * motion.position), np.sin(order * motion.position)
        square = 0.5 * order * motion.velocity**2
        columns = [behind(c * motion.acceleration - s * square), behind(s * motion.acceleration + c * square)]
        return [order], np.column_stack(columns)[:, None, :], 1.0

    return Family("", lambda _: map(block, ORDERS), lambda *_: None, 3, **fields)
