"""Base parameters: the combinations of an arm's numbers that its drives identify, and bodies that have them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from threadpoolctl import threadpool_limits

from whsklearn.effects.base import Array
from whsklearn.systems._arm_kernels import N_BODY
from whsklearn.systems.arm_files import body_numbers, numbers_of, pseudo_inertia

# As a share of a column's length. The part that earlier columns leave unexplained is either rounding (1e-13 on random
# motion) or above 1e-5 (random arms of 2 to 7 joints); the tolerance lies between.
TOLERANCE = 1e-9
ROUNDING = 1e-12  # of the largest eigenvalue of a correlation matrix, or of the sum of the absolute terms of a number


@dataclass(frozen=True, eq=False)
class BaseParameters:
    """Which columns a regression keeps, and which parameters each of their weights combines.

    Attributes
    ----------
    names : tuple of str
        Names of the columns kept, shape (b,).
    kept : ndarray of int, shape (b,)
        Their indices among all columns.
    mapping : ndarray of shape (b, n_columns)
        Maps a full set of parameters to base parameters: ``mapping @ numbers``.
    merged : dict of str to dict of str to float
        For each name kept, the other parameters that its weight includes, with their factors.
    unseen : tuple of str
        Parameters that no motion can reveal.

    References
    ----------
    Gautier 1991, Numerical calculation of the base inertial parameters of robots, J. Robotic Systems 8(4), 485-506.

    Examples
    --------
    >>> import numpy as np
    >>> from whsklearn.systems import base_parameters
    >>> a, b = np.random.default_rng(0).normal(size=(2, 20))
    >>> base = base_parameters(np.column_stack([a, b, a + 2 * b, 0 * a]), ["m", "J", "d", "z"])
    >>> base.names, base.unseen, base.merged["J"]["d"]
    (('m', 'J'), ('z',), 2.0)
    """

    names: tuple[str, ...]
    kept: NDArray[np.int64]
    mapping: Array
    merged: dict[str, dict[str, float]]
    unseen: tuple[str, ...]


def base_parameters(
    columns: ArrayLike, names: Sequence[str], groups: Sequence[int] = (), tolerance: float = TOLERANCE
) -> BaseParameters:
    """Keep each column that is not a combination of those before it, group by group in the given order.

    Within a group, the column with the largest remainder comes first: among the inertias of a link that turns about z,
    Izz then represents the sum, and not an Ixx that is visible only through a hundredth of a degree of tilt.

    Parameters
    ----------
    columns : array-like of shape (m, n_columns)
        Regressor along motion that excites everything, m at least as large as n_columns.
    names : sequence of str
        Names of the columns.
    groups : sequence of int, optional
        Number of columns in each group; by default each column is a group.
    tolerance : float
        Share of a column's length below which its remainder counts as zero.

    Examples
    --------
    >>> import numpy as np
    >>> base_parameters(np.ones((4, 2)), ["m", "copy"]).names
    ('m',)
    """
    y = np.asarray(columns, dtype=float)
    lengths = np.linalg.norm(y, axis=0)
    seen = lengths > tolerance * max(float(lengths.max(initial=0.0)), 1e-300)
    scaled: Array = np.asarray(
        np.linalg.qr(y / np.where(seen, lengths, 1.0), mode="r")
    )  # as many rows as columns, with the same dependences
    basis = np.zeros((scaled.shape[0], 0))
    kept: list[int] = []
    for group in np.split(np.arange(y.shape[1]), np.cumsum(groups)[:-1] if len(groups) else np.arange(1, y.shape[1])):
        open_ = [int(i) for i in group if seen[i]]
        while open_:
            left = scaled[:, open_]
            for _ in range(2):  # twice is enough (Kahan; Giraud et al. 2005, Numer. Math. 101)
                left = left - basis @ (basis.T @ left)
            sizes = np.linalg.norm(left, axis=0)
            best = int(np.argmax(np.where(sizes > tolerance, sizes * lengths[open_], 0.0)))
            if not sizes[best] > tolerance:
                break
            kept.append(open_.pop(best))
            basis = np.column_stack([basis, left[:, best] / sizes[best]])
    kept.sort()
    index = np.array(kept, dtype=np.int64)
    mapping: Array = np.asarray(np.linalg.lstsq(scaled[:, index], scaled, rcond=None)[0], dtype=float)
    mapping *= np.where(seen, lengths, 0.0)
    mapping /= lengths[index, None]
    mapping[np.abs(mapping) < tolerance * np.abs(mapping).max(initial=0.0)] = 0.0
    mapping[:, index] = np.eye(index.size)
    merged = {
        names[i]: {names[j]: round(float(row[j]), 12) for j in map(int, np.flatnonzero(row)) if j != i}
        for i, row in zip(kept, mapping, strict=True)
    }
    unseen = tuple(names[j] for j in map(int, np.flatnonzero(~mapping.any(axis=0))))
    return BaseParameters(tuple(names[i] for i in kept), index, mapping, {k: v for k, v in merged.items() if v}, unseen)


# --- physically consistent inertias: every link is a realisable body, by its log-Cholesky parameters -----------------
# The pseudo-inertia of a body, J = [[S, h], [h', m]] with S = tr(I)/2 1 - I, is positive definite if and only if the
# numbers are those of a body of positive density (Wensing, Kim and Slotine 2018).  Rucker and Wensing (2022) write it
#
#     J = U U',  U = e^alpha [[e^d1, s12, s13, t1], [0, e^d2, s23, t2], [0, 0, e^d3, t3], [0, 0, 0, 1]],
#
# and any ten real numbers alpha, d, s, t are such a body.
LEAST_MASS, LEAST_RADIUS = 1e-3, 1e-2  # kg and m: the initial body of a link to which the file gives none
USUAL = 1.0, 0.1  # kg and m: the initial body of all links, where neither the file nor the numbers say more
# Standard errors per unit of a logarithm: masses and sizes in the file are taken to be right within a factor of twenty.
# This determines what the drives do not; a tenth of it took ten times as many steps on the AIRBOT.
NEARNESS = 0.3
OFF_DIAGONAL = (0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3)


def from_log_cholesky(x: Array) -> Array:
    """The ten numbers of bodies from their log-Cholesky parameters, shape (..., 10) each; see the module's formula."""
    u = np.zeros((*x.shape[:-1], 4, 4), dtype=x.dtype)
    u[..., range(3), range(3)], u[..., 3, 3] = np.exp(x[..., 1:4]), 1.0
    for k, place in enumerate(OFF_DIAGONAL):
        u[(..., *place)] = x[..., 4 + k]
    u *= np.exp(x[..., :1, None])
    return numbers_of(u @ np.swapaxes(u, -1, -2))


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


def whitening(covariance: Array) -> Array:
    """Rows (p, p) whose products with numbers of this covariance (p, p) are independent with unit variance.

    Directions that are known to rounding only count as `ROUNDING`: numbers of joints that moved one after the other
    have correlations of one, whose Cholesky factor does not exist.

    >>> w = whitening(np.array([[4.0, 1.0], [1.0, 1.0]]))
    >>> (w @ np.array([[4.0, 1.0], [1.0, 1.0]]) @ w.T).round(6).tolist()
    [[1.0, 0.0], [0.0, 1.0]]
    """
    size = np.sqrt(np.diag(covariance))
    power, vectors = np.linalg.eigh(covariance / np.outer(size, size))
    return np.asarray((vectors / np.sqrt(np.maximum(power, ROUNDING * power[-1]))).T / size)


def usual_body(kept: NDArray[np.int64], values: Array, error: Array, n: int) -> tuple[float, float]:
    """Mass and radius of a ball with the median mass, moment and inertia of base numbers: m, m r and m r².

    ``kept`` (b,): which number of n links each one is; ``values``, ``error`` (b,): those that may be zero at 95 % may
    be of any size, as where joints moved one after the other, and are not asked.
    """
    held, size = (kept < N_BODY * n) & (np.abs(values) > 1.96 * error), np.abs(values)
    kind = np.digitize(kept % N_BODY, [1, 4])  # m, m r, m r^2
    rows, logs = [[0.1, 0.0], [0.0, 0.1]], [0.1 * np.log(x) for x in USUAL]
    for power in range(3):
        if (some := held & (kind == power) & (size > 0.0)).any():
            rows.append([1.0, power])
            logs.append(float(np.log(np.median(size[some]))))
    mass, radius = np.exp(np.linalg.lstsq(np.array(rows), np.array(logs), rcond=None)[0]).tolist()
    return mass, radius


@threadpool_limits.wrap(limits=1, user_api="blas")  # two threads take twice the CPU and sum in another order
def consistent_numbers(
    inertial: Array,
    armature: Array,
    base: BaseParameters,
    values: ArrayLike,
    covariance: ArrayLike | None,
    known: NDArray[np.bool_],
) -> tuple[Array, Array | None]:
    """Links (n, 10) and armature (n,) that are physical and have these base numbers; see `Arm.consistent`.

    The armature is None if no base number holds one, and as given where it is ``known`` (n,).

    Raises ValueError if ``values`` does not have one number per base parameter.
    """
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
    white = whitening(spread[np.ix_(concerned, concerned)])
    error = np.sqrt(np.diag(spread)[concerned]) * (covariance is not None)
    mass, radius = usual_body(base.kept[concerned], theta, error, n)
    if not inertial[:, 0].any():  # from bodies of a gram and a centimetre, the search ended up to a million sigma away
        inertial = np.tile(body_numbers(mass, np.zeros(3), 2.0 * mass * radius**2 * np.eye(3)), (n, 1))
    start = np.concatenate([np.concatenate([log_cholesky(row) for row in inertial]), np.log(armature + 1e-6)])
    start, open_ = start[: None if motors else N_BODY * n], ~known[: n if motors else 0]

    links = N_BODY * n
    scale = np.concatenate([np.tile([1.0] * 4 + [radius] * 6, n), np.ones(start.size - links)])
    seen = white @ mapping
    of_links, nearness = seen[:, :links].reshape(-1, n, N_BODY), NEARNESS * np.eye(start.size)

    def full(x: Array) -> Array:
        turned = np.where(open_, np.exp(x[links:]), armature[: open_.size])
        return np.concatenate([from_log_cholesky(x[:links].reshape(n, N_BODY)).ravel(), turned])

    def errors(x: Array) -> Any:
        return np.concatenate([seen @ full(x) - white @ theta, NEARNESS * (x - start)])

    def jacobian(x: Array) -> Any:
        inner = np.einsum("bni,nij->bnj", of_links, slopes(x[:links].reshape(n, N_BODY)))
        return np.vstack([np.hstack([inner.reshape(-1, links), seen[:, links:] * np.exp(x[links:]) * open_]), nearness])

    found = full(least_squares(errors, start, jacobian, ftol=1e-6, xtol=1e-6, x_scale=scale, max_nfev=200).x)
    return found[:links].reshape(n, N_BODY), found[links:] if motors else None
