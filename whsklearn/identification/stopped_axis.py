"""An axis between the ends of its travel, and the stop that it strikes there.

The axis is fitted to its motion between the stops, and the stop to the motion after each impact, with the numbers of
the axis kept.  A contact that is no spring with a damper, such as that of MuJoCo, which pushes the harder the harder it
is pressed, then does not bend the numbers of the axis.
"""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
from scipy.optimize import least_squares

from whsklearn.effects import ContactStop
from whsklearn.effects.base import Array, Bools, Integers, rms
from whsklearn.identification.axis_fit import fit_hanging_axis, fit_rigid_axis
from whsklearn.identification.axis_numbers import axis_theta
from whsklearn.identification.end_stops import Contacts, contacts
from whsklearn.identification.view import LEAST_SEGMENT, View
from whsklearn.identification.windows import MOST, errors_from
from whsklearn.models import AxisModel
from whsklearn.models.axis import spring_steps
from whsklearn.recursion.batch.axis_free_run import covariance_of

# An impact: the motion before it from which its state is known, and after it from which the stop is (s)
APPROACH, FOLLOWED = 0.1, 0.15
# What is tried first of a contact: undamped rate (rad per sample), damping ratio, and how deep in the region it begins
RATES, RATIOS, DEPTHS = (0.05, 0.2, 0.6), (0.1, 1.0), (0.0, 0.25, 0.5, 0.75)
# What can be found: a stop of 1.5 rad per sample is over within two samples, so that a harder one cannot be told
RATES_SHOWN, RATIOS_SHOWN, DEPTHS_TRIED = (0.01, 1.5), (0.01, 5.0), (-1.0, 0.99)
SMALL = 1e-5  # a step of differences


def fit_stopped_axis(log: View, *, hangs: bool = False) -> AxisModel:
    """The rigid axis between stops at one end of its travel or at both, beside gravity if it ``hangs``.

    Raises ValueError if the output is not a position, no end is struck, or the axis between the stops cannot be fitted.
    """
    if log.logged != "position":
        raise ValueError("A stop can be identified from a position only.")
    found = contacts(log, hangs=hangs)
    between = found.between(log)
    if not found.ends or between is None:
        raise ValueError("The axis does not strike an end of its travel.")
    return _with_stop(fit_hanging_axis(between) if hangs else fit_rigid_axis(between), log, found)


def _with_stop(model: AxisModel, log: View, stops: Contacts) -> AxisModel:
    """The axis with the stop that follows the motion after each impact best, from its state before it."""
    theta, form = axis_theta(model)
    before, horizon = (max(round(seconds / log.dt), LEAST_SEGMENT) for seconds in (APPROACH, FOLLOWED))
    begins = np.flatnonzero(np.diff(stops.touched.astype(int)) == 1)
    begins = begins[_inside(begins, log, before, horizon)][:MOST]
    if not begins.size:
        raise ValueError("No impact at a stop is logged with the motion before and after it.")
    sides = sorted(stops.ends)
    start, deepest = (np.array([x[k] for k in sides]) for x in (stops.ends, {-1: log.y.min(), 1: log.y.max()}))

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
