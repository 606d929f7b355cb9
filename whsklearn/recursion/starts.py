"""Where a search begins: random stable blocks, and least squares for what is linear beside them.

The prediction error has several minima; a single start ends in the global one in about
six of ten cases on the paper's example and in far fewer on some systems, so several
starts run side by side (measured by benchmarks/accuracy.py).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from whsklearn.recursion.predictor import record_regressors

if TYPE_CHECKING:
    from numpy.typing import NDArray


def random_stable(order: int, rng: np.random.Generator) -> NDArray[np.float64]:
    """A stable denominator from uniform reflection coefficients (Levinson recursion)."""
    b = np.zeros(0)
    for r in rng.uniform(-0.9, 0.9, order):
        b = np.append(b + r * b[::-1], r)
    return b


def random_start(dims: tuple[int, ...], rng: np.random.Generator) -> NDArray[np.float64]:
    """theta with stable blocks and moderate weights."""
    na, nb, nc, nd, nw = dims
    return np.concatenate(
        [
            rng.normal(0.0, 1.5, na - 1),
            random_stable(nb, rng),
            rng.normal(0.0, 0.5, nw),
            rng.normal(0.0, 0.5, nc - 1),
            random_stable(nd, rng),
        ]
    )


def least_squares_start(
    theta: NDArray[np.float64],
    dims: tuple[int, ...],
    codes: NDArray[np.int64],
    shapes: NDArray[np.float64],
    kappa: float,
    u: NDArray[np.float64],
    y: NDArray[np.float64],
    restart: NDArray[np.bool_],
) -> NDArray[np.float64]:
    """Keep L1 of ``theta`` and take weights, c and d from least squares.

    With L1 fixed, y is linear in the products c_m w_k and in d; the products are a matrix
    of rank one, so its first singular vectors give c and w (Bai 1998, Automatica 34(3)).
    """
    na, nb, nc, nd, nw = dims
    n1 = na - 1 + nb
    rows = np.empty((y.size, nc * nw + nd))
    record_regressors(theta, dims, codes, shapes, kappa, u, y, restart, rows)
    solution = np.linalg.lstsq(rows, y, rcond=1e-10)[0]
    if not np.isfinite(solution).all():
        return theta
    left, _, _ = np.linalg.svd(solution[: nc * nw].reshape(nc, nw), full_matrices=False)
    c = left[:, 0]
    floor = 0.05 * np.abs(c).max()
    first = c[0] if abs(c[0]) > floor else np.copysign(floor, c[0])
    products = solution[: nc * nw].reshape(nc, nw)
    out = theta.copy()
    out[n1 : n1 + nw] = (c @ products) * first
    out[n1 + nw : n1 + nw + nc - 1] = c[1:] / first
    out[n1 + nw + nc - 1 :] = solution[nc * nw :]
    return out
