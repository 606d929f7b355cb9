"""Ways to divide the poles and zeros of a linear model between two blocks, and to exchange them afterwards."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from whsklearn.effects.base import Array
from whsklearn.recursion.batch.best_linear import Ratio

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    Roots = list[NDArray[np.complex128]]  # groups that stay together


MOST = 512  # divisions tried at most; order 8 with real roots only would have 65,536


class Orders(NamedTuple):
    """Largest numbers of zeros and poles of each block."""

    zeros_1: int
    poles_1: int
    zeros_2: int
    poles_2: int


def divisions(ratio: Ratio, orders: Orders) -> Iterator[tuple[Ratio, Ratio]]:
    """All pairs of blocks whose product has the zeros and poles of the ratio; conjugate pairs stay together.

    Where the orders leave no room for a pair, its roots are real and nearly equal, and noise made a pair of them: one
    zero in each block.  Each of the two is then their real part.

    ``ratio``: the linear model. ``orders``: orders of the blocks. A block with more zeros than poles is skipped, except
    for one zero without a pole.
    """
    zeros, poles = _groups(np.roots(ratio.b)), _groups(np.roots(ratio.a))
    for some_zeros, some_poles in ((zeros, poles), (_apart(zeros), poles), (_apart(zeros), _apart(poles))):
        found = list(itertools.islice(_divided(some_zeros, some_poles, orders), MOST))
        if found:
            yield from found
            return


def _divided(zeros: Roots, poles: Roots, orders: Orders) -> Iterator[tuple[Ratio, Ratio]]:
    """The divisions of these groups of roots."""
    for p in itertools.product((False, True), repeat=len(poles)):
        first, second = _chosen(poles, p, True), _chosen(poles, p, False)
        if first.size > orders.poles_1 or second.size > orders.poles_2:
            continue
        for z in itertools.product((False, True), repeat=len(zeros)):
            up, down = _chosen(zeros, z, True), _chosen(zeros, z, False)
            if up.size <= min(orders.zeros_1, max(first.size, 1)) and down.size <= min(
                orders.zeros_2, max(second.size, 1)
            ):
                yield Ratio(_polynomial(up), _polynomial(first)), Ratio(_polynomial(down), _polynomial(second))


def _apart(groups: Roots) -> Roots:
    """The groups with the two roots of every pair at their real part."""
    return [np.array([r.real + 0j]) for group in groups for r in group]


def padded(block: Ratio, n_zeros: int, n_poles: int) -> Ratio:
    """The block padded with zero coefficients up to these orders; a fit is free to move the new roots at z = 0."""
    b = np.append(block.b, np.zeros(max(n_zeros + 1 - block.b.size, 0)))
    return Ratio(b, np.append(block.a, np.zeros(max(n_poles + 1 - block.a.size, 0))))


def reflections(b: Array) -> list[Array]:
    """The numerators in which one zero, or one conjugate pair, is reflected at the unit circle.

    The gain stays the same at every frequency and only the phase changes.  A zero and its image are often two minima
    of a fit.
    """
    lead = int(np.flatnonzero(b)[0]) if np.any(b) else b.size
    groups = _groups(np.roots(b))
    found = []
    for i, group in enumerate(groups):
        others = [g for k, g in enumerate(groups) if k != i]
        image = _polynomial(np.concatenate([*others, 1.0 / np.conj(group)]))
        gain = b[lead] * float(np.prod(np.abs(group)))
        found.append(np.concatenate([np.zeros(lead), gain * image, np.zeros(b.size - lead - image.size)]))
    return found


def _groups(roots: NDArray[Any]) -> list[NDArray[np.complex128]]:
    """Real roots alone, conjugate pairs together; roots at zero, which are delays, are skipped."""
    roots = roots[np.abs(roots) > 1e-9]
    upper = roots[roots.imag > 1e-9 * np.abs(roots)]
    real = roots[np.abs(roots.imag) <= 1e-9 * np.abs(roots)]
    return [np.array([r, np.conj(r)]) for r in upper] + [np.array([r]) for r in real]


def _chosen(groups: list[NDArray[np.complex128]], marks: tuple[bool, ...], wanted: bool) -> NDArray[np.complex128]:
    parts = [g for g, mark in zip(groups, marks, strict=True) if mark is wanted]
    return np.concatenate(parts) if parts else np.empty(0, dtype=complex)


def _polynomial(roots: NDArray[np.complex128]) -> Array:
    return np.atleast_1d(np.real(np.poly(roots)))


# --- new starts from a minimum that has a zero or a pole in the wrong block -----------------------------------------
# A linear model of the whole chain does not show which of its poles and zeros are before the law and which are
# behind it (Schoukens, Tiels 2017, Automatica 85, sec. 5).  A search that has put one on the wrong side finds no
# downhill path to the other.
def exchanged(theta: Array, dims: tuple[int, ...]) -> list[Array]:
    """theta with zeros of L1 and L2 exchanged, with poles exchanged, and with both exchanged.

    ``theta`` (n_parameters,): a_2 ..., b_1 ..., weights of the law, c_2 ..., d_1 ...
    ``dims``: n_a, n_b, n_c, n_d and the number of the law's terms.
    Returns the new starts, without ``theta`` itself; the weights of the law are unchanged.
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
