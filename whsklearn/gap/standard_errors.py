"""Standard errors of an effect's labelled numbers, from the derivatives of the fit."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from whsklearn.gap.plant import Linearised

Array = NDArray[Any]
N_DRAWS = 64  # of the numbers, each a model: their spread is known to 9 %


def covariance(fit: Linearised) -> Array:
    """s^2 (J'J)^-1 of the fitted residual, with columns scaled to unit length; shape (p, p).

    A number that moves no residual (a change whose time lies between two fitted parts) gets no variance.
    """
    scale = np.linalg.norm(fit.jacobian, axis=0)
    scale[scale == 0.0] = np.inf
    unit = fit.jacobian / scale
    inverse = np.linalg.pinv(unit.T @ unit, rcond=1e-10) / np.outer(scale, scale)
    return inverse * float(fit.residual @ fit.residual) / max(fit.residual.size - fit.x.size, 1)


def labelled_errors(fit: Linearised, index: int) -> dict[str, float]:
    """Standard errors of one term's labelled numbers.

    The covariance of the free numbers is carried to labels such as amplitude and phase by drawing.  Numbers that
    the draws do not move have none.
    """
    return errors_of(fit, lambda model: model.terms[index].effect.labelled())


def errors_of(fit: Linearised, read: Callable[[Any], Mapping[str, float | str]]) -> dict[str, float]:
    """Standard errors of the numbers that ``read`` finds in a model."""
    centre = {k: v for k, v in read(fit.rebuild(fit.x)).items() if not isinstance(v, str)}
    values, vectors = np.linalg.eigh(covariance(fit))
    spread = vectors * np.sqrt(np.maximum(values, 0.0))
    rng = np.random.default_rng(0)
    draws: dict[str, list[float]] = {k: [] for k in centre}
    for z in np.clip(fit.x + rng.standard_normal((N_DRAWS, fit.x.size)) @ spread.T, fit.low, fit.high):
        try:
            labels = read(fit.rebuild(z))
        except (ValueError, OverflowError):
            continue
        if not labels.keys() >= draws.keys():  # a draw at a bound may have fewer numbers to tell
            continue
        for k, seen in draws.items():
            gap = float(labels[k]) - centre[k]
            seen.append((gap + np.pi) % (2 * np.pi) - np.pi if k.startswith("phase") else gap)
    errors = {k: float(np.std(v)) for k, v in draws.items() if v}
    return {k: v for k, v in errors.items() if np.isfinite(v) and v > 0.0}
