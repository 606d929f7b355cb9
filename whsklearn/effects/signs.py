"""The sign of a velocity, sharp or smooth, and the waves over an angle: what several equations are made of.

sign(dx) is tanh(kappa dx) with ``kappa`` finite while a gradient is needed, and the sign itself at
``kappa = inf``; the paper's smooth law (3) is such a tanh already.  A negative ``kappa`` is both: the value
of the sign, the slope of tanh(-kappa dx).
"""

from __future__ import annotations

import math

from whsklearn._numba import njit, part

AT_REST = 1e-6


@part
def tanh(z):
    """The hyperbolic tangent to three units in the last place, in half of the C library's time.

    (1 - q) / (1 + q) with q = exp(-2 |z|); near zero, where that cancels, its Taylor series.
    """
    s = z * z
    if s < 0.01:
        r = 62.0 / 2835.0 + s * (-1382.0 / 155925.0 + s * (21844.0 / 6081075.0 - s * (929569.0 / 638512875.0)))
        return z * (1.0 + s * (-1.0 / 3.0 + s * (2.0 / 15.0 + s * (-17.0 / 315.0 + s * r))))
    q = math.exp(-2.0 * abs(z))
    return math.copysign((1.0 - q) / (1.0 + q), z)


@part
def smooth_sign(dx, kappa):
    """sign(dx) and its slope; tanh(kappa dx) for a finite kappa, the sign with that slope for -kappa."""
    if kappa == math.inf:
        return (1.0 if dx > 0.0 else (-1.0 if dx < 0.0 else 0.0)), 0.0
    z = kappa * dx
    if abs(z) > 20.0:  # there tanh is one to the last bit, and most samples of a sharp sign are there
        return (1.0 if dx > 0.0 else -1.0), 0.0
    s = tanh(z)
    if kappa < 0.0:
        # what is left of a motion long after it has died away, 1e-20 say, is rest and has no sign
        return (0.0 if abs(z) < AT_REST else (1.0 if dx > 0.0 else -1.0)), -kappa * (1.0 - s * s)
    return s, kappa * (1.0 - s * s)


@njit(cache=False, error_model="numpy")
def wave(cosine, sine, argument):
    """``cosine`` cos(argument) + ``sine`` sin(argument), which is A cos(argument + phi) with A e^(i phi) = c - i s."""
    return cosine * math.cos(argument) + sine * math.sin(argument)


@njit(cache=False, error_model="numpy")
def clipped(value, limit):
    """clip(value, -limit, limit)."""
    return min(limit, max(-limit, value))
