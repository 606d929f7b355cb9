"""The static terms of a law by their code: value and derivatives, for a law's kernels.

Auxiliary models and sensitivity filters call `term`, the simulators `directed_term`.
"""

from __future__ import annotations

import math

import numpy as np

from whsklearn._numba import njit, part
from whsklearn.effects import codes, equations


@part
def directed_term(code, s0, s1, s2, x, dx, s, ds):
    """Value of a term and its derivatives by x and by dx, with s and ds for sign(dx) and its slope."""
    if code == codes.VISCOUS:
        return equations.viscous(dx)
    if code == codes.COULOMB:
        return equations.coulomb(s, ds)
    if code == codes.ASYMMETRIC_COULOMB:
        return equations.asymmetric_coulomb(s, ds)
    if code == codes.ASYMMETRIC_VISCOUS:
        return equations.asymmetric_viscous(dx, s, ds)
    if code == codes.STRIBECK_EXP:
        return equations.stribeck(s0, s1, dx, s, ds)
    if code == codes.POSITION_FRICTION:
        return equations.position_friction(math.cos(s1), -math.sin(s1), s0, x, s, ds)
    if code == codes.TANH:
        return equations.smooth_coulomb(s0, dx)
    if code == codes.TANH_DIFFERENCE:
        return equations.smooth_stribeck(s0, s1, dx)
    if code == codes.STRIBECK_TANH:
        return equations.reduced_stribeck(s0, dx)
    if code == codes.QUADRATIC_DRAG:
        return equations.quadratic_drag(dx)
    if code == codes.POWER:
        return equations.power(s0, x)
    if code == codes.HINGE:
        return equations.hinge(s0, x)
    if code == codes.NATURAL_SPLINE:
        return equations.natural_spline(s0, s1, s2, x)
    if code == codes.SPEED_HINGE:
        return equations.speed_hinge(s0, dx)
    return 1.0, 0.0, 0.0


@njit(cache=False, error_model="numpy", forceinline=True)
def term(code, s0, s1, s2, x, dx, kappa):
    """Value of a term and its derivatives by x and by dx, where sign(dx) has the sharpness kappa."""
    if codes.COULOMB <= code <= codes.POSITION_FRICTION:
        s, ds = equations.smooth_sign(dx, kappa)
    else:
        s, ds = 0.0, 0.0
    return directed_term(code, s0, s1, s2, x, dx, s, ds)


@njit(error_model="numpy", short=True)
def law_values(law, shapes, x, dx, kappa):
    """The values of each term of a ``law``, given by its codes, along a record, at weight one; shape (K, n)."""
    out = np.empty((law.size, x.size))
    for k in range(law.size):
        for i in range(x.size):
            out[k, i] = term(law[k], shapes[k, 0], shapes[k, 1], shapes[k, 2], x[i], dx[i], kappa)[0]
    return out
