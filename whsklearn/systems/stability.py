"""Stability of a discrete-time block from its denominator."""

from __future__ import annotations

import numpy as np

from whsklearn._numba import njit


@njit(cache=True, error_model="numpy")
def is_stable(b, radius):
    """Whether 1 + b_1 q^-1 + ... has all its roots inside ``radius`` (Schur-Cohn step-down)."""
    n = b.size
    if n == 0:
        return True
    if n <= 2:  # the triangle of Jury, without arrays: this is asked at every update
        first = b[0] / radius
        second = b[1] / (radius * radius) if n == 2 else 0.0
        return abs(second) < 1.0 and abs(first) < 1.0 + second
    k = np.empty(n)
    scale = 1.0
    for i in range(n):
        scale /= radius
        k[i] = b[i] * scale
    row = np.empty(n)
    for m in range(n, 0, -1):
        r = k[m - 1]
        if not abs(r) < 1.0:
            return False
        for i in range(m - 1):
            row[i] = (k[i] - r * k[m - 2 - i]) / (1.0 - r * r)
        for i in range(m - 1):
            k[i] = row[i]
    return True
