"""Nameless functions of position, speed, drive and time, for a gap that no named effect describes."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]
HATS = (0.08, 0.03, 0.01)  # of the travel: a stop or a bump at one angle is narrower than any wave up to order 12


def generic_basis(scene: Any, angle: Array, v: Array, u: Array) -> list[Array]:
    """Blocks of nameless columns, shape (n, k) each: functions of position, speed, drive and time, and products."""
    q = angle
    t = np.arange(q.size) / q.size
    q = (q - scene.centre) / scene.reach
    v, u = v / (2 * scene.speed), u / (2 * scene.torque)
    s = np.sign(v)
    powers = [q, v, u, q * v, q * q, v * v, q**3, v**3, q * q * v, q * v * v, s, s * q, s * v, s * q * q, q * u]
    waves = [f(k * angle_k) for k in range(1, 13) for angle_k in [angle] for f in (np.sin, np.cos)]
    return [
        np.column_stack(powers),
        np.column_stack([np.exp(-0.5 * ((v - c) / 0.12) ** 2) for c in np.linspace(-1, 1, 16)]),
        np.column_stack(waves),
        np.column_stack([w * x for w in waves[:8] for x in (np.ones_like(v), v, s, u)]),
        np.column_stack([p * t for p in powers]),
        np.column_stack([np.roll(x, k) for x in (u, v, s) for k in (0, 1, 2, 4, 8)]),
        *(hats(q, 2.0 * width) for width in HATS),
    ]


def hats(q: Array, width: float) -> Array:
    """Piecewise linear functions, each around one position within -1 to 1, shape (n, k); they sum to one.

    Examples
    --------
    >>> hats(np.array([-1.0, -0.25, 1.0]), 0.5)
    array([[1. , 0. , 0. , 0. , 0. ],
           [0. , 0.5, 0.5, 0. , 0. ],
           [0. , 0. , 0. , 0. , 1. ]])
    """
    centres = np.linspace(-1.0, 1.0, round(2.0 / width) + 1)
    return np.maximum(0.0, 1.0 - np.abs(q[:, None] - centres) / (centres[1] - centres[0]))
