"""The axis as physics, fitted by its free run from an inverse-dynamics start."""

from __future__ import annotations

import itertools
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from whsklearn.effects import Coulomb, FrictionLaw, GravityImbalance, InputOffset, SpeedHinge, Viscous
from whsklearn.identification.view import derivative, window_of
from whsklearn.models import AxisModel
from whsklearn.recursion.batch.axis_free_run import AxisLog, fit_axis
from whsklearn.validation import whiteness_test

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from whsklearn.effects import Effect
    from whsklearn.identification.view import View

    Array = NDArray[np.float64]

KNOTS = (0.1, 0.3, 0.6, 0.85)  # quantiles of speed at which a free law may bend
PIECE = 2.0  # s of a free run whose place is to be known
LEAST_PIECE = 100  # samples of it
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
        If gravity is next to nothing, or as `inverse_start`.
    """
    model = _fit(
        replace(log, logged="position", target=derivative(log.y, log.dt, log.bounds)[0]), np.empty(0), hangs=True
    )
    share = model.parameters["gravity_imbalance"] / np.std(log.u)
    if share < LEAST_GRAVITY:
        raise ValueError(f"Gravity would be {100 * share:.2g} % of the drive, so the axis without it is the same.")
    return model


def _fit(log: View, knots: Array, *, hangs: bool = False) -> AxisModel:
    data = axis_log(log, knots, hangs=hangs)
    free = np.r_[np.ones(4, bool), np.full(2, hangs), np.ones(knots.size, bool)]
    start = inverse_start(log, hangs=hangs)
    found = []
    for factor in (1.0, 0.3, 3.0):  # a smoothed or noisy velocity bends the start; the least error decides
        theta = np.concatenate([start, np.zeros(6 - start.size + knots.size)])
        theta[0] *= factor
        found.append(fit_axis(theta, data, free))
    best = min(found, key=lambda f: f.cost)
    theta, errors = best.theta, np.sqrt(np.maximum(np.diag(best.covariance), 0.0))
    if not white(best.error, log):
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


def axis_log(log: View, knots: Array, *, hangs: bool) -> AxisLog:
    """The record as the fit of an axis takes it, in one piece, or in short ones where gravity pulls.

    Where it does the place counts, and a free run is off it after some seconds.
    """
    n = log.u.size
    piece = max(round(PIECE / log.dt), LEAST_PIECE) if hangs else n
    begins = np.concatenate([np.arange(a, b, piece) for a, b in itertools.pairwise(log.bounds)])
    return AxisLog(
        log.u, log.target, np.arange(n) >= 0, np.append(begins, n), log.target[begins], log.y[begins] * hangs, log.dt,
        knots, hangs=hangs,
    )  # fmt: skip


def white(error: Array, log: View) -> bool:
    """Whether the error of a free run is white, by Ljung and Box; of a smoothed velocity it is taken a window apart."""
    apart = error[:: window_of(log.y.size, log.dt) if log.logged == "position" else 1]
    if not np.isfinite(apart).all():  # it ran away
        return False
    if apart.size <= LEAST_TESTED or not np.ptp(apart) > 1e-9 * np.ptp(log.in_si.target):  # exact but for rounding
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


def gravity_of(sine: float, cosine: float) -> GravityImbalance:
    """k1 sin q + k2 cos q as A cos(q + phi)."""
    return GravityImbalance(float(np.hypot(sine, cosine)), phase=float(np.arctan2(-sine, cosine)))


def _gravity_errors(forces: Array, covariance: Array) -> dict[str, float]:
    """Standard errors of amplitude and phase, to first order."""
    (sine, cosine), amplitude = forces, max(np.hypot(*forces), 1e-300)
    slopes = np.array([[sine, cosine], [-cosine / amplitude, sine / amplitude]]) / amplitude
    errors = np.sqrt(np.maximum(np.diag(slopes @ covariance @ slopes.T), 0.0))
    return dict(zip(("gravity_imbalance", "gravity_imbalance__phase"), errors.tolist(), strict=True))


def sine_and_cosine(gravity: GravityImbalance) -> tuple[float, float]:
    """The reverse of `gravity_of`."""
    return -gravity.amplitude * np.sin(gravity.phase), gravity.amplitude * np.cos(gravity.phase)


def inverse_start(log: View, *, hangs: bool = False) -> Array:
    """Inertia, viscous, Coulomb, offset from u = J a + B v + C sign(v) + o, and k1 sin q + k2 cos q; least squares.

    Raises
    ------
    ValueError
        If the drive does not accelerate the output in its own direction.
    """
    if log.logged == "position":
        velocity, acceleration = derivative(log.y, log.dt, log.bounds)
    else:
        velocity, acceleration = log.target, derivative(log.target, log.dt, log.bounds)[0]
    moving = np.abs(velocity) > 0.02 * np.abs(velocity).max()
    columns = np.column_stack([acceleration, velocity, np.sign(velocity), np.ones_like(velocity)])
    if hangs:
        columns = np.column_stack([columns, np.sin(log.y), np.cos(log.y)])
    columns = columns[moving]
    scale = np.maximum(np.abs(columns).max(axis=0), 1e-300)
    theta = np.linalg.lstsq(columns / scale, log.u[moving], rcond=None)[0] / scale
    if not theta[0] > 0:
        raise ValueError("The drive does not accelerate the output in its own direction, so this is no rigid axis.")
    theta[1:3] = np.maximum(theta[1:3], 1e-3 * np.std(log.u) / np.array([np.std(velocity) or 1.0, 1.0]))
    return theta
