"""Contact with the ends of the travel, by inverse dynamics: a few one-sided events, and the motion between them.

A rigid stop supplies whatever torque holds the axis, with one sign (Signorini's condition; Brogliato 1999, Nonsmooth
Mechanics, ch. 1).  In contact the drive says nothing of inertia, friction or its own age.
"""

from __future__ import annotations

import itertools
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.ndimage import binary_dilation

from whsklearn.effects.base import Array, Bools
from whsklearn.effects.position import TOUCHED
from whsklearn.identification.axis_inverse import FEWEST, WIDTHS, acting, balance
from whsklearn.identification.view import LEAST_SEGMENT, View, derivative
from whsklearn.recursion.batch.axis_free_run import HANGS, AxisForm

REWEIGHTINGS = 15
HALF = 0.5
# The events are the large residuals of a robust fit (`python -m benchmarks.blind_mujoco --only
# range_one,range_both,forcerange`).  Of a stop they have 0.99 of the residual's energy, and 0.8 to 1 of the outer half
# of its region is struck, of all others less than 0.15; both must be most of it.
# Robust standard deviations above which a sample is an event: stops reach 20 to 60.
STOP_FAR = 6.0
# Deviations at which a sample has half weight in the robust fit (Cauchy's weights), and above which a sample in the
# outer half of the region counts as struck.
STOP_KNEE = 3.0
# Share of the events' energy allowed outside the regions: the blur carries some to before the contact.
STOP_EDGE = 0.03
LEAST_HELD = 0.1  # of the record
MARGIN = 0.01  # of the travel: how far before the events of an end a contact may begin, as its first push is no event
BESIDE = 3  # samples before and after a contact that are left out with it: the velocity of the sample is uncertain


class Region(NamedTuple):
    """One end of the travel: the start of its region, +1 (upper) or -1, and its share of the events' energy."""

    edge: float
    side: int
    energy: float


def robust(x: Array, y: Array) -> tuple[Array, Array, float]:
    """Weights of the columns, residual of the target and its robust standard deviation, under Cauchy's weights."""
    scale = np.linalg.norm(x, axis=0) + 1e-300
    w = np.ones(y.size)
    for _ in range(REWEIGHTINGS):
        c, *_ = np.linalg.lstsq(x / scale * w[:, None], y * w, rcond=1e-10)
        r = y - x / scale @ c
        s = 1.48 * float(np.median(np.abs(r - np.median(r)))) + 1e-300
        w = 1.0 / np.sqrt(1.0 + (r / (STOP_KNEE * s)) ** 2)
    return c / scale, r, s


def struck(x: Array, y: Array, q: Array, dry: int | None = None) -> list[Region]:
    """The ends of the travel that are struck, by the events in the residual of a robust fit: none, one or two.

    ``x`` (n, p), ``y`` (n,): columns and target of a torque balance at the positions ``q`` (n,). ``dry``: the column of
    dry friction, which holds an axis at a stop while the drive turns round.
    """
    c, r, s = robust(x, y)
    held = 0.0 if dry is None else max(float(c[dry]), 0.0)
    event = np.abs(r) > STOP_FAR * s
    total = float(np.sum(r[event] ** 2))
    if total <= HALF * float(r @ r):
        return []
    found = []
    for side in (1, -1):
        depth = side * q
        pushed = np.flatnonzero(event & (side * r > 0.0))
        energy = float(np.sum(r[pushed] ** 2))
        if energy <= STOP_EDGE * total:
            continue
        order = pushed[np.argsort(depth[pushed])]
        edge = float(depth[order][np.searchsorted(np.cumsum(r[order] ** 2), STOP_EDGE * energy)])
        deep = (depth >= HALF * (edge + float(depth.max()))) & (np.abs(r) > held)
        if deep.any() and np.mean(side * r[deep] > STOP_KNEE * s) > HALF:
            found.append(Region(side * edge, side, energy / total))
    return found if sum(f.energy for f in found) > HALF else []


class Contacts(NamedTuple):
    """Ends of the travel that a record strikes, by their sides (-1, 1), and the samples (n,) in contact."""

    ends: dict[int, float]
    touched: Bools

    def between(self, log: View) -> View | None:
        """The record without them and their neighbours, in segments; None if none is long enough."""
        left_out = binary_dilation(self.touched, iterations=BESIDE)
        if not left_out.any():
            return log
        kept = []
        for a, b in itertools.pairwise(log.bounds.tolist()):
            edges = np.flatnonzero(np.diff(left_out[a:b], prepend=True, append=True)) + a
            kept += [(s, e) for s, e in edges.reshape(-1, 2).tolist() if e - s >= LEAST_SEGMENT]
        if not kept:
            return None
        starts = tuple(np.cumsum([e - s for s, e in kept])[:-1].tolist())
        u, y = (np.concatenate([x[s:e] for s, e in kept]) for x in (log.u, log.y))
        bare = replace(log, u=u, y=y, target=y, starts=starts)
        return replace(bare, target=derivative(y, log.dt, bare.bounds)[0])


def contacts(log: View, *, hangs: bool) -> Contacts:
    """The ends that are struck by an axis with a weight, if it ``hangs``, or without.

    ``log``: its position in SI.  Those that are struck seldom, and where a soft one begins, are shown once the rest is
    left out.
    """
    form = AxisForm(orders=HANGS if hangs else HANGS[:0])
    found, between = Contacts({}, np.zeros(log.y.size, dtype=bool)), log
    while more := _struck_by(between, form):
        ends = found.ends | {r.side: r.edge - r.side * MARGIN * float(np.ptp(log.y)) for r in more}
        then = Contacts(ends, (log.y <= ends.get(-1, -np.inf)) | (log.y >= ends.get(1, np.inf)))
        left = then.between(log)
        if left is None:
            break
        found, between = then, left
    return found


def struck_before(log: View, cut: int) -> int:
    """The first held-out sample, after ``cut`` if an end of the travel is struck first in what would be held out.

    What is fitted before must show it, or no model predicts the rest.  A tenth of the record remains in any case.
    """
    if log.logged != "position":
        return cut
    found, latest = contacts(log, hangs=log.angle), int((1.0 - LEAST_HELD) * log.y.size)
    for side, end in found.ends.items():
        there = found.touched & (side * log.y >= side * end)
        first = int(np.argmax(there))
        left = first + int(np.argmin(np.append(there[first:], False))) + LEAST_SEGMENT
        cut = left if cut < left <= latest else cut
    return cut


def _struck_by(log: View, form: AxisForm) -> list[Region]:
    """The ends of the travel that are struck, by inverse dynamics with the narrowest Gaussian that shows any.

    A wide one blurs a contact far into the free motion.
    """
    record, placed = replace(log, u=acting(log)), form._replace(powers=1)
    for width in WIDTHS:
        columns, drive = balance(record, width, placed)
        at = 4 + form.of_position
        if drive.size < FEWEST:
            continue
        found = struck(np.delete(columns, at, axis=1), drive, columns[:, at], dry=2)
        if found := [r for r in found if not _gives_way(r, log.y)]:
            return found
    return []


def _gives_way(region: Region, y: Array) -> bool:
    """Whether the end would be a spring over a large part of the travel, as in `EndStop.implausible`."""
    beyond = float(np.max(region.side * y)) - region.side * region.edge
    return beyond > TOUCHED * (float(np.ptp(y)) - beyond)
