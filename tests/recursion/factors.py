"""U and D of a covariance."""

from __future__ import annotations

import numpy as np


def factorise(p: np.ndarray) -> np.ndarray:
    """U and D of a symmetric positive definite P, in one array."""
    # P = U D U' with U upper: the Cholesky factor of P with both axes reversed, reversed back
    root = np.linalg.cholesky(p[::-1, ::-1])[::-1, ::-1]
    scale = root.diagonal()
    ud = (root / scale).T.copy()  # nothing is below the diagonal of the factor
    ud.flat[:: len(ud) + 1] = scale**2
    return ud
