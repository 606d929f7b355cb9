"""Rational filters over the rows of a table, at rest at the start of each experiment."""

from __future__ import annotations

import numpy as np

from whsklearn._numba import njit


@njit(cache=True, error_model="numpy")
def filter_rows(b, a, rows, bounds):
    """Apply b(q)/a(q) to every row, from rest at each of the bounds.

    ``b``, ``a``: coefficients in powers of the delay, a[0] = 1. ``rows`` (m, n): signals. ``bounds``: first samples of
    the experiments, and n at the end. Returns (m, n).
    """
    order = max(b.size, a.size) - 1
    num = np.zeros(order + 1)
    den = np.zeros(order + 1)
    num[: b.size] = b
    den[: a.size] = a
    out = np.empty_like(rows)
    state = np.zeros(order + 1)  # transposed direct form II; the last entry stays zero
    for i in range(rows.shape[0]):
        for e in range(bounds.size - 1):
            state[:] = 0.0
            for t in range(bounds[e], bounds[e + 1]):
                v = rows[i, t]
                y = num[0] * v + state[0]
                for k in range(order):
                    state[k] = num[k + 1] * v - den[k + 1] * y + state[k + 1]
                out[i, t] = y
    return out


@njit(cache=True, error_model="numpy")
def delayed_rows(signal, count, bounds):
    """The signal delayed by 0 ... count - 1 samples, shape (count, n); zeros before each experiment."""
    out = np.zeros((count, signal.size))
    for k in range(count):
        for e in range(bounds.size - 1):
            for t in range(bounds[e] + k, bounds[e + 1]):
                out[k, t] = signal[t - k]
    return out
