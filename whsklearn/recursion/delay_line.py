"""A line of past samples, newest first."""

from __future__ import annotations

from whsklearn._numba import njit


@njit(cache=True, error_model="numpy")
def push(past, newest):
    """Put the newest sample, one number an input, before the older ones."""
    m = newest.size
    for i in range(past.size - 1, m - 1, -1):
        past[i] = past[i - m]
    for i in range(m):
        past[i] = newest[i]
