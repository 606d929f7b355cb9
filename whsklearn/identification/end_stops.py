"""End stops: a few one-sided events at the ends of the travel, and an axis between them.

A rigid stop supplies whatever torque holds the axis, with one sign (Signorini's condition; Brogliato 1999, Nonsmooth
Mechanics, ch. 1).  In contact the drive says nothing of inertia and friction, so an axis is fitted to its motion
between the stops, and the numbers of a stop to the motion after each impact, with those of the axis kept.  A contact
that is no spring with a damper, such as that of MuJoCo, which pushes the harder the harder it is pressed, then does
not bend the numbers of the axis.
"""

from __future__ import annotations

import itertools
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.ndimage import binary_dilation
from scipy.optimize import least_squares

from whsklearn.effects import ContactStop
from whsklearn.effects.base import Array, Bools, Integers, rms
from whsklearn.identification.axis_fit import fit_hanging_axis, fit_rigid_axis
from whsklearn.identification.axis_inverse import FEWEST, WIDTHS, acting, balance
from whsklearn.identification.axis_numbers import axis_theta
from whsklearn.identification.view import LEAST_SEGMENT, View, derivative
from whsklearn.identification.windows import MOST, errors_from
from whsklearn.models import AxisModel
from whsklearn.models.axis import spring_steps
from whsklearn.recursion.batch.axis_free_run import HANGS, AxisForm, covariance_of

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
BESIDE = 3  # samples before and after a contact that are left out with it: the velocity of the sample is uncertain
# An impact: the motion before it from which its state is known, and after it from which the stop is (s)
APPROACH, FOLLOWED = 0.1, 0.15
# What is tried first of a contact: undamped rate (rad per sample), damping ratio, and how deep in the region it begins
RATES, RATIOS, DEPTHS = (0.05, 0.2, 0.6), (0.1, 1.0), (0.0, 0.25, 0.5, 0.75)
# What can be found: a stop of 1.5 rad per sample is over within two samples, so that a harder one cannot be told
RATES_SHOWN, RATIOS_SHOWN, DEPTHS_TRIED = (0.01, 1.5), (0.01, 5.0), (-1.0, 0.99)
SMALL = 1e-5  # a step of differences


class Region(NamedTuple):
    """One end of the travel: the start of its region, +1 (upper) or -1, and its share of the events' energy."""

    edge: float
    side: int
    energy: float


def robust(x: Array, y: Array) -> tuple[Array, float]:
    """(residual of the target, its robust standard deviation) under Cauchy's weights."""
    scale = np.linalg.norm(x, axis=0) + 1e-300
    w = np.ones(y.size)
    for _ in range(REWEIGHTINGS):
        c, *_ = np.linalg.lstsq(x / scale * w[:, None], y * w, rcond=1e-10)
        r = y - x / scale @ c
        s = 1.48 * float(np.median(np.abs(r - np.median(r)))) + 1e-300
        w = 1.0 / np.sqrt(1.0 + (r / (STOP_KNEE * s)) ** 2)
    return r, s


def struck(x: Array, y: Array, q: Array) -> list[Region]:
    """The ends of the travel that are struck, by the events in the residual of a robust fit: none, one or two.

    ``x`` (n, p), ``y`` (n,): columns and target of a torque balance at the positions ``q`` (n,).
    """
    r, s = robust(x, y)
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
        deep = depth >= HALF * (edge + float(depth.max()))
        if np.mean(side * r[deep] > STOP_KNEE * s) > HALF:
            found.append(Region(side * edge, side, energy / total))
    return found if sum(f.energy for f in found) > HALF else []


def fit_stopped_axis(log: View, *, hangs: bool = False) -> AxisModel:
    """The rigid axis between stops at one end of its travel or at both, beside gravity if it ``hangs``.

    Raises ValueError if the output is not a position, no end is struck, or the axis between the stops cannot be fitted.
    """
    if log.logged != "position":
        raise ValueError("A stop can be identified from a position only.")
    form, between = AxisForm(orders=HANGS if hangs else HANGS[:0]), log
    touched, ends = np.zeros(log.y.size, dtype=bool), dict[int, float]()
    while found := _struck_by(between, form):
        ends.update((r.side, r.edge) for r in found)
        touched = (log.y <= ends.get(-1, -np.inf)) | (log.y >= ends.get(1, np.inf))
        between = _without(log, binary_dilation(touched, iterations=BESIDE))
    if not ends:
        raise ValueError("The axis does not strike an end of its travel.")
    model = fit_hanging_axis(between) if hangs else fit_rigid_axis(between)
    return _with_stop(model, log, ends, touched)


def _struck_by(log: View, form: AxisForm) -> list[Region]:
    """The ends of the travel that are struck, by inverse dynamics with the Gaussian that shows them best.

    Those that are struck seldom, and where a soft one begins, are shown once the rest is left out.
    """
    record, placed = replace(log, u=acting(log)), form._replace(powers=1)
    found: list[Region] = []
    for width in WIDTHS:
        columns, drive = balance(record, width, placed)
        if drive.size >= FEWEST:
            at = 4 + form.of_position
            here = struck(np.delete(columns, at, axis=1), drive, columns[:, at])
            found = max(found, here, key=lambda f: sum(r.energy for r in f))
    return found


def _without(log: View, left_out: Bools) -> View:
    """The record without some samples, in segments between them."""
    kept = []
    for a, b in itertools.pairwise(log.bounds.tolist()):
        edges = np.flatnonzero(np.diff(left_out[a:b], prepend=True, append=True)) + a
        kept += [(s, e) for s, e in edges.reshape(-1, 2).tolist() if e - s >= LEAST_SEGMENT]
    if not kept:
        raise ValueError(f"Between the stops it never moves freely for {LEAST_SEGMENT} samples.")
    starts = tuple(np.cumsum([e - s for s, e in kept])[:-1].tolist())
    u, y = (np.concatenate([x[s:e] for s, e in kept]) for x in (log.u, log.y))
    bare = replace(log, u=u, y=y, target=y, starts=starts)
    return replace(bare, target=derivative(y, log.dt, bare.bounds)[0])


def _with_stop(model: AxisModel, log: View, ends: dict[int, float], touched: Bools) -> AxisModel:
    """The axis with the stop that follows the motion after each impact best, from its state before it."""
    theta, form = axis_theta(model)
    before, horizon = (max(round(seconds / log.dt), LEAST_SEGMENT) for seconds in (APPROACH, FOLLOWED))
    begins = np.flatnonzero(np.diff(touched.astype(int)) == 1)
    begins = begins[_inside(begins, log, before, horizon)][:MOST]
    if not begins.size:
        raise ValueError("No impact at a stop is logged with the motion before and after it.")
    sides = sorted(ends)
    start, deepest = (np.array([x[k] for k in sides]) for x in (ends, {-1: log.y.min(), 1: log.y.max()}))

    def stop_of(x: Array) -> Array:
        """Ends, stiffness and relaxation, from the logarithms of rate and damping ratio and the depths of the ends."""
        found = dict(zip(sides, start + x[2:] * (deepest - start), strict=True))
        rate = np.exp(x[0]) / log.dt
        between = found.get(-1, -np.inf), found.get(1, np.inf)
        return np.array([*between, model.inertia * rate**2, 2.0 * np.exp(x[1]) / rate])

    def error(x: Array) -> Array:
        run = replace(log, hold=model.hold, steps=max(model.steps, spring_steps((np.exp(x[0]) / log.dt) ** 2, log.dt)))
        return errors_from(theta, form._replace(stop=stop_of(x)), run, begins, horizon, before).ravel()

    tried = itertools.product(np.log(RATES), np.log(RATIOS), DEPTHS)
    starts = [np.r_[rate, ratio, np.full(start.size, depth)] for rate, ratio, depth in tried]
    limits = np.array([np.log(RATES_SHOWN), np.log(RATIOS_SHOWN), *[DEPTHS_TRIED] * start.size]).T
    best = least_squares(error, min(starts, key=lambda x: rms(error(x))), bounds=tuple(limits), diff_step=1e-4)
    bounds = np.arange(begins.size + 1) * horizon
    covariance = covariance_of(best.jac.T, best.fun, best.x, bounds)

    def stopped(x: Array) -> AxisModel:
        return replace(model, effects=(*model.effects, _contact_stop(*stop_of(x))))

    found = stopped(best.x)
    names = [k for k in found.parameters if k not in model.parameters]

    def numbers(x: Array) -> Array:
        return np.array([stopped(x).parameters[k] for k in names])

    steps = SMALL * np.eye(best.x.size)
    slopes = np.array([numbers(best.x + d) - numbers(best.x - d) for d in steps]).T / (2.0 * SMALL)
    spread = np.sqrt(np.einsum("ij,jk,ik->i", slopes, covariance, slopes))
    own: dict[str, float] = dict(zip(names, spread.tolist(), strict=True))
    return replace(found, standard_errors={**model.standard_errors, **own})


def _contact_stop(low: float, high: float, stiffness: float, relaxation: float) -> ContactStop:
    """The stop with these ends, of which one may be infinite."""
    if np.isinf(low):
        return ContactStop(stiffness, high, relaxation)
    if np.isinf(high):
        return ContactStop(stiffness, low, relaxation, side="lower")
    return ContactStop(stiffness, 0.5 * (high - low), relaxation, 0.5 * (high + low), side="both")


def _inside(begins: Integers, log: View, before: int, horizon: int) -> Bools:
    """Which of the samples have so many before them and after them in their segment."""
    k = np.searchsorted(log.bounds, begins, side="right")
    return (begins - before >= log.bounds[k - 1]) & (begins + horizon <= log.bounds[k])
