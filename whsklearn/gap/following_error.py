"""A position servo of which only command and position are logged: its loop turns their difference into the drive."""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import numpy as np

from whsklearn.filtering.records import CUTOFF_SIGMA, HIGHEST_CUTOFF, filtered, gaussian_derivatives
from whsklearn.gap import least_squares as ols
from whsklearn.gap.record import Array, ServoRecord
from whsklearn.identification.drive_lead import earlier

# Share of the residual below which a delay, a derivative or an integral is accepted: a delay trades off against viscous
# friction (`benchmarks.real_axes --only so101`).
WORTH_IT = 0.9
LONGEST_DELAY = 0.4  # s between a command's stamp and its effect: a bus of hobby servos needs 0.06 to 0.2
CUTOFF = 4.0  # Hz: commands of a position servo are slow
PER_PERIOD = 16  # rows of the regression in a period of that frequency
# Inertia and friction drive no axis, and derivative and integral have the sign of the gain.  Without these signs the
# command of two chirps of SO-101 is taken 0.16 s late, beside a negative friction; with them 0.04 and 0.08 s.
POSITIVE = np.array([True, True, True, False, False, False, True, True])


class Loop(NamedTuple):
    """What is known of a position loop, beside its gain: delay of the command (s), T_D (s) and 1 / T_I (1/s).

    >>> Loop(delay=0.1, derivative=0.0, integral=0.5)
    Loop(delay=0.1, derivative=0.0, integral=0.5)
    """

    delay: float
    derivative: float
    integral: float


def following_error(record: ServoRecord) -> tuple[Array, Loop]:
    """(drive in units of the loop's gain, rad; the loop), with the first commands repeated.

    Inside the servo, torque = gain (e + T_D de/dt + 1/T_I int e dt) of the error e = command - position.  A command
    that is time-stamped when it is sent acts later.  Delay, T_D and T_I are those at which inertia, viscous and dry
    friction, a constant and gravity explain the error best; each is left out if it does not explain considerably more.
    Neither the delay nor a filter or an integral reaches across a hole.  The reference of the ``record`` is the
    command; its drive is not used.  Astrom, Hagglund 2006, Advanced PID Control, ISA, equation (3.4).

    >>> t = np.arange(3000) * 0.02
    >>> wave = lambda t: 0.4 * np.sin(1.3 * t) + 0.2 * np.sin(4.1 * t + 1.0) + 0.05 * np.sin(9.0 * t)
    >>> sags = wave(t - 0.1) - 0.02 * np.cos(wave(t - 0.1))
    >>> record = ServoRecord(t, np.zeros_like(t), sags, wave(t), units=("rad", "rad"))
    >>> round(following_error(record)[1].delay, 2)
    0.1
    """
    command, position, dt = record.reference, record.position, record.dt
    assert command is not None
    kernels = gaussian_derivatives(CUTOFF_SIGMA / (2 * np.pi * min(CUTOFF, HIGHEST_CUTOFF / dt)), dt)
    middle, longest = position.mean(), round(LONGEST_DELAY / dt)
    (c, rate), (q, v, a) = (
        [record.by_piece(partial(filtered, taps=k, every=1), x - middle) for k in taps]
        for x, taps in ((command, kernels[:2]), (position, kernels))
    )
    dry = np.tanh(v / (0.05 * float(np.std(v)) + 1e-12))
    axis = np.column_stack([a, v, dry, np.ones_like(q), np.cos(q + middle), np.sin(q + middle)])
    inside = record.by_piece(partial(_inner, edge=kernels[0].size + longest), np.ones(q.size, dtype=bool))
    rows = np.flatnonzero(inside)[:: max(1, int(1.0 / (PER_PERIOD * CUTOFF * dt)))]

    def fitted(samples: int, n: int) -> tuple[float, Array]:
        """(rms residual, the first n of T_D and 1 / T_I) at one delay."""
        error, slope = (record.by_piece(partial(earlier, samples=-samples), x) - y for x, y in ((c, q), (rate, v)))
        loop = [-slope, -record.by_piece(lambda e: np.cumsum(e) * dt, error)][:n]
        columns = np.column_stack([axis, *loop])[rows]
        sizes, _ = ols.solve(columns, error[rows], POSITIVE[: columns.shape[1]])
        return float(np.std(error[rows] - columns @ sizes)), sizes[axis.shape[1] :]

    best, least = (0, 0), fitted(0, 0)[0]
    for n in range(3):
        losses = [fitted(k, n)[0] for k in range(longest + 1)]
        if min(losses) < WORTH_IT * least:
            best, least = (int(np.argmin(losses)), n), min(losses)
    derivative, integral = np.append(fitted(*best)[1], np.zeros(2 - best[1]))
    error = record.by_piece(partial(earlier, samples=-best[0]), command) - position

    def controlled(e: Array) -> Array:
        slope = np.gradient(e, dt) if e.size > 1 else np.zeros_like(e)
        return e + derivative * slope + integral * dt * np.cumsum(e)

    drive = record.by_piece(controlled, error)
    return drive, Loop(best[0] * dt, float(derivative), float(integral))


def _inner(all_of_it: Array, edge: int) -> Array:
    """The samples of a segment that are not affected by its ends through a filter or a delay."""
    edge = min(edge, all_of_it.size // 4)
    n = np.arange(all_of_it.size)
    return (n >= edge) & (n < all_of_it.size - edge)
