"""The first guess: inverse dynamics by least squares on smoothed derivatives.

torque = J a + sum of terms is linear in the weights, so the library's recursive least squares on
motion features is the estimator; what noise in the features does to it, the search that follows undoes.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from whsklearn.gap import axis_kernel as k
from whsklearn.gap.candidates import Candidate

Array = NDArray[Any]


def motion(position: Array, drive: Array, dt: float, cutoff: float) -> tuple[Array, Array, Array, Array]:
    """Position, velocity, acceleration and drive behind one Gaussian, shape (n,) each."""
    from scipy.ndimage import gaussian_filter1d

    sigma = 0.833 / (2 * np.pi * cutoff * dt)
    out = [gaussian_filter1d(position, sigma, order=i, mode="nearest") / dt**i for i in range(3)]
    return out[0], out[1], out[2], gaussian_filter1d(drive, sigma, mode="nearest")


def column(kind: Candidate, angle: Array, speed: Array, drive: Array, time: Array, shape: tuple[float, ...]) -> Array:
    """Torque columns of an effect that is linear in its size, on given signals; shape (n, 1 or 2)."""
    s = np.sign(speed)
    c = kind.code
    if c == k.VISCOUS:
        x = speed
    elif c == k.COULOMB:
        x = s
    elif c == k.ASYMMETRIC_COULOMB:
        x = np.abs(s)
    elif c == k.ASYMMETRIC_VISCOUS:
        x = np.abs(speed)
    elif c == k.STRIBECK:
        x = s * np.exp(-((np.abs(speed) / shape[0]) ** shape[1]))
    elif c == k.QUADRATIC_DRAG:
        x = speed * np.abs(speed)
    elif c == k.LOAD_FRICTION:
        x = s * np.abs(drive)
    elif c == k.INPUT_OFFSET:
        x = np.ones_like(speed)
    elif c == k.SPRING:
        x = angle - shape[0]
    elif c == k.HARDENING:
        x = (angle - shape[0]) ** 3
    elif c == k.END_STOP:
        x = np.sign(angle) * np.maximum(np.abs(angle) - shape[0], 0)
    elif c == k.FRICTION_DRIFT:
        x = s * (1 - np.exp(-time / shape[0]))
    elif c == k.PRESLIDING:
        x = s
    elif kind.paired:
        q = 2 * np.pi * shape[0] * time if c == k.TONE else (shape[0] if shape else 1.0) * angle
        pair = np.column_stack([np.cos(q), np.sin(q)])
        factor = {k.TORQUE_RIPPLE: drive, k.POSITION_FRICTION: s}.get(c)
        return pair if factor is None else pair * factor[:, None]
    else:
        raise ValueError(f"{kind.name} has no torque column")
    return x[:, None]
