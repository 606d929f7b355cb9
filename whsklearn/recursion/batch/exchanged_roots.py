"""New starts from a minimum that has a zero or a pole in the wrong block.

A linear model of the whole chain does not show which of its poles and zeros are before the law and which are
behind it (Schoukens, Tiels 2017, Automatica 85, sec. 5).  A search that has put one on the wrong side finds no
downhill path to the other.
"""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]


def exchanged(theta: Array, dims: tuple[int, ...]) -> list[Array]:
    """theta with zeros of L1 and L2 exchanged, with poles exchanged, and with both exchanged.

    Parameters
    ----------
    theta : ndarray of shape (n_parameters,)
        a_2 ..., b_1 ..., weights of the law, c_2 ..., d_1 ...
    dims : tuple of int
        n_a, n_b, n_c, n_d and the number of the law's terms.

    Returns
    -------
    list of ndarray
        The new starts, without ``theta`` itself; the weights of the law are unchanged.

    Examples
    --------
    >>> [t.tolist() for t in exchanged(np.array([0.5, 1.0, -0.2]), (2, 0, 2, 0, 1))]
    [[-0.2, 1.0, 0.5]]
    """
    na, nb, nc, nd, nw = dims
    first = slice(0, na - 1), slice(na - 1, na - 1 + nb)
    c0 = na - 1 + nb + nw
    second = slice(c0, c0 + nc - 1), slice(c0 + nc - 1, c0 + nc - 1 + nd)
    pairs = [pairings(theta[i], theta[j]) for i, j in zip(first, second, strict=True)]
    out = []
    for choice in itertools.product(*pairs):
        new = theta.copy()
        for i, j, (p, q) in zip(first, second, choice, strict=True):
            new[i], new[j] = p, q
        if not np.allclose(new, theta):
            out.append(new)
    return out


def pairings(p: Array, q: Array) -> list[tuple[Array, Array]]:
    """(p, q), and every result of exchanging a real root or complex pair of 1 + p... with one of 1 + q..."""
    out = [(p, q)]
    mine, yours = _factors(p), _factors(q)
    for i, j in itertools.product(range(len(mine)), range(len(yours))):
        if mine[i].size == yours[j].size:
            out.append((_product(mine, i, yours[j]), _product(yours, j, mine[i])))
    return out


def _factors(p: Array) -> list[Array]:
    """Real factors of the lowest degree of z^n + p_1 z^(n-1) + ..."""
    roots = np.roots(np.concatenate([[1.0], p]))
    real = [np.array([1.0, -r.real]) for r in roots if r.imag == 0.0]
    return real + [np.array([1.0, -2 * r.real, abs(r) ** 2]) for r in roots if r.imag > 0.0]


def _product(factors: list[Array], i: int, other: Array) -> Array:
    """Coefficients after the leading one of the product in which factor i is replaced."""
    out = np.ones(1)
    for j, factor in enumerate(factors):
        out = np.convolve(out, other if i == j else factor)
    return out[1:]
