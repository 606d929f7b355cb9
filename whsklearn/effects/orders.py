"""Waves of many orders over one motion, as a search for the order of an effect looks through them."""

from __future__ import annotations

import math

from whsklearn._numba import njit


@njit(nogil=True)
def waves(out, angle, blur, front, first, step):
    """Put front exp(-(k blur)^2 / 2) of cos(k angle), then of sin(k angle), into ``out``, k an even ``step`` apart.

    From one order to the next the angle turns by a constant and the logarithm of the damping falls by an even amount
    more, so three functions a sample do for all orders; the rounding of a hundred products is 1e-13.  ``out``, of
    shape (n, 2 count), may be of single precision: products are of double.
    """
    n, count = out.shape[0], out.shape[1] // 2
    for i in range(n):
        c, s = math.cos(first * angle[i]), math.sin(first * angle[i])
        turn_c, turn_s = math.cos(step * angle[i]), math.sin(step * angle[i])
        b = blur[i] * blur[i]
        size = front[i] * math.exp(-0.5 * first * first * b)
        fall, further = math.exp(-(first + 0.5 * step) * step * b), math.exp(-step * step * b)
        for j in range(count):
            out[i, j] = size * c
            out[i, count + j] = size * s
            c, s = c * turn_c - s * turn_s, s * turn_c + c * turn_s
            size *= fall
            fall *= further
            if abs(size) < 1e-30:  # products of the smallest numbers take a hundred times as long
                size = 0.0
    return out
