"""Inverse dynamics in the other direction: what explains the acceleration, given the drive.

u = J a + f is fitted by least squares of the drive.  That is right under a stiff controller, where the path is given
and the drive responds to whatever is missing.  If the axis swings freely it is the other way round: the drive is
given and the acceleration responds.  Then J a and a force of the position nearly cancel, the fit ends at an inertia
near zero, and the force explains hardly anything of the small drive (three of six logs of a pendulum).  A regression
of the acceleration on the drive,

    a = (u - f) / J,

shows that the same force explains nearly everything.  Both describe the same model, and a force of the position is
tried in both directions.

References
----------
Frisch 1934, Statistical Confluence Analysis by Means of Complete Regression Systems, for the two directions of one
regression; Haavelmo 1943, The statistical implications of a system of simultaneous equations, Econometrica 11(1), 1-12.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from whsklearn.gap.calibration import coloured, gain, n_effective, smoothed_power
from whsklearn.gap.plants import servo_stop as stop
from whsklearn.gap.plants.servo_model import AxisModel
from whsklearn.gap.plants.servo_own import N_NULL
from whsklearn.gap.tangent import Tangent

Array = NDArray[Any]


def regression(view: Any, model: AxisModel) -> tuple[Array, Array]:
    """(acceleration, columns) at the judged samples; the columns are the drive and all of the model except inertia."""
    _, x, target, _, free = view.solved(model)
    columns = np.column_stack([target, stop.without_pushes(model, x)[:, 1:][:, free[1 : x.shape[1]]]])
    return x[view.at, 0], columns[view.at]


def left(view: Any, model: AxisModel) -> Array:
    """Residual of the acceleration under the model, shape (n,)."""
    a, columns = regression(view, model)
    norm = np.linalg.norm(columns, axis=0)
    columns = columns[:, norm > 0.0] / norm[norm > 0.0]
    return np.asarray(a - columns @ np.linalg.lstsq(columns, a, rcond=1e-10)[0])


def tangent(view: Any, model: AxisModel, rng: np.random.Generator) -> Tangent:
    """Residual of the acceleration under the model, with noise of its colour for comparison.

    The artefacts of the filters are subtracted from the drive (`InverseView.artefact`).  No record of the model itself
    is made, because a model without the force does not swing.
    """
    rest = left(view, model)
    power = smoothed_power(rest)
    null = np.array([coloured(power, rest.size, rng) for _ in range(N_NULL)])
    n = n_effective(coloured(power, rest.size, np.random.default_rng(0)), view.n_effective)
    return Tangent(rest, null, regression(view, model)[1], n, stop.away(view, model))


def explained(view: Any, model: AxisModel, grown: AxisModel) -> tuple[float, float]:
    """(gain, share of the residual power removed) of the grown model, for the acceleration."""
    before, after = left(view, model), left(view, grown)
    power = smoothed_power(before)
    n = n_effective(coloured(power, before.size, np.random.default_rng(0)), view.n_effective)
    g = gain(float(before @ before), float(after @ after), n)
    return g, float(max(0.0, -np.expm1(-g / n)))
