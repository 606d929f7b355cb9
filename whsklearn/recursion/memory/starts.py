"""Starting points of a search: random stable blocks, and least squares for the parameters that are then linear.

The prediction error has several minima.  A single start ends in the global one in about
six of ten cases on the paper's example and in far fewer cases on some systems, so several
starts run in parallel (measured by benchmarks/accuracy.py).
"""

from __future__ import annotations

import functools
import itertools

import numpy as np

from whsklearn._numba import njit
from whsklearn.effects.base import Array, Bools
from whsklearn.effects.rows import law_values
from whsklearn.recursion.memory.blocks import KNOWN, first_block
from whsklearn.recursion.rows.predictor import LEAST_MOTION, Law

N_SIZES = 9  # random L1 behind which a term's size is measured; an odd number has a median


def random_stable(order: int, rng: np.random.Generator) -> Array:
    """A stable denominator from uniform reflection coefficients."""
    return denominator_of(rng.uniform(-0.9, 0.9, order))


def denominator_of(reflections: Array) -> Array:
    """b_1, ... from reflection coefficients (Levinson recursion); stable if each is between -1 and 1."""
    b: list[float] = []  # arrays would take five times as long, and a sample is waiting
    for r in reflections.tolist():
        b = [x + r * y for x, y in zip(b, b[::-1], strict=True)] + [r]
    return np.array(b)


def random_start(dims: tuple[int, ...], rng: np.random.Generator, scales: Array | None = None) -> Array:
    """theta with stable blocks; the weights are of the order of ``scales``, or of one if the scales are unknown."""
    na, nb, nc, nd, nw = dims
    weights = rng.normal(0.0, 0.5, nw)
    a, b = rng.normal(0.0, 1.5, na - 1), random_stable(nb, rng)
    w = weights if scales is None else weights * scales
    return np.concatenate([a, b, w, rng.normal(0.0, 0.5, nc - 1), random_stable(nd, rng)])


def term_scales(law: Law, u: Array, y: Array, restart: Bools, rng: np.random.Generator) -> Array:
    """Weights at which each term alone would have the size of the output; the median over random L1.

    They make starts and priors independent of the units of the log.
    """
    dims = tuple(int(d) for d in law[0])
    return scales_from([term_sizes(law, random_start(dims, rng), u, restart) for _ in range(N_SIZES)], y)


def term_sizes(law: Law, start: Array, u: Array, restart: Bools) -> Array:
    """Root mean square of each term behind the L1 of a start."""
    x, dx = first_block(start, law[0], u, restart, KNOWN)[0]
    return np.sqrt(np.mean(law_values(law[1], law[2], x, dx, np.inf) ** 2, axis=1))


def scales_from(sizes: list[Array], y: Array) -> Array:
    """Weights at which each term, with the median of its ``sizes``, has the size of the output."""
    typical = np.sort(np.array(sizes), axis=0)[len(sizes) // 2]  # the median of nine, faster than np.median
    return np.sqrt(np.mean(y**2)) / np.where(typical > 0.0, typical, 1.0)


def exchanged(theta: Array, dims: tuple[int, ...]) -> list[Array]:
    """theta with zeros of L1 and L2 exchanged, with poles exchanged, and with both exchanged.

    The best linear approximation of a chain has the poles of both blocks, so a search easily ends where one block has
    those of the other.  ``theta`` itself is not among the starts; the weights of the law are unchanged.
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
    """(p, q), and every result of exchanging a real root or complex pair of 1 + p... with one of 1 + q...

    A complex pair is exchanged with two real roots too: a search that gives a resonance to the wrong block leaves two
    real poles where it belongs.
    """
    out = [(p, q)]
    mine, yours = _factors(p), _factors(q)
    for i, j in itertools.product(_groups(mine), _groups(yours)):
        mine_out, yours_out = [mine[k] for k in i], [yours[k] for k in j]
        if sum(f.size - 1 for f in mine_out) == sum(f.size - 1 for f in yours_out) and len(i) + len(j) < 4:
            out.append((_product(mine, i, yours_out), _product(yours, j, mine_out)))
    return out


def _factors(p: Array) -> list[Array]:
    """Real factors of the lowest degree of z^n + p_1 z^(n-1) + ..."""
    roots = np.roots(np.concatenate([[1.0], p]))
    real = [np.array([1.0, -r.real]) for r in roots if r.imag == 0.0]
    return real + [np.array([1.0, -2 * r.real, abs(r) ** 2]) for r in roots if r.imag > 0.0]


def _groups(factors: list[Array]) -> list[tuple[int, ...]]:
    """The places of each factor, and of any two real ones."""
    real = [i for i, f in enumerate(factors) if f.size == 2]
    return [(i,) for i in range(len(factors))] + list(itertools.combinations(real, 2))


def _product(factors: list[Array], out: tuple[int, ...], others: list[Array]) -> Array:
    """Coefficients after the leading one of the product in which ``others`` stand for the factors ``out``."""
    kept = [f for i, f in enumerate(factors) if i not in out]
    return functools.reduce(np.convolve, [*kept[: out[0]], *others, *kept[out[0] :]], np.ones(1))[1:]


def regressors(theta: Array, law: Law, u: Array, y: Array, restart: Bools) -> Array:
    """Regressors that are linear once L1 of ``theta`` is fixed: f_k(t-m) for m = 1..n_c, then -y(t-n)."""
    dims, codes, shapes = law
    (x, dx), motion = first_block(theta, dims, u, restart, KNOWN)
    f = law_values(codes, shapes, x, dx, 0.5 / max(motion, LEAST_MOTION))
    return lagged(f, y, restart, int(dims[2]), int(dims[3]))


def lagged(f: Array, y: Array, restart: Bools, nc: int, nd: int) -> Array:
    """f(t-1), .. f(t-n_c), -y(t-1), .. -y(t-n_d) of every sample; zero before the start of its experiment."""
    rows = np.zeros((y.size, nc * len(f) + nd))
    _lag(rows, f, y, restart, nc, nd)
    return rows


@njit(error_model="numpy", counted=False, short=True)
def _lag(rows, f, y, restart, nc, nd):
    nw = f.shape[0]
    since = 0
    for t in range(y.size):
        if restart[t]:
            since = 0
        for m in range(min(nc, since)):
            for k in range(nw):
                rows[t, m * nw + k] = f[k, t - 1 - m]
        for i in range(min(nd, since)):
            rows[t, nc * nw + i] = -y[t - 1 - i]
        since += 1


def least_squares_start(theta: Array, law: Law, rows: Array, y: Array) -> Array:
    """Keep L1 of ``theta`` and compute the weights, c and d by least squares on its `regressors`."""
    return with_solution(theta, law, solved(rows, y), rows)


def solved(rows: Array, y: Array) -> Array:
    """Least squares in one call: the normal equations need five, and each call that is not cached costs 10 us.

    What is too small to be estimated is judged of columns of one size: those of the law are in other units than those
    of y.
    """
    size = np.sqrt(np.einsum("ij,ij->j", rows, rows))
    size[size == 0.0] = 1.0
    return np.asarray(np.linalg.lstsq(rows / size, y, rcond=1e-10)[0] / size, dtype=np.float64)


def with_solution(theta: Array, law: Law, solution: Array, rows: Array) -> Array:
    """``theta`` with the weights, c and d of a least-squares solution on ``rows``.

    With L1 fixed, y is linear in the products c_m w_k and in d.  The products form a matrix of rank one, so its first
    singular vectors give c and w (Bai 1998, Automatica 34(3)).  They are taken of the signals that the products give:
    the weights themselves may have different units.
    """
    na, nb, nc, _, nw = (int(d) for d in law[0])
    n1 = na - 1 + nb
    if not np.isfinite(solution).all():
        return theta
    products = solution[: nc * nw].reshape(nc, nw)
    given = products @ rows[:, :nw].T
    c = np.linalg.eigh(given @ given.T)[1][:, -1]
    floor = 0.05 * np.abs(c).max()
    first = c[0] if abs(c[0]) > floor else np.copysign(floor, c[0])
    out = theta.copy()
    out[n1 : n1 + nw] = (c @ products) * first
    out[n1 + nw : n1 + nw + nc - 1] = c[1:] / first
    out[n1 + nw + nc - 1 :] = solution[nc * nw :]
    return out
