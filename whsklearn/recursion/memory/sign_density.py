"""Log density of (a, b) for a law that jumps with sign(dx), over the few signs in doubt.

Given phi = (a, b), it is known which signs flip, and the linear parameters r = (w, c, d) are projected out:

    log p(phi) = -(N - n_r)/2 log S(phi) - log|H(phi)|/2,    S = min_r sum of squares, H its curvature,

both from M of `linearised` updated by the rows that the flipped signs enter.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from whsklearn._numba import part
from whsklearn.recursion.memory.linearised import Signs
from whsklearn.systems.stability import is_stable

Array = NDArray[np.float64]

RADIUS = 0.999  # largest radius of the poles of L1


class SignProblem(NamedTuple):
    """Arguments of `log_density`: the signs of `linearised.Signs`, and the rows that they enter, each row once.

    Attributes
    ----------
    matrix : ndarray of shape (n + 1, n + 1)
        [J e]' W [J e] with the signs frozen.
    theta : ndarray of shape (n,)
        Parameters at which it is linearised.
    dims : ndarray of shape (5,)
        As in `predictor`.
    count : float
        Number of samples after forgetting.
    dx, sign, scale, gradient, curvature, height
        As in `Signs`.
    rows : ndarray of shape (R, n + 1)
        Rows of [J e] that a sign in doubt enters.
    row : ndarray of shape (E, n_c)
        Indices of the rows that each sign enters; -1 for none.
    reach : ndarray of shape (E,)
        How far (a, b) may move, measured by ``metric``, before a sign can flip; in ascending order.
    metric : ndarray of shape (n_1, n_1)
        Defines the distance sqrt(delta' metric delta).
    """

    matrix: Array
    theta: Array
    dims: NDArray[np.int64]
    count: float  # type: ignore[assignment]  # number of samples; the tuple's own method of this name is not used
    dx: Array
    sign: Array
    scale: Array
    gradient: Array
    curvature: Array
    height: Array
    rows: Array
    row: NDArray[np.int64]
    reach: Array
    metric: Array


def posed(matrix: Array, theta: Array, dims: NDArray[np.int64], count: float, signs: Signs) -> SignProblem:
    """Build the problem of these signs; two of them may enter the same row."""
    at, index = np.unique(signs.at.ravel(), return_inverse=True)
    index = index.reshape(signs.at.shape)
    rows = np.zeros((at.size, theta.size + 1))
    rows[index.ravel()] = signs.rows.reshape(-1, theta.size + 1)
    n1 = signs.gradient.shape[1]
    return SignProblem(
        matrix, theta, dims, float(count), signs.dx, signs.sign, signs.scale, np.ascontiguousarray(signs.gradient),
        np.ascontiguousarray(signs.curvature), np.ascontiguousarray(signs.height), rows,
        np.where(signs.at < 0, -1, index), np.zeros(signs.dx.size), np.zeros((n1, n1)),
    )  # fmt: skip


def by_reach(p: SignProblem, covariance: Array) -> SignProblem:
    """The same problem with its signs in order of reach, so that most particles check only a few of 500.

    ``covariance`` is that of (a, b).  With its root L, a step delta of length r changes dx by at most
    r (|L'g| + |L'H L| r / 2), so no sign that is skipped could have flipped.
    """
    root = np.linalg.cholesky(covariance)
    slope = np.sqrt(np.sum((p.gradient @ root) ** 2, axis=1))
    bend = np.sqrt(np.sum((root.T @ p.curvature @ root) ** 2, axis=(1, 2)))
    away = np.abs(p.dx)
    reach = 2.0 * away / np.maximum(slope + np.sqrt(slope**2 + 2.0 * bend * away), 1e-300)
    reach[p.sign != np.sign(p.dx)] = 0.0  # already flipped at the linearisation point
    order = np.argsort(reach, kind="stable")
    asked = {
        name: getattr(p, name)[order] for name in ("dx", "sign", "scale", "gradient", "curvature", "height", "row")
    }
    metric = np.asarray(np.linalg.inv(covariance), dtype=np.float64)
    return p._replace(**asked, reach=(1.0 - 1e-9) * reach[order], metric=metric)


@part
def turn(delta, p, matrix, change, touched):
    """M at (a, b) = theta_0 + delta: find the signs that flip, and change the rows that they enter."""
    n, n1, nw, nc = p.theta.size, p.gradient.shape[1], p.height.shape[1], p.row.shape[1]
    w, c = p.theta[n1 : n1 + nw], p.theta[n1 + nw : n1 + nw + nc - 1]
    for j in range(n + 1):
        for k in range(n + 1):
            matrix[j, k] = p.matrix[j, k]
    n_touched, size = 0, 0.0
    for k in range(n1):
        for j in range(n1):
            size += delta[k] * p.metric[k, j] * delta[j]
    size = np.sqrt(max(size, 0.0))
    for t in range(p.dx.size):
        if p.reach[t] > size:
            break
        dx = p.dx[t]
        for k in range(n1):
            slope = p.gradient[t, k]
            for j in range(n1):
                slope += 0.5 * p.curvature[t, k, j] * delta[j]
            dx += slope * delta[k]
        jump = (1.0 if dx > 0.0 else -1.0) - p.sign[t]
        if jump == 0.0:
            continue
        jump *= p.scale[t]
        dv = 0.0
        for k in range(nw):
            dv += w[k] * p.height[t, k] * jump
        for m in range(nc):
            i = p.row[t, m]
            if i < 0:
                continue
            if change[i, 0] == 0.0:
                change[i, 0] = 1.0
                touched[n_touched] = i
                n_touched += 1
            factor = 1.0 if m == 0 else c[m - 1]
            change[i, n] -= factor * dv
            for k in range(nw):
                change[i, n1 + k] += factor * p.height[t, k] * jump
            if m > 0:
                change[i, n1 + nw + m - 1] += dv
    stop = n1 + nw + nc - 1
    for s in range(n_touched):
        i = touched[s]
        d, row = change[i], p.rows[i]
        d[0] = 0.0
        for j in range(n1, n + 1):
            if stop <= j < n:
                continue
            for k in range(n + 1):
                matrix[j, k] += d[j] * (row[k] + d[k])
            for k in range(n + 1):
                matrix[k, j] += row[k] * d[j]
        for k in range(n + 1):
            d[k] = 0.0


@part
def log_density(delta, p, matrix, change, touched, low, rest):
    """Return (log p(phi), S); ``rest`` receives the best r - r_0, ``low`` the Cholesky factor of H."""
    n, n1 = p.theta.size, delta.size
    nb = p.dims[1]
    b = np.empty(nb)
    for j in range(nb):
        b[j] = p.theta[n1 - nb + j] + delta[n1 - nb + j]
    if not is_stable(b, RADIUS):
        return -np.inf, np.inf
    turn(delta, p, matrix, change, touched)
    s = matrix[n, n]
    for i in range(n1):
        pull = -2.0 * matrix[i, n]
        for j in range(n1):
            pull += matrix[i, j] * delta[j]
        s += pull * delta[i]
    curvature = 0.0
    nr = n - n1
    for i in range(nr):
        for j in range(i + 1):
            h = matrix[n1 + i, n1 + j]
            for k in range(j):
                h -= low[i, k] * low[j, k]
            if i == j:
                if not h > 1e-14 * matrix[n1 + i, n1 + i]:
                    return -np.inf, np.inf
                low[i, i] = np.sqrt(h)
                curvature += np.log(low[i, i])
            else:
                low[i, j] = h / low[j, j]
        q = matrix[n1 + i, n]
        for j in range(n1):
            q -= matrix[n1 + i, j] * delta[j]
        for k in range(i):
            q -= low[i, k] * rest[k]
        rest[i] = q / low[i, i]
        s -= rest[i] * rest[i]
    for i in range(nr - 1, -1, -1):
        r = rest[i]
        for k in range(i + 1, nr):
            r -= low[k, i] * rest[k]
        rest[i] = r / low[i, i]
    s = max(s, 1e-14 * p.matrix[n, n])  # in a record without noise, only rounding errors remain
    return -0.5 * (p.count - nr) * np.log(s) - curvature, s
