"""The static terms of a law as compiled scalar functions f(x, dx).

``term`` is the one place where the mathematics of a memoryless effect is written:
simulators, auxiliary models and sensitivity filters all call it.  A term is a small
integer code and up to three shape numbers, because a compiled kernel cannot hold a
Python object.

sign(dx) is tanh(kappa dx) with ``kappa`` finite while a gradient is needed, and the
sign itself at ``kappa = inf``; the paper's smooth law (3) is such a tanh already.  A negative
``kappa`` is both: the value of the sign, the slope of tanh(-kappa dx).
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

N_SHAPE = 3
AT_REST = 1e-6

VISCOUS = 0
COULOMB = 1
TANH = 2
TANH_DIFFERENCE = 3
STRIBECK_TANH = 4
STRIBECK_EXP = 5
QUADRATIC_DRAG = 6
ASYMMETRIC_COULOMB = 7
ASYMMETRIC_VISCOUS = 8
POSITION_FRICTION = 9
POWER = 10
HINGE = 11
CONSTANT = 12


@njit(cache=True, error_model="numpy")
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


@njit(cache=True, error_model="numpy")
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


@njit(cache=True, error_model="numpy")
def term(code, s0, s1, s2, x, dx, kappa):
    """Value of a term and its derivatives by x and by dx."""
    if code == VISCOUS:
        return dx, 0.0, 1.0
    if code == COULOMB:
        s, ds = smooth_sign(dx, kappa)
        return s, 0.0, ds
    if code == TANH:
        s = tanh(dx / s0)
        return s, 0.0, (1.0 - s * s) / s0
    if code == TANH_DIFFERENCE:
        p = tanh(dx / s0)
        q = tanh(dx / s1)
        return p - q, 0.0, (1.0 - p * p) / s0 - (1.0 - q * q) / s1
    if code == STRIBECK_TANH:
        s = tanh(dx / s0)
        return -s, 0.0, -(1.0 - s * s) / s0
    if code == STRIBECK_EXP:
        s, ds = smooth_sign(dx, kappa)
        r = abs(dx) / s0
        if r == 0.0:
            return s, 0.0, ds
        power = r**s1
        bump = math.exp(-power)
        slope = -bump * s1 * power / abs(dx) * (1.0 if dx > 0.0 else -1.0)
        return bump * s, 0.0, bump * ds + slope * s
    if code == QUADRATIC_DRAG:
        return dx * abs(dx), 0.0, 2.0 * abs(dx)
    if code == ASYMMETRIC_COULOMB:
        s, ds = smooth_sign(dx, kappa)
        return s * s, 0.0, 2.0 * s * ds
    if code == ASYMMETRIC_VISCOUS:
        s, ds = smooth_sign(dx, kappa)
        return dx * s, 0.0, s + dx * ds
    if code == POSITION_FRICTION:
        s, ds = smooth_sign(dx, kappa)
        wave = math.cos(s0 * x + s1)
        return s * wave, -s * s0 * math.sin(s0 * x + s1), ds * wave
    if code == POWER:
        if s0 == 0.0:
            return 1.0, 0.0, 0.0
        return x**s0, s0 * x ** (s0 - 1.0), 0.0
    if code == HINGE:
        if x > s0:
            return x - s0, 1.0, 0.0
        return 0.0, 0.0, 0.0
    return 1.0, 0.0, 0.0


@njit(cache=True, error_model="numpy")
def term_values(code, s0, s1, s2, x, dx, kappa):
    """The values of one term along a record."""
    out = np.empty(x.size)
    for i in range(x.size):
        out[i] = term(code, s0, s1, s2, x[i], dx[i], kappa)[0]
    return out
