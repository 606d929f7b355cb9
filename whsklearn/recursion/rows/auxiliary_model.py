"""The auxiliary model: the regressors (6) from estimates of x and v, which are rebuilt from theta.

theta holds products, in the paper's order:

    [g a_1 .. g a_na, g b_1 + g, g b_2 .. g b_nb, other weights, c_2 .. c_nc, d_1 .. d_nd]

where g is the weight of the key term, gamma_6 (x - x(t-1)).  If the key term is linear in x
itself, the entry of b_1 is g b_1.

The auxiliary state is x_hat(t-1) .. x_hat(t-nx), nx = max(n_b, 1) + 1, then
v_hat(t-1) .. v_hat(t-nc).
"""

from __future__ import annotations

import math

from whsklearn._numba import njit, part
from whsklearn.effects.terms import VISCOUS, term

SMALLEST_KEY = 1e-9
LARGEST_SIGNAL = 1e6


@njit(cache=True, error_model="numpy")
def auxiliary_size(dims):
    """Length of the auxiliary state."""
    return max(dims[1], 1) + 1 + dims[2]


@part
def row(dims, codes, shapes, key, state, u_past, first_u, y_past, first_y, phi):
    """phi(t) of (6), from the auxiliary state, u(t-2), ... at ``first_u`` and y(t-1), ... at ``first_y``."""
    na, nb, nc, nd, nw = dims[0], dims[1], dims[2], dims[3], dims[4]
    nx = max(nb, 1) + 1
    for i in range(na):
        phi[i] = u_past[first_u + i]
    for j in range(nb):
        phi[na + j] = -state[1 + j]
    differs = codes[key] == VISCOUS
    if differs and nb == 0:
        phi[0] -= state[1]  # no b_1 to share the term -g x(t-2) with
    j = na + nb
    for k in range(nw):
        if k != key:
            phi[j] = term(codes[k], shapes[k, 0], shapes[k, 1], shapes[k, 2], state[0], state[0] - state[1], math.inf)[
                0
            ]
            j += 1
    for m in range(1, nc):
        phi[j] = state[nx + m]
        j += 1
    for i in range(nd):
        phi[j + i] = -y_past[first_y + i]


@part
def rebuild(theta, dims, codes, shapes, key, state, u_past, first):
    """Advance the auxiliary state by one sample: x_hat(t) and v_hat(t), with the products in theta undone."""
    na, nb, nc, nw = dims[0], dims[1], dims[2], dims[4]
    nx = max(nb, 1) + 1
    g = theta[0]
    if abs(g) < SMALLEST_KEY:
        g = SMALLEST_KEY if g >= 0.0 else -SMALLEST_KEY
    x = u_past[first]
    for i in range(1, na):
        x += theta[i] / g * u_past[first + i]
    differs = codes[key] == VISCOUS
    for j in range(nb):
        b = theta[na + j] / g
        if j == 0 and differs:
            b -= 1.0
        x -= b * state[j]
    # interim estimates may be unstable; the saturation only keeps them finite
    x = min(max(x, -LARGEST_SIGNAL), LARGEST_SIGNAL)
    dx = x - state[0]
    v = 0.0
    j = na + nb
    for k in range(nw):
        f = term(codes[k], shapes[k, 0], shapes[k, 1], shapes[k, 2], x, dx, math.inf)[0]
        if k == key:
            v += g * f
        else:
            v += theta[j] * f
            j += 1
    for k in range(nx - 1, 0, -1):
        state[k] = state[k - 1]
    state[0] = x
    for k in range(nx + nc - 1, nx, -1):
        state[k] = state[k - 1]
    state[nx] = v
