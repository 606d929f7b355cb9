"""Stability of a discrete-time block from its denominator."""

from __future__ import annotations

import numpy as np

from whsklearn._numba import njit


@njit(cache=False, error_model="numpy", forceinline=True)
def is_stable(b, radius):
    """Whether 1 + b_1 q^-1 + ... has all its roots inside ``radius`` (Schur-Cohn step-down)."""
    n = b.size
    first = b[0] / radius if n > 0 else 0.0
    second = b[1] / (radius * radius) if n > 1 else 0.0
    # Jury's stability conditions without arrays, because this is checked at every update
    stable = abs(second) < 1.0 and abs(first) < 1.0 + second
    if n > 2:
        stable = _stepped_down(b, radius)
    return stable


@njit(cache=False, error_model="numpy", counted=True)
def _stepped_down(b, radius):
    """Schur-Cohn: every reflection coefficient is below one."""
    n = b.size
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
