"""A position servo of which only command and position are logged: its following error takes the place of the drive."""

from __future__ import annotations

from functools import partial

import numpy as np

from whsklearn.filtering.gaussian import CUTOFF_SIGMA, HIGHEST_CUTOFF, filtered, gaussian_derivatives
from whsklearn.gap.record import Array, ServoRecord

# Share of the residual without a delay, below which a delay of a position servo's command is accepted: a delay trades
# off against viscous friction (`benchmarks.real_axes --only so101`).
WORTH_A_DELAY = 0.9
LONGEST_DELAY = 0.4  # s between a command's stamp and its effect: a bus of hobby servos needs 0.06 to 0.2
CUTOFF = 4.0  # Hz: commands of a position servo are slow


def following_error(record: ServoRecord) -> tuple[Array, float]:
    """(command minus position, rad; the delay, s, by which the command acts late), first samples repeated.

    Inside the servo, torque = gain (command - position), so the error is the drive in units of the loop's gain.  A
    command that is time-stamped when it is sent acts later.  The delay used is the one at which inertia, viscous and
    dry friction, a constant and gravity explain the error best.  Neither the delay nor a filter reaches across a hole.

    ``record``: its reference is the command; its drive is not used.

    Examples
    --------
    >>> t = np.arange(3000) * 0.02
    >>> wave = lambda t: 0.4 * np.sin(1.3 * t) + 0.2 * np.sin(4.1 * t + 1.0) + 0.05 * np.sin(9.0 * t)
    >>> sags = wave(t - 0.1) - 0.02 * np.cos(wave(t - 0.1))
    >>> record = ServoRecord(t, np.zeros_like(t), sags, wave(t), units=("rad", "rad"))
    >>> round(following_error(record)[1], 2)
    0.1
    """
    command, position, dt = record.reference, record.position, record.dt
    assert command is not None
    kernels = gaussian_derivatives(CUTOFF_SIGMA / (2 * np.pi * min(CUTOFF, HIGHEST_CUTOFF / dt)), dt)
    q, v, a = (record.by_piece(partial(filtered, taps=k, every=1), position - position.mean()) for k in kernels)
    q = q + position.mean()
    slow = 0.05 * float(np.std(v)) + 1e-12
    columns = np.column_stack([a, v, np.tanh(v / slow), np.ones_like(q), np.cos(q), np.sin(q)])
    edge = kernels[0].size + round(LONGEST_DELAY / dt)
    inside = record.by_piece(partial(_inner, edge=edge), np.ones(q.size, dtype=bool))
    basis, _ = np.linalg.qr(columns[inside])

    def left(samples: int) -> float:
        error = (record.by_piece(lambda x: filtered(late(x, samples), kernels[0], 1), command) - q)[inside]
        return float(np.linalg.norm(error - basis @ (basis.T @ error)))

    losses = [left(k) for k in range(round(LONGEST_DELAY / dt) + 1)]
    best = int(np.argmin(losses))
    if losses[best] > WORTH_A_DELAY * losses[0]:
        best = 0
    return record.by_piece(partial(late, samples=best), command) - position, best * dt


def late(x: Array, samples: int) -> Array:
    """A signal delayed by some samples, with its first value repeated before it."""
    samples = min(samples, x.size)
    return np.concatenate([np.full(samples, x[0]), x[: x.size - samples]])


def _inner(all_of_it: Array, edge: int) -> Array:
    """The samples of a segment that are not affected by its ends through a filter or a delay."""
    edge = min(edge, all_of_it.size // 4)
    n = np.arange(all_of_it.size)
    return (n >= edge) & (n < all_of_it.size - edge)
