"""The axis as physics, fitted by its free run from an inverse-dynamics start."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from whsklearn.effects import Coulomb, FrictionLaw, InputOffset, SpeedHinge, Viscous
from whsklearn.identification.view import derivative
from whsklearn.models import AxisModel
from whsklearn.recursion.axis_free_run import AxisLog, fit_axis

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from whsklearn.identification.view import View

    Array = NDArray[np.float64]

KNOTS = (0.1, 0.3, 0.6, 0.85)  # quantiles of speed at which a free law may bend


def fit_rigid_axis(log: View) -> AxisModel:
    """Inertia, viscous and Coulomb friction, offset."""
    return _fit(log, np.empty(0))


def fit_free_law_axis(log: View) -> AxisModel:
    """The same with friction bent at four speeds."""
    speed = np.abs(log.target)
    return _fit(log, np.unique(np.quantile(speed[speed > 0.02 * speed.max()], KNOTS)))


def _fit(log: View, knots: Array) -> AxisModel:
    n = log.u.size
    data = AxisLog(
        log.u, log.target, np.arange(n) >= 0, np.array([0, n]), log.target[:1].copy(), np.zeros(1), log.dt, knots
    )
    free = np.r_[np.ones(4, bool), np.zeros(2, bool), np.ones(knots.size, bool)]
    start = inverse_start(log)
    found = []
    for factor in (1.0, 0.3, 3.0):  # a smoothed or noisy velocity bends the start; the least error decides
        theta = np.concatenate([start, np.zeros(2 + knots.size)])
        theta[0] *= factor
        found.append(fit_axis(theta, data, free))
    best = min(found, key=lambda f: f.cost)
    theta, errors = best.theta, np.sqrt(np.maximum(np.diag(best.covariance), 0.0))
    law = FrictionLaw(
        [Viscous(theta[1]), Coulomb(theta[2]), *(SpeedHinge(w, k) for w, k in zip(theta[6:], knots, strict=True))]
    )
    named = dict(zip(("inertia", *law.labels), np.r_[errors[:3], errors[6:]].tolist(), strict=True))
    return AxisModel(
        float(theta[0]),
        law,
        (InputOffset(float(theta[3])),),
        dt=log.dt,
        logged="position" if log.logged == "position" else "velocity",
        standard_errors=named | {"input_offset": float(errors[3])},
    )


def inverse_start(log: View) -> Array:
    """Inertia, viscous, Coulomb, offset from u = J a + B v + C sign(v) + o; least squares.

    Raises
    ------
    ValueError
        If the drive does not accelerate the output in its own direction.
    """
    if log.logged == "position":
        velocity, acceleration = derivative(log.y, log.dt)
    else:
        velocity, acceleration = log.target, derivative(log.target, log.dt)[0]
    moving = np.abs(velocity) > 0.02 * np.abs(velocity).max()
    columns = np.column_stack([acceleration, velocity, np.sign(velocity), np.ones_like(velocity)])[moving]
    scale = np.maximum(np.abs(columns).max(axis=0), 1e-300)
    theta = np.linalg.lstsq(columns / scale, log.u[moving], rcond=None)[0] / scale
    if not theta[0] > 0:
        raise ValueError("The drive does not accelerate the output in its own direction, so this is no rigid axis.")
    theta[1:3] = np.maximum(theta[1:3], 1e-3 * np.std(log.u) / np.array([np.std(velocity) or 1.0, 1.0]))
    return theta
