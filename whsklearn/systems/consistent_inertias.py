"""Physically consistent inertias: every link is a realisable body, by its log-Cholesky parameters.

The pseudo-inertia of a body, J = [[S, h], [h', m]] with S = tr(I)/2 1 - I, is positive definite if and only if the
numbers are those of a body of positive density (Wensing, Kim and Slotine 2018).  Rucker and Wensing (2022) write it

    J = U U',  U = e^alpha [[e^d1, s12, s13, t1], [0, e^d2, s23, t2], [0, 0, e^d3, t3], [0, 0, 0, 1]],

and any ten real numbers alpha, d, s, t are such a body.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from threadpoolctl import threadpool_limits

from whsklearn.effects.base import Array
from whsklearn.systems._arm_kernels import N_BODY
from whsklearn.systems.arm_files import inertia_matrix
from whsklearn.systems.base_parameters import BaseParameters

LEAST_MASS, LEAST_RADIUS = 1e-3, 1e-2  # kg and m: the initial body of a link for which the file gives none
# Standard errors per unit of a logarithm: masses and sizes in the file are taken to be right within a factor of twenty.
# This determines what the drives do not; a tenth of it took ten times as many steps on the AIRBOT.
NEARNESS = 0.3
OFF_DIAGONAL = (0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3)


def pseudo_inertia(numbers: Array) -> Array:
    """The pseudo-inertia J (4, 4) of ten numbers.

    ``numbers`` is (10,).
    """
    inertia = inertia_matrix(numbers)
    out = np.empty((4, 4))
    out[:3, :3] = 0.5 * np.trace(inertia) * np.eye(3) - inertia
    out[:3, 3] = out[3, :3] = numbers[1:4]
    out[3, 3] = numbers[0]
    return out


def from_log_cholesky(x: Array) -> Array:
    """The ten numbers of bodies from their log-Cholesky parameters, shape (..., 10) each; see the module's formula."""
    u = np.zeros((*x.shape[:-1], 4, 4), dtype=x.dtype)
    u[..., range(3), range(3)], u[..., 3, 3] = np.exp(x[..., 1:4]), 1.0
    for k, place in enumerate(OFF_DIAGONAL):
        u[(..., *place)] = x[..., 4 + k]
    u *= np.exp(x[..., :1, None])
    pseudo = u @ np.swapaxes(u, -1, -2)
    inner = pseudo[..., :3, :3]
    inertia = np.trace(inner, axis1=-2, axis2=-1)[..., None, None] * np.eye(3) - inner
    lower = inertia[..., [0, 0, 1, 0, 1, 2], [0, 1, 1, 2, 2, 2]]
    return np.concatenate([pseudo[..., 3, 3:], pseudo[..., :3, 3], lower], axis=-1)


def slopes(x: Array) -> Array:
    """Derivatives of `from_log_cholesky`, shape (n, 10, 10), [link, number, parameter], by complex steps: exact."""
    step = 1e-30
    each = x[:, None, :] + 1j * step * np.eye(N_BODY)
    return np.swapaxes(from_log_cholesky(each).imag / step, 1, 2)


def log_cholesky(numbers: Array) -> Array:
    """The inverse; impossible numbers are moved to the nearest body with a little mass and extent."""
    j = pseudo_inertia(numbers)
    values, vectors = np.linalg.eigh(j)
    least = np.array([1.0, 1.0, 1.0, LEAST_RADIUS**-2]) * LEAST_MASS * LEAST_RADIUS**2
    if values[0] <= 0.0:
        j = (vectors * np.maximum(values, 0.0)) @ vectors.T + np.diag(least)
    u = np.linalg.cholesky(j[::-1, ::-1])[::-1, ::-1]
    scale = u[3, 3]
    return np.array([np.log(scale), *np.log(np.diag(u)[:3] / scale), *(u[i, k] / scale for i, k in OFF_DIAGONAL)])


@threadpool_limits.wrap(limits=1, user_api="blas")  # two threads take twice the CPU and sum in another order
def consistent_numbers(
    inertial: Array, armature: Array, base: BaseParameters, values: ArrayLike, covariance: ArrayLike | None
) -> tuple[Array, Array | None]:
    """Links (n, 10) and armature (n,) that are physical and have these base numbers; see `Arm.consistent`.

    The armature is None if no base number holds one.

    Raises ValueError if ``values`` does not have one number per base parameter.
    """
    from scipy.linalg import block_diag
    from scipy.optimize import least_squares

    n = len(inertial)
    theta = np.asarray(values, dtype=float)
    if theta.shape != (len(base.kept),):
        raise ValueError(f"values has shape {theta.shape}, expected ({len(base.kept)},), one per base parameter.")
    motors = base.mapping.shape[1] >= (N_BODY + 1) * n
    width = (N_BODY + 1) * n if motors else N_BODY * n
    concerned = base.kept < width
    mapping, theta = base.mapping[concerned, :width], theta[concerned]
    spread = np.eye(len(base.kept)) if covariance is None else np.asarray(covariance, dtype=float)
    whitening = np.linalg.inv(np.linalg.cholesky(spread[np.ix_(concerned, concerned)]))
    start = np.concatenate([np.concatenate([log_cholesky(row) for row in inertial]), np.log(armature + 1e-6)])
    start = start[: None if motors else N_BODY * n]

    links = N_BODY * n

    def full(x: Array) -> Array:
        return np.concatenate([from_log_cholesky(x[:links].reshape(n, N_BODY)).ravel(), np.exp(x[links:])])

    def errors(x: Array) -> Any:
        return np.concatenate([whitening @ (mapping @ full(x) - theta), NEARNESS * (x - start)])

    def jacobian(x: Array) -> Any:
        inner = block_diag(*slopes(x[:links].reshape(n, N_BODY)), *np.exp(x[links:]))
        return np.vstack([whitening @ mapping @ inner, NEARNESS * np.eye(x.size)])

    found = full(least_squares(errors, start, jacobian, ftol=1e-6, xtol=1e-6, max_nfev=200).x)
    return found[:links].reshape(n, N_BODY), found[links:] if motors else None
