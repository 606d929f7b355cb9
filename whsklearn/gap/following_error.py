"""A position servo of which only command and position are logged: its following error takes the place of the drive."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from whsklearn.gap import evidence as rules
from whsklearn.gap.filters import CUTOFF_SIGMA, filtered, gaussian_derivatives

Array = NDArray[Any]
LONGEST_DELAY = 0.4  # s between a command's stamp and its effect: a bus of hobby servos needs 0.06 to 0.2
CUTOFF = 4.0  # Hz: commands of a position servo are slow


def following_error(command: Array, position: Array, dt: float) -> tuple[Array, float]:
    """(command minus position, rad; the delay, s, by which the command acts late), the record's first samples repeated.

    Inside the servo, torque = gain (command - position), so the error is the drive in units of the loop's gain.  A
    command that is stamped when it is sent acts later; the delay taken is the one at which inertia, viscous and dry
    friction, a constant and gravity explain the error best.

    Parameters
    ----------
    command, position : ndarray of shape (n,)
    dt : float

    Examples
    --------
    >>> t = np.arange(3000) * 0.02
    >>> wave = lambda t: 0.4 * np.sin(1.3 * t) + 0.2 * np.sin(4.1 * t + 1.0) + 0.05 * np.sin(9.0 * t)
    >>> sags = wave(t - 0.1) - 0.02 * np.cos(wave(t - 0.1))
    >>> round(following_error(wave(t), sags, 0.02)[1], 2)
    0.1
    """
    kernels = gaussian_derivatives(CUTOFF_SIGMA / (2 * np.pi * min(CUTOFF, 0.08 / dt)), dt)
    q, v, a = (filtered(position - position.mean(), k, 1) for k in kernels)
    q = q + position.mean()
    slow = 0.05 * float(np.std(v)) + 1e-12
    columns = np.column_stack([a, v, np.tanh(v / slow), np.ones_like(q), np.cos(q), np.sin(q)])
    edge = min(kernels[0].size + round(LONGEST_DELAY / dt), q.size // 4)
    inside = slice(edge, q.size - edge)
    basis, _ = np.linalg.qr(columns[inside])

    def left(samples: int) -> float:
        error = (filtered(late(command, samples), kernels[0], 1) - q)[inside]
        return float(np.linalg.norm(error - basis @ (basis.T @ error)))

    losses = [left(k) for k in range(round(LONGEST_DELAY / dt) + 1)]
    best = int(np.argmin(losses))
    if losses[best] > rules.WORTH_A_DELAY * losses[0]:
        best = 0
    return late(command, best) - position, best * dt


def late(x: Array, samples: int) -> Array:
    """A signal some samples later, its first value before."""
    return np.concatenate([np.full(samples, x[0]), x[: x.size - samples]])
