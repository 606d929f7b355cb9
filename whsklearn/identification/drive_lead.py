"""Timing of the logged drive relative to the position."""

from __future__ import annotations

import dataclasses
import functools
import itertools
from collections.abc import Callable, Sequence

import numpy as np

from whsklearn.effects.base import Array, rms
from whsklearn.filtering.records import HOLDS
from whsklearn.identification.axis_inverse import FEWEST, KNOWN, balance, inverse_starts, solved
from whsklearn.identification.axis_numbers import coarse, shooting_log
from whsklearn.identification.end_stops import contacts
from whsklearn.identification.view import View
from whsklearn.identification.windows import axis_score
from whsklearn.recursion.batch.axis_free_run import HANGS, AxisForm, fit_pieces

# s: the oldest drive of a real log (pendulum rigs and arms reach -0.016 to 0.038 s)
OLDEST = 0.06
# Iterations for a drive that was logged late: the first finds half of 16 ms, the third all.
MOST_MOVES = 6
# Largest age of the drive, in samples, due to sampling alone: a drive held over a sample is half a sample old, and a
# logger may add one sample.
LATEST = 1.5
# Of the squared residual with the drive as logged: a shift must remove at least this share.
EXPLAINED = 0.5
OVER_TURNS = 11  # powers of a position without an angle that follow a weight over two turns, in units nobody stated
# Standard deviation (s) of the Gaussian in `skew`, and its minimum in samples: narrow enough for the motion of a servo,
# wide enough for its encoder.
WIDTH, FEWEST_WIDE = 0.02, 4.0
# Samples, pieces (s), first step (s) and iterations of the search by multiple shooting
ENOUGH, PIECES, STEP, SHORT_FIT = 6_000, 0.5, 0.004, 6


def drive_lead(
    look: Callable[[int], tuple[float, float]], as_logged: float, dt: float, *, either_way: bool = False
) -> int:
    """Samples by which a drive was logged after it had acted; zero unless this removes half of the residual as logged.

    Inverse dynamics underestimates the age of the drive at first, so the estimate is repeated until it does not change.

    ``look``: (age of the drive in s, rms residual) of the record with its drive shifted earlier by a number of samples.
    ``as_logged``: rms residual of the record as logged, without an age.
    ``dt``: sampling time (s).
    ``either_way``: whether to report a drive that acts later than it was logged, as a negative number; otherwise that
        is a delay.

    >>> drive_lead(lambda lead: (0.6 * (lead - 8) * 0.001, abs(lead - 8.0)), 8.0, 0.001)
    8
    """
    lead, (age, left) = 0, look(0)
    for _ in range(MOST_MOVES):
        more = round(-age / dt)
        size = abs(more) if either_way else more
        if size <= (0.0 if lead else LATEST) or abs(lead + more) * dt > OLDEST:
            break
        lead += more
        age, left = look(lead)
    return lead if left**2 < EXPLAINED * as_logged**2 else 0


def skew(log: View) -> int:
    """Samples by which the drive of an axis log must be shifted earlier (negative: later) to fit its motion.

    Determined by inverse dynamics with friction, an offset and a position-dependent force, and for a position by
    multiple shooting from there: the signs of a smoothed velocity bias the first by up to a sample.
    """
    width = smoothing_width(log.dt)
    if 2 * OLDEST < log.dt or log.logged == "output":
        return 0
    stops = contacts(log, hangs=log.angle) if log.logged == "position" else None

    def free(lead: int) -> View:
        """The motion between the stops: what these push is no answer to the drive, whatever its age."""
        shifted = moved(log, lead)
        return (stops and stops.between(shifted)) or shifted

    form = force_form([free(0)])
    columns, drive = balance(free(0), width, form)
    if drive.size < 10 * FEWEST:
        return 0

    def look(lead: int) -> tuple[float, float]:
        return age(free(lead), form)

    lead = drive_lead(look, rms(drive - columns @ solved(columns, drive)), log.dt, either_way=True)
    if lead and not look(lead)[1] < KNOWN * rms(drive):
        return 0
    if log.logged == "position" and look(0)[1] < KNOWN * rms(drive):
        lead = _by_shooting(free, lead, form)
    return lead


def force_form(logs: Sequence[View]) -> AxisForm:
    """The force over position that explains the drives better: of a weight if it is an angle, or a polynomial.

    A sine of plain counts is noise on the grid of the encoder, beside which the drive looks early.
    """
    if logs[0].logged != "position":
        return AxisForm()
    cubic = AxisForm(powers=3, centre=float(np.mean(np.concatenate([log.y for log in logs]))))

    def left(form: AxisForm) -> float:
        parts = [balance(log, smoothing_width(log.dt), form) for log in logs]
        columns, drive = (np.concatenate(x) for x in zip(*parts, strict=True))
        return float(np.sum((drive - columns @ solved(columns, drive)) ** 2))

    if logs[0].angle:
        return min((AxisForm(orders=HANGS), cubic), key=left)
    turns = cubic._replace(powers=OVER_TURNS)
    return turns if left(turns) < EXPLAINED * left(cubic) else cubic


def age(log: View, form: AxisForm) -> tuple[float, float]:
    """(age of the drive in s, rms residual without it in the drive's unit) by inverse dynamics, to first order."""
    columns, drive = balance(log, smoothing_width(log.dt), form)
    theta = solved(columns, drive)
    both = np.column_stack([columns, np.gradient(columns @ theta, log.dt)])
    found = np.linalg.lstsq(both / (norm := np.linalg.norm(both, axis=0) + 1e-300), drive, rcond=1e-10)[0] / norm
    return float(found[-1]), rms(drive - columns @ theta)


def same_age(logs: Sequence[View]) -> list[int]:
    """Samples by which each log's drive must be shifted earlier so that all are as old as the least shifted one.

    What all logs lack biases their ages alike, so the differences are known where `skew` finds no age.
    """
    form, leads = force_form(logs), np.zeros(len(logs), dtype=int)
    for _ in range(MOST_MOVES):
        ages = np.array([age(moved(log, int(lead)), form)[0] for log, lead in zip(logs, leads, strict=True)])
        more = np.round((ages[np.argmin(np.abs(ages))] - ages) / logs[0].dt).astype(int)
        if not more.any() or np.abs(leads + more).max() * logs[0].dt > OLDEST:
            break
        leads += more
    return leads.tolist()


def _by_shooting(free: Callable[[int], View], lead: int, form: AxisForm) -> int:
    """The shift near ``lead`` with the smallest error of short runs, with a drive held or smooth between its samples.

    ``free``: the motion with its drive shifted.  No shift is preferred to one that does not remove `EXPLAINED` of the
    squared error.
    """
    dt = free(0).dt

    @functools.cache
    def left(shift: int) -> float:
        shifted = coarse(free(shift))
        shifted = shifted.part(0, min(shifted.u.size, ENOUGH))
        try:
            starts = inverse_starts(shifted, form)
        except ValueError:
            return np.inf
        theta = min((s.theta for s in starts), key=lambda theta: axis_score(theta, form, shifted))
        held, smooth = (shooting_log(dataclasses.replace(shifted, hold=h), PIECES, form) for h in HOLDS)
        return min(fit_pieces(theta, pieces, iterations=SHORT_FIT).cost for pieces in (held, smooth))

    step = max(round(STEP / dt), 1)
    while step:
        near = min((k for k in (lead - step, lead + step) if abs(k) * dt <= OLDEST), key=left, default=lead)
        if left(near) < left(lead):
            lead = near
        else:
            step //= 2
    return lead if left(lead) < EXPLAINED * left(0) else 0


def smoothing_width(dt: float) -> float:
    """Standard deviation of the Gaussian in samples."""
    return max(WIDTH / dt, FEWEST_WIDE)


def moved(log: View, lead: int) -> View:
    """The record with its drive shifted earlier by a number of samples; the end of every segment is held."""
    if not lead:
        return log
    parts = [earlier(log.u[a:b], lead) for a, b in itertools.pairwise(log.bounds)]
    return dataclasses.replace(log, u=np.concatenate(parts))


def earlier(u: Array, samples: int) -> Array:
    """A signal shifted earlier by a number of samples (negative: later); its last or first value is held.

    >>> import numpy as np
    >>> earlier(np.arange(5.0), 2).tolist(), earlier(np.arange(5.0), -1).tolist()
    ([2.0, 3.0, 4.0, 4.0, 4.0], [0.0, 0.0, 1.0, 2.0, 3.0])
    """
    if samples < 0:
        return earlier(u[::-1], -samples)[::-1]
    return np.concatenate([u[samples:], np.full(min(samples, u.size), u[-1])])
