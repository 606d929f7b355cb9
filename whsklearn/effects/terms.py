"""The static terms of a law by their code: value and derivatives, for a law's kernels.

Auxiliary models and sensitivity filters call `term`, the simulators `directed_term`.
"""

from __future__ import annotations

import math

import numpy as np

from whsklearn._numba import njit, part
from whsklearn.effects.codes import (
    ASYMMETRIC_COULOMB,
    ASYMMETRIC_VISCOUS,
    CONSTANT,
    COULOMB,
    HINGE,
    N_SHAPE,
    NATURAL_SPLINE,
    POSITION_FRICTION,
    POWER,
    QUADRATIC_DRAG,
    SPEED_HINGE,
    STRIBECK_EXP,
    STRIBECK_TANH,
    TANH,
    TANH_DIFFERENCE,
    VISCOUS,
)
from whsklearn.effects.equations import (
    asymmetric_coulomb,
    asymmetric_viscous,
    coulomb,
    hinge,
    natural_spline,
    position_friction,
    power,
    quadratic_drag,
    reduced_stribeck,
    smooth_coulomb,
    smooth_sign,
    smooth_stribeck,
    speed_hinge,
    stribeck,
    tanh,
    viscous,
)

__all__ = [
    "ASYMMETRIC_COULOMB",
    "ASYMMETRIC_VISCOUS",
    "CONSTANT",
    "COULOMB",
    "HINGE",
    "NATURAL_SPLINE",
    "N_SHAPE",
    "POSITION_FRICTION",
    "POWER",
    "QUADRATIC_DRAG",
    "SPEED_HINGE",
    "STRIBECK_EXP",
    "STRIBECK_TANH",
    "TANH",
    "TANH_DIFFERENCE",
    "VISCOUS",
    "directed_term",
    "law_values",
    "smooth_sign",
    "tanh",
    "term",
]


@part
def directed_term(code, s0, s1, s2, x, dx, s, ds):
    """Value of a term and its derivatives by x and by dx, with s and ds for sign(dx) and its slope."""
    if code == VISCOUS:
        return viscous(dx)
    if code == COULOMB:
        return coulomb(s, ds)
    if code == ASYMMETRIC_COULOMB:
        return asymmetric_coulomb(s, ds)
    if code == ASYMMETRIC_VISCOUS:
        return asymmetric_viscous(dx, s, ds)
    if code == STRIBECK_EXP:
        return stribeck(s0, s1, dx, s, ds)
    if code == POSITION_FRICTION:
        return position_friction(math.cos(s1), -math.sin(s1), s0, x, s, ds)
    if code == TANH:
        return smooth_coulomb(s0, dx)
    if code == TANH_DIFFERENCE:
        return smooth_stribeck(s0, s1, dx)
    if code == STRIBECK_TANH:
        return reduced_stribeck(s0, dx)
    if code == QUADRATIC_DRAG:
        return quadratic_drag(dx)
    if code == POWER:
        return power(s0, x)
    if code == HINGE:
        return hinge(s0, x)
    if code == NATURAL_SPLINE:
        return natural_spline(s0, s1, s2, x)
    if code == SPEED_HINGE:
        return speed_hinge(s0, dx)
    return 1.0, 0.0, 0.0


@njit(cache=False, error_model="numpy", forceinline=True)
def term(code, s0, s1, s2, x, dx, kappa):
    """Value of a term and its derivatives by x and by dx, where sign(dx) has the sharpness kappa."""
    if COULOMB <= code <= POSITION_FRICTION:
        s, ds = smooth_sign(dx, kappa)
    else:
        s, ds = 0.0, 0.0
    return directed_term(code, s0, s1, s2, x, dx, s, ds)


@njit(error_model="numpy", short=True)
def law_values(codes, shapes, x, dx, kappa):
    """The values of each term of a law along a record, at weight one; shape (K, n)."""
    out = np.empty((codes.size, x.size))
    for k in range(codes.size):
        for i in range(x.size):
            out[k, i] = term(codes[k], shapes[k, 0], shapes[k, 1], shapes[k, 2], x[i], dx[i], kappa)[0]
    return out
