"""A line of past samples, newest first."""

from __future__ import annotations

from whsklearn._numba import part


@part
def push(past, newest):
    """Put the newest sample, one number per input, in front of the older ones."""
    m = newest.size
    for i in range(past.size - 1, m - 1, -1):
        past[i] = past[i - m]
    for i in range(m):
        past[i] = newest[i]


@part
def clear(past):
    """Forget the past samples."""
    for i in range(past.size):
        past[i] = 0.0
