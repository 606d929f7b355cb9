"""Generic functions at every port of a chain: what no catalogue holds, to ask whether anything is left there."""

from __future__ import annotations

from whsklearn._numba import njit, part

HAT_U, HAT_X, HAT_DX, HAT_T, LAG_U, LAG_V, PRODUCT, HAT_Q = 300, 301, 302, 303, 304, 305, 306, 307


@njit(cache=False, error_model="numpy")
def hat(value, centre, width):
    """Triangle of height one."""
    return max(0.0, 1.0 - abs(value - centre) / width)


@part
def probe(code, centre, width, x, dx, u, t, v, s):
    """A function of weight one at the law's port; s stands for sign(dx)."""
    if code == HAT_X:
        return hat(x, centre, width)
    if code == HAT_DX:
        return hat(dx, centre, width)
    if code == HAT_T:
        return hat(float(t), centre, width)
    if code == LAG_V:
        i = t - int(centre)
        return v[i] if i >= 0 else 0.0
    if code == PRODUCT:
        if centre == 0.0:
            return x * dx
        if centre == 1.0:
            return x * s
        if centre == 2.0:
            return u * dx
        if centre == 3.0:
            return abs(u) * s
        if centre == 4.0:
            return t * dx
        if centre == 5.0:
            return t * s
        if centre == 6.0:
            return x * u
        return x * abs(dx)
    return 0.0
