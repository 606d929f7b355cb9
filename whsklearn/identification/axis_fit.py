"""The axis as physics, fitted by its free run from an inverse-dynamics start."""

from __future__ import annotations

import functools
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from whsklearn.effects import Coulomb, FrictionLaw, InputOffset, SpeedHinge, Viscous
from whsklearn.identification.axis_inverse import Start, inverse_starts
from whsklearn.identification.axis_numbers import axis_log, axis_residual, gravity_of, shooting_log
from whsklearn.identification.view import derivative, window_of
from whsklearn.identification.windows import axis_score
from whsklearn.models import AxisModel
from whsklearn.recursion.batch.axis_free_run import AxisFit, AxisLog, fit_axis, fit_pieces, free_run
from whsklearn.validation import whiteness_test

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from whsklearn.effects import Effect
    from whsklearn.identification.view import View

    Array = NDArray[np.float64]

KNOTS = (0.1, 0.3, 0.6, 0.85)  # quantiles of speed at which a free law may bend
SHOOTING = (
    0.25,
    0.5,
    2.0,
)  # s of the pieces of multiple shooting: from what is fitted first to what windows are judged by
# Of the drive's rms: what is fitted where there is no gravity, and held-out data happen to like, is up to 0.2 %
# (benchmarks/which_structure.py, axes of MuJoCo)
LEAST_GRAVITY = 0.01
LEVEL = 0.01  # of the test for whiteness
LEAST_TESTED = 60  # samples, twice the lags of the test and some
BLOCKS = 20  # of the scores of inverse dynamics: each is to be longer than what is missing is correlated


def fit_rigid_axis(log: View) -> AxisModel:
    """Inertia, viscous and Coulomb friction, offset, in SI."""
    return _fit(log, np.empty(0))


def fit_free_law_axis(log: View) -> AxisModel:
    """The same with friction bent at four speeds."""
    speed = np.abs(log.target)
    return _fit(log, np.unique(np.quantile(speed[speed > 0.02 * speed.max()], KNOTS)))


def fit_hanging_axis(log: View) -> AxisModel:
    """The rigid axis with gravity; the output is its position, an angle, which gravity keeps from drifting away.

    Raises
    ------
    ValueError
        If gravity is next to nothing, or as `inverse_starts`.
    """
    model = _fit(
        replace(log, logged="position", target=derivative(log.y, log.dt, log.bounds)[0]), np.empty(0), hangs=True
    )
    share = model.parameters["gravity_imbalance"] / np.std(log.u)
    if share < LEAST_GRAVITY:
        raise ValueError(f"Gravity would be {100 * share:.2g} % of the drive, so the axis without it is the same.")
    return model


def _fit(log: View, knots: Array, *, hangs: bool = False) -> AxisModel:
    """The numbers that simulate best over windows of the record, of all that the fits ended at."""
    best = _best_minimum(log, knots, hangs=hangs)
    theta, errors = best.theta, np.sqrt(np.maximum(np.diag(best.covariance), 0.0))
    if not white(axis_residual(theta, log, knots, hangs=hangs), log):
        other, spread = inverse_dynamics(log, knots, hangs=hangs)
        # two estimators agree where nothing is missing, and how far they lie apart tells what is (Hausman 1978)
        errors = np.hypot(np.hypot(errors, spread), theta - other)
    law = FrictionLaw(
        [Viscous(theta[1]), Coulomb(theta[2]), *(SpeedHinge(w, k) for w, k in zip(theta[6:], knots, strict=True))]
    )
    effects: list[Effect] = [InputOffset(float(theta[3]))]
    named = dict(
        zip(("inertia", *law.labels, "input_offset"), np.r_[errors[:3], errors[6:], errors[3]].tolist(), strict=True)
    )
    if hangs:
        gravity = gravity_of(*theta[4:6])
        effects.append(gravity)
        wider = np.diag(errors[4:6] / np.sqrt(np.maximum(np.diag(best.covariance)[4:6], 1e-300)))
        named |= _gravity_errors(theta[4:6], wider @ best.covariance[4:6, 4:6] @ wider)
    return AxisModel(
        float(theta[0]),
        law,
        tuple(effects),
        dt=log.dt,
        logged="position" if log.logged == "position" else "velocity",
        standard_errors=named,
    )


def _best_minimum(log: View, knots: Array, *, hangs: bool) -> AxisFit:
    """Starts by inverse dynamics, fits by multiple shooting over short and long pieces, and by one free run.

    Where gravity is large against the inertia the free run of a start that is a little wrong is lost within a second,
    and its least squares end anywhere.  So the best start goes first over pieces short enough for it, and of all
    that is found the numbers whose windows are simulated best are taken.
    """
    free = np.r_[np.ones(4, bool), np.full(2, hangs), np.ones(knots.size, bool)]

    def score(theta: Array) -> float:
        return axis_score(theta, knots, log, hangs=hangs)

    least, start = min(((score(s.theta), s) for s in inverse_starts(log, knots, hangs=hangs)), key=lambda pair: pair[0])
    whole = axis_log(log, knots, hangs=hangs)
    best = start_as_fit(start, whole)
    fits: list[Callable[[Array], AxisFit]] = [functools.partial(fit_axis, log=whole, free=free)]
    if log.logged == "position":
        pieces = [shooting_log(log, seconds, knots, hangs=hangs) for seconds in SHOOTING]
        fits += [functools.partial(fit_pieces, log=p, free=free) for p in pieces]
    for fit in fits:
        ended = fit(best.theta)
        if np.isfinite(ended.cost) and start.holds(ended.theta) and (reached := score(ended.theta)) < least:
            least, best = reached, ended
    return best


def start_as_fit(start: Start, log: AxisLog) -> AxisFit:
    """What inverse dynamics found, where nothing simulates better; its errors are all that two estimators differ by."""
    error = log.target - free_run(start.theta, log)
    return AxisFit(start.theta, np.zeros((start.theta.size,) * 2), error, 0.0)


def white(error: Array, log: View) -> bool:
    """Whether the error of a free run is white, by Ljung and Box; of a smoothed velocity it is taken a window apart."""
    apart = error[:: window_of(log.y.size, log.dt) if log.logged == "position" else 1]
    if not np.isfinite(apart).all():  # it ran away
        return False
    if apart.size <= LEAST_TESTED or not np.ptp(apart) > 1e-9 * np.ptp(log.in_si.y):  # exact but for rounding
        return True
    return whiteness_test(apart).p_value > LEVEL


def inverse_dynamics(log: View, knots: Array, *, hangs: bool) -> tuple[Array, Array]:
    """The numbers by least squares of the torque balance along the measured motion, and their standard errors.

    In closed loop the motion hardly knows what is missing, and the drive carries it: these estimates stay near the
    truth where those of a free run, whose input holds what is missing, do not.  The errors are the sandwich over
    blocks.  On 20 axes whose cogging is 7 % of the drive the intervals of a free run alone held the inertia of 9, the
    ones made wider by both all 20 (tests/identification/test_axis_fit.py measures it).
    """
    from scipy.signal import savgol_filter

    window = window_of(log.y.size, log.dt)
    place = log.y if log.logged == "position" else log.target
    velocity, acceleration = derivative(place, log.dt, log.bounds)
    if log.logged != "position":
        velocity, acceleration = savgol_filter(log.target, window, 2), velocity
    side = np.sign(velocity)
    columns = [acceleration, velocity, side, np.ones_like(velocity)]
    columns += [np.sin(log.y), np.cos(log.y)] if hangs else [np.zeros_like(velocity)] * 2
    columns += [side * np.maximum(np.abs(velocity) - k, 0.0) for k in knots]
    moving = np.abs(velocity) > 0.02 * np.abs(velocity).max()
    rows = np.column_stack(columns) * moving[:, None]
    scale = np.maximum(np.linalg.norm(rows, axis=0), 1e-300)
    rows = rows / scale
    drive = savgol_filter(log.u, window, 2) * moving
    inverse = np.linalg.pinv(rows.T @ rows, rcond=1e-12, hermitian=True)
    theta = inverse @ (rows.T @ drive)
    edges = np.linspace(0, drive.size, BLOCKS + 1).astype(int)[:-1]
    scores = np.add.reduceat(rows * (drive - rows @ theta)[:, None], edges, axis=0)
    return theta / scale, np.sqrt(np.maximum(np.diag(inverse @ (scores.T @ scores) @ inverse), 0.0)) / scale


def _gravity_errors(forces: Array, covariance: Array) -> dict[str, float]:
    """Standard errors of amplitude and phase, to first order."""
    (sine, cosine), amplitude = forces, max(np.hypot(*forces), 1e-300)
    slopes = np.array([[sine, cosine], [-cosine / amplitude, sine / amplitude]]) / amplitude
    errors = np.sqrt(np.maximum(np.diag(slopes @ covariance @ slopes.T), 0.0))
    return dict(zip(("gravity_imbalance", "gravity_imbalance__phase"), errors.tolist(), strict=True))
