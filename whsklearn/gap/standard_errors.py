"""Standard errors of an effect's labelled numbers: from the derivatives of the fit, and from the drive's own scale."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from scipy.optimize import lsq_linear
from scipy.stats import chi2

from whsklearn.gap.calibration import N_DRAWS
from whsklearn.gap.diagnosis import Diagnosis
from whsklearn.gap.plant import Linearised
from whsklearn.gap.record import Array


def covariance(fit: Linearised) -> Array:
    """s^2 (J'J)^-1 of the fitted residual, with columns scaled to unit length; shape (p, p).

    A number on which the residual does not depend (a change whose time lies between two fitted parts) gets no variance,
    nor does one whose derivative overflows (a negligible inertia, to which a spring was fitted).
    """
    if fit.covariance is not None:
        return np.asarray(fit.covariance)
    jacobian = np.where(np.all(np.isfinite(fit.jacobian), axis=0), fit.jacobian, 0.0)
    scale = np.linalg.norm(jacobian, axis=0)
    scale[scale == 0.0] = np.inf
    unit = jacobian / scale
    inverse = np.linalg.pinv(unit.T @ unit, rcond=1e-10) / np.outer(scale, scale)
    out: Array = inverse * float(fit.residual @ fit.residual) / max(fit.residual.size - fit.x.size, 1)
    return out if np.all(np.isfinite(out)) else np.zeros_like(out)  # a residual that overflows gives no error


def labelled_errors(fit: Linearised, index: int) -> dict[str, float]:
    """Standard errors of one term's labelled numbers.

    The covariance of the free numbers is propagated to labels such as amplitude and phase by random draws.  Numbers
    that do not change between draws have no error.
    """
    return errors_of(fit, lambda model: model.terms[index].effect.labelled())


def errors_of(fit: Linearised, read: Callable[[Any], Mapping[str, float | str]]) -> dict[str, float]:
    """Standard errors of the numbers that ``read`` finds in a model."""
    centre = {k: v for k, v in read(fit.rebuild(fit.x)).items() if not isinstance(v, str)}
    values, vectors = np.linalg.eigh(covariance(fit))
    spread = vectors * np.sqrt(np.maximum(values, 0.0))
    rng = np.random.default_rng(0)
    draws: dict[str, list[float]] = {k: [] for k in centre}
    for z in np.clip(fit.x + rng.standard_normal((N_DRAWS, fit.x.size)) @ spread.T, *_limits(fit)):
        try:
            labels = read(fit.rebuild(z))
        except (ValueError, OverflowError):
            continue
        if not labels.keys() >= draws.keys():  # a draw at a bound may have fewer numbers
            continue
        for k, seen in draws.items():
            gap = float(labels[k]) - centre[k]
            seen.append((gap + np.pi) % (2 * np.pi) - np.pi if k.startswith("phase") else gap)
    errors = {k: float(np.std(v)) for k, v in draws.items() if v}
    return {k: v for k, v in errors.items() if np.isfinite(v) and v > 0.0}


def p_of_zero(fit: Linearised, index: int) -> float:
    """P-value of one term being absent: of all its linear numbers being zero, or its size if none is linear.

    The statistic is what the residual gains without the term, to first order, with all other numbers refitted within
    their limits: the age of a drive cannot stand for a lag of two samples.  The shape of the term is held: without the
    effect a shape has no meaning (Davies 1987, Biometrika 74(1), 33-43), and one that is hardly determined, such as the
    order of friction that varies along a short travel, makes the size uncertain though the effect is not.  The two
    weights of a wave are tested together, because one of them may look like a term of the base law.  A limit is absent
    at the end of its range, which the drive does not reach, and not at zero: a drive that is always at its limit fits
    any limit with an inertia and friction in proportion, and none above itself.

    References
    ----------
    Wald 1943, Trans. AMS 54(3), 426-482.
    """
    low, high = _limits(fit)

    def numbers(x: Array) -> tuple[Array, Array]:
        """(linear numbers, shape)."""
        term = fit.rebuild(np.clip(x, low, high)).terms[index]
        n = max(term.kind.linear, 1)
        return np.array(term.q[:n]), np.array(term.q[n:])

    spread = covariance(fit)
    size = np.sqrt(np.diag(spread))
    centre, form = numbers(fit.x)
    slopes, shaped = np.zeros((centre.size, size.size)), np.zeros(size.size, dtype=bool)
    for i, step in enumerate(np.diag(size)):
        (up, one), (down, other) = numbers(fit.x + step), numbers(fit.x - step)
        shaped[i] = np.any(one != form) or np.any(other != form)
        slopes[:, i] = 0.0 if shaped[i] else 0.5 * (up - down)  # for one standard error
    sized = slopes.any(axis=0)
    if not sized.any():
        return 0.0
    if math.isinf(fit.rebuild(fit.x).terms[index].kind.cls.neutral):
        away = (high - fit.x)[sized] / size[sized]
    else:
        away = np.linalg.pinv(slopes[:, sized]) @ -centre
    if np.isinf(away).any():
        return 0.0
    size[size == 0.0] = np.inf
    values, vectors = np.linalg.eigh(spread / np.outer(size, size))
    seen = values > 1e-10  # the others are directions in which the covariance is a pseudo-inverse: nothing is known
    root = (vectors[:, seen] / np.sqrt(values[seen])).T  # its square is the inverse of the correlations
    rest = ~sized & ~shaped & np.isfinite(size)
    room = np.maximum([fit.x - low, high - fit.x], 0.0)[:, rest] / size[rest] + 1e-9
    left = lsq_linear(root[:, rest], -root[:, sized] @ away, (-room[0], room[1]))
    return float(chi2.sf(2.0 * left.cost, centre.size))


def _limits(fit: Linearised) -> tuple[Array, Array]:
    """Limits of the numbers; one that the fit has left is none.

    Free runs find an inertia that the regression behind it is blind to.
    """
    return np.where(fit.x < fit.low, -np.inf, fit.low), np.where(fit.x > fit.high, np.inf, fit.high)


_OF_DRIVE = re.compile(r"_(nm|kg)(?=_|$)")  # in the labels of an effect's numbers
_UNITS = re.compile(r"\b(Nm|N|kg)\b")


def with_drive_error(diagnosis: Diagnosis, relative: float) -> None:
    """Widen the standard errors of a diagnosis by the relative standard deviation of the drive's scale.

    A relative error of the scale causes the same relative error in inertia, friction and amplitudes, and none in
    orders, phases, delays and speeds.  The two errors are independent, so their variances add (JCGM 100:2008, eq. 10).

    ``diagnosis``: changed in place. ``relative``: standard deviation of the torque constant as a share of it; 0 changes
    nothing.

    >>> from whsklearn.effects import Cogging
    >>> from whsklearn.gap import NamedEffect
    >>> errors = {"amplitude_nm": 0.003, "order": 0.01}
    >>> found = Diagnosis("named", "", effects=[NamedEffect(Cogging(0.05, 12.0), errors, 90.0, 1.0)])
    >>> with_drive_error(found, 0.08)
    >>> found.effects[0].standard_errors
    {'amplitude_nm': 0.005, 'order': 0.01}
    """
    if not relative:
        return
    for effect in [e for found in diagnosis.effects for e in (found, *found.orders)]:
        values = effect.effect.labelled()
        for label, error in effect.standard_errors.items():
            if _OF_DRIVE.search(label):
                effect.standard_errors[label] = math.hypot(error, relative * float(values[label]))
    for row in diagnosis.base_parameters:
        if _UNITS.search(row["unit"]):
            for when in ("before", "after"):
                row[f"{when}_error"] = math.hypot(row[f"{when}_error"] or 0.0, relative * row[when])
    diagnosis.notes.insert(
        0,
        f"The torque constant is known to {100 * relative:.3g} % (standard deviation); "
        "the intervals of inertia, friction and torques include that.",
    )
